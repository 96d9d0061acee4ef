# SPDX-License-Identifier: Apache-2.0
"""CloudSLAM's statements of no effect, of a ratio between two routes and of times, and its figures
of single events."""

from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from test_compare import column_of, outcome_of, results_of, runs_of

from slambed.papers.compare import compare_paper
from slambed.papers.figures import drawn_figures
from slambed.papers.lookup import pool_of
from slambed.papers.orderings import JudgedOrdering
from slambed.papers.paper_page import write_paper_page
from slambed.papers.published import Paper, read_papers
from slambed.report.load import Results

LAPS = {"rectangle": "synthetic_rectangle_small_lap2", "circular": "synthetic_circular_small_lap2"}
BANDWIDTHS = (12, 24, 48, 96)
RUNS = 5


@pytest.fixture(scope="module")
def paper() -> Paper:
    return read_papers(["cloudslam"])[0]


def trips(variant: str, route: str, profile: str, **more: Any) -> list[dict[str, Any]]:
    found = runs_of("cloudslam", variant, profile, 0, RUNS, dataset=LAPS[route], engine="virtual")
    for i, run in enumerate(found):
        run |= {"run_key": f"{run['run_key']}{len(more)}{sorted(more.items())}", "wall_s": 128.0}
        run |= {k: v * (1 + 0.001 * i) if "." not in k else v for k, v in more.items()}
    return list(found)


def bandwidths(slow_rmse: float = 1.0, circular_matches: float = 200.0) -> Results:
    """Returns the runs of Figure 15; `slow_rmse` is the error of `distance` at 12 Mbit/s."""
    rows = []
    for mbps in BANDWIDTHS:
        profile = f"cloudslam_{mbps}mbps"
        rows += trips("periodic", "rectangle", profile, **{"params.period_s": 5.0},
                      reference_rmse_m=1.0, remote_matches_mean=400.0)  # fmt: skip
        rows += trips("periodic", "circular", profile, **{"params.period_s": 5.0},
                      reference_rmse_m=9.0, remote_matches_mean=circular_matches)  # fmt: skip
        rows += trips("distance", "rectangle", profile, **{"params.distance_m": 20.0},
                      reference_rmse_m=slow_rmse if mbps == 12 else 1.0)  # fmt: skip
    return results_of(rows, reproduces=("cloudslam",))


def ordering(paper: Paper, results: Results, name: str) -> JudgedOrdering:
    found = column_of(paper, results).orderings
    return next(o for o in found if o.contrast.id == f"cloudslam.{name}")


def test_bandwidth_that_makes_no_difference(paper: Paper) -> None:
    found = ordering(paper, bandwidths(), "O17")
    assert (found.kind, found.provenance) == ("holds", "stand_in")
    assert found.holding == "3 of 3 curves hold"


def test_one_curve_with_a_difference_decides(paper: Paper) -> None:
    found = ordering(paper, bandwidths(slow_rmse=1.6), "O17")
    assert (found.kind, found.words) == ("reversed", "reversed in part")
    assert found.holding == "2 of 3 curves hold, 1 reversed"
    assert "distance" in found.values(ours=True) or "of 3 curves" in found.values(ours=True)


def test_a_ratio_between_two_routes_has_one_on_stand_ins(paper: Paper) -> None:
    double = column_of(paper, bandwidths()).rows["cloudslam.C31"]
    assert (double.mark, double.verdict.outcome) == ("S", "reproduced")
    assert double.ours.startswith("2 ")
    assert "ours 2.00 times" in double.verdict.why
    assert outcome_of(column_of(paper, bandwidths(circular_matches=400.0)), "cloudslam.C31") == (
        "differs"
    )
    assert ordering(paper, bandwidths(), "O16").kind == "holds"
    assert ordering(paper, bandwidths(circular_matches=500.0), "O16").kind == "reversed"


def with_events(results: Results, folder: Path, events: list[dict[str, Any]]) -> Results:
    """Writes these events into every run."""
    results.folder = folder / results.name
    columns = {name: [e.get(name) for e in events] for e in events for name in e}
    for key in results.runs["run_key"]:
        place = results.run_dir(str(key))
        place.mkdir(parents=True)
        pq.write_table(pa.table(columns), place / "events.parquet")
    return results


