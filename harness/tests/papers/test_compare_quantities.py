# SPDX-License-Identifier: Apache-2.0
"""Claims of the IJNC paper that are computed from several numbers of ours: C07 and C28."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from test_compare import column_of, outcome_of, results_of, runs_of

from slambed.papers.beside import beside
from slambed.papers.judged import Judge
from slambed.papers.lookup import Found, pool_of
from slambed.papers.measured import Measured
from slambed.papers.orderings import OrderingCase
from slambed.papers.published import Paper, cells_of, read_papers
from slambed.report.load import Results

SYSTEMS = {
    ("edgeslam", "conventional"),
    ("multithread_rl", "multithread"),
    ("multithread_rl", "relocate"),
    ("multithread_rl", "multithread_rl"),
}


@pytest.fixture(scope="module")
def paper() -> Paper:
    return read_papers(["multithread_rl"])[0]


def rows(system: str, variant: str, dataset: str, runs: int = 20, **more: Any) -> Any:
    text = {"params.codec": "compatibility", "dataset": dataset}
    return runs_of(system, variant, "ijnc_wifi", 0, runs, **text, **more)


def results(found: list[dict[str, Any]]) -> Results:
    return results_of(found, reproduces=("multithread_rl",))


def requests(edge_ms: float, local_ms: float = 55.0, runs: int = 20) -> list[dict[str, Any]]:
    """Returns runs of `relocate` on Pioneer2 whose failed requests take 47 ms of transport."""
    found = rows("multithread_rl", "relocate", "fr2_pioneer_slam2", runs)
    for i, run in enumerate(found):
        spread = 1 + 0.001 * (i - runs / 2)
        run["edge_attempt_ms_mean"] = edge_ms * spread
        run["transfer_fail_ms_mean"] = 47.0 * spread
        run["local_attempt_ms_mean"] = local_ms * spread
    return list(found)


def test_an_increase_adds_up_the_steps_of_an_attempt_that_fails(paper: Paper) -> None:
    as_printed = column_of(paper, results(requests(11.0)))
    assert as_printed.rows["ijnc.C07"].ours.startswith("5.455")  # 58 over 55
    assert outcome_of(as_printed, "ijnc.C07") == "reproduced"
    faster = column_of(paper, results(requests(4.0)))
    assert faster.rows["ijnc.C07"].ours.startswith("-7.273")
    assert outcome_of(faster, "ijnc.C07") == "differs"
    assert outcome_of(column_of(paper, results(requests(15.0))), "ijnc.C07") == "differs"
    assert (
        outcome_of(column_of(paper, results(requests(11.0, runs=4))), "ijnc.C07") == "inconclusive"
    )


TABLE_4 = {
    "fr2_desk_with_person": (0.869, 0.982),
    "fr2_pioneer_slam2": (0.645, 0.946),
    "fr2_pioneer_slam3": (0.867, 0.975),
}
"""Coverage of Edge-SLAM and of Multithread-RL."""


def test_points_of_coverage_are_no_percent_of_it(paper: Paper) -> None:
    """C14: `up to 30.1 percentage points`; our value is shown where the paper has its maximum."""
    found = []
    for dataset, covered in TABLE_4.items():
        for system, share in zip(
            (("edgeslam", "conventional"), ("multithread_rl", "multithread_rl")),
            covered,
            strict=True,
        ):
            found += rows(*system, dataset, coverage_processed=share)
    column = column_of(paper, results(found))
    assert outcome_of(column, "ijnc.C14") == "reproduced"
    assert column.rows["ijnc.C14"].ours.startswith("30.1 ")


def test_a_reduction_is_shown_as_one(paper: Paper) -> None:
    found = rows("edgeslam", "conventional", "fr2_pioneer_slam2", update_pause_ms_mean=1613.7)
    found += rows("multithread_rl", "relocate", "fr2_pioneer_slam2", update_pause_ms_mean=910.4)
    column = column_of(paper, results(found))
    assert column.rows["ijnc.C21"].ours.startswith("43.58 ")
    assert outcome_of(column, "ijnc.C21") == "reproduced"
    place = beside(column.rows["ijnc.C21"])
    assert place is not None and place.words == "what is left 1 x print"


def test_an_increase_needs_every_step(paper: Paper) -> None:
    without = [
        {k: v for k, v in run.items() if k != "transfer_fail_ms_mean"} for run in requests(11.0)
    ]
    assert column_of(paper, results(without)).rows["ijnc.C07"].mark == "N"


def desk(losing: str = "", leaving_out: str = "") -> Results:
    """Returns runs of all four systems on Desk; those of one system lose track once."""
    found = []
    for system, variant in sorted(SYSTEMS):
        if variant != leaving_out:
            losses = int(variant == losing)
            found += rows(system, variant, "fr2_desk_with_person", track_losses=losses)
    return results(found)


def test_a_number_said_of_all_is_reproduced_where_each_of_them_has_it(paper: Paper) -> None:
    found = column_of(paper, desk())
    assert outcome_of(found, "ijnc.C28") == "reproduced"
    assert found.rows["ijnc.C28"].ours == "0 ± 0 (n 20)"


@pytest.mark.parametrize("losing", sorted(variant for _, variant in SYSTEMS))
def test_one_of_them_is_enough_to_differ(paper: Paper, losing: str) -> None:
    found = column_of(paper, desk(losing))
    assert outcome_of(found, "ijnc.C28") == "differs"
    ids = {"conventional": "edgeslam_conventional"}
    assert ids.get(losing, losing) in found.rows["ijnc.C28"].verdict.why


def test_without_one_of_them_nothing_is_said(paper: Paper) -> None:
    found = column_of(paper, desk(leaving_out="relocate"))
    assert found.rows["ijnc.C28"].mark == "N"


def test_zeros_in_a_table_are_no_gaps(paper: Paper) -> None:
    """O05, with a printed 0 and runs of ours without a spread."""
    contrast = next(c for c in paper.contrasts if c.id == "ijnc.O05")
    cells = cells_of(paper)
    first = contrast.chains[0][0]
    cells[first] = replace(cells[first], value=0.0)
    same = Measured(Found(None, None, ""), np.full(5, 0.9))
    judge = Judge(paper, pool_of([]), cells, frozenset(), dict.fromkeys(cells, same))
    case = OrderingCase(judge, contrast)
    assert 0.0 in case.table(ours=False) and np.isfinite(case.table(ours=False)).all()
    assert 0 <= case.p_paper() <= 1
    spread, runs = case._spreads()
    assert not spread.any() and (runs == 5).all()
