# SPDX-License-Identifier: Apache-2.0
"""Cache sizes and pruning."""

import os
import time
from pathlib import Path

import pytest
from command_line import refused, slambed

from slambed.commands import cache as cache_cli
from slambed.data.places import MADE_AGAIN
from slambed.errors import ExitCode

DAY_S = 86400.0
MEGABYTE = 1_000_000


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache with a sequence unused for 40 days, one from today, features unused for 40 days, and
    a download."""
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path))
    for name, days in {
        "prepared/old-1/frames.bin": 40,
        "prepared/new-2/frames.bin": 0,
        "features/a.features": 40,
        "features/a.lock": 40,
        "recorded/.lock": 40,
        "data/tum/file": 400,
        "somebody's/file": 400,
    }.items():
        file = tmp_path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(bytes(MEGABYTE if "frames" in name else 0))
        for path in (file, file.parent):
            os.utime(path, 2 * (time.time() - days * DAY_S,))
    return tmp_path


def left(cache: Path) -> list[str]:
    return sorted(str(f.relative_to(cache)) for f in cache.rglob("*") if f.is_file())


def test_size_says_what_each_kind_takes(cache: Path) -> None:
    code, out, _ = slambed("cache", "size")
    assert code == ExitCode.OK
    lines = out.splitlines()
    assert lines[0].startswith("prepared (") and "2 items, 0.00 GB" in lines[0], lines
    assert "for up to 40 days" in lines[0] and lines[1].startswith("features (")
    assert lines[-1].startswith(f"{cache}: 3 items") and len(lines) == 3
    found = {item.path.name: item for item in cache_cli.items(cache)}
    assert found["old-1"].bytes >= MEGABYTE and found["a.features"].bytes == 0


def test_an_empty_cache_takes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path / "none"))
    assert "0 items" in slambed("cache", "size")[1]
    assert "would remove 0 items" in slambed("cache", "prune")[1]
    assert not (tmp_path / "none").exists()


def test_prune_frees_what_nobody_used_and_only_if_asked_to(cache: Path) -> None:
    before = left(cache)
    code, out, _ = slambed("cache", "prune")
    assert code == ExitCode.OK and "would remove 2 items" in out and left(cache) == before
    assert "prepared/old-1: 0.00 GB, unused for 40 days" in out and "new-2" not in out
    code, out, _ = slambed("cache", "prune", "--yes")
    assert code == ExitCode.OK and "removed 2 items" in out
    kept = ["data/tum/file", "features/a.lock", "prepared/new-2/frames.bin", "recorded/.lock"]
    assert left(cache) == sorted([*kept, "somebody's/file"])
    assert not (cache / "prepared" / "old-1").exists()


def test_prune_frees_one_kind_and_what_was_used_today_where_asked(cache: Path) -> None:
    slambed("cache", "prune", "--kind", "prepared", "--unused-days", "0", "--yes")
    assert not list((cache / "prepared").iterdir()) and (cache / "features/a.features").exists()
    assert "no kind 'data'" in refused(ExitCode.BAD_INPUT, "cache", "prune", "--kind", "data")


def test_python_packages_go_only_if_named(cache: Path) -> None:
    """They may come back in newer versions, which are part of run keys."""
    (cache / "python" / "a1").mkdir(parents=True)
    assert "python (Python packages of systems): 1 items" in slambed("cache", "size")[1]
    slambed("cache", "prune", "--unused-days", "0", "--yes")
    assert (cache / "python" / "a1").is_dir()
    slambed("cache", "prune", "--kind", "python", "--unused-days", "0", "--yes")
    assert not (cache / "python" / "a1").exists()


def test_a_sequence_that_was_read_today_is_in_use(cache: Path) -> None:
    frames = cache / "prepared" / "old-1" / "frames.bin"
    os.utime(frames, (time.time(), frames.stat().st_mtime))
    assert "old-1" not in slambed("cache", "prune")[1]


def test_a_link_goes_and_what_it_leads_to_stays(cache: Path, tmp_path: Path) -> None:
    (cache / "prepared" / "linked").symlink_to(cache / "somebody's")
    slambed("cache", "prune", "--unused-days", "0", "--yes")
    assert not (cache / "prepared" / "linked").is_symlink()
    assert (cache / "somebody's" / "file").is_file()


def test_everything_that_is_written_into_the_cache_has_a_name() -> None:
    """A folder missing here would stay root's after sudo and would never be freed."""
    import slambed.campaign.prepared_inputs as inputs
    import slambed.campaign.recordings as recordings
    import slambed.data.verified as verified
    import slambed.engines.board.leftovers as leftovers
    import slambed.segment.masks as masks
    import slambed.spec.host_speed as host_speed
    from slambed.data.places import OURS, PICTURES, cache_folder, download_folder, prepared_folder
    from slambed.engines.python_packages import find_environment
    from slambed.spec.runtime import PythonPackages

    folders = (inputs.inputs_folder(), prepared_folder(), download_folder())
    folders += (masks.mask_file("key").parent,)
    named = {path.relative_to(cache_folder()).as_posix() for path in folders}
    packages = find_environment(PythonPackages(requires=["numpy"]), Path())
    named.add(packages.folder.parent.name)
    named |= {
        PICTURES,
        leftovers.FOLDER,
        recordings.FOLDERS,
        verified.FOLDER,
        host_speed.FILE,
        "features",
        "networks",
    }
    kept = {"data", "networks", leftovers.FOLDER, host_speed.FILE}
    assert named <= set(OURS) and named - kept == set(MADE_AGAIN)
