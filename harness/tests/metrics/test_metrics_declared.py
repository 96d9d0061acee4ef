# SPDX-License-Identifier: Apache-2.0
"""Metrics declared in a system.yaml: computed from events; invalid declarations are refused."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from slambed.errors import SlambedError
from slambed.metrics import declared
from slambed.metrics.catalog import METRICS_VERSION, metric, metrics_of, own_of, version_for
from slambed.metrics.declared import own_digest, own_metrics, value_of
from slambed.metrics.events import EventLog
from slambed.metrics.metric import Use
from slambed.metrics.run_data import RunData
from slambed.records.kept_spec import KeptSpec
from slambed.spec.library import Library
from slambed.spec.system import OwnMetric


def event(t_s: float, name: str, node: str = "mobile", **fields: Any) -> dict[str, Any]:
    return {"t_ns": int(t_s * 1e9), "type": name, "node": node, **fields}


LOG = [
    event(0.0, "frame_tracked", state="ok"),
    event(1.0, "state_changed", **{"from": "start", "to": "OS"}),
    event(2.0, "queue", length=4, kind="up"),
    event(3.0, "queue", "edge", length=10, kind="up"),
    event(4.0, "state_changed", **{"from": "OS", "to": "MES"}),
    event(5.0, "queue", length=6, kind="down"),
    event(9.0, "state_changed", **{"from": "MES", "to": "OS"}),
    event(9.5, "idle", length=0.0),
    event(12.0, "frame_tracked", state="ok"),
    event(13.0, "state_changed", **{"from": "OS", "to": "MES"}),
]


def run_of(events: list[dict[str, Any]]) -> RunData:
    run = RunData(Path("nowhere"), KeptSpec())
    run.log = EventLog(events)
    return run


@pytest.mark.parametrize(
    ("declaration", "expected"),
    [
        ({"event": "state_changed", "take": "count"}, 4),
        ({"event": "state_changed", "take": "count", "unless": {"from": "start"}}, 3),
        ({"event": "state_changed", "take": "count", "where": {"to": ["OS", "SZ"]}}, 2),
        ({"event": "never", "take": "count"}, 0),
        # From 1 to 4 s and from 9 to 12 s, the last frame.
        ({"event": "state_changed", "take": "seconds", "where": {"to": "OS"}}, 6.0),
        # Entered after the last frame: no playback.
        ({"event": "state_changed", "take": "seconds", "where": {"to": "MES"}}, 5.0),
        ({"event": "never", "take": "seconds"}, None),
        ({"event": "queue", "take": "mean", "field": "length"}, 20 / 3),
        ({"event": "queue", "take": "sum", "field": "length", "node": "mobile"}, 10.0),
        ({"event": "queue", "take": "median", "field": "length", "where": {"kind": "up"}}, 7.0),
        ({"event": "queue", "take": "p95", "field": "length", "node": "edge"}, 10.0),
        ({"event": "queue", "take": "min", "field": "length"}, 4.0),
        ({"event": "queue", "take": "max", "field": "length"}, 10.0),
        ({"event": "queue", "take": "last", "field": "length"}, 6.0),
        ({"event": "queue", "take": "max", "field": "kind"}, None),
        ({"event": "queue", "take": "rate", "field": "length"}, 150.0),
        ({"event": "idle", "take": "rate", "field": "length"}, None),
    ],
)
def test_what_is_taken(declaration: dict[str, Any], expected: float | None) -> None:
    item = OwnMetric.model_validate({"doc": "x"} | declaration)
    assert value_of(item, run_of(LOG)) == pytest.approx(expected)


def test_nothing_is_counted_where_nothing_was_measured() -> None:
    item = OwnMetric.model_validate({"doc": "x", "event": "queue", "take": "count"})
    assert value_of(item, run_of([])) is None


@pytest.mark.parametrize(
    "declaration", [{"take": "count", "field": "length"}, {"take": "max"}, {"take": "most"}]
)
def test_a_declaration_that_makes_no_sense_is_refused(declaration: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="take"):
        OwnMetric.model_validate({"doc": "x", "event": "queue"} | declaration)


@pytest.fixture
def systems(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A checkout with systems written by the test."""
    library = Library(tmp_path)
    monkeypatch.setattr(declared, "Library", lambda: library)
    declared._system.cache_clear()
    yield tmp_path / "systems"
    declared._system.cache_clear()


def write_system(systems: Path, name: str, metrics: dict[str, Any]) -> None:
    content = {"name": name, "title": name, "roles": ["mobile"], "metrics": metrics}
    (systems / name).mkdir(parents=True)
    (systems / name / "system.yaml").write_text(yaml.safe_dump(content))


QUEUE = {"event": "queue", "take": "max", "field": "length", "doc": "longest queue"}


def test_a_system_brings_its_metrics_with_it(systems: Path) -> None:
    shown = {"label": "queue", "unit": "B", "shown": "KB", "scale": 0.001, "gated": True}
    write_system(systems, "fast", {"queue_b_max": QUEUE | shown | {"better": "lower"}})
    write_system(systems, "plain", {})
    own = own_of(["plain", "fast", "gone"])
    item = metric("queue_b_max", own)
    assert (item.heading, item.show(2500.0), item.better) == ("queue [KB]", "2.5", "lower")
    assert Use.GATED in item.use
    assert metrics_of("fast")[-1] == item
    assert metrics_of("plain") == metrics_of("gone")
    assert version_for("plain") == str(METRICS_VERSION)
    assert version_for("fast") == f"{METRICS_VERSION}+{own_digest('fast')}"


def test_the_version_follows_what_is_computed_and_not_its_words(systems: Path) -> None:
    for name, change in {"a": {}, "b": {"doc": "other"}, "c": {"take": "min"}}.items():
        write_system(systems, name, {"queue_b_max": QUEUE | change})
    assert own_digest("a") == own_digest("b") != own_digest("c")


def test_one_key_means_one_thing(systems: Path) -> None:
    write_system(systems, "first", {"queue_b_max": QUEUE})
    write_system(systems, "same", {"queue_b_max": QUEUE})
    write_system(systems, "other", {"queue_b_max": QUEUE | {"unit": "s"}})
    assert list(own_of(["first", "same"])) == ["queue_b_max"]
    with pytest.raises(SlambedError, match="'queue_b_max' of system other is something else"):
        own_of(["first", "other"])


def test_a_name_of_every_system_is_taken(systems: Path) -> None:
    write_system(systems, "greedy", {"ate_rmse_m": QUEUE})
    with pytest.raises(SlambedError, match="'ate_rmse_m' is a metric of every system"):
        own_metrics("greedy", frozenset({"ate_rmse_m"}))
