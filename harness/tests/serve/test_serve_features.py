# SPDX-License-Identifier: Apache-2.0
"""Features and map on the page of a run, from a real virtual run."""

import http.client
import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from browser import Page
from command_line import slambed
from scipy.spatial import cKDTree
from virtual_parts import make_sequence, needs_programs, write_experiment
from waiting import in_background

from slambed.records.manifest import Manifest
from slambed.serve.features import BLOCK, FeatureFile, FeatureFiles
from slambed.serve.server import open_server
from slambed.serve.site import Site

pytestmark = needs_programs


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the cache and the results of two virtual runs, alone and offloaded."""
    root = tmp_path_factory.mktemp("features")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SLAMBED_CACHE", str(root / "cache"))
        (root / "cache" / "prepared").mkdir(parents=True)
        sequence = make_sequence(root / "cache" / "prepared" / "walk-1")
        experiment = write_experiment(root, sequence, runs=1)
        code, out, err = slambed("run", str(experiment), "--results", str(root / "results"))
        assert code == 0, out + err
    return root


@pytest.fixture
def place(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of it, whose cache is the one in use."""
    root = Path(shutil.copytree(made, tmp_path / "copy", symlinks=True))
    monkeypatch.setenv("SLAMBED_CACHE", str(root / "cache"))
    return root


@pytest.fixture
def address(place: Path) -> Iterator[str]:
    site = Site(place / "results")
    with open_server(site, 0) as server, in_background(lambda: server.serve_forever(0.02)):
        yield f"localhost:{server.server_port}"
        server.shutdown()


def ask(address: str, path: str) -> tuple[int, bytes]:
    connection = http.client.HTTPConnection(address, timeout=60)
    connection.request("GET", path)
    answer = connection.getresponse()
    found = answer.status, answer.read()
    connection.close()
    return found


def run_of(place: Path, label: str) -> Path:
    """Returns the folder of the run of a system."""
    runs = (place / "results" / "walk" / "runs").iterdir()
    (found,) = (
        run.resolve()
        for run in runs
        if json.loads((run / "manifest.json").read_text())["spec"]["label"] == label
    )
    return found


def data_of(address: str, run: Path) -> dict[str, Any]:
    status, body = ask(address, f"/experiments/walk/runs/{run.name}/data.json")
    assert status == 200
    found: dict[str, Any] = json.loads(body)
    return found


@pytest.mark.parametrize("label", ["alone", "offloaded"])
def test_a_frame_has_the_features_that_its_event_counts(
    place: Path, address: str, label: str
) -> None:
    run = run_of(place, label)
    assert data_of(address, run)["has_features"] is True
    events = pd.read_parquet(run / "events.parquet")
    tracked = events[(events["type"] == "frame_tracked") & (events["node"] == "mobile")]
    assert len(tracked) > 5
    for row in tracked.to_dict("records"):
        path = f"/experiments/walk/runs/{run.name}/features/{int(row['frame'])}.json"
        status, body = ask(address, path)
        features = json.loads(body)
        assert status == 200 and len(features["u"]) == json.loads(row["extra"])["features"] > 100
        assert min(features["u"]) >= 0 and max(features["u"]) < features["width"]
        assert min(features["v"]) >= 0 and max(features["v"]) < features["height"]
        assert len(features["near"]) == len(features["octave"]) == len(features["u"])
        assert any(features["near"])


def test_keyframes_see_the_same_points_from_different_places(place: Path, address: str) -> None:
    run = run_of(place, "alone")
    shown = data_of(address, run)["map"]
    events = pd.read_parquet(run / "events.parquet")
    created = events[(events["type"] == "keyframe_created") & (events["node"] == "mobile")]
    assert len(shown["t_s"]) == len(shown["ends"]) == len(shown["keyframes"]["x"]) == len(created)
    assert len(created) > 2 and shown["ends"] == sorted(shown["ends"])
    points = np.stack([shown["points"][axis] for axis in "xyz"], axis=1)
    assert len(points) == shown["ends"][-1] > 300
    before, after = points[: shown["ends"][0]], points[shown["ends"][0] : shown["ends"][1]]
    places = np.stack([shown["keyframes"][axis] for axis in "xyz"], axis=1)
    far_m = np.median(np.linalg.norm(before - places[0], axis=1))
    apart_m, _ = cKDTree(before).query(after)
    assert np.median(apart_m) < 0.03 * far_m


