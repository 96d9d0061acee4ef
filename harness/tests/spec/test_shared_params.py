# SPDX-License-Identifier: Apache-2.0
"""`params_from:` of a system.yaml."""

from pathlib import Path

import pytest

from slambed.errors import SlambedError
from slambed.spec.library import Library

SHARED = """\
rate_hz: {type: float, default: 2.0, min: 0.0, max: 10.0, unit: Hz, doc: how often}
mode: {type: str, default: plain, choices: [plain, fancy]}
"""
SYSTEM = """\
name: solo
title: A system
roles: [mobile]
params_from: ../shared.yaml
params:
  mode: {default: fancy}
  own: {type: int, default: 1}
"""


def library(root: Path, system: str = SYSTEM, shared: str = SHARED) -> Library:
    (root / "systems" / "solo").mkdir(parents=True)
    (root / "systems" / "shared.yaml").write_text(shared)
    (root / "systems" / "solo" / "system.yaml").write_text(system)
    return Library(root)


def test_shared_parameters_follow_the_own_ones_and_keep_what_is_not_said_anew(
    tmp_path: Path,
) -> None:
    solo = library(tmp_path).system("solo")
    assert list(solo.params) == ["own", "rate_hz", "mode"]
    assert solo.params["rate_hz"].unit == "Hz"
    assert solo.params["mode"].choices == ["plain", "fancy"]
    assert solo.resolve("default", {}) == {"own": 1, "rate_hz": 2.0, "mode": "fancy"}


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("../shared.yaml", "../nowhere.yaml", "no such file: .*nowhere.yaml"),
        ("../shared.yaml", "[1]", "'params_from': expected the path of a file, .*line 4"),
        (
            "default: fancy",
            "default: odd",
            "'params.mode': 'odd' is none of plain, fancy, .*line 6",
        ),
        ("default: fancy", "defualt: fancy", "unknown key 'defualt', .*line 6"),
    ],
)
def test_what_is_wrong_is_reported_with_its_line(
    tmp_path: Path, old: str, new: str, complaint: str
) -> None:
    with pytest.raises(SlambedError, match=complaint):
        library(tmp_path, SYSTEM.replace(old, new)).system("solo")


def test_a_file_that_holds_no_parameters_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SlambedError, match="expected parameters"):
        library(tmp_path, shared="- 1\n").system("solo")
