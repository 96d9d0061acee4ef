# SPDX-License-Identifier: Apache-2.0
"""Published numbers compared with ours: provenance comes first, and verdicts follow from the
numbers."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from slambed.errors import SlambedError
from slambed.metrics.collect import SOME_EVENTS, write_some_events
from slambed.metrics.update_round import PART_FIELDS
from slambed.papers.beside import Beside, beside
from slambed.papers.compare import Column, PaperVerdicts, compare_paper, comparison_table
from slambed.papers.experiment_tables import comparisons_for
from slambed.papers.fits import DeviceFit, read_fits
from slambed.papers.fitted import far_off
from slambed.papers.judged import Judged
from slambed.papers.lookup import Found, Pool, pool_of
from slambed.papers.measured import Measured
from slambed.papers.paper_runs import experiments_of
from slambed.papers.peer import peer_tables
from slambed.papers.published import Difference, Paper, cells_of, read_paper, read_papers
from slambed.papers.published.mapping import OtherReading
from slambed.papers.verdicts.means import judge_mean
from slambed.papers.verdicts.model import Mean, Share, Verdict
from slambed.papers.verdicts.shares import judge_share
from slambed.papers.verdicts.statements import judge_difference, judge_window, pair_by_seed
from slambed.report.load import Results

OFFICE = "fr3_long_office_household"


def runs_of(
    system: str, variant: str, profile: str | None, lost: int, runs: int, **more: Any
) -> Any:
    """Returns rows of summary.csv in which `lost` of `runs` runs lose track."""
    return [
        {
            "run_key": f"{system}{variant}{profile}{more.get('dataset')}{i}{more.get('engine')}",
            "cell": f"{system}:{variant}/{profile}",
            "label": f"{system}:{variant}",
            "system": system,
            "variant": variant,
            "profile": profile,
            "dataset": OFFICE,
            "engine": "local",
            "link_backend": "relay" if system != "orbslam2" else None,
            "valid": True,
            "not_completed": False,
            "lost": i < lost,
            "wall_s": 87.0,
            "ate_rmse_m": 0.015 + 0.0001 * i,
            "coverage": 1.0,
            "repetition": i,
            "params.codec": "binary",
        }
        | more
        for i in range(runs)
    ]


def results_of(
    rows: list[dict[str, Any]], name: str = "made_up", reproduces: tuple[str, ...] = ("dynnetslam",)
) -> Results:
    return Results(Path(name), name, pd.DataFrame(rows), spec={"reproduces": list(reproduces)})


def column_of(paper: Paper, *results: Results, engine: str = "", **more: Any) -> Column:
    """Returns the verdicts of one kind of engine, by default the only one."""
    found = compare_paper(paper, pool_of(list(results)), **more).columns
    return next(c for c in found if not engine or c.engine == engine)


def outcome_of(column: Column, name: str) -> str:
    return column.rows[name].verdict.outcome


def table_2(lost: dict[str, list[int]], runs: int, **more: Any) -> Results:
    """Returns runs of Table 2; `lost` maps a variant to its losses at 0, 20, 40, 60, 80 ms."""
    rows = []
    for variant, counts in lost.items():
        for profile, bad in zip(
            ("none", "rtt_20", "rtt_40", "rtt_60", "rtt_80"), counts, strict=True
        ):
            rows += runs_of("edgeslam", variant, profile, bad, runs, **more)
    return results_of(rows)


PAPER_CONVENTIONAL = [78, 79, 82, 92, 100]
PAPER_ENHANCED = [0, 2, 10, 48, 73]
DOCUMENTED = {"conventional": [1, 2, 1, 3, 2], "static": [0, 0, 0, 0, 0]}
"""docs/logbook/2026-11-21-dynnetslam-tables-2-and-3.md: runs of ten that lost track."""


@pytest.fixture(scope="module")
def dynnetslam() -> Paper:
    return read_papers(["dynnetslam"])[0]


def test_all_papers_are_readable_and_complete() -> None:
    papers = {paper.id: paper for paper in read_papers()}
    assert set(papers) == {
        "cloudslam", "dynnetslam", "edgeslam_semantic", "multithread_rl", "peer_orbslam2",
    }  # fmt: skip
    cells = {
        name: sum(len(r.values) for t in p.tables for r in t.rows.values())
        for name, p in papers.items()
    }
    assert cells == {"cloudslam": 20, "dynnetslam": 110, "edgeslam_semantic": 45,
                     "multithread_rl": 96, "peer_orbslam2": 0}  # fmt: skip
    assert {n: len(p.claims) for n, p in papers.items()} == {
        "cloudslam": 38, "dynnetslam": 56, "edgeslam_semantic": 60, "multithread_rl": 28,
        "peer_orbslam2": 0,
    }  # fmt: skip
    for paper in papers.values():
        ids = [item.id for item in [*paper.tables, *paper.figures, *paper.claims]]
        assert len(ids) == len(set(ids))
        stated = {s for figure in paper.figures for s in figure.stated}
        assert stated <= {claim.id for claim in paper.claims}


def test_unknown_keys_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "p.yaml"
    path.write_text("id: p\nkind: paper\nauthor: me\n")
    with pytest.raises(SlambedError, match=r"p\.yaml"):
        read_paper(path)


def test_nothing_run_is_said_so(dynnetslam: Paper) -> None:
    column = column_of(dynnetslam)
    cells = [r for i, r in column.rows.items() if i.startswith("dynnet.T")]
    assert len(cells) == 110
    assert {r.mark for r in column.rows.values()} <= {"N", "P"}
    assert all(r.missing and r.why for r in column.rows.values() if r.mark == "N")
    assert {o.ordering.outcome for o in column.orderings} <= {"inconclusive", "not_shown_by_paper"}


def test_the_documented_table_2_reproduces_nothing(dynnetslam: Paper) -> None:
    """With ten runs per cell on the generated room, all ten cells were once called 'same
    ordering'."""
    for dataset, marks in (("synthetic_fr3_path", {"S"}), (OFFICE, {"D", "I"})):
        column = column_of(dynnetslam, table_2(DOCUMENTED, 10, engine="virtual", dataset=dataset))
        cells = {i: r for i, r in column.rows.items() if i.startswith("dynnet.T2.")}
        assert len(cells) == 10
        assert {r.mark for r in cells.values()} == marks
        about = [o for o in column.orderings if set(o.contrast.ids()) <= set(cells)]
        assert {o.contrast.id: o.ordering.outcome for o in about} == {
            "dynnet.O03": "too_few_runs",
            "dynnet.O04": "not_seen",
            "dynnet.O05": "too_few_runs",
        }


