# SPDX-License-Identifier: Apache-2.0
"""What a shell offers when Tab is pressed: commands, and names of what there is a file of.

Loading a command's module takes seconds. So names stand here, with who takes which, and stand-ins
for the commands; only for the options of a command its own module is loaded.
"""

import json
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from slambed.commands.older_verbs import renewed
from slambed.native import repository_root

VARIABLE = "_SLAMBED_COMPLETE"
ENGINES = ("auto", "docker", "local", "virtual")
NO_CHOICE: tuple[str, ...] = ()
VALUES: dict[str, tuple[str, ...]] = {
    "--engine": ENGINES,
    "--format": ("tum", "euroc", "kitti", "mcap"),
    **dict.fromkeys(
        (
            "-o", "--output", "--results", "--runs", "--jobs", "--scheduler", "--retries",
            "--wait-for-quiet", "--set", "--only", "--force", "--a", "--b", "--out", "--html",
            "--metric", "--sequence", "--from", "--to", "--around", "--baseline", "--alpha",
            "--history", "--publish", "--link-to", "--slowest", "--hosts", "--on", "--good",
            "--bad", "--folder", "--cache", "--frames", "--table", "--until-s",
        ),
        NO_CHOICE,
    ),
}  # fmt: skip
"""Options that a value follows -> the values, where they can be listed."""


def _stems(folder: str) -> list[str]:
    return [path.stem for path in (repository_root() / folder).glob("*.yaml")]


def _systems() -> list[str]:
    others = os.environ.get("SLAMBED_SYSTEMS", "").split(os.pathsep)
    folders = [repository_root() / "systems", *(Path(part) for part in others if part)]
    return [path.parent.name for folder in folders for path in folder.glob("*/system.yaml")]


def _papers() -> list[str]:
    return [path.parent.name for path in (repository_root() / "papers").glob("*/paper.yaml")]


def _inferences() -> list[str]:
    return [path.stem for path in (repository_root() / "papers").glob("*/inference/*.yaml")]


def _experiments() -> list[str]:
    return _stems("experiments")


def _with_results() -> list[str]:
    """Experiments that have a folder in results/, where the shell is."""
    return [path.parent.name for path in Path("results").glob("*/experiment.json")]


def _runs() -> list[str]:
    return [path.name for path in Path("results").glob("*/runs/*")]


def _datasets() -> list[str]:
    others = os.environ.get("SLAMBED_DATASETS", "").split(os.pathsep)
    own = [Path(part) for part in others if part]
    files = [path.stem for folder in own for path in folder.glob("*.yaml")]
    folders = [path.parent.name for folder in own for path in folder.glob("*/dataset.yaml")]
    return [*_stems("catalog/datasets"), *files, *folders]


SELECTIONS = {"--a", "--b", "--only", "--force"}
"""Options that a selection of cells follows (slambed.spec.selection)."""


def _selections(words: list[str]) -> set[str]:
    """Those of one key that the results named on the line have: `system=edgeslam`."""
    folders = [folder for word in words for folder in (Path(word), Path("results") / word)]
    found: set[str] = set()
    for folder in folders:
        try:
            runs = json.loads((folder / "experiment.json").read_bytes())["runs"]
            named = [(key, run.get(name)) for run in runs for key, name in KEPT.items()]
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            continue
        # What a shell would take for two words is left out.
        found |= {f"{k}={v}" for k, v in named if isinstance(v, str) and v and " " not in v}
    return found


KEPT = {
    "system": "system", "variant": "variant", "label": "label", "dataset": "dataset",
    "link": "profile", "engine": "engine",
}  # fmt: skip
"""Key of a selection -> what a run of experiment.json calls it."""

KINDS = (
    "experiment", "system", "shared-params", "device", "device-fit", "dataset", "profile", "paper",
    "plan", "input", "network", "inference", "hosts",
)  # fmt: skip
"""Of the YAML files that have a schema."""

TAKES: dict[tuple[str, ...], Callable[[], Iterable[str]]] = {
    ("run",): _experiments,
    ("status",): lambda: {*_experiments(), *_with_results()},
    ("report",): lambda: ["all", *_with_results()],
    ("gate",): _with_results,
    ("bisect",): _experiments,
    ("explain",): _runs,
    ("infer",): _inferences,
    ("schema",): lambda: KINDS,
    ("new",): lambda: ("system", "dataset", "experiment"),
    ("systems", "show"): _systems,
    ("devices", "show"): lambda: _stems("catalog/devices"),
    ("experiments", "show"): _experiments,
    ("profiles", "show"): lambda: _stems("netem_profiles"),
    ("inputs", "prepare"): lambda: _stems("catalog/inputs"),
    ("inputs", "show"): lambda: _stems("catalog/inputs"),
    **{("data", verb): _datasets for verb in ("prepare", "show", "difficulty", "export")},
    ("data", "download"): _datasets,
    **{("papers", verb): _papers for verb in ("compare", "lint", "plan", "power")},
    ("papers", "run"): lambda: ["all", *_papers()],
}
"""Command -> the names that may follow it."""


@dataclass(frozen=True)
class Asked:
    """A command line that somebody is writing, without the name of the program."""

    words: list[str]
    """Those that are written to their end."""
    begun: str
    """The one under the cursor."""


def asked(environment: Mapping[str, str]) -> Asked | None:
    """What the shell's script hands over (Typer's variables); None when no shell asks."""
    if VARIABLE not in environment:
        return None
    if "COMP_WORDS" in environment:
        words = environment["COMP_WORDS"].split()
        at = int(environment.get("COMP_CWORD", len(words)))
        return Asked(words[1:at], words[at] if at < len(words) else "")
    line = environment.get("_TYPER_COMPLETE_ARGS", "")
    words = line.split()[1:]
    begun = words.pop() if words and not line.endswith(" ") else ""
    return Asked(words, begun)


def names_for(line: Asked) -> list[str] | None:
    """What may stand under the cursor; None where only the command itself knows."""
    if line.begun.startswith("-") or not line.words:
        return None
    if (last := line.words[-1]) in SELECTIONS:
        return sorted(name for name in _selections(line.words) if name.startswith(line.begun))
    if last.startswith("-") and last in VALUES:
        found = VALUES[last]
        return [name for name in found if name.startswith(line.begun)] if found else None
    words, _ = renewed(line.words)
    for length in (2, 1):
        if (take := TAKES.get(tuple(words[:length]))) is not None:
            names = {name for name in take() if name.startswith(line.begun)}
            return sorted(names - set(line.words))
    return None


def add_stand_ins(app: typer.Typer, line: Asked, commands: Iterable[str]) -> bool:
    """Commands that answer this one question, in the place of the real ones; False where the real
    one must be asked."""
    if not line.words:
        for name in commands:
            app.command(name)(_nothing)
        return True
    names = names_for(line)
    if names is None:
        return False

    def offered() -> list[str]:
        return names

    def takes_names(
        words: Annotated[list[str] | None, typer.Argument(autocompletion=offered)] = None,
    ) -> None:
        """Stands for the command that is being written."""

    anything = {"ignore_unknown_options": True, "allow_extra_args": True}
    app.command(line.words[0], context_settings=anything)(takes_names)
    return True


def _nothing() -> None:
    # Stands for a command of which only the name is asked; a docstring would be reported as its
    # help.
    pass
