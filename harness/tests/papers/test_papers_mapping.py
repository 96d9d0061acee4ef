# SPDX-License-Identifier: Apache-2.0
"""Former mistakes of mappings, each of which gave a verdict about something else."""

from dataclasses import replace
from fnmatch import fnmatchcase

import pytest

from slambed.metrics.device_share import device_cores, share_of_device
from slambed.papers.margins import margin_of_cell
from slambed.papers.published import Paper, PublishedCell, cells_of, read_papers, table_cells
from slambed.records.kept_spec import KeptSpec
from slambed.records.manifest import Manifest
from slambed.spec.library import Library

OTHER_READINGS = {"rpe_trans_rmse", "rpe_rot_rmse", "cpu_mobile_mean"}


@pytest.fixture(scope="module")
def papers() -> dict[str, Paper]:
    return {paper.id: paper for paper in read_papers()}


@pytest.fixture(scope="module")
def cells(papers: dict[str, Paper]) -> dict[str, PublishedCell]:
    return {name: cell for paper in papers.values() for name, cell in cells_of(paper).items()}


def test_accuracy_is_that_of_the_runs_without_a_loss(papers: dict[str, Paper]) -> None:
    """Conventional Edge-SLAM loses 78 of 100 runs, so its 1.3 cm are from 22 runs, not 100."""
    cells = cells_of(papers["dynnetslam"])
    assert papers["dynnetslam"].metrics["ate_rmse"].only_without_loss
    assert cells["dynnet.T1.ate_rmse.conventional"].runs == 22
    losses = {n.removeprefix("dynnet.T3."): c for n, c in cells.items() if "dynnet.T3." in n}
    for name, lost in losses.items():
        assert lost.value is not None
        assert cells[f"dynnet.T4.{name}"].runs == 100 - lost.value


def test_the_spread_over_rounds_is_not_one_over_runs(cells: dict[str, PublishedCell]) -> None:
    assert cells["dynnet.T1.T_MU.conventional"].spread == 61.3
    assert cells["dynnet.T1.T_MU.conventional"].runs is None


@pytest.mark.parametrize("name", ["dynnetslam", "multithread_rl"])
def test_cpu_is_percent_of_four_cores(papers: dict[str, Paper], name: str) -> None:
    """54 % of one core is 13.5 % of the board, and so less than the printed 34.3 %."""
    assert papers[name].metrics["cpu_mobile_mean"].key == "mobile_cpu_device_percent"
    device = Library().device("raspberry_pi_4").model_dump()
    spec = KeptSpec.model_validate({"engine": "virtual", "device_mobile": device})
    assert share_of_device(54.0, device_cores(spec, Manifest(), "mobile")) == 13.5


def test_an_interruption_is_time_that_tracking_stood_still(papers: dict[str, Paper]) -> None:
    metric = papers["multithread_rl"].metrics["average_interruption"]
    assert metric.key == "update_pause_ms_mean"


def test_cloudslam_is_compared_with_a_reference_run_and_both_directions(
    papers: dict[str, Paper], cells: dict[str, PublishedCell]
) -> None:
    paper = papers["cloudslam"]
    # The error is relative to ORB-SLAM2's path in the prior map, over scored frames: the dataset's
    # reference.
    assert paper.metrics["rmse_vs_orbslam"].key == "reference_rmse_m"
    assert paper.metrics["avg_bandwidth"].key == "link_mbit_s"
    for name, strategy in (("C19", "period_s"), ("C20", "period_s"), ("C21", "distance_m"),
                           ("C22", "distance_m")):  # fmt: skip
        assert strategy in cells[f"cloudslam.{name}"].conditions, name


def test_the_two_maps_of_orbslam_are_distinguished(papers: dict[str, Paper]) -> None:
    systems = papers["cloudslam"].systems
    prior = {
        name: systems[name].match["params.prior_map"] for name in ("orbslam2", "orbslam2_prior")
    }
    assert fnmatchcase("", str(prior["orbslam2"]))
    assert not fnmatchcase("", str(prior["orbslam2_prior"]))
    assert fnmatchcase("map.slm", str(prior["orbslam2_prior"]))


def test_points_of_figures_have_the_unit_of_their_metric(cells: dict[str, PublishedCell]) -> None:
    """Figures print none, and an ordering over them says what our numbers are."""
    assert cells["ijnc.F7.orbslam2.fr2_pioneer_slam2"].unit == "MiB/min"
    assert cells["cloudslam.F11.periodic_rectangle_rate.1"].unit == "Mbit/s"
    assert cells["dynnet.F12.orbslam2.linear"].unit == "%"