def test_equal_shares_of_many_runs_are_reproduced(dynnetslam: Paper) -> None:
    lost = {"conventional": PAPER_CONVENTIONAL, "static": PAPER_ENHANCED}
    column = column_of(dynnetslam, table_2(lost, 100))
    assert outcome_of(column, "dynnet.T2.enhanced.rtt0") == "reproduced"
    assert outcome_of(column, "dynnet.T2.enhanced.rtt20") == "reproduced"
    assert outcome_of(column, "dynnet.T2.conventional.rtt80") == "reproduced"
    assert outcome_of(column, "dynnet.T2.enhanced.rtt60") == "reproduced"
    assert column.score.cells >= 10
    orderings = {
        o.contrast.id: o.ordering.outcome
        for o in column.orderings
        if all(name.startswith("dynnet.T2.") for name in o.contrast.ids())
    }
    assert set(orderings.values()) == {"holds"}


def test_a_reversed_ordering_is_a_finding(dynnetslam: Paper) -> None:
    lost = {"conventional": PAPER_ENHANCED[::-1], "static": PAPER_CONVENTIONAL}
    column = column_of(dynnetslam, table_2(lost, 100))
    about = [o for o in column.orderings if o.contrast.id in ("dynnet.O03", "dynnet.O05")]
    assert {o.ordering.outcome for o in about} == {"reversed"}
    assert outcome_of(column, "dynnet.T2.enhanced.rtt0") == "differs"


