# SPDX-License-Identifier: Apache-2.0
"""The page that compares the variants of all papers on the same sequences."""

import csv
import re
from pathlib import Path

import pandas as pd
import pytest
from test_paper_page import Anchors

from slambed.commands.papers import write_all
from slambed.papers.cross_page import (
    BARS,
    cell_svg,
    cells_of_runs,
    scene_of,
    takeaway,
    write_cross_page,
)
from slambed.papers.published import read_papers
from slambed.report.load import Results

LINKS = ("none", "slow")
BOARDS = ("pi", "jetson")


def results_of(losses: dict[str, int], runs: int = 10) -> Results:
    """Every variant on one sequence, two links and two boards; on `slow`, so many of its runs lose
    track."""
    rows = [
        {
            "label": f"{variant} [{board}]", "dataset": dataset, "profile": link,
            "device_mobile": board, "track_losses": int(link == "slow" and number < lost),
            "ate_rmse_m": 0.01 * (number + 1), "coverage": 1.0, "valid": True,
            "started_utc": "2026-11-27T10:00:00.000+00:00",
        }
        for variant, lost in losses.items()
        for dataset in ("synthetic_mono_room" if "camera" in variant else "synthetic_room",)
        for board in BOARDS
        for link in LINKS
        for number in range(runs)
    ]  # fmt: skip
    return Results(Path("x_all_systems"), "all", pd.DataFrame(rows))


def test_a_walk_is_one_sequence_whatever_the_sensor() -> None:
    assert scene_of("synthetic_mono_room") == scene_of("synthetic_room") == "synthetic_room"
    assert scene_of("synthetic_fr3_path_mono") == "synthetic_fr3_path"