def test_up_to_is_no_bound(cells: dict[str, PublishedCell]) -> None:
    for number in (13, 14, 15, 17, 18):
        claim = cells[f"ijnc.C{number}"].claim
        assert claim is not None
        assert claim.op == "up_to"
        assert claim.quantity is not None
        assert claim.quantity.kind == "max_over"


def test_every_run_over_wifi_names_the_network_and_the_codec(papers: dict[str, Paper]) -> None:
    paper = papers["multithread_rl"]
    for name, cell in table_cells(paper).items():
        if name.split(".")[1] in ("T4", "T5", "T6"):
            assert "network" in cell.conditions, name
    # The paper's messages are text archives; only ORB-SLAM2 sends none.
    for name in ("edgeslam_conventional", "multithread", "relocate", "multithread_rl"):
        assert paper.systems[name].match["params.codec"] == "compatibility", name


def test_what_cannot_be_decided_yet_has_two_readings(papers: dict[str, Paper]) -> None:
    metrics = papers["multithread_rl"].metrics
    still_open = {
        name for name, m in metrics.items() if any(not r.excluded for r in m.other_readings)
    }
    assert still_open == OTHER_READINGS


def test_frames_tried_while_lost_are_processed(papers: dict[str, Paper]) -> None:
    """Edge-SLAM covers 64.5 % of Pioneer2 while it is lost for 79 of 116 s."""
    metric = papers["multithread_rl"].metrics["coverage"]
    assert metric.key == "coverage_processed"
    assert [(r.key, r.excluded) for r in metric.other_readings] == [("coverage", True)]


def test_hand_held_is_no_robot_and_sequences_count_once(papers: dict[str, Paper]) -> None:
    tum = papers["edgeslam_semantic"].datasets["tum16"]
    names = {p.stem for p in (Library().root / "catalog" / "datasets").glob("fr*.yaml")}
    chosen = {name for name in names if any(fnmatchcase(name, p) for p in tum.match)}
    assert "fr1_desk" in chosen
    assert not any("pioneer" in name for name in chosen)
    assert tum.each_sequence_once
    metric = papers["edgeslam_semantic"].metrics["localization_error_mean"]
    assert (metric.key, metric.only) == ("ate_mean_m", {"ate_alignment": "sim3"})


def test_no_number_is_counted_twice(
    papers: dict[str, Paper], cells: dict[str, PublishedCell]
) -> None:
    """15 claims of DynNetSLAM once duplicated its tables, and settings were among the results."""
    twice = {name for name, cell in cells.items() if cell.comparability.duplicate_of}
    assert {f"dynnet.C{n}" for n in (*range(22, 25), *range(30, 38), *range(38, 42))} <= twice
    assert {"ijnc.C01", "ijnc.C08", "ijnc.C25", "ijnc.C26"} <= twice
    assert "dynnet.T1.track_loss_ratio.conventional" in twice
    settings = [n for n, cell in cells.items() if cell.comparability.parameter and ".T" in n]
    assert len(settings) == 45 + 8 + 6  # edgesem T1, cloudslam T2, the text of cloudslam T1a


def test_losses_in_the_turn_are_asked_as_a_share_of_the_losses(
    cells: dict[str, PublishedCell],
) -> None:
    for name, per in (("C21", "losses"), ("C28", "losses"), ("C29", "runs")):
        claim = cells[f"dynnet.{name}"].claim
        assert claim is not None
        assert claim.quantity is not None
        assert claim.quantity.kind == "window_share"
        assert (claim.quantity.from_s, claim.quantity.to_s, claim.quantity.per) == (22, 25, per)


def test_the_orderings_that_the_papers_state_are_declared(papers: dict[str, Paper]) -> None:
    count = {name: len(paper.contrasts) for name, paper in papers.items()}
    assert count == {"cloudslam": 17, "dynnetslam": 24, "edgeslam_semantic": 5,
                     "multithread_rl": 10, "peer_orbslam2": 0}  # fmt: skip
    for paper in papers.values():
        assert all(item.lines for item in paper.contrasts), paper.id


def test_a_margin_reads_counts_of_runs_as_shares(papers: dict[str, Paper]) -> None:
    """Ten of ten runs are 100 %, where a share can hardly move, not 10 %."""
    paper = papers["dynnetslam"]
    cells = cells_of(paper)
    lost = cells["dynnet.C27"]
    counted = replace(lost, value=10, runs=10)
    in_percent = replace(lost, value=100, runs=10, unit="%")
    assert margin_of_cell(paper, cells, counted, []) == margin_of_cell(paper, cells, in_percent, [])
