# SPDX-License-Identifier: Apache-2.0
"""Tab completion: commands, and the names of existing files.

Loading a command's module takes seconds. So this module lists the arguments of each command and
registers stand-ins for the commands; the real module is loaded only for options.
"""

import json
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from slambed.commands.older_verbs import renewed
from slambed.commands.shared_options import ENGINES
from slambed.native import repository_root

VARIABLE = "_SLAMBED_COMPLETE"
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
            "--bad", "--folder", "--cache", "--frames", "--table", "--messages", "--until-s",
            "--budget", "--part",
        ),
        NO_CHOICE,
    ),
}  # fmt: skip
"""Maps an option that takes a value to its values, where they can be listed."""


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
    """Returns experiments with a folder in results/ of the current directory."""
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
"""Options that take a selection of cells (slambed.spec.selection)."""


def _selections(words: list[str]) -> set[str]:
    """Returns the single-key selections, such as `system=edgeslam`, of results named on the
    line."""
    folders = [folder for word in words for folder in (Path(word), Path("results") / word)]
    found: set[str] = set()
    for folder in folders:
        try:
            runs = json.loads((folder / "experiment.json").read_bytes())["runs"]
            named = [(key, run.get(name)) for run in runs for key, name in KEPT.items()]
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            continue
        # Values with spaces are left out: a shell would split them.
        found |= {f"{k}={v}" for k, v in named if isinstance(v, str) and v and " " not in v}
    return found


KEPT = {
    "system": "system", "variant": "variant", "label": "label", "dataset": "dataset",
    "link": "profile", "engine": "engine",
}  # fmt: skip
"""Maps the key of a selection to the key of a run in experiment.json."""

KINDS = (
    "experiment", "system", "shared-params", "device", "device-fit", "dataset", "profile", "paper",
    "plan", "input", "network", "inference", "hosts",
)  # fmt: skip
"""Kinds of YAML files that have a schema."""

TAKES: dict[tuple[str, ...], Callable[[], Iterable[str]]] = {
    ("run",): _experiments,
    ("status",): lambda: {*_experiments(), *_with_results()},
    ("report",): lambda: ["all", *_with_results()],
    ("gate",): _with_results,
    ("bisect",): _experiments,
    ("explain",): lambda: [*_with_results(), *_runs()],
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
"""Maps a command to the names it takes."""


@dataclass(frozen=True)
class Asked:
    """A command line being typed, without the name of the program."""

    words: list[str]
    """The complete words."""
    begun: str
    """The word under the cursor."""


def asked(environment: Mapping[str, str]) -> Asked | None:
    """Returns the command line from Typer's environment variables, or None when no shell asks for
    completion."""
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
    """Returns completions of the word under the cursor, or None where only the command itself
    knows."""
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
    """Adds stand-ins that answer this completion; False where the real command is needed."""
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
        """Stand-in for the command being typed."""

    anything = {"ignore_unknown_options": True, "allow_extra_args": True}
    app.command(line.words[0], context_settings=anything)(takes_names)
    return True


def _nothing() -> None:
    # Stand-in for a command whose name is completed; a docstring would be shown as its help.
    pass
