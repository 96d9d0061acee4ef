# SPDX-License-Identifier: Apache-2.0
"""What a system left instead of its files: links, folders, pipes, and paths that no error can be
computed of. Each makes the outcome `died`, with the reason."""

import stat
from dataclasses import replace
from pathlib import Path

import numpy as np

from slambed.data.trajectory import read_tum
from slambed.engines.result import RunResult
from slambed.errors import SlambedError
from slambed.files.remove import remove_entry
from slambed.metrics.accuracy import FARTHEST_ESTIMATE_M
from slambed.spec.runtime import PLAYERS_FILES

PATHS = ("trajectory.txt", "trajectory_live.txt")
ROLES = ("mobile", "edge")
_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFLNK: "a link",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
}


def must_be_a_file(path: Path) -> None:
    """Raises SlambedError for what is no file: reading a pipe may never end, and a link of a
    container leads elsewhere on this host. A missing file is left to the reader."""
    try:
        mode = path.lstat().st_mode
    except OSError:
        return
    if not stat.S_ISREG(mode):
        kind = _KINDS.get(stat.S_IFMT(mode), "a device")
        raise SlambedError(f"{path.name}: it is {kind}; write a file")


def judge_files(result: RunResult, raw: Path) -> RunResult:
    """Removes what nobody may read in place of the files of a node."""
    for role in ROLES:
        for name in sorted(PLAYERS_FILES):
            try:
                must_be_a_file(raw / role / name)
            except SlambedError as error:
                remove_entry(raw / role / name)
                result = _died(result, f"{role} node: {error}")
    return result


def judge_paths(result: RunResult, raw: Path) -> RunResult:
    """Removes paths that no error can be computed of: those of a system that diverged, and what
    is no trajectory. An empty path is one of a system that never tracked."""
    for name in PATHS:
        path = raw / "mobile" / name
        if not path.exists():
            continue
        try:
            _must_be_near(path)
        except SlambedError as error:
            path.unlink()
            # Only the name: the folder is gone when the user reads this.
            result = _died(result, f"mobile node: {str(error).replace(str(path), name)}")
    return result


def _must_be_near(path: Path) -> None:
    poses = read_tum(path)
    away_m = np.abs(poses.positions_m).max(axis=1, initial=0.0)
    far = np.flatnonzero(~(away_m < FARTHEST_ESTIMATE_M))
    if far.size:
        worst_m = float(away_m[far[0]])
        raise SlambedError(
            f"{path}: diverged: the pose at {poses.stamps_s[far[0]]:.6f} s is {worst_m:g} m away"
        )


def _died(result: RunResult, reason: str) -> RunResult:
    """A run that ended otherwise keeps its outcome and its reason."""
    if result.outcome != "completed":
        return result
    return replace(result, outcome="died", reason=reason)