def test_one_row_per_variant_with_median_and_losses(tmp_path: Path) -> None:
    path = write_cross_page(results_of({"A": 0, "B & C": 4, "one camera": 0}), tmp_path)
    assert path == tmp_path / "systems.html"
    html = path.read_text()
    found = Anchors()
    found.feed(html)
    assert not found.open
    assert re.findall(r"<tr><th>([^<]+)</th><td>", html) == ["A", "B &amp; C", "one camera"]
    assert html.count('role="img"') == 3  # one sequence, seen by two kinds of camera
    assert "10 runs per combination, virtual time, generated sequences, played 2026-11-27" in html
    lost = "B &amp; C, pi, slow: median ATE RMSE 5.5 cm, 4 of 10 runs lost track"
    assert f"<title>{lost}</title>" in html
    with (tmp_path / "tables" / "all_systems.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 3 * len(BOARDS) * len(LINKS)
    assert {row["runs with a loss"] for row in rows} == {"0", "4"}


def test_the_headline_is_computed() -> None:
    cells = cells_of_runs(results_of({"A": 0, "B": 4}))
    assert takeaway(cells) == [
        "In 6 of 8 combinations at most 10 % of the runs lose track. 1 of 2 variants never "
        "loses it (A). B loses it most often, in 20 % of its runs."
    ]
    assert takeaway(cells_of_runs(results_of({"A": 0}))) == [
        "In 4 of 4 combinations at most 10 % of the runs lose track. 1 of 1 variant never loses "
        "it (A)."
    ]


def test_of_few_runs_none_may_be_lost_and_a_few_names_are_told() -> None:
    def said(losses: dict[str, int]) -> str:
        (line,) = takeaway(cells_of_runs(results_of(losses, runs=3)))
        return line

    assert said({"A": 0, "B": 1}).startswith("In 6 of 8 combinations no run loses track. ")
    assert "2 of 3 variants never lose it (A and B). C loses" in said({"A": 0, "B": 0, "C": 1})
    many = {"A": 0, "B": 0, "C": 0, "D": 1}
    assert "3 of 4 variants never lose it. D loses" in said(many)


def test_a_dot_at_the_upper_end_is_inside_its_picture() -> None:
    results = results_of({"A": 0})
    results.runs["ate_rmse_m"] = 5.0
    svg = str(cell_svg(cells_of_runs(results), list(LINKS), list(BOARDS)))
    top = float(re.findall(r'viewBox="\S+ (\S+)', svg)[0])
    centers = [float(y) for y in re.findall(r'cy="(\S+)" r="3.4"', svg)]
    assert centers and min(centers) - 3.4 >= top


def test_what_was_not_measured_is_not_shown_as_none(tmp_path: Path) -> None:
    results = results_of({"A": 2, "B": 0})
    runs = results.runs.astype({"track_losses": object})
    results.runs = runs
    first = runs.index[runs["label"].eq("A [pi]") & runs["profile"].eq("slow")]
    runs.loc[first[5:], "track_losses"] = None
    runs.loc[first, "ate_rmse_m"] = None
    of_b = runs["label"].str.startswith("B")
    runs.loc[of_b, ["track_losses", "coverage"]] = None
    cells = cells_of_runs(results)
    words = [cell.words for cell in cells]
    assert "A, pi, slow: no ATE RMSE, 2 of 5 runs lost track" in words
    assert "B, pi, none: median ATE RMSE 5.5 cm, track losses not measured" in words
    assert takeaway(cells) == [
        "In 2 of 4 combinations at most 10 % of the runs lose track. None of 1 variant never "
        "loses it. A loses it most often, in 11 % of its runs."
    ]
    assert takeaway([c for c in cells if c.variant == "B"]) == ["Track losses were not measured."]
    path = write_cross_page(results, tmp_path)
    assert path is not None and "nan" not in re.sub("[a-z]nan|nan[a-z]", "", path.read_text())
    with (tmp_path / "tables" / "all_systems.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["runs with a loss"] for row in rows if row["variant"] == "B"} == {"-"}
    assert {row["coverage [%]"] for row in rows if row["variant"] == "B"} == {"-"}
    (a,) = [r for r in rows if (r["variant"], r["board"], r["link"]) == ("A", "pi", "slow")]
    assert (a["runs"], a["runs with a loss"], a["ATE RMSE [cm]"]) == ("10", "2 of 5", "-")


def test_a_larger_error_is_higher_and_a_larger_share_has_a_longer_bar() -> None:
    cells = cells_of_runs(results_of({"B": 4}, runs=10))
    svg = cell_svg(cells, list(LINKS), list(BOARDS))
    heights = list(map(float, re.findall(r'class="lost"[^>]* height="([\d.]+)"', svg)))
    assert heights == pytest.approx([0, 0.4 * BARS, 0, 0.4 * BARS])
    worse = results_of({"B": 4})
    worse.runs["ate_rmse_m"] *= 10
    above = cell_svg(cells_of_runs(worse), list(LINKS), list(BOARDS))
    first = [float(re.findall(r'cy="([\d.]+)"', picture)[0]) for picture in (svg, above)]
    assert first[1] < first[0]


def test_without_a_valid_run_there_is_no_page(tmp_path: Path) -> None:
    results = results_of({"A": 0})
    results.runs["valid"] = False
    assert write_cross_page(results, tmp_path) is None
    assert not list(tmp_path.iterdir())


def test_runs_of_no_paper_come_into_the_comparison_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    papers = [paper for paper in read_papers() if paper.kind == "paper"][:2]
    alone, beside = tmp_path / "alone", tmp_path / "beside"
    write_all(papers, lambda paper: [], alone, every=False)
    write_all(papers, lambda paper: [], beside, every=False, besides=[results_of({"A": 0})])
    assert f"all systems: {beside / 'systems.html'}" in capsys.readouterr().out.replace("\n", "")
    assert not (alone / "systems.html").exists() and (beside / "systems.html").is_file()
    assert "systems.html" in (beside / "index.html").read_text()
    for paper in papers:
        page = Path(paper.id) / "index.html"
        assert (alone / page).read_text() == (beside / page).read_text()
