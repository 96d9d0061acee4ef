# SPDX-License-Identifier: Apache-2.0
"""The first screen of a report: one sentence, one picture, one table; the rest is folded."""

import re
import shutil
from dataclasses import replace
from html import escape
from pathlib import Path

import pandas as pd
import pytest
from command_line import refused, slambed
from results_factory import losing

from slambed.errors import ExitCode
from slambed.report import overview
from slambed.report.compute_times import compute_times
from slambed.report.conditions import median_run, typical_run
from slambed.report.experiment import write_report
from slambed.report.load import Results, load
from slambed.report.overview import overviews
from slambed.report.rounds import update_round_tables
from slambed.report.timeline import rtt_of
from slambed.report.told import told

LOST = ("0000000000000001", "0000000000000002")


@pytest.fixture(scope="module")
def experiment(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return losing(tmp_path_factory.mktemp("overview"))


@pytest.fixture(scope="module")
def page(experiment: Path) -> str:
    return write_report(experiment, figures=False).html.read_text()


def test_sentence_picture_and_table_come_before_all_that_is_folded(page: str) -> None:
    places = [
        page.index(part)
        for part in (
            "Runs with a track loss: edgeslam:static 2 of 2; orbslam2 none of 1.",
            '<svg class="timeline overview"',
            "<table",
            '<details class="part">',
        )
    ]
    assert places == sorted(places)
    folded = page.index('<details class="part">')
    assert page.count("<table", 0, folded) == 1
    assert " open" not in "".join(re.findall(r"<details class=\"part\"[^>]*>", page))


def test_the_picture_has_link_states_losses_updates_and_tracking(experiment: Path) -> None:
    results = load(experiment)
    (picture,) = overviews(results)
    assert len(picture.shown) == 2 and picture.shown[1] in LOST and picture.left_out == 0
    svg = picture.svg
    for part in (
        ">ramp_85: RTT asked (line), measured (dots)<",
        'data-name="RTT of ramp_85, asked"',
        "<title>RTT measured:",
        ">orbslam2, none<",
        ">edgeslam:static, ramp_85",
        "<title>lost from 6.0 s",
        "<title>track lost at 6.0 s",
        "<title>map update applied at ",
        'data-name="edgeslam:static, ramp_85, tracking"',
        ">10 s<",
    ):
        assert part in svg, part
    # The system alone has no link that delays, no loss and no update.
    alone = svg.split(f"#t-{picture.shown[1]}")[0]
    assert "<title>track lost" not in alone and "<title>map update" not in alone


def test_the_links_outages_are_shaded(experiment: Path) -> None:
    results = load(experiment)
    assert "outage" not in overviews(results)[0].svg
    gaps = [{"start_s": 2.0, "length_s": 1.5}]
    cut = replace(results, links={"ramp_85": {"rtt_ms": 20, "gaps": gaps}})
    svg = overviews(cut)[0].svg
    assert ">ramp_85: RTT asked (line), measured (dots), outages shaded<" in svg
    assert "<title>the link&#x27;s outage 2 to 3.5 s" in svg


@pytest.mark.parametrize(
    ("sources", "words", "value"),
    [
        (["tcp_info"], "smoothed by TCP", 7.0),
        (["echo"], "by echo", 7.0),
        (["probe"], "by the system's probe", 7.0),
        (["probe", "tcp_info"], "smoothed by TCP", 8.0),
        ([None], "as the mobile node knows it", 7.0),
    ],
)
def test_the_source_of_an_rtt_is_named_and_two_are_not_mixed(
    sources: list[str | None], words: str, value: float
) -> None:
    events = pd.DataFrame(
        {"t_ns": 10**9 * (i + 1), "type": "rtt_sample", "node": "mobile", "source": source,
         "rtt_ms": 7.0 + i}
        for i, source in enumerate(sources)
    )  # fmt: skip
    without_probe = pd.DataFrame({"t_s": [0.0], "series": ["asked_rtt_ms"], "value": [5.0]})
    source, known = rtt_of(without_probe, events)
    assert (source, list(known["value"])) == (words, [value])


def test_every_mark_leads_to_the_time_line_of_its_run(page: str) -> None:
    start = page.index('<svg class="timeline overview"')
    svg = page[start : page.index("<figcaption>", start)]
    links = re.findall(r'<a href="#([^"]+)"', svg)
    assert len(links) >= 10
    assert set(links) <= set(re.findall(r' id="([^"]+)"', page))
    for link in set(links):
        line = page[page.index(f'id="{link}"') :].partition("</div>")[0]
        assert '<svg class="timeline"' in line
    # Nothing that can be pointed at is without a link: neither states nor crosses nor ticks.
    for mark in ("ok from", "track lost at", "map update applied at", "lost from"):
        places = list(re.finditer(f"<title>[^<]*{mark}", svg))
        assert places, mark
        for found in places:
            assert svg.rfind("<a ", 0, found.start()) > svg.rfind("</a>", 0, found.start())


def test_runs_without_events_leave_a_page_without_a_picture(tmp_path: Path) -> None:
    experiment = losing(tmp_path)
    for path in experiment.glob("runs/*/events.parquet"):
        path.unlink()
    text = write_report(experiment, figures=False).html.read_text()
    assert "timeline overview" not in text and "<table" in text


def test_of_two_runs_the_worse_one_is_shown_and_called_so(experiment: Path) -> None:
    results = load(experiment)
    (picture,) = overviews(results)
    both = results.runs.set_index("run_key").loc[list(LOST)]
    assert both["coverage"].nunique() == 1 and picture.shown[1] == both["ate_rmse_m"].idxmax()
    assert picture.svg.count("worse of 2: ") == 1


def test_tables_of_events_say_how_many_runs_have_any(tmp_path: Path) -> None:
    experiment = losing(tmp_path)
    (whole,) = overviews(load(experiment))
    assert whole.part == ""
    results = load(experiment)
    (table,) = update_round_tables(results)
    assert "have no events" not in table.caption
    without = whole.shown[1]
    (experiment / "runs" / without / "events.parquet").unlink()
    results = load(experiment)
    (picture,) = overviews(results)
    assert {without, picture.shown[1]} == set(LOST)
    assert picture.part == "from 2 of 3 runs, the others have no events"
    (table,) = update_round_tables(results)
    assert "; from 1 of 2 runs, the others have no events" in table.caption
    page = write_report(experiment, figures=False).html.read_text()
    assert f"The strips were chosen {picture.part}." in page
    assert escape(table.caption, quote=False) in page
    place = ("--results", str(experiment.parent))
    code, out, _ = slambed("report", experiment.name, "--losses", *place)
    assert code == 0 and "note: losses from 2 of 3 runs, the others have no events" in out
    for path in experiment.glob("runs/*/events.parquet"):
        path.unlink()
    line = refused(ExitCode.BAD_INPUT, "report", experiment.name, "--losses", *place)
    assert "no run has its events" in line


def test_compute_times_are_those_of_a_run_with_events(experiment: Path, tmp_path: Path) -> None:
    copy = tmp_path / "invented"
    shutil.copytree(experiment, copy)
    (copy / "runs" / LOST[0] / "events.parquet").unlink()
    results = load(copy)
    (time,) = compute_times(results.only(results.runs["run_key"].isin(LOST).tolist()))
    (other,) = compute_times(results.only(results.runs["run_key"].eq(LOST[1]).tolist()))
    assert time == other


def runs(*rows: tuple[str, str, bool | None]) -> Results:
    """Results of valid runs: label, link, and whether track was lost; None is not measured."""
    table = pd.DataFrame(rows, columns=["label", "profile", "lost"])
    table = table.assign(valid=True, dataset="room", cell=table["label"] + "/" + table["profile"])
    return Results(Path("x"), "x", table.assign(not_completed=False))


def test_the_sentence_names_runs_that_died_without_a_loss() -> None:
    one, five = runs(("a", "none", False)), runs(*[("a", "none", False)] * 5)
    one.runs["not_completed"] = True
    five.runs.loc[:1, "not_completed"] = True
    assert told(one) == "The run kept track, and did not complete."
    assert told(five) == "No run of 5 lost track; 2 of 5 runs did not complete."
    one.runs["lost"] = True
    assert told(one) == "The run lost track, and did not complete."


@pytest.mark.parametrize(
    ("rows", "sentence"),
    [
        ([], ""),
        ([("a", "none", False)] * 3, "No run of 3 lost track."),
        ([("a", "none", True)] * 2, "Every run of 2 lost track."),
        ([("a", "none", True)], "The run lost track."),
        (
            [("a", "none", False)] * 3
            + [("b", "none", False)] * 2
            + [("b", "rtt_85", True)] * 2
            + [("b", "rtt_85", False)],
            "Runs with a track loss: b 2 of 3 with rtt_85, none of 2 otherwise; a none of 3.",
        ),
        (
            [(name, "none", name == "a") for name in "abcdef"],
            "Runs with a track loss: a 1 of 1; b none of 1; c none of 1; d none of 1; "
            "2 more systems are in the table.",
        ),
        ([("a", "none", None)] * 2, ""),
        (
            [("a", "none", False)] * 8 + [("a", "none", None)] * 2,
            "No run of 8 lost track; 2 more were not measured.",
        ),
        (
            [("a", "none", True)] * 2 + [("b", "none", None)],
            "Every run of 2 lost track; 1 more was not measured.",
        ),
        (
            [("b", "rtt_85", True)] * 2
            + [("b", "rtt_85", None), ("b", "none", False), ("b", "none", None)]
            + [("a", "none", False), ("a", "none", None)],
            "Runs with a track loss: b 2 of 2 with rtt_85, none of 1 otherwise; a none of 1; "
            "3 more were not measured.",
        ),
    ],
)
def test_one_sentence_says_who_lost_track(
    rows: list[tuple[str, str, bool | None]], sentence: str
) -> None:
    assert told(runs(*rows)) == sentence


def test_the_median_run_counts_a_failure_as_worse_than_any_error() -> None:
    rows = pd.DataFrame(
        {
            "run_key": list("abcde"),
            "coverage": [1.0, 0.2, 1.0, None, 1.0],
            "ate_rmse_m": [0.03, 0.001, 0.01, None, 0.02],
        }
    )
    # Best to worst: c, e, a, b (most frames lost), d (nothing tracked).
    assert median_run(rows) == "a"
    # Of an even number no run is the middle one: the better one would flatter the system.
    assert median_run(rows.iloc[:4]) == "b"
    assert median_run(rows.iloc[[0, 2]]) == "a"
    assert typical_run(rows.iloc[[0, 2]]) == "a" and typical_run(rows.iloc[:3]) == "c"
    assert median_run(rows.iloc[:0]) is None


def test_where_not_all_cells_fit_the_links_with_most_losses_are_shown() -> None:
    found = runs(
        *(
            (system, link, link == "rtt_9")
            for link in ("rtt_1", "rtt_9", "rtt_5")
            for system in "abcde"
        )
    )
    kept = [link for link, _ in overview._links(found.runs)]
    assert kept == ["rtt_9"]
    few = found.runs[found.runs["label"].isin(["a", "b", "c"])]
    assert [link for link, _ in overview._links(few)] == ["rtt_1", "rtt_9"]
