# SPDX-License-Identifier: Apache-2.0
"""What must hold for results and host after a campaign, whatever faults it had."""

import contextlib
import fcntl
import time
from collections import Counter
from pathlib import Path

import docker
import pandas as pd
import psutil
from chaos_daemon import DAEMON_ERRORS, Daemon
from chaos_faults import processes
from virtual_parts import fingerprints

from slambed.campaign.folder import ResultFolder
from slambed.campaign.ledger import Ledger
from slambed.campaign.store import LOCK, WORK
from slambed.engines.base import LABEL
from slambed.engines.cgroups import CgroupMaker
from slambed.files.json_file import read_object
from slambed.metrics.digest import digest

ALWAYS = ("manifest.json", "summary.json")
"""Files of every run."""
ENDS_WITHIN_S = 10.0
"""Time for a process to notice that its harness was killed."""


def problems_of_results(folder: ResultFolder) -> list[str]:
    """Lists missing, duplicate and truncated runs, and unexpected files."""
    planned = read_object(folder.path / "experiment.json") or {}
    keys = {str(run["run_key"]) for run in planned.get("runs", [])}
    found: list[str] = []
    there, shown = set(folder.store.keys()), set(folder.run_keys())
    if not keys:
        found.append("experiment.json names no run")
    found += [f"lost: {key}" for key in sorted(keys - there)]
    found += [f"not in the experiment's view: {key}" for key in sorted((keys & there) - shown)]
    found += [f"nobody asked for: {key}" for key in sorted((there | shown) - keys)]
    for key in sorted(there):
        found += [f"torn: {key}: {why}" for why in _torn(folder.store.runs / key)]
    finished = Counter(
        str(entry["run_key"])
        for entry in Ledger(folder.path / "ledger.jsonl").read()
        if entry["event"] == "run_finished" and entry.get("valid") is True
    )
    found += [f"double: {key} {count} times" for key, count in finished.items() if count > 1]
    for place in (folder.store.results / WORK, folder.path):
        left = [p.name for p in place.iterdir() if p.name != LOCK and p.name.startswith((".", "0"))]
        found += [f"left in {place.name}: {name}" for name in left if place.name == WORK]
        found += [f"left in {place.name}: {name}" for name in left if name.endswith(".partial")]
    work = [p.name for p in (folder.store.results / WORK).iterdir() if p.name != LOCK]
    found += [f"left in {WORK}: {name}" for name in work]
    table = folder.path / "summary.csv"
    reported = set(pd.read_csv(table)["run_key"]) if table.is_file() else set()
    if reported != keys or not (folder.path / "report" / "index.html").is_file():
        found.append(f"a report of {len(reported)} runs instead of {len(keys)}")
    return found


def _torn(place: Path) -> list[str]:
    """Lists the problems of a run's folder."""
    found = [f"no {name}" for name in ALWAYS if read_object(place / name) is None]
    if not found:
        reported = (read_object(place / "manifest.json") or {}).get("results_sha256")
        if reported != digest(place):
            found.append("its files are not what its manifest says")
        summary = read_object(place / "summary.json") or {}
        whole = summary.get("coverage") is not None and summary.get("outcome") == "completed"
        if summary.get("valid") is True and not whole:
            found.append(f"valid, but {summary.get('outcome')}: {summary.get('outcome_reason')}")
    return found


def problems_of_bytes(folder: ResultFolder, reference: dict[str, str]) -> list[str]:
    """Lists files that differ from those of an undisturbed campaign."""
    here = fingerprints(folder)
    names = sorted(here.keys() | reference.keys())
    return [f"other bytes: {name}" for name in names if here.get(name) != reference.get(name)]


def problems_of_host(
    token: str,
    locks: list[Path],
    pids: list[int],
    keys: list[str],
    empty: Path,
    daemon: Daemon | None = None,
) -> list[str]:
    """Lists leftover processes, locks, cgroups, containers and temporary files."""
    deadline = time.monotonic() + ENDS_WITHIN_S
    group = daemon.cgroup if daemon is not None else ""
    while (left := processes(token, group)) and time.monotonic() < deadline:
        time.sleep(0.05)
    found = []
    for process in left:
        with contextlib.suppress(psutil.Error):
            found.append(f"process left: {process.pid} {' '.join(process.cmdline())[:100]}")
    found += [f"lock held: {path}" for path in locks if _is_held(path, pids)]
    groups = [
        path.name for path in CgroupMaker().leftovers() if path.name[:-5].startswith(tuple(keys))
    ]
    found += [f"control group left: {name}" for name in groups if keys]
    found += [f"container left: {name}" for name in _containers(keys, daemon)]
    found += [f"temporary file left: {path.name}" for path in sorted(empty.iterdir())]
    return found


def _is_held(path: Path, pids: list[int]) -> bool:
    """Checks these holders only: the host lock may belong to another campaign by now."""
    if (read_object(path) or {}).get("pid") not in pids:
        return False
    with path.open("r+") as handle:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def _containers(keys: list[str], daemon: Daemon | None) -> list[str]:
    """Containers of these runs; with a separate daemon, all containers."""
    try:
        client = daemon.client if daemon is not None else docker.from_env(timeout=20)
        found = client.containers.list(all=True, filters={"label": LABEL})
    except DAEMON_ERRORS:
        return []
    return [str(c.name) for c in found if daemon is not None or c.labels.get(LABEL) in keys]
