# SPDX-License-Identifier: Apache-2.0
"""Cost models: fitted to measured stage times, and scaled to printed ones."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pydantic import ValidationError

from slambed.calibrate.fit import fit_stage, fit_stages
from slambed.calibrate.match import Fit, in_threads, scaled, solve
from slambed.calibrate.seen import Seen, look
from slambed.calibrate.targets import Component, Targets
from slambed.errors import SlambedError
from slambed.files.yaml_source import load_yaml, parse
from slambed.metrics.events import EventLog
from slambed.native import repository_root
from slambed.spec.device import StageCost
from slambed.spec.library import Library

FITS = repository_root() / "catalog" / "devices" / "fits"


def test_a_fit_finds_the_cost_that_made_the_times() -> None:
    random = np.random.default_rng(1)
    n1, n2 = random.uniform(100, 1000, 2000), random.uniform(0, 5000, 2000)
    jitter = np.exp(random.normal(0, 0.2, 2000))
    fit = fit_stage("track", n1, n2, (400 + 3 * n1 + 0.5 * n2) * jitter)
    assert fit.cost.b_us == pytest.approx(3, rel=0.1)
    assert fit.cost.c_us == pytest.approx(0.5, rel=0.1)
    assert fit.cost.jitter == pytest.approx(0.2, rel=0.1)
    assert abs(fit.mean_error_percent) < 0.1
    assert abs(fit.median_error_percent) < 3
    assert fit.p95_error_percent == pytest.approx(100 * (np.exp(1.96 * 0.2) - 1), rel=0.2)


def test_a_size_that_never_changes_is_a_fixed_time() -> None:
    n1 = np.linspace(100, 1000, 50)
    cost = fit_stage("extract", n1, np.full(50, 3.1), 400 + 3 * n1).cost
    assert (cost.a_us, cost.b_us, cost.c_us) == (pytest.approx(400, rel=0.01), 3, 0)


def test_a_stage_seen_a_few_times_is_not_fitted() -> None:
    rows = [("often", 10.0, 0.0, 1.0)] * 5 + [("rare", 10.0, 0.0, 1.0)] * 4
    table = pd.DataFrame(rows, columns=["name", "n1", "n2", "cpu_ms"])
    assert [fit.name for fit in fit_stages(table)] == ["often"]


def test_one_factor_meets_the_middle_of_two_conditions() -> None:
    alpha, beta = solve(np.array([1.0, 2.0]), np.ones(2), np.array([30.0, 30.0]), most=0.0)
    assert beta == 0
    # The solution minimizes the sum of (alpha * base / wanted - 1) squared.
    assert alpha == pytest.approx(30 * 3 / 5)


def test_a_fixed_time_meets_both_where_it_may() -> None:
    base, rate, wanted = np.array([1.0, 2.0]), np.array([1.0, 1.0]), np.array([20.0, 30.0])
    assert solve(base, rate, wanted, most=1.0) == pytest.approx((10.0, 10.0))
    # A stage that occurs in one of four frames has four times the fixed time.
    assert solve(base, rate / 4, wanted, most=1.0) == pytest.approx((10.0, 40.0))


def test_the_fixed_share_has_a_limit() -> None:
    base, rate, wanted = np.array([1.0, 2.0]), np.array([1.0, 1.0]), np.array([30.0, 30.0])
    alpha, beta = solve(base, rate, wanted, most=1.0)
    assert alpha == pytest.approx(0, abs=1e-5) and beta == pytest.approx(30)
    alpha, beta = solve(base, rate, wanted, most=0.5)
    assert beta * rate.mean() == pytest.approx(alpha * base.mean())
    spread = (alpha * base + beta * rate) / 30
    assert spread.min() > 0.8 and spread.max() < 1.2


def test_scaling_keeps_the_dependence_on_sizes() -> None:
    cost = StageCost(a_us=10, b_us=2, c_us=0.5, jitter=0.1)
    assert scaled(cost, 3, 0.2) == StageCost(a_us=30, b_us=6, c_us=1.5, jitter=0.2)
    assert scaled(cost, 3, 0.2, fixed_us=7) == StageCost(a_us=7, b_us=6, c_us=1.5, jitter=0.2)


def stage(name: str, t_ms: float, wall_ms: float, cpu_ms: float) -> dict[str, object]:
    return {
        "type": "stage", "node": "mobile", "worker": "tracking", "name": name,
        "t_ns": int(t_ms * 1e6), "wall_ms": wall_ms, "cpu_ms": cpu_ms,
    }  # fmt: skip


def test_a_component_is_seen_per_frame() -> None:
    done = {"type": "frame_tracked", "node": "mobile", "worker": None}
    events = [
        stage("track", 10, 8, 6),
        {**done, "t_ns": 10_000_000},
        stage("track", 30, 10, 6),
        stage("create_keyframe", 34, 4, 3),
        {**done, "t_ns": 34_000_000},
    ]
    component = Component(
        name="all",
        source="here",
        node="mobile",
        stages=["track", "create_keyframe"],
        fixed_on="create_keyframe",
        mean_ms={"x": 1.0},
    )
    seen = look(component, [EventLog(events, [])])
    assert (seen.mean, seen.busy, seen.fixed) == (11.0, 7.5, 0.5)
    assert seen.sd == pytest.approx(3.0)


def updates(*events: dict[str, object]) -> EventLog:
    common = {"node": "mobile", "worker": "tracking", "n2": 0}
    return EventLog([{**common, "t_ns": i, **event} for i, event in enumerate(events)], [])


def test_a_map_for_a_lost_frame_and_a_declined_update_are_no_update() -> None:
    """Their costs are neither in the mean nor scaled: their number depends on the costs themselves,
    and a fit that counted them did not converge."""
    insert = {"type": "stage", "name": "insert_keyframes", "wall_ms": 40.0, "cpu_ms": 40.0}
    log = updates(
        insert,
        {"type": "update_applied", "relocalization": False},
        {**insert, "wall_ms": 900.0, "cpu_ms": 900.0},
        {"type": "update_applied", "relocalization": True},
        {**insert, "wall_ms": 30.0, "cpu_ms": 30.0},
        {"type": "update_declined"},
        {**insert, "wall_ms": 60.0, "cpu_ms": 60.0},
        {"type": "update_applied", "relocalization": False},
    )
    component = Component(
        name="insert",
        source="here",
        node="mobile",
        stages=["insert_keyframes"],
        measure="per_update",
        mean_ms={"x": 1.0},
    )
    seen = look(component, [log])
    assert (seen.mean, seen.busy) == (50.0, 50.0)


def test_an_attempt_counts_when_it_got_as_far_as_a_pose() -> None:
    attempt = {"type": "stage", "name": "relocalize", "cpu_ms": 0.0}
    log = updates(
        {**attempt, "wall_ms": 10.0},
        {**attempt, "wall_ms": 50.0, "n2": 1},
        {**attempt, "wall_ms": 70.0, "n2": 2},
        {**attempt, "wall_ms": 11.0, "n2": 1, "node": "edge"},
    )
    for node, mean in (("mobile", 60.0), ("edge", 11.0)):
        component = Component(
            name="attempt",
            source="here",
            node=node,
            stages=["relocalize"],
            measure="per_attempt",
            mean_ms={"x": 1.0},
        )
        assert look(component, [log]).mean == mean


def test_a_mapped_keyframe_takes_what_its_stages_took_on_every_worker() -> None:
    log = updates(
        {"type": "stage", "node": "mobile", "name": "insert", "wall_ms": 3.0, "cpu_ms": 3.0},
        {"type": "stage", "node": "mobile", "name": "bundle", "wall_ms": 20.0, "cpu_ms": 20.0},
        {"type": "stage", "node": "mobile", "name": "track", "wall_ms": 90.0, "cpu_ms": 90.0},
        {"type": "keyframe_mapped", "node": "mobile"},
        {"type": "stage", "node": "mobile", "name": "insert", "wall_ms": 5.0, "cpu_ms": 5.0},
        {"type": "keyframe_mapped", "node": "mobile"},
    )
    component = Component(
        name="mapping",
        source="here",
        node="mobile",
        stages=["insert", "bundle"],
        measure="per_mapped_keyframe",
        mean_ms={"x": 1.0},
    )
    seen = look(component, [log])
    assert (seen.mean, seen.busy) == (14.0, 14.0)


def test_an_answer_takes_from_capture_until_its_pose_is_there() -> None:
    """It includes transport and waiting, but not other work of the edge."""
    log = updates(
        {"type": "stage", "node": "edge", "name": "track", "wall_ms": 30.0, "cpu_ms": 30.0},
        {"type": "frame_answered", "latency_ms": 200.0},
        {"type": "stage", "node": "edge", "name": "track", "wall_ms": 50.0, "cpu_ms": 50.0},
        {"type": "frame_answered", "latency_ms": 300.0},
    )
    component = Component(
        name="answer",
        source="here",
        node="edge",
        stages=["track"],
        measure="per_answer",
        mean_ms={"x": 1.0},
    )
    seen = look(component, [log])
    assert (seen.mean, seen.busy) == (250.0, 40.0)


def test_a_device_that_is_fitted_on_keeps_what_the_fit_is_not_about() -> None:
    """It keeps speed, accelerators and their stages; stages in `along` get the factor of their
    component."""
    source = load_yaml(FITS / "edgesem.yaml")
    fit = Fit(parse(Targets, source), source, Library())
    before = Library().device("edge_xeon_titan_v").model
    fit.scales["answer"].alpha = 2.0
    after = fit.model("edge")
    assert before is not None
    assert (after.speed, after.accelerators) == (before.speed, before.accelerators)
    for name, factor in (("segment", 1), ("decode_image", 1), ("bundle", 2), ("extract", 2)):
        old, new = before.stages[name], after.stages[name]
        assert (new.a_us, new.accelerator) == (
            pytest.approx(factor * old.a_us, rel=1e-3),
            old.accelerator,
        )


def test_other_machines_of_a_paper_get_the_stages_with_their_own_cores_and_speed() -> None:
    fit = Fit(
        parse(Targets, load_yaml(FITS / "cloudslam_table1.yaml")),
        load_yaml(FITS / "cloudslam_table1.yaml"),
        Library(),
    )
    fit.scales["mapping"].alpha = 3.0
    found = fit.models("mobile")
    one_core, vehicle = found["edge_i7_6700k_1_core"], found["vehicle_e5_2680v2"]
    before = Library().device("vehicle_e5_2680v2").model
    assert before is not None and before.stages["bundle"] != vehicle.stages["bundle"]
    # Features of the two images are extracted in two threads.
    halved = one_core.stages["extract"].b_us / 2
    assert vehicle.stages["extract"].b_us == pytest.approx(halved, rel=1e-3)
    assert vehicle.stages | {"extract": None} == one_core.stages | {"extract": None}
    assert (vehicle.cores, vehicle.speed) == (before.cores, before.speed)


def ijnc(**changes: object) -> Targets:
    return parse(Targets, load_yaml(FITS / "ijnc.yaml")).model_copy(update=changes)


def test_a_damped_fit_takes_a_part_of_each_step() -> None:
    """Starting at twice the target, a full step halves the factor; half a step divides it by
    sqrt(2)."""
    source = load_yaml(FITS / "ijnc.yaml")
    for damping, factor in ((0.0, 0.5), (0.5, 0.5**0.5)):
        fit = Fit(ijnc(damping=damping), source, Library())
        before = fit.scales["insert"].alpha
        fit.seen["insert", "serial"] = Seen(mean=830.8, sd=10.0, busy=830.8)
        fit.improve("insert")
        assert fit.scales["insert"].alpha == pytest.approx(before * factor)


def test_one_printed_mean_leaves_open_what_is_fixed() -> None:
    content = ijnc().model_dump()
    content["components"][1]["fixed_on"] = "track"
    with pytest.raises(ValidationError, match="pose: fixed_on needs two printed means"):
        Targets.model_validate(content)


def test_a_condition_is_played_on_its_own_sequence() -> None:
    content = ijnc().model_dump()
    content["conditions"]["lost"] = content["conditions"]["serial"]
    targets = Targets.model_validate(content | {"datasets": {"lost": "synthetic_pioneer2"}})
    assert targets.dataset_of("serial") == "synthetic_desk"
    assert targets.dataset_of("lost") == "synthetic_pioneer2"
    with pytest.raises(ValidationError, match="no condition found"):
        Targets.model_validate(content | {"datasets": {"found": "synthetic_desk"}})


@pytest.mark.parametrize("path", sorted(FITS.glob("*.yaml")), ids=lambda path: path.stem)
def test_the_fits_that_we_ship_are_whole(path: Path) -> None:
    source = load_yaml(path)
    targets = parse(Targets, source)
    library = Library()
    fit = Fit(targets, source, library)
    for role, fitted in targets.devices.items():
        if fitted.given:
            continue
        model, shipped = fit.model(role), library.device(fitted.device).model
        assert shipped is not None and shipped.cores == fitted.cores
        for name, other in list(fit.models(role).items())[1:]:
            ours = library.device(name).model
            assert ours is not None and (ours.cores, ours.speed) == (other.cores, other.speed)
            expected = in_threads(shipped.stages, fitted.threads, ours.cores)
            assert ours.stages.keys() == expected.keys()
            for stage, cost in expected.items():
                assert ours.stages[stage].model_dump() == pytest.approx(
                    cost.model_dump(), rel=1e-3
                ), f"{name} has not the {stage} of {fitted.device}"
        assert set(shipped.stages) >= set(model.stages)
        # A fit changes only its own stages, and not others such as those of the text codec.
        about = {name for c in targets.components if c.node == role for name in c.stages}
        others = set(model.stages) - about
        assert {name: model.stages[name] for name in others} == {
            name: shipped.stages[name] for name in others
        }


def test_a_device_that_is_another_at_its_own_speed_follows_its_fit() -> None:
    known, derived = (Library().device(name).model for name in ("edge_i7_6700t", "edge_m1_pro"))
    assert known is not None and derived is not None
    assert derived.stages == known.stages


def test_a_fit_with_a_stage_that_is_not_its_own_is_refused() -> None:
    with pytest.raises(ValidationError, match="fixed_on fuse is not among the stages"):
        Component(
            name="x", source="x", node="edge", stages=["bundle"], fixed_on="fuse", mean_ms={"c": 1}
        )


def test_threads_of_an_unknown_stage_are_refused() -> None:
    source = load_yaml(FITS / "cloudslam_table1.yaml")
    targets = parse(Targets, source)
    device = targets.devices["mobile"].model_copy(update={"threads": {"no_such_stage": 2}})
    with pytest.raises(SlambedError, match="threads: device edge_i7_6700k_1_core has no stage"):
        Fit(targets.model_copy(update={"devices": {"mobile": device}}), source, Library())


def test_a_component_on_a_stage_without_a_cost_is_refused() -> None:
    source = load_yaml(FITS / "ijnc.yaml")
    targets = ijnc()
    component = targets.components[0]
    named = component.model_copy(update={"stages": [*component.stages, "no_such_stage"]})
    changed = targets.model_copy(update={"components": [named, *targets.components[1:]]})
    with pytest.raises(SlambedError, match=f"component {component.name}: .* no_such_stage"):
        Fit(changed, source, Library())
