# SPDX-License-Identifier: Apache-2.0
"""Tab completion, called as the shells' own scripts call it."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import typer
from command_line import slambed, slambed_process
from harness_parts import first_line

from slambed.commands import main as cli
from slambed.commands.completion import TAKES, VALUES, Asked, asked, names_for
from slambed.spec.library import Library


def offered(line: str, cwd: Path | None = None, **environment: str) -> list[str]:
    """Completes as fish does: one value per line, with its description after a tab."""
    code, out, err = slambed_process(
        cwd=cwd,
        _SLAMBED_COMPLETE="complete_fish",
        _TYPER_COMPLETE_FISH_ACTION="get-args",
        _TYPER_COMPLETE_ARGS=line,
        **environment,
    )
    assert (code, err) == (0, "")
    return [row.split("\t")[0] for row in out.splitlines()]


def test_commands_are_offered_by_what_is_begun() -> None:
    assert offered("slambed re") == ["report", "results"]
    assert {"run", "status", "papers", "profiles", "doctor"} <= set(offered("slambed "))


def test_options_are_the_commands_own() -> None:
    assert offered("slambed run --dry") == ["--dry-run"]
    assert offered("slambed data export --f") == ["--format"]


@pytest.mark.parametrize(
    ("line", "name"),
    [
        ("slambed run quicks", "quickstart"),
        ("slambed run --engine virtual --wait quicks", "quickstart"),
        ("slambed systems show orb", "orbslam2"),
        ("slambed devices show jetson", "jetson_tx2"),
        ("slambed data prepare synthetic_off", "synthetic_office"),
        ("slambed profiles show ramp_8", "ramp_85"),
        ("slambed profile show ramp_8", "ramp_85"),
        ("slambed papers plan dynnets", "dynnetslam"),
        ("slambed run quickstart --engine vir", "virtual"),
        ("slambed data export synthetic_room --format eur", "euroc"),
    ],
)
def test_names_are_offered(line: str, name: str) -> None:
    words = line.split()[1:]
    assert name in (names_for(Asked(words[:-1], words[-1])) or [])


def test_bash_zsh_and_fish_get_the_same_names() -> None:
    bash = {
        "_SLAMBED_COMPLETE": "complete_bash",
        "COMP_WORDS": "slambed run d_f",
        "COMP_CWORD": "2",
    }
    zsh = {"_SLAMBED_COMPLETE": "complete_zsh", "_TYPER_COMPLETE_ARGS": "slambed run d_f"}
    names = [name for name in Library().experiments() if name.startswith("d_f")]
    assert slambed_process(**bash)[1].split() == names == offered("slambed run d_f")
    out = slambed_process(**zsh)[1]
    assert all(f'"{name}"' in out for name in names)


def test_own_systems_and_results_are_offered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "systems/mine").mkdir(parents=True)
    (tmp_path / "systems/mine/system.yaml").write_text("name: mine\n")
    (tmp_path / "results/tried/runs/0123abcd").mkdir(parents=True)
    (tmp_path / "results/tried/experiment.json").write_text("{}")
    (tmp_path / "lab/my_walk").mkdir(parents=True)
    (tmp_path / "lab/my_walk/dataset.yaml").touch()
    (tmp_path / "lab/my_room.yaml").touch()
    monkeypatch.setenv("SLAMBED_DATASETS", str(tmp_path / "lab"))
    assert names_for(Asked(["data", "show"], "my")) == ["my_room", "my_walk"]
    monkeypatch.setenv("SLAMBED_SYSTEMS", str(tmp_path / "systems"))
    monkeypatch.chdir(tmp_path)
    assert names_for(Asked(["systems", "show"], "mi")) == ["mine"]
    assert names_for(Asked(["report"], "t")) == ["tried"]
    assert names_for(Asked(["explain"], "01")) == ["0123abcd"]


def test_what_results_have_is_offered_to_select_by(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    runs = [
        {"system": "edgeslam", "variant": v, "label": f"slam {v}", "profile": p, "engine": "local"}
        for v in ("static", "conventional")
        for p in (None, "rtt_40")
    ]
    (tmp_path / "results/tried").mkdir(parents=True)
    (tmp_path / "results/tried/experiment.json").write_text(json.dumps({"runs": runs}))
    all_of_it = ["engine=local", "link=rtt_40", "system=edgeslam", "variant=conventional",
                 "variant=static"]  # fmt: skip
    for words in (["diff", "results/tried", "--a"], ["run", "tried", "--only"]):
        assert names_for(Asked(words, "")) == all_of_it
    assert names_for(Asked(["diff", "results/tried", "--b"], "va")) == all_of_it[-2:]
    (tmp_path / "results/tried/experiment.json").write_text("[torn")
    assert names_for(Asked(["diff", "results/tried", "--b"], "va")) == []


def test_no_shell_asks_in_a_usual_call() -> None:
    assert asked({}) is None
    assert asked(
        {"_SLAMBED_COMPLETE": "complete_zsh", "_TYPER_COMPLETE_ARGS": "slambed run q"}
    ) == (Asked(["run"], "q"))


def test_names_load_no_commands_module() -> None:
    """Completion is fast because it skips seconds of imports."""
    code = """