def test_the_pair_that_decides_is_shown_with_who_is_who(dynnetslam: Paper) -> None:
    lost = {"conventional": [60, 60, 60, 30, 90], "static": [5, 5, 5, 30, 5]}
    column = column_of(dynnetslam, table_2(lost, 100))
    found = {o.contrast.id: o for o in column.orderings}
    pairs = found["dynnet.O03"]
    assert (pairs.kind, pairs.holding) == ("not_seen", "4 of 5 pairs hold")
    assert [pair.outcome for pair in pairs.others] == ["holds"] * 4
    ours = "enhanced (static) Edge-SLAM: 30/100 = conventional Edge-SLAM: 30/100"
    assert pairs.values(ours=True).startswith(ours)
    assert "weakest of 5 pairs" in pairs.values(ours=True)
    printed = f"{PAPER_ENHANCED[3]:g} < conventional Edge-SLAM: {PAPER_CONVENTIONAL[3]:g} %"
    assert printed in pairs.values(ours=False)
    assert " → " in found["dynnet.O04"].values(ours=True)
    # A unit stands behind a number.
    alone = found["dynnet.O17"].values(ours=False)
    assert ": 0 % to ORB-SLAM2" in alone and alone.endswith(": not printed")
    # The number of runs of a table does not distinguish systems.
    assert not any("runs 100" in o.values(ours=False) for o in column.orderings)


@pytest.mark.parametrize("runs", [1, 2, 4])
def test_up_to_four_runs_decide_nothing(dynnetslam: Paper, runs: int) -> None:
    column = column_of(dynnetslam, table_2({"static": [runs] * 5}, runs))
    cells = [r for i, r in column.rows.items() if i.startswith("dynnet.T2.enhanced")]
    assert {r.verdict.outcome for r in cells} == {"inconclusive"}
    assert "too few, 5 are the least" in cells[0].verdict.why


def test_fitted_and_stand_in_numbers_are_never_reproduced(dynnetslam: Paper) -> None:
    exact = table_2({"static": PAPER_ENHANCED}, 100)
    assert outcome_of(column_of(dynnetslam, exact), "dynnet.T2.enhanced.rtt0") == "reproduced"
    stand_in = column_of(
        dynnetslam, table_2({"static": PAPER_ENHANCED}, 100, dataset="synthetic_fr3_path")
    )
    row = stand_in.rows["dynnet.T2.enhanced.rtt0"]
    assert (row.mark, row.provenance) == ("S", "stand_in")
    assert "synthetic_fr3_path" in row.why
    assert row.position is None
    runs = table_2({"static": PAPER_ENHANCED}, 100, device_mobile="pi")
    fit = DeviceFit("a_fit", ("dynnet.T2.enhanced.*",), frozenset(["pi"]))
    fitted = column_of(dynnetslam, runs, fits=[fit])
    row = fitted.rows["dynnet.T2.enhanced.rtt0"]
    assert (row.mark, row.provenance, row.position) == ("F", "fitted", None)
    assert row.why.startswith("set to match a published value; no evidence")
    assert row.hint == ""  # as printed
    other = column_of(dynnetslam, exact, fits=[fit])
    assert other.rows["dynnet.T2.enhanced.rtt0"].mark == "R"  # devices that were not fitted


@pytest.mark.parametrize(
    ("ours", "expected"),
    [
        (0.0, "fitted, yet 48 points below the printed value"),
        (48.0, ""),
        (60.0, ""),
        (99.0, "fitted, yet 51 points above the printed value"),
    ],
)
def test_a_fitted_share_that_is_far_from_the_printed_one_says_so(
    dynnetslam: Paper, ours: float, expected: str
) -> None:
    lost = [*PAPER_ENHANCED[:3], round(ours), PAPER_ENHANCED[4]]
    fit = DeviceFit("a_fit", ("dynnet.T2.enhanced.*",), frozenset(["pi"]))
    column = column_of(dynnetslam, table_2({"static": lost}, 100, device_mobile="pi"), fits=[fit])
    row = column.rows["dynnet.T2.enhanced.rtt60"]
    assert (row.mark, row.hint) == ("F", expected)
    assert (expected in row.why) and "no evidence" in row.why
    other = column_of(dynnetslam, table_2({"static": lost}, 100))
    assert other.rows["dynnet.T2.enhanced.rtt60"].hint == ""  # the verdict has the reason


