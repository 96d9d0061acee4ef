# SPDX-License-Identifier: Apache-2.0
"""Files of older versions are read with today's names."""

import json
import tarfile
from itertools import islice
from pathlib import Path

import pandas as pd
import pytest

from slambed import older_names
from slambed.campaign.campaign_state import state_of_ledger
from slambed.metrics.catalog import SUMMARY_KEYS
from slambed.metrics.summary import Summary
from slambed.native import repository_root
from slambed.older_names import keys_today, manifest_of_today, summary_of_today
from slambed.records.manifest import Manifest
from slambed.regression.gate import read_runs

ROOT = repository_root()
ARCHIVES = sorted(ROOT.glob("papers/*/runs.tar.xz"))
RUNS_READ = 20
OLD_SIDECAR = json.loads(Path(__file__).with_name("kept_manifest.json").read_text())["sidecar"]


def test_there_are_kept_archives() -> None:
    assert ARCHIVES


@pytest.mark.parametrize("archive", ARCHIVES, ids=lambda path: path.name)
def test_a_kept_archive_is_read_with_the_names_of_today(archive: Path, tmp_path: Path) -> None:
    runs = 0
    with tarfile.open(archive, "r:xz") as stream:
        wanted = (m for m in stream if m.name.endswith(("/summary.json", "/manifest.json")))
        for member in islice(wanted, 2 * RUNS_READ):
            content = stream.extractfile(member)
            assert content is not None
            path = tmp_path / Path(member.name).name
            path.write_bytes(content.read())
            if path.name == "summary.json":
                summary = Summary.read(path)
                assert summary is not None and summary.valid and summary.completed
                assert summary["invalid_reason"] is None
                assert not set(summary) & set(older_names.SUMMARY)
                runs += 1
            else:
                manifest = Manifest.read(path)
                assert manifest is not None and manifest.invalid_reasons == []
                assert manifest.kept.engine in ("virtual", "local")
                assert manifest.kept.is_virtual == (manifest.kept.engine == "virtual")
    assert runs == RUNS_READ


def test_a_key_of_today_counts_where_a_file_has_both() -> None:
    assert keys_today({"old": 1, "x": 2}, {"old": "new"}) == {"new": 1, "x": 2}
    assert keys_today({"new": 3, "old": 1}, {"old": "new"}) == {"new": 3}
    assert list(keys_today({"a": 1, "old": 2, "b": 3}, {"old": "new"})) == ["a", "new", "b"]


def test_no_name_of_today_is_an_older_one() -> None:
    for table in (older_names.SUMMARY, older_names.MANIFEST, older_names.LINK, older_names.LEDGER):
        assert not set(table) & set(table.values())
    assert set(older_names.SUMMARY.values()) <= set(SUMMARY_KEYS)
    assert set(older_names.MANIFEST.values()) <= set(Manifest.model_fields)


def test_a_summary_of_today_stays_as_it_is() -> None:
    summary = {"outcome": "died", "not_completed": True, "valid": True, "invalid_reason": None}
    assert summary_of_today(summary) == summary


@pytest.mark.parametrize(
    ("old", "outcome", "valid", "reason"),
    [
        ({"outcome": "completed", "valid": True}, "completed", True, None),
        (
            {"outcome": "invalid", "valid": False, "invalid_reason": "late"},
            "completed", False, "late",
        ),
        ({"outcome": "edge_died", "valid": False, "invalid_reason": "x"}, "died", True, None),
        (
            {"outcome": "died", "not_completed": True, "trusted": True, "distrust": None},
            "died", True, None,
        ),
        (
            {"outcome": "completed", "not_completed": False, "trusted": False, "distrust": "late"},
            "completed", False, "late",
        ),
    ],
)  # fmt: skip
def test_a_summary_of_any_version_says_whether_it_is_valid(
    old: dict[str, object], outcome: str, valid: bool, reason: str | None
) -> None:
    summary = summary_of_today(old)
    assert (summary["outcome"], summary["valid"]) == (outcome, valid)
    assert summary.get("invalid_reason") == reason
    assert not {"trusted", "distrust"} & set(summary)


def test_a_manifest_of_the_version_before_has_its_reasons_and_its_sidecar() -> None:
    old = {
        "outcome": "completed", "distrust": ["late"], "link": {"distrust": "RTT"},
        "beside": OLD_SIDECAR,
    }  # fmt: skip
    found = Manifest.model_validate_json(json.dumps(old))
    assert found.invalid_reasons == ["late"]
    assert found.link is not None and found.link.invalid_reason == "RTT"
    assert found.sidecar is not None and found.sidecar.samples == OLD_SIDECAR["samples"]
    assert manifest_of_today(manifest_of_today(old)) == manifest_of_today(old)


def test_a_ledger_of_the_version_before_counts_its_valid_runs() -> None:
    entries = [
        {"event": "campaign_started", "todo": ["a", "b"], "pid": 1},
        {"event": "run_finished", "run_key": "a", "trusted": True},
        {"event": "run_finished", "run_key": "b", "valid": True},
    ]
    for minute, entry in enumerate(entries):
        entry["time_utc"] = f"2026-01-01T00:0{minute}:00Z"
    found = state_of_ledger("x", entries, 0.0, lambda pid, since_s: False)
    assert found is not None and (found.valid, found.invalid) == (2, 0)


def test_a_history_of_the_version_before_has_the_columns_of_today(tmp_path: Path) -> None:
    old = pd.DataFrame(
        {"cell": ["c"], "not_completed": [False], "trusted": [True], "distrust": [None]}
    )
    old.to_csv(tmp_path / "summary.csv", index=False)
    table, problems = read_runs(tmp_path)
    assert list(table) == ["cell", "not_completed", "valid", "invalid_reason"] and not problems
    assert table["valid"].tolist() == [True]
