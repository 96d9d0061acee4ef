# SPDX-License-Identifier: Apache-2.0
"""Which feature and image caches a virtual run uses, and which are removed."""

import os
from pathlib import Path
from typing import Any

import pytest
from harness_parts import run_spec

from slambed.engines.virtual import feature_file, feature_key, prune_features, sim_config
from slambed.spec.library import Library


def world(tmp_path: Path, **params: Any) -> dict[str, Any]:
    spec = run_spec(device_mobile=Library().device("host"), params=params)
    return sim_config(spec, 10, feature_file(tmp_path, spec)).as_json()


def test_a_system_that_sends_pictures_gets_a_cache_of_them_per_quality(tmp_path: Path) -> None:
    fine = world(tmp_path, n_orb=500, jpeg_quality=90)["image_cache"]
    coarse = world(tmp_path, n_orb=500, jpeg_quality=50)["image_cache"]
    assert fine["path"] != coarse["path"] and fine["key"] != coarse["key"]
    assert Path(fine["path"]).parent == tmp_path
    # The pictures do not depend on the number of features.
    assert world(tmp_path, n_orb=900, jpeg_quality=90)["image_cache"] == fine


def test_what_the_edge_extracts_hangs_on_the_quality(tmp_path: Path) -> None:
    keys = [feature_key(run_spec(params={"n_orb": 500, "jpeg_quality": q})) for q in (90, 50)]
    assert keys[0] != keys[1]


def test_other_systems_and_runs_without_caches_get_none(tmp_path: Path) -> None:
    assert "image_cache" not in world(tmp_path, n_orb=500)
    spec = run_spec(device_mobile=Library().device("host"), params={"jpeg_quality": 90})
    assert "image_cache" not in sim_config(spec, 10, None).as_json()


def test_the_longest_unused_caches_of_either_kind_go(tmp_path: Path) -> None:
    for age, name in enumerate(("new.features", "new.images", "old.images", "old.features")):
        (tmp_path / name).write_bytes(bytes(100))
        os.utime(tmp_path / name, (1e9 - age, 1e9 - age))
    prune_features(tmp_path, limit_bytes=250)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["new.features", "new.images"]


def test_a_lock_stays_for_those_who_wait_on_it(tmp_path: Path) -> None:
    for name in ("old.features", "old.lock"):
        (tmp_path / name).write_bytes(bytes(100))
    prune_features(tmp_path, limit_bytes=50)
    assert [path.name for path in tmp_path.iterdir()] == ["old.lock"]


def test_a_cache_that_another_campaign_removes_is_passed_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("gone.features", "large.features"):
        (tmp_path / name).write_bytes(bytes(100))
    is_file = Path.is_file

    def removed_then(path: Path) -> bool:
        found = is_file(path)
        if path.name == "gone.features":
            path.unlink(missing_ok=True)
        return found

    monkeypatch.setattr(Path, "is_file", removed_then)
    prune_features(tmp_path, limit_bytes=50)
    assert list(tmp_path.iterdir()) == []