def test_a_fitted_mean_that_is_far_from_the_printed_one_says_so() -> None:
    """Like the attempts of IJNC's Table 3: printed 55 ms, ours 4.73."""
    paper = read_papers(["multithread_rl"])[0]
    cell = cells_of(paper)["ijnc.T3.execution_time.dT_LR"]
    found = Found(None, None, "")

    def hint_of(*values: float) -> str:
        ours = Measured(found, np.array(values))
        return far_off(cell, ours, judge_mean(ours.mean, Mean(55.0), 0.15))

    assert hint_of(4.6, 4.7, 4.8, 4.7, 4.85) == "fitted, yet the printed value is 11.6 times ours"
    assert hint_of(638.0) == "fitted, yet 11.6 times the printed value"
    assert hint_of(77.0, 77.1, 76.9, 77.0, 77.0) == "fitted, yet 40 % above the printed value"
    assert hint_of(33.0) == "fitted, yet 40 % below the printed value"
    assert hint_of(55.0, 55.1, 54.9, 55.0, 55.0) == ""


SIX_OF_TWENTY = Measured(Found(None, None, ""), np.repeat([1.0, 0.0], [6, 14]), is_share=True)


@pytest.mark.parametrize("losses", [3, 6])
def test_the_time_of_losses_is_not_compared_with_their_share(
    dynnetslam: Paper, losses: int
) -> None:
    """C28: losses at 22 s, judged by the share of them in a window."""
    cell = cells_of(dynnetslam)["dynnet.C28"]
    row = Judged(cell, "fitted", judge_window(3, losses, 3 / 87), SIX_OF_TWENTY, "")
    assert (beside(row), row.hint) == (None, "")


def test_runs_with_a_loss_in_a_window_are_compared(dynnetslam: Paper) -> None:
    """C29: 0 of 100 runs; six of ours lose track, four of them in the window."""
    cell = cells_of(dynnetslam)["dynnet.C29"]
    verdict = judge_share(Share(4, 20), Share(0, 100))
    row = Judged(cell, "fitted", verdict, SIX_OF_TWENTY, "")
    assert beside(row) == Beside("points", 0.2)
    assert row.hint == "fitted, yet 20 points above the printed value"
    few = replace(row, verdict=judge_share(Share(1, 4), Share(0, 100)))
    assert (beside(few), few.hint) == (None, "")


def test_a_printed_number_of_runs_is_a_share_of_its_runs(dynnetslam: Paper) -> None:
    """C27 prints runs of 100; here they are of ten, then of an unknown number."""
    cell = replace(cells_of(dynnetslam)["dynnet.C27"], value=3.0, runs=10)
    row = Judged(cell, "fitted", Verdict("inconclusive", ""), SIX_OF_TWENTY, "")
    place = beside(row)
    assert place is not None and (place.words, row.hint) == ("as printed", "")
    unknown = replace(row, cell=replace(cell, runs=None))
    assert (beside(unknown), unknown.hint) == (None, "")


def test_a_difference_of_shares_is_compared_with_the_printed_difference(dynnetslam: Paper) -> None:
    """30 % and 10 % of ours, printed 10 points."""
    cell = cells_of(dynnetslam)["dynnet.C26"]
    assert cell.claim is not None
    quantity = Difference(kind="difference", of="one", base="other")
    claim = cell.claim.model_copy(update={"quantity": quantity})
    pair = pair_by_seed(np.repeat([1.0, 0.0], [2, 18]), SIX_OF_TWENTY.values)
    verdict = judge_difference(pair, 10.0, scale=100.0)
    row = Judged(replace(cell, value=10.0, claim=claim), "fitted", verdict, SIX_OF_TWENTY, "")
    place = beside(row)
    assert place is not None and place.words == "+10 points"
    assert row.hint == "fitted, yet 10 points above the printed value"


def test_runs_that_are_kept_without_events_are_no_missing_runs(
    dynnetslam: Paper, tmp_path: Path
) -> None:
    """Like runs of `slambed results pack`: Table 1 needs events."""
    rows = runs_of("edgeslam", "static", "none", 0, 20, engine="virtual")
    rows += runs_of("edgeslam", "conventional", "none", 0, 20, engine="virtual")
    column = column_of(dynnetslam, results_of(rows))
    row = column.rows["dynnet.T1.T_MU.enhanced"]
    assert (row.mark, row.missing) == ("E", "no_events")
    play = "slambed run made_up --engine virtual --runs 20 --force '*'"
    assert row.why == f"20 runs are there, without events; {play} makes them"
    found = {o.contrast.id: o for o in column.orderings}
    assert found["dynnet.O01"].kind == "no_events"
    assert found["dynnet.O01"].values(ours=True) == "run, events not kept"
    assert found["dynnet.O20"].kind == "not_run"
    # An existing log without such a delay is a different case.
    kept = tmp_path / "made_up" / "runs" / str(rows[0]["run_key"])
    kept.mkdir(parents=True)
    table = pa.table({"t_ns": [1], "type": ["frame_tracked"], "node": ["mobile"]})
    pq.write_table(table, kept / "events.parquet")
    results = results_of(rows)
    results.folder = tmp_path / "made_up"
    row = column_of(dynnetslam, results).rows["dynnet.T1.T_MU.enhanced"]
    assert (row.mark, row.missing) == ("N", "no_metric")
    assert column_of(dynnetslam).rows["dynnet.T1.T_MU.enhanced"].missing == "too_few_runs"


