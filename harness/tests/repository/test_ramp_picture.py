# SPDX-License-Identifier: Apache-2.0
"""The picture of the front page shows every run, and is one that a browser reads."""

import runpy
from pathlib import Path
from xml.etree import ElementTree

from results_factory import quickstart_like

from slambed import Results
from slambed.native import repository_root
from slambed.spec.library import Library

ROOT = repository_root()
DRAW = runpy.run_path(str(ROOT / "tools" / "ramp_picture.py"))
SVG = "{http://www.w3.org/2000/svg}"


def words(svg: ElementTree.Element) -> list[str]:
    return ["".join(item.itertext()) for item in svg.iter(f"{SVG}text")]


def test_each_system_has_its_runs_and_what_became_of_them(tmp_path: Path) -> None:
    results = Results(quickstart_like(tmp_path, 2, 6.0))
    svg = ElementTree.fromstring(DRAW["picture"](results))
    said = words(svg)
    for label in results.valid_runs["label"].unique():
        assert label in said
    strips = {item.get("y") for item in svg.iter(f"{SVG}rect") if item.get("height") == "6"}
    assert len(strips) == len(results.valid_runs)
    assert sum("runs" in line for line in said) == results.valid_runs["label"].nunique()


def test_the_picture_in_the_docs_is_of_the_experiments_systems() -> None:
    experiment, _ = Library().experiment("ramp")
    svg = ElementTree.parse(ROOT / "docs" / "pictures" / "ramp.svg").getroot()
    said = words(svg)
    assert all(choice.label in said for choice in experiment.systems)
    assert any("10 of 10 runs" in line for line in said)
