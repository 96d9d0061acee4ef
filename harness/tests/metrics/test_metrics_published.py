# SPDX-License-Identifier: Apache-2.0
"""Metrics that papers report: device share, all-pairs RPE, pauses, loss windows, total traffic
of the link, and the distance to a reference run."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from results_factory import RawRun, spec_of, write_raw
from scipy.spatial.transform import Rotation

from slambed.data.trajectory import Trajectory, read_tum
from slambed.errors import SlambedError
from slambed.metrics.accuracy import (
    RANDOM_PAIRS,
    absolute_error,
    pairs_of_any_distance,
    relative_error_over_all,
)
from slambed.metrics.device_share import device_cores
from slambed.metrics.loss_times import in_window, loss_times_of, loss_times_text
from slambed.metrics.reference_path import error_to_reference, reference_of
from slambed.metrics.run_summary import summarize_run
from slambed.records.kept_spec import KeptSpec
from slambed.records.manifest import Manifest
from slambed.sampling.record import GrantedLimits, NodeLimits

EDGE_SPEC = spec_of("edgeslam", "static", "ramp_85", 0)
CORES = 4


def straight(count: int = 50, offset_m: float = 0.0, growth_m: float = 0.0) -> Trajectory:
    """Along x at 10 Hz; `offset_m` to the side, growing by `growth_m` per pose."""
    stamps = np.arange(count) / 10
    positions = np.zeros((count, 3))
    positions[:, 0] = stamps
    positions[:, 1] = offset_m + growth_m * np.arange(count)
    return Trajectory(stamps, positions, np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)))


def test_cpu_is_reported_as_share_of_the_whole_device(tmp_path: Path) -> None:
    granted = {"limits": {"mobile": {"granted": {"quota_cores": 2.0}}}}
    found = summarize_run(write_raw(tmp_path / "raw", RawRun(manifest=granted)), EDGE_SPEC)
    assert found["mobile_cores"] == 2.0
    assert found["mobile_cpu_device_percent"] == found["mobile_cpu_percent_mean"] / 2


def test_the_cores_are_the_models_or_the_quota_granted() -> None:
    def granted(cores: float | None) -> Manifest:
        return Manifest(limits={"mobile": NodeLimits(granted=GrantedLimits(quota_cores=cores))})

    manifest, live = granted(1.5), KeptSpec(engine="docker", device_mobile="pi")
    model = {"name": "pi", "model": {"cores": CORES}}
    virtual = KeptSpec.of({"engine": "virtual", "device_mobile": model})
    assert device_cores(virtual, manifest, "mobile") == CORES
    assert device_cores(live, manifest, "mobile") == 1.5
    assert device_cores(live, Manifest(), "mobile") is None
    assert device_cores(KeptSpec(engine="local"), granted(None), "mobile") is None


def test_both_directions_of_the_link_count(tmp_path: Path) -> None:
    found = summarize_run(write_raw(tmp_path / "raw", RawRun()), EDGE_SPEC)
    bits = 8 * (found["bytes_up"] + found["bytes_down"])
    assert found["link_mbit_s"] == pytest.approx(bits / 1e6 / found["wall_s"])
    assert found["link_mbit_s"] > 8e-6 * found["bytes_up"] / found["wall_s"]
    alone = write_raw(tmp_path / "alone", RawRun(edge=False))
    assert summarize_run(alone, spec_of("orbslam2", "default", None, 0))["link_mbit_s"] is None


def test_the_pause_is_what_the_program_reports_and_nothing_else(tmp_path: Path) -> None:
    """t_mu_ms also includes the work of a parallel update during tracking."""
    raw = write_raw(tmp_path / "raw", RawRun())
    assert summarize_run(raw, EDGE_SPEC)["update_pause_ms_mean"] is None
    path = raw / "mobile" / "events.jsonl"
    pauses = iter(range(1, 1000))

    def reported(event: dict[str, Any]) -> dict[str, Any]:
        return event | ({"pause_ms": next(pauses)} if event["type"] == "update_applied" else {})

    lines = [json.dumps(reported(json.loads(line))) for line in path.read_text().splitlines()]
    path.write_text("\n".join(lines) + "\n")
    found = summarize_run(raw, EDGE_SPEC)
    assert found["update_pause_ms_mean"] == (1 + found["updates_applied"]) / 2


def test_losses_are_reported_with_their_times(tmp_path: Path) -> None:
    raw = write_raw(tmp_path / "raw", RawRun(lost_at_s=((5.0, 6.5), (9.0, 9.5))))
    found = summarize_run(raw, EDGE_SPEC)
    times = loss_times_of(found["loss_times_s"])
    assert times == pytest.approx([5.0, 9.0], abs=0.11)
    assert times[0] == pytest.approx(found["first_loss_s"], abs=1e-3)
    assert [in_window(times, *window) for window in ((4.5, 6), (0, 60), (6, 8))] == [1, 2, 0]
    assert found["lost_s"] == pytest.approx(2.0, abs=0.35)


@pytest.mark.parametrize("times", [[], [22.4], [0.033, 22.0, 31.067]])
def test_loss_times_come_back_from_their_text(times: list[float]) -> None:
    assert loss_times_of(loss_times_text(times)) == times


@pytest.mark.parametrize(("cell", "times"), [(float("nan"), []), (None, []), (22.4, [22.4])])
def test_loss_times_come_back_from_a_table(cell: object, times: list[float]) -> None:
    assert loss_times_of(cell) == times


def test_the_mean_stands_beside_the_rmse(tmp_path: Path) -> None:
    raw = write_raw(tmp_path / "raw", RawRun())
    found = summarize_run(raw, EDGE_SPEC)
    estimate, truth = read_tum(raw / "mobile" / "trajectory.txt"), read_tum(raw / "groundtruth.txt")
    assert found["ate_mean_m"] == absolute_error(estimate, truth).mean
    assert found["ate_mean_m"] < found["ate_rmse_m"]


def test_rpe_over_all_pairs_of_independent_errors_is_root_two_of_theirs() -> None:
    """Explains a published RPE / ATE near 1.4: it indicates all pairs, since the errors of two
    poses add up."""
    rng = np.random.default_rng(5)
    truth = straight(90)
    noisy = Trajectory(
        truth.stamps_s, truth.positions_m + rng.normal(0, 0.01, (90, 3)), truth.quaternions_xyzw
    )
    ate = absolute_error(noisy, truth).rmse
    rpe = relative_error_over_all(noisy, truth)
    assert rpe.translation_m.rmse / ate == pytest.approx(2**0.5, rel=0.05)
    assert rpe.translation_m.pairs == 90 * 90
    assert rpe.rotation_deg.rmse == pytest.approx(0.0, abs=1e-9)


def test_rpe_over_all_pairs_against_a_sum_written_out() -> None:
    truth, estimate = straight(12), straight(12, growth_m=0.01)
    turned = Rotation.from_rotvec(np.outer(np.linspace(0, 0.2, 12), [0, 0, 1])).as_quat()
    estimate = Trajectory(estimate.stamps_s, estimate.positions_m, turned)
    steps, turns = [], []
    own, true = estimate.rotations(), truth.rotations()
    for i in range(12):
        for j in range(12):
            p = own[i].inv().apply(estimate.positions_m[j] - estimate.positions_m[i])
            q = true[i].inv().apply(truth.positions_m[j] - truth.positions_m[i])
            steps.append(np.linalg.norm(p - q))
            turns.append(((true[i].inv() * true[j]).inv() * (own[i].inv() * own[j])).magnitude())
    found = relative_error_over_all(estimate, truth)
    assert found.translation_m.rmse == pytest.approx(np.sqrt(np.mean(np.square(steps))))
    assert found.rotation_deg.rmse == pytest.approx(np.degrees(np.sqrt(np.mean(np.square(turns)))))


def test_pairs_of_a_long_path_are_drawn_the_same_way_every_time() -> None:
    assert len(pairs_of_any_distance(99)) == 99 * 99
    first, second = pairs_of_any_distance(2000), pairs_of_any_distance(2000)
    assert len(first) == RANDOM_PAIRS
    assert np.array_equal(first, second)
    assert first.min() >= 0
    assert first.max() < 2000


def test_drift_against_a_reference_is_not_aligned_away() -> None:
    reference, aside = straight(), straight(offset_m=3.0)
    assert error_to_reference(aside, reference).rmse == pytest.approx(3.0)
    assert absolute_error(aside, reference).rmse == pytest.approx(0.0, abs=1e-9)
    drifting = error_to_reference(straight(growth_m=0.1), reference)
    assert drifting.rmse == pytest.approx(0.1 * np.sqrt(np.mean(np.arange(50) ** 2)))


def test_runs_of_different_times_have_no_distance() -> None:
    later = Trajectory(
        straight().stamps_s + 100, straight().positions_m, straight().quaternions_xyzw
    )
    with pytest.raises(SlambedError, match="no pose of the reference run"):
        error_to_reference(later, straight())


def test_the_reference_is_the_run_nearest_to_all_others() -> None:
    paths = {"a": straight(offset_m=9.0), "b": straight(offset_m=0.2), "c": straight(offset_m=0.1),
             "d": straight()}  # fmt: skip
    assert reference_of(paths) == "c"
    assert reference_of({"only": straight()}) == "only"
    assert reference_of({"y": straight(), "x": straight()}) == "x"
    with pytest.raises(SlambedError, match="no run of the reference system"):
        reference_of({})
