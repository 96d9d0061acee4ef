# SPDX-License-Identifier: Apache-2.0
"""Older names are read as today's: in stored campaigns, event logs and users' files."""

import json
import tarfile
from pathlib import Path

import pandas as pd
import pytest

from slambed import older_names
from slambed.data.recipe import Dataset
from slambed.metrics.collect import events_today, stored_log
from slambed.metrics.event_columns import EVENT_COLUMNS, table_of
from slambed.metrics.events import read_events
from slambed.metrics.summary import Summary
from slambed.native import repository_root
from slambed.older_names import FIELDS, METRICS, PARAMETERS, STAGES, event_today, keys_today
from slambed.records.manifest import Manifest
from slambed.spec.device import CostModel

KEPT = ("dynnetslam", "multithread_rl")

OLD = [
    {"t_ns": 1, "type": "initialised", "frame": 0},
    {"t_ns": 2, "type": "frame_tracked", "state": "not_initialised"},
    {"t_ns": 3, "type": "stage", "name": "serialise_text", "wall_ms": 1.5},
    {"t_ns": 4, "type": "update_begun", "relocalisation": True, "travelled_m": 2.5},
    {"t_ns": 5, "type": "relocalised", "by": "edge", "incarnation": 2},
]
TODAY = [
    {"t_ns": 1, "type": "initialized", "frame": 0},
    {"t_ns": 2, "type": "frame_tracked", "state": "not_initialized"},
    {"t_ns": 3, "type": "stage", "name": "serialize_text", "wall_ms": 1.5},
    {"t_ns": 4, "type": "update_begun", "relocalization": True, "traveled_m": 2.5},
    {"t_ns": 5, "type": "relocalized", "by": "edge", "session": 2},
]


@pytest.mark.parametrize("paper", KEPT)
def test_a_kept_campaign_is_read_in_the_words_of_today(paper: str, tmp_path: Path) -> None:
    with tarfile.open(repository_root() / f"papers/{paper}/runs.tar.xz") as archive:
        for member in archive:
            if member.name.endswith(("/summary.json", "/manifest.json")):
                archive.extract(member, tmp_path, filter="data")
                if len(list(tmp_path.rglob("*.json"))) == 8:
                    break
    summaries, manifests = (
        list(tmp_path.rglob(f"{name}.json")) for name in ("summary", "manifest")
    )
    assert summaries and manifests
    for path in summaries:
        summary = Summary.read(path)
        assert summary is not None
        assert "relocalizations" in summary and not METRICS.keys() & summary.keys()
    for path in manifests:
        manifest = Manifest.read(path)
        assert manifest is not None and manifest.kept.params is not None
        assert not PARAMETERS.keys() & manifest.kept.params.keys()
        old = json.loads(path.read_text())["spec"]["params"]
        assert [*manifest.kept.params.values()] == [*old.values()]


def test_an_event_log_is_read_in_the_words_of_today(tmp_path: Path) -> None:
    (tmp_path / "mobile").mkdir()
    log = "".join(json.dumps(event) + "\n" for event in OLD)
    (tmp_path / "mobile/events.jsonl").write_text(log)
    assert read_events(tmp_path).events == [{**event, "node": "mobile"} for event in TODAY]


def test_stored_events_are_read_in_the_words_of_today(tmp_path: Path) -> None:
    import pyarrow.parquet as pq

    before = {
        {"relocalization": "relocalisation", "session": "incarnation"}.get(name, name): kind
        for name, kind in EVENT_COLUMNS.items()
    }
    pq.write_table(table_of(OLD, before, [], extra=True), tmp_path / "events.parquet")
    assert stored_log(tmp_path / "events.parquet").events == TODAY
    found = stored_log(tmp_path / "events.parquet", ["relocalized", "initialized"]).events
    assert found == [TODAY[0], TODAY[4]]
    table = events_today(pd.DataFrame(pq.read_table(tmp_path / "events.parquet").to_pandas()))
    assert [*table["type"]] == [event["type"] for event in TODAY]
    assert {"relocalization", "session"} <= {*table} and "incarnation" not in table
    assert [*table["name"].dropna()] == ["serialize_text"]


def test_what_has_todays_words_is_left_alone() -> None:
    for event in TODAY:
        assert event_today(dict(event)) == event
    assert keys_today({"serialise": 1, "serialize": 2}, STAGES) == {"serialize": 2}


def test_devices_and_datasets_of_users_may_have_the_old_words() -> None:
    model = CostModel.model_validate({"cores": 4, "stages": {"relocalise": {"a_us": 1.0}}})
    assert [*model.stages] == ["relocalize"]
    given = {"id": "mine", "title": "Mine", "reader": "tum", "paths": ["mine"], "licence": "CC0"}
    assert Dataset.model_validate(given | {"depth_unit_m": 0.001}).license == "CC0"


def test_no_older_name_is_todays() -> None:
    """A correction of spelling in that file would make stored results unreadable."""
    tables = [table for name, table in vars(older_names).items() if name.isupper()]
    renaming = [t for t in tables if all(isinstance(today, str) for today in t.values())]
    assert FIELDS in renaming
    for table in renaming:
        assert not table.keys() & set(table.values())