def test_kept_updates_are_enough_for_their_delays(dynnetslam: Paper, tmp_path: Path) -> None:
    """Like runs of `slambed results pack --events update_applied`."""
    rows = runs_of("edgeslam", "static", "none", 0, 20, engine="virtual")
    results = results_of(rows)
    results.folder = tmp_path / "made_up"
    whole = tmp_path / "events.parquet"
    for number, row in enumerate(rows):
        parts = {field: float(number) for field in (*PART_FIELDS.values(), "t_total_ms")}
        update = {"t_ns": [1], "type": ["update_applied"], "node": ["mobile"]}
        pq.write_table(pa.table(update | {name: [ms] for name, ms in parts.items()}), whole)
        kept = results.run_dir(str(row["run_key"]))
        kept.mkdir(parents=True)
        write_some_events(whole, ["update_applied"], kept / SOME_EVENTS)
    measured = column_of(dynnetslam, results).rows["dynnet.T1.T_MU.enhanced"]
    assert measured.ours.startswith("9.5 ±")


def test_live_and_virtual_are_two_columns(dynnetslam: Paper) -> None:
    check_engines_apart(dynnetslam)


def check_engines_apart(dynnetslam: Paper) -> None:
    live = runs_of("edgeslam", "static", "none", 0, 60)
    virtual = runs_of("edgeslam", "static", "none", 60, 60, engine="virtual")
    found = compare_paper(dynnetslam, pool_of([results_of(live + virtual)]))
    shares = {
        c.engine: c.rows["dynnet.T2.enhanced.rtt0"].measured.share.value for c in found.columns
    }
    assert shares == {"virtual": 1.0, "live": 0.0}
    assert all(sum(c.marks(list(c.rows)).values()) == len(found.cells) for c in found.columns)


def test_pooled_engines_are_noticed(dynnetslam: Paper, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Pool, "of_engine", lambda pool, engine: pool)
    with pytest.raises(AssertionError):
        check_engines_apart(dynnetslam)


def test_a_cell_and_its_claim_have_one_verdict(dynnetslam: Paper) -> None:
    column = column_of(dynnetslam, table_2({"static": PAPER_ENHANCED}, 100))
    again = [r for r in column.rows.values() if r.cell.comparability.duplicate_of in column.rows]
    assert len(again) >= 10
    for row in again:
        first = column.rows[str(row.cell.comparability.duplicate_of)]
        assert row.verdict == first.verdict
        assert row.mark == "P"  # and counted once


def test_survivors_and_thresholds(dynnetslam: Paper) -> None:
    """Table 4 averages runs without a loss, each at one threshold."""
    rows = []
    for limit, ate in ((30, 0.017), (40, 0.024)):
        params = {"params.l_ol_ms": limit, "params.b_ms": 10}
        rows += runs_of("dynnetslam", "wh_wosz", "sine", 2, 20, ate_rmse_m=ate, **params)
    for number, row in enumerate(rows):
        row["run_key"] = f"k{number}"
        row["ate_rmse_m"] = 9.0 if row["lost"] else row["ate_rmse_m"] * (1 + 0.01 * (number % 5))
    column = column_of(dynnetslam, results_of(rows))
    thirty = column.rows["dynnet.T4.dyn_wh_wosz.office_30"]
    assert thirty.measured.mean.count == 18
    assert (thirty.mark, thirty.verdict.assumed != ()) == ("R", True)
    assert column.rows["dynnet.T4.dyn_wh_wosz.office_40"].mark == "D"
    assert column.rows["dynnet.T4.dyn_wh_wosz.office_50"].missing == "too_few_runs"


