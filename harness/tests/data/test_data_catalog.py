# SPDX-License-Identifier: Apache-2.0
"""Dataset files, the search path, and the cache of prepared sequences."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest
from command_line import slambed
from data_samples import one_line, tum_recipe, write_prepared, write_tum
from waiting import in_background

from slambed.data import places
from slambed.data.catalog import Catalog, in_reading_order, prepare
from slambed.data.recipe_file import load_recipe
from slambed.errors import ExitCode, SlambedError

CAMERA = "{{ width: 64, height: 48, fy: 50, cx: 31.5, cy: 23.5, bf: 4, {} }}"


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """A catalog folder, a data folder with one TUM sequence, and an empty cache."""
    tum_recipe(tmp_path / "datasets")
    write_tum(tmp_path / "data/tiny_tum")
    return tmp_path


def catalog(home: Path) -> Catalog:
    return Catalog.load(home / "datasets", [home / "data"])


def entries(home: Path) -> list[str]:
    """Returns the entries of the cache, without locks."""
    folder = places.prepared_folder(home / "cache")
    return sorted(p.name for p in folder.iterdir() if not p.name.endswith(".lock"))


def test_the_shipped_catalog_is_sound() -> None:
    shipped = Catalog.load(search=[])
    for name in ("redkitchen", "office", "desk", "fr1_xyz", "kitti_07", "euroc_v1_01"):
        dataset = shipped.get(name)
        assert dataset.title and dataset.license
        if dataset.download is not None:
            assert dataset.download.verified == (dataset.download.sha256 != "unverified here")
    for dataset in shipped.datasets.values():
        assert all(choice in shipped.datasets for choice in dataset.first_of)
        if dataset.reader == "tum" and dataset.sensor == "rgbd" and dataset.id.startswith("fr"):
            assert (dataset.depth_unit_m, dataset.camera and dataset.camera.bf) == (0.0002, 40)


def test_quickstart_takes_what_is_there(tmp_path: Path) -> None:
    assert Catalog.load(search=[]).resolve("quickstart", tmp_path).id == "synthetic_room"
    (tmp_path / "redkitchen").mkdir()
    assert Catalog.load(search=[tmp_path]).resolve("quickstart", tmp_path).id == "redkitchen"


@pytest.mark.parametrize(
    ("extra", "expected"),
    [
        ({"dpeth_unit_m": "1"}, "did you mean 'depth_unit_m'?"),
        ({"camera": "{ widht: 3 }"}, "did you mean 'width'?"),
        ({"camera": "{ f_x: 50, width: 1 }"}, "did you mean 'fx'?"),
        ({"depth_unit_m": "-1"}, "depth_unit_m"),
        ({"depth_unit_m": "0"}, "depth_unit_m is needed"),
        ({"synthetic": "{ seed: 1 }"}, "exactly one of"),
        ({"download": "{ url: x, sha256: abc }"}, "sha256"),
        ({"playback": "{ fsp: 3 }"}, "did you mean 'fps'?"),
        ({"title": "[1"}, "tiny_tum.yaml line"),
        ({"id": "other"}, "name the file other.yaml"),
        ({"aliases": "['']"}, "'aliases.0': expected a name of letters"),
        ({"aliases": "[a b]"}, "'aliases.0': expected a name of letters"),
        ({"aliases": "[a, a]"}, "'a' is given twice"),
        ({"camera": CAMERA.format("fx: 1.0e+9")}, "'camera.fx': is 1e+09, but fy 50"),
        ({"camera": CAMERA.format("fx: 4")}, "'camera.fx': is 4, but fy 50"),
        ({"camera": CAMERA.format("fx: 50, distortion: [1.0e+9, 0, 0, 0]")}, "of 1e+09"),
        ({"camera": CAMERA.format("fx: 50, distortion: [-5, 0, 0, 0, 0]")}, "change sides"),
        ({"camera": CAMERA.format("fx: 50, distortion: [0, 0, 0, 0, 0, -5, 0, 0]")}, "change si"),
        ({"12": "3"}, "'12': expected a name, not 12"),
        ({"on": "3"}, "a key is true (quote it)"),
    ],
)
def test_bad_dataset_files(tmp_path: Path, extra: dict[str, str], expected: str) -> None:
    file = tum_recipe(tmp_path, **extra)
    with pytest.raises(SlambedError) as error:
        load_recipe(file)
    assert str(file) in one_line(error)
    assert expected in one_line(error)


@pytest.mark.parametrize(
    "real",
    [
        "[0.231222, -0.784899, -0.003257, -0.000105, 0.917205]",  # fr2 of TUM
        "[-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]",  # EuRoC
        "[0.43, -2.65, 0.0007, -0.0003, 1.54, 0.31, -2.48, 1.47]",  # Azure Kinect
    ],
)
def test_real_lenses_are_taken(tmp_path: Path, real: str) -> None:
    camera = CAMERA.format(f"fx: 50, distortion: {real}")
    assert load_recipe(tum_recipe(tmp_path, camera=camera)).camera is not None


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ("blackout_start_s: 5, blackout_end_s: 1", "1 is not after blackout_start_s 5"),
        ("blackout_start_s: 5, blackout_end_s: 5", "5 is not after blackout_start_s 5"),
        ("blackout_start_s: 5", "without blackout_end_s the lens is never covered"),
        ("activity: walking", "'synthetic.activity': is of people"),
        ("activity: walking, people: 0", "'synthetic.activity': is of people"),
        ("people: 13", "'synthetic.people': input should be less than or equal to 12"),
        ("noise: 100", "'synthetic.noise': input should be less"),
        ("focal_error: -0.1", "'synthetic.focal_error': input should be greater"),
        ("seed: -1", "'synthetic.seed': input should be greater"),
        ("labels: 2", "'synthetic.labels': expected true or false, not 2"),
    ],
)
def test_bad_options_of_the_generator_have_their_line(
    tmp_path: Path, options: str, expected: str
) -> None:
    file = tmp_path / "gen.yaml"
    file.write_text(f"id: gen\ntitle: G\nsynthetic: {{ {options} }}\n")
    with pytest.raises(SlambedError) as error:
        load_recipe(file)
    assert expected in one_line(error) and f"{file} line 3" in one_line(error)


def test_unknown_key_has_its_line(tmp_path: Path) -> None:
    file = tum_recipe(tmp_path)
    file.write_text(file.read_text() + "playback:\n  fps: 10\n  strat_s: 1\n")
    with pytest.raises(SlambedError, match=r"tiny_tum\.yaml line 11; did you mean 'start_s'"):
        load_recipe(file)


def test_two_files_with_one_name(tmp_path: Path) -> None:
    tum_recipe(tmp_path, "one", aliases="[office]")
    tum_recipe(tmp_path, "two", aliases="[office]")
    broken = Catalog.load(tmp_path, [])
    assert broken.get("office").id == "one"
    with pytest.raises(SlambedError, match="'office' is already taken"):
        broken.get("two")


def test_a_broken_file_stops_only_who_asks_for_it(home: Path) -> None:
    (home / "datasets" / "torn.yaml").write_text("id: torn\ntitle: [\n")
    known = catalog(home)
    assert known.get("tiny_tum").id == "tiny_tum"
    with pytest.raises(SlambedError, match=r"torn\.yaml line"):
        known.resolve("torn")
    with pytest.raises(SlambedError, match=r"'tiny_tmu' is not known.*torn cannot be read"):
        known.get("tiny_tmu")


def test_unknown_dataset(home: Path) -> None:
    with pytest.raises(SlambedError) as error:
        catalog(home).prepare("tiny_tmu", home / "cache")
    assert "did you mean 'tiny_tum'" in one_line(error)


def test_missing_dataset_says_where_it_looked_and_where_to_get_it(home: Path) -> None:
    tum_recipe(home / "datasets", "gone", download="{ url: https://example.org/gone.tgz }")
    with pytest.raises(SlambedError) as error:
        catalog(home).prepare("gone", home / "cache")
    line = one_line(error)
    assert str(home / "data") in line and "https://example.org/gone.tgz" in line
    assert error.value.code == ExitCode.BAD_INPUT


def test_prepare_makes_once_and_reuses(home: Path) -> None:
    seen: list[tuple[int, int]] = []
    first = catalog(home).prepare("tiny_tum", home / "cache", lambda d, t: seen.append((d, t)))
    first.verify()
    assert seen[-1] == (5, 5)
    assert first.info.source["dataset"] == "tiny_tum"
    seen.clear()
    again = catalog(home).prepare("tiny_tum", home / "cache", lambda d, t: seen.append((d, t)))
    assert again.path == first.path and not seen


def test_a_changed_source_or_recipe_is_prepared_anew(home: Path) -> None:
    first = catalog(home).prepare("tiny_tum", home / "cache")
    (home / "data/tiny_tum/groundtruth.txt").write_text("1305031102.18 0 0 0 0 0 0 1\n")
    second = catalog(home).prepare("tiny_tum", home / "cache")
    assert second.path != first.path and second.checksum == first.checksum
    tum_recipe(home / "datasets", depth_unit_m="0.0003")
    assert catalog(home).prepare("tiny_tum", home / "cache").checksum != first.checksum


def test_a_prepared_sequence_outlives_its_source(home: Path) -> None:
    first = catalog(home).prepare("tiny_tum", home / "cache")
    told: list[str] = []
    assert catalog(home).prepare("tiny_tum", home / "cache", notify=told.append).path == first.path
    assert not told
    (home / "data/tiny_tum").rename(home / "elsewhere")
    assert catalog(home).prepare("tiny_tum", home / "cache", notify=told.append).path == first.path
    (note,) = told
    assert note == (
        f"note: dataset 'tiny_tum' not found: no tiny_tum in {home / 'data'}; the sequence "
        "prepared from it before is played"
    )


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ({"paths": "[tiny_tum/rgb.txt]"}, "rgb.txt is a file, but tum reads folders; name the"),
        ({"paths": "[dead]"}, "data/dead is a link to nothing"),
        ({"paths": "['dea*']"}, "data/dead is a link to nothing"),
        ({"paths": "[~nobody_x/x]"}, "not found: no ~nobody_x/x in"),
        ({"camera": "null"}, "brings no calibration; add camera: {width: ..., height: ..., fx"),
        ({"reader": "TUM"}, "did you mean 'tum'"),
    ],
)
def test_a_source_that_cannot_be_read_is_one_line(
    home: Path, keys: dict[str, str], expected: str
) -> None:
    (home / "data/dead").symlink_to("nowhere")
    tum_recipe(home / "datasets", **keys)
    with pytest.raises(SlambedError) as error:
        catalog(home).prepare("tiny_tum", home / "cache")
    assert expected in one_line(error) and error.value.code == ExitCode.BAD_INPUT


def test_a_damaged_cache_entry_is_made_again(home: Path) -> None:
    first = catalog(home).prepare("tiny_tum", home / "cache")
    (first.path / "index.bin").write_bytes(b"")
    assert catalog(home).prepared("tiny_tum", home / "cache") is None
    catalog(home).prepare("tiny_tum", home / "cache").verify()


def test_a_prepared_folder_on_the_search_path_is_used_as_it_is(home: Path) -> None:
    write_prepared(home / "data/given")
    tum_recipe(home / "datasets", "given")
    assert catalog(home).prepare("given", home / "cache").path == home / "data/given"
    assert prepare(str(home / "data/given")).info.id == "tiny"


@pytest.mark.parametrize("meters", [0.01, 0.09])
def test_wrong_depth_scale(home: Path, meters: float) -> None:
    tum_recipe(home / "datasets", "scaled")
    write_tum(home / "data/scaled", meters=meters)
    with pytest.raises(SlambedError) as error:
        catalog(home).prepare("scaled", home / "cache")
    assert "wrong depth scale" in one_line(error) and "depth_unit_m" in one_line(error)
    assert entries(home) == []


def test_an_interrupt_leaves_nothing_and_the_next_call_finishes(home: Path) -> None:
    def interrupt(done: int, _: int) -> None:
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        catalog(home).prepare("tiny_tum", home / "cache", interrupt)
    assert entries(home) == []
    # The next call removes leftovers of a killed process.
    leftover = places.prepared_folder(home / "cache") / ".tiny_tum-0123.partial-99999"
    leftover.mkdir()
    (leftover / "frames.bin").write_bytes(b"half")
    sequence = catalog(home).prepare("tiny_tum", home / "cache")
    sequence.verify()
    assert entries(home) == [sequence.path.name]


def test_two_at_once_prepare_only_once(home: Path) -> None:
    starts: list[int] = []
    both_in = threading.Barrier(2, timeout=30)

    def work() -> None:
        mine = catalog(home)
        both_in.wait()
        mine.prepare("tiny_tum", home / "cache", lambda d, _: starts.append(d) if d == 1 else None)

    with in_background(work):
        work()
    assert starts == [1]
    assert len(entries(home)) == 1


def test_an_absolute_path_is_where_it_says(home: Path) -> None:
    write_tum(home / "elsewhere/far_one")
    tum_recipe(home / "datasets", "far", paths=f"[{home}/elsewhere/far_*]")
    far = catalog(home).get("far")
    assert catalog(home).locate(far) == home / "elsewhere/far_one"
    assert Catalog.load(home / "datasets", []).available(far, home / "cache")
    tum_recipe(home / "datasets", "far", paths="[/nowhere/far_*, tiny_tum]")
    assert catalog(home).locate(catalog(home).get("far")) == home / "data/tiny_tum"


@pytest.mark.parametrize(
    ("pattern", "complaint"),
    [
        ("''", "names no file or folder"),
        ("/", "names no file or folder"),
        ("a**b", "is no pattern of a path"),
        ("scans/**.png", "is no pattern of a path"),
    ],
)
def test_what_is_no_pattern_is_reported_with_its_line(
    tmp_path: Path, pattern: str, complaint: str
) -> None:
    file = tum_recipe(tmp_path, paths=f"[{pattern}]")
    with pytest.raises(SlambedError) as error:
        load_recipe(file)
    assert (
        f"{file} line 4" in one_line(error)
        and "'paths'" in one_line(error)
        and complaint in one_line(error)
    )


def test_search_path_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SLAMBED_DATA", f"{tmp_path}/a:{tmp_path}/b:")
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path / "c"))
    path = places.search_path()
    assert path[:2] == [tmp_path / "a", tmp_path / "b"]
    assert path[-1] == tmp_path / "c/data"
    assert places.prepared_folder() == tmp_path / "c/prepared"


def test_the_home_of_nobody_is_a_folder_that_does_not_exist() -> None:
    own = {"SLAMBED_DATA": "~nobody_x/a", "SLAMBED_DATASETS": "~nobody_x/b"}
    code, out, err = slambed("data", "where", **own)
    assert code == ExitCode.OK, err
    assert "~nobody_x/a  (does not exist)" in out
    assert "~nobody_x/b  (dataset files, does not exist)" in out


def test_parts_of_a_recording_are_in_the_order_of_their_numbers(home: Path) -> None:
    """Numbered like ros2 bag and rosbag --split do."""
    for i in (0, 2, 10):
        (home / f"data/walk_{i}.mcap").write_bytes(b"")
    names = ["walk_0.mcap", "walk_2.mcap", "walk_10.mcap"]
    paths = [home / "data" / name for name in names]
    assert sorted((home / "data").glob("walk_*.mcap"), key=in_reading_order) == paths