def test_without_a_cache_the_page_says_so(place: Path, address: str) -> None:
    run = run_of(place, "alone")
    shutil.rmtree(place / "cache" / "features")
    data = data_of(address, run)
    assert data["has_pictures"] is True and data["has_features"] is False
    assert data["map"]["keyframes"]["x"] and not data["map"]["points"]["x"]
    page = f"/experiments/walk/runs/{run.name}/"
    assert ask(address, f"{page}features/0.json")[0] == 404
    assert b"No features and no points: they come from the cache" in ask(address, page)[1]


def test_what_is_no_frame_or_damaged_is_not_found(place: Path, address: str) -> None:
    run = run_of(place, "alone")
    page = f"/experiments/walk/runs/{run.name}/"
    for name in ("40.json", "x.json", "-1.json", "0.txt", "9" * 30 + ".json"):
        assert ask(address, f"{page}features/{name}")[0] == 404, name
    manifest = Manifest.read(run / "manifest.json")
    assert manifest is not None
    opened = FeatureFiles().of(manifest)
    assert opened is not None and len(opened.offsets) == 41
    file = opened.path
    content = bytearray(file.read_bytes())
    content[int(opened.offsets[3]) + BLOCK.size] ^= 1
    file.write_bytes(content)
    assert ask(address, f"{page}features/2.json")[0] == 200
    assert ask(address, f"{page}features/3.json")[0] == 404
    for cut in (0, 10, 30, 200, int(opened.offsets[5])):
        file.write_bytes(content[:cut])
        found = FeatureFile.open(file)
        assert found is None or found.frame(6) is None
        assert ask(address, f"{page}features/6.json")[0] == 404
        assert ask(address, page)[0] == 200
    for offset in (2**64 - 1, 2**63 - 1, 2**40):
        wrong = content.replace(opened.offsets[7:8].tobytes(), np.uint64(offset).tobytes(), 1)
        file.write_bytes(wrong)
        found = FeatureFile.open(file)
        assert found is not None and found.frame(5) is not None
        assert found.frame(6) is None and found.frame(7) is None
    file.write_bytes(b"SLFC" + b"\xff" * 16)
    assert FeatureFile.open(file) is None


@pytest.mark.browser
def test_boxes_show_and_hide_features_and_map(page: Page, place: Path, address: str) -> None:
    run = run_of(place, "alone")
    page.open(
        f"http://{address}/experiments/walk/runs/{run.name}/",
        "document.getElementById('player').dataset.ready === 'yes'",
    )
    picture = "document.getElementById('features')"
    drawn = (
        f"(() => {{ const c = {picture}; const d = c.getContext('2d').getImageData(0, 0, c.width,"
        " c.height).data; let n = 0; for (let i = 3; i < d.length; i += 4) n += d[i] > 0;"
        " return n; })()"
    )
    indices = data_of(address, run)["frames"]["index"]
    for number in (0, 12):
        page.value(
            f"(() => {{ const s = document.getElementById('cursor'); s.value = {number};"
            " s.dispatchEvent(new Event('input')); })()"
        )
        page.until(f"{picture}.dataset.frame === '{indices[number]}'")
        assert page.value(f"{picture}.hidden") is False
        assert page.value(drawn) > 1000
    assert "keyframes, and" in page.text("#space-says")
    space = "document.getElementById('space').toDataURL()"
    with_map = page.value(space)
    for box in ("show-features", "show-map"):
        page.value(f"document.getElementById('{box}').focus()")
        page.key(" ")
    page.until(f"{picture}.hidden")
    assert page.value(space) != with_map and "keyframe" not in page.text("#space-says")