@pytest.mark.parametrize("excluded", [False, True])
def test_other_readings_are_shown_and_open_ones_leave_a_number_undecided(
    dynnetslam: Paper, excluded: bool
) -> None:
    reading = OtherReading(key="coverage", note="with a pose", excluded=excluded)
    name = "track_loss_ratio"
    metric = dynnetslam.metrics[name].model_copy(update={"other_readings": [reading]})
    paper = dynnetslam.model_copy(update={"metrics": dynnetslam.metrics | {name: metric}})
    column = column_of(paper, table_2({"static": PAPER_ENHANCED}, 100, coverage=0.25))
    cell = "dynnet.T2.enhanced.rtt20"
    assert outcome_of(column, cell) == ("reproduced" if excluded else "inconclusive")
    assert column.rows[cell].ours == "2 (2/100)"
    assert "coverage (with a pose): 100 (100/100)" in column.rows[cell].why


def test_conditions_that_a_number_leaves_open_must_be_constant(dynnetslam: Paper) -> None:
    rows = runs_of("edgeslam", "static", "none", 0, 10, **{"params.n_orb": 750})
    other = runs_of("edgeslam", "static", "none", 10, 10, **{"params.n_orb": 1000})
    for row in other:
        row["run_key"] += "other"
    cell = column_of(dynnetslam, results_of(rows + other)).rows["dynnet.T2.enhanced.rtt0"]
    assert (cell.mark, cell.missing) == ("N", "no_metric")
    assert "params.n_orb (1000, 750)" in cell.why


def test_the_profile_does_not_matter_without_a_link(dynnetslam: Paper) -> None:
    rows = runs_of("orbslam2", "default", None, 117, 300)
    column = column_of(dynnetslam, results_of(rows))
    assert column.rows["dynnet.T3.orbslam2_mobile.office"].measured.share.runs == 300


def test_only_experiments_that_reproduce_a_table_count(dynnetslam: Paper) -> None:
    """A sensitivity study and text archives differ in ways that the table does not name."""
    own = runs_of("edgeslam", "static", "none", 0, 30)
    study = runs_of("edgeslam", "static", "none", 30, 30, engine="docker")
    text = runs_of("edgeslam", "static", "none", 30, 30, dataset=OFFICE) + own
    for row in text[:30]:
        row["params.codec"] = "compatibility"
        row["run_key"] += "text"
    column = column_of(
        dynnetslam,
        results_of(text, reproduces=("dynnet.T2",)),
        results_of(study, "study", reproduces=("dynnet.T1",)),
        results_of(study, "other", reproduces=()),
    )
    assert column.rows["dynnet.T2.enhanced.rtt0"].measured.share.runs == 30
    assert column.rows["dynnet.T2.enhanced.rtt0"].measured.share.bad == 0


@pytest.mark.parametrize(
    ("op", "value", "outcome"),
    [("set", [250, 300], "differs"), ("range", [250, 300], "differs"), ("range", [350, 450],
     "reproduced"), ("lt", 500, "reproduced"), ("gt", 500, "differs"), ("about", 390, "reproduced"),
     ("up_to", 94, "inconclusive")],
)  # fmt: skip
def test_operators(dynnetslam: Paper, op: str, value: object, outcome: str) -> None:
    """Our 400 was once 'at least 250 +- 300', and our 2 % 'up to 94 %': both 'the bound holds'."""
    claim = next(c for c in dynnetslam.claims if c.id == "dynnet.C19")
    changed = claim.model_copy(update={"op": op, "value": value, "duplicate_of": None})
    claims = [changed if c.id == claim.id else c for c in dynnetslam.claims]
    stated = dynnetslam.model_copy(update={"claims": claims})
    key = dynnetslam.metrics[claim.metric]
    ours = 400.0 / key.scale
    runs = runs_of("edgeslam", "static", "none", 0, 20, **{key.key: ours})
    for number, row in enumerate(runs):
        row[key.key] = ours * (1 + 0.02 * (number % 5 - 2))
    column = column_of(stated, results_of(runs))
    assert outcome_of(column, "dynnet.C19") == outcome