def both_laps(folder: Path, *closed_s: float) -> Results:
    """Returns runs of ORB-SLAM2 over both laps that close loops at these times."""
    rows = runs_of("orbslam2", "default", None, 0, RUNS, dataset="synthetic_rectangle_small",
                   engine="virtual", loops_closed=len(closed_s))  # fmt: skip
    for run in rows:
        run["params.prior_map"] = ""
    events = [{"t_ns": 0, "type": "run_start", "node": "mobile"}]
    events += [
        {"t_ns": int(1e9 * time), "type": "loop_closed", "node": "mobile"} for time in closed_s
    ]
    return with_events(results_of(rows, reproduces=("cloudslam",)), folder, events)


@pytest.mark.parametrize(
    ("closed_s", "outcome", "why"),
    [
        ((251.0, 299.0), "reproduced", "ours at 251 and 299 s; 5 of 5 runs have 2 of loop_closed"),
        ((120.0, 299.0), "differs", "ours at 120 and 299 s"),
        ((251.0,), "differs", "0 of 5 runs have 2 of loop_closed"),
        ((), "differs", "0 of 5 runs have 2 of loop_closed"),
    ],
)
def test_times_of_loops(
    paper: Paper, tmp_path: Path, closed_s: tuple[float, ...], outcome: str, why: str
) -> None:
    row = column_of(paper, both_laps(tmp_path, *closed_s)).rows["cloudslam.C16"]
    assert (row.mark, row.verdict.outcome) == ("S", outcome)
    assert why in row.verdict.why


def test_runs_without_events_have_no_times(paper: Paper, tmp_path: Path) -> None:
    results = both_laps(tmp_path, 251.0, 299.0)
    results.folder = tmp_path / "elsewhere"
    assert column_of(paper, results).rows["cloudslam.C16"].verdict.outcome == "not_run"


def corrections(folder: Path) -> Results:
    rows = trips("adaptive", "rectangle", "cloudslam_unconstrained",
                 **{"params.correction_threshold_m": 2.0}, correction_m_p95=1.0)  # fmt: skip
    rows += trips("periodic", "rectangle", "cloudslam_unconstrained", **{"params.period_s": 5.0},
                  link_mbit_s=1.0)  # fmt: skip
    events = [
        {"t_ns": 2 * 10**9, "type": "keyframe_sent", "node": "mobile"},
        {"t_ns": 3 * 10**9, "type": "pose_update_applied", "node": "mobile", "initial": True,
         "magnitude_m": 50.0},
        {"t_ns": 9 * 10**9, "type": "pose_update_applied", "node": "mobile", "initial": False,
         "magnitude_m": 0.5},
    ]  # fmt: skip
    return with_events(results_of(rows, reproduces=("cloudslam",)), folder, events)


def test_figures_of_single_events_are_drawn(paper: Paper, tmp_path: Path) -> None:
    results = corrections(tmp_path)
    verdicts = compare_paper(paper, pool_of([results]))
    sent, sizes = drawn_figures(verdicts, verdicts.columns[0], [results])
    assert (sent.label, sizes.label) == ("Fig. 12", "Fig. 18")
    assert "periodic, period s 5" in sent.svg
    assert "distance" not in sent.svg  # none was played
    assert f"{RUNS} runs per curve" in sizes.note
    assert "share of events" in sizes.svg and "correction in m" in sizes.svg
    assert ">0.5<" in sizes.svg and ">50<" not in sizes.svg  # the pose that placed the trip
    assert drawn_figures(verdicts, verdicts.columns[0], [results]) == [sent, sizes]
    page = write_paper_page(paper, [results], tmp_path / "papers").html.read_text()
    assert "<h2>Fig. 12</h2>" in page and "<h2>Fig. 18</h2>" in page


def test_without_runs_nothing_is_drawn(paper: Paper) -> None:
    verdicts = compare_paper(paper, pool_of([]))
    assert drawn_figures(verdicts, verdicts.columns[0], []) == []