import sys
from slambed.commands.main import run_command
try:
    run_command([])
except SystemExit:
    pass
print([name for name in ("numpy", "pandas", "matplotlib", "scipy") if name in sys.modules])
"""
    for line in ("slambed systems show orb", "slambed explain 0", "slambed "):
        done = subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            check=True,
            env=os.environ | {"_SLAMBED_COMPLETE": "complete_zsh", "_TYPER_COMPLETE_ARGS": line},
        )
        assert done.stdout.splitlines()[-1] == "[]", done.stdout


def test_help_and_a_mistyped_name_load_no_more_than_commands() -> None:
    """Modules of commands import heavy packages only when a command is executed, because that takes
    seconds."""
    code = """
import sys
from slambed.commands.main import COMMANDS, run_command
assert run_command([sys.argv[1]]) == int(sys.argv[2])
names = [place.partition(":")[0] for place in COMMANDS.values()]
assert all(f"slambed.commands.{name}" in sys.modules for name in names)
print([name for name in ("numpy", "pandas", "scipy", "yaml") if name in sys.modules])
"""
    for word, ends_with in (("--help", "0"), ("reprot", "2")):
        done = subprocess.run(
            [sys.executable, "-c", code, word, ends_with],
            capture_output=True,
            text=True,
            check=True,
        )
        assert done.stdout.splitlines()[-1] == "[]", done.stdout


def test_every_command_and_option_that_is_named_is_there() -> None:
    slambed("--help")  # loads all of them
    group = typer.main.get_command(cli.app)
    options: dict[str, bool] = {}
    for words in TAKES:
        found = group
        for word in words:
            assert word in found.commands, words
            found = found.commands[word]
        for option in found.params:
            for name in option.opts if option.param_type_name == "option" else ():
                options[name] = option.is_flag
    with_value = {name for name, flag in options.items() if not flag and name.startswith("-")}
    assert with_value <= set(VALUES), sorted(with_value - set(VALUES))


def test_bash_completes_with_what_was_installed(tmp_path: Path) -> None:
    """Tests from --install-completion in a real bash to the names in its COMPREPLY."""
    (tmp_path / "bin").mkdir()
    program = tmp_path / "bin" / "slambed"
    program.write_text(first_line() + "from slambed.commands.main import main\nmain()\n")
    program.chmod(0o755)
    environment = os.environ | {
        "HOME": str(tmp_path),
        "PATH": f"{tmp_path / 'bin'}:{os.environ['PATH']}",
    }
    script = """
slambed --install-completion || exit 1
source "$HOME/.bashrc"
COMP_WORDS=(slambed devices show raspberry_pi_4)
COMP_CWORD=3
_slambed_completion slambed
printf '%s\n' "${COMPREPLY[@]}"
"""
    done = subprocess.run(
        ["bash", "--norc", "-c", script],
        capture_output=True,
        text=True,
        env=environment,
        check=True,
        cwd=tmp_path,
    )
    assert "bash completion installed" in done.stdout
    assert done.stdout.splitlines()[-2:] == ["raspberry_pi_4", "raspberry_pi_4_ijnc"]