def test_the_tables_of_a_paper_as_text(dynnetslam: Paper) -> None:
    verdicts: PaperVerdicts = compare_paper(
        dynnetslam, pool_of([table_2({"static": PAPER_ENHANCED}, 100)])
    )
    table = comparison_table(verdicts, verdicts.columns[0], list(verdicts.cells))
    rows = {row[0]: row for row in table.rows}
    assert rows["dynnet.T2.enhanced.rtt60"][4:8] == ["48 %", "48 (48/100)", "reproduced",
                                                      "measured"]  # fmt: skip
    row: Judged = verdicts.columns[0].rows["dynnet.T2.conventional.rtt0"]
    assert (row.missing, row.ours) == ("too_few_runs", "-")


def test_fits_name_the_numbers_they_used(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(
        "fits: [dynnet.T1.T_MU.*]\n"
        "devices: {mobile: {device: pi}, edge: {device: desktop, given: true}}\n"
    )
    (tmp_path / "b.yaml").write_text("title: no numbers\n")
    found = read_fits(tmp_path)
    assert [(f.name, f.devices) for f in found] == [("a", frozenset(["pi"]))]
    assert found[0].has("dynnet.T1.T_MU.enhanced")
    assert not found[0].has("dynnet.T1.T_LM.enhanced")
    (tmp_path / "c.yaml").write_text("fits: [")
    with pytest.raises(SlambedError, match=r"not YAML: .*c\.yaml line 1"):
        read_fits(tmp_path)
    (tmp_path / "c.yaml").write_text("fits: [a]\ndevices: {mobile: {also: [b]}}\n")
    with pytest.raises(SlambedError, match=r"c\.yaml: devices: expected roles"):
        read_fits(tmp_path)


def test_peer_ratios() -> None:
    peer = read_papers(["peer_orbslam2"])[0]
    rng = np.random.default_rng(1)
    rows = runs_of("orbslam2", "default", None, 0, 5, experiment="peer_redkitchen")
    stand_in = peer_tables(peer, pool_of([results_of(rows)]))[0]
    (played,) = {row["dataset"] for row in rows}
    message = (
        f"{played} is played instead of redkitchen: numbers of the two cannot be compared. Ours"
    )
    assert stand_in.caption.startswith(message)
    assert {row[-1] for row in stand_in.rows} == {"not compared", "not run"}
    assert {tuple(row[5:7]) for row in stand_in.rows} == {("-", "-")}  # no ratio, no aim
    for row in rows:
        row["dataset"] = "redkitchen"
    for row in rows:
        row |= {"ate_rmse_m": 0.06 + 0.001 * rng.random(), "track_ms_median": 12 + rng.random()}
    tables = peer_tables(peer, pool_of([results_of(rows)]))
    assert len(tables) == 1 and "instead of" not in tables[0].caption
    cells = {row[0]: row for row in tables[0].rows}
    assert cells["ATE RMSE [cm]"][-1] == "met"
    assert cells["tracking, median [ms]"][-1] == "better"
    assert cells["mapping per keyframe, CPU [ms]"][-1] == "not run"


def test_an_experiment_shows_the_tables_it_reproduces(dynnetslam: Paper) -> None:
    rows = runs_of("edgeslam", "static", "none", 0, 30)
    results = results_of(rows, reproduces=("dynnet.T2", "dynnet.F9"))
    tables = {table.name: table for table in comparisons_for(results)}
    assert set(tables) == {"compare_dynnetslam_live", "orderings_dynnetslam_live"}
    shown = {row[0].rsplit(".", 2)[0] for row in tables["compare_dynnetslam_live"].rows}
    assert {"dynnet.T2"} <= shown
    words = "".join(cell for table in tables.values() for row in table.rows for cell in row)
    assert "same ordering" not in words


def test_experiments_of_a_paper_are_those_that_reproduce_it(
    dynnetslam: Paper, tmp_path: Path
) -> None:
    (tmp_path / "d_t2_rtt.yaml").write_text("id: d_t2_rtt\nreproduces: [dynnet.T2]\n")
    (tmp_path / "other.yaml").write_text("id: other\n")
    assert experiments_of([dynnetslam], tmp_path) == ["d_t2_rtt"]
    with pytest.raises(SlambedError, match="no experiment"):
        experiments_of(read_papers(["cloudslam"]), tmp_path)
