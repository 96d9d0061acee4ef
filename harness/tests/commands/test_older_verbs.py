# SPDX-License-Identifier: Apache-2.0
"""Renamed commands: the former name works for one release and prints a note."""

from pathlib import Path

import pytest
from command_line import slambed

from slambed.commands.main import COMMANDS
from slambed.commands.older_verbs import OLDER, renewed


@pytest.mark.parametrize("name", OLDER)
def test_an_old_name_leads_to_a_command_that_is_there(name: str) -> None:
    now, note = renewed([name, "x"])
    assert now == [*OLDER[name], "x"] and f"'slambed {' '.join(OLDER[name])}'" in note
    assert name not in COMMANDS
    code, out, err = slambed(name, "--help")
    assert code == 0 and err.strip() == note
    assert out == slambed(*OLDER[name], "--help")[1]


def test_what_is_new_has_no_note(tmp_path: Path) -> None:
    for given in (["report", "plots"], [], ["--version"]):
        assert renewed(given) == (given, "")


def test_old_and_new_do_the_same(tmp_path: Path) -> None:
    old = slambed("profile", "show", "ramp_85", "--output", str(tmp_path / "a.png"))
    new = slambed("profiles", "show", "ramp_85", "--output", str(tmp_path / "a.png"))
    assert old[:2] == new[:2] and new[0] == 0
    assert old[2].startswith("note: 'slambed profile' is 'slambed profiles' now") and not new[2]
