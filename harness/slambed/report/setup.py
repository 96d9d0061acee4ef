# SPDX-License-Identifier: Apache-2.0
"""Describes how a report's numbers were made: engines and devices, in sentences."""

from collections import Counter
from collections.abc import Iterator

import pandas as pd

from slambed.report.boards import board_lines
from slambed.report.compute_times import ComputeTime
from slambed.report.load import Results
from slambed.report.own_programs import program_lines
from slambed.spec.device import VIRTUAL
from slambed.spec.experiment import DEVICE_PACE

ENGINES = {
    "docker": "containers under the limits of their device, in real time",
    "local": "processes under the limits of their device, in real time",
    VIRTUAL: "simulated time; computing time and link are models, not measurements",
}
HOST = {"cores", "cpu_model"}
"""Facts of a manifest that say what a live run was made on."""
NO_LIMITS = (
    "Virtual runs have no limits: the time of every stage comes from the model of its device."
)


def setup_lines(results: Results, times: list[ComputeTime]) -> list[str]:
    """Returns engines with their numbers of runs, the devices of each node, and their compute
    times."""
    if not len(results.runs):
        return []
    lines: list[str] = []
    engines = results.runs["engine"].dropna().value_counts(sort=False)
    for engine, count in engines.items():
        name = str(engine)
        how_many = f", {count} runs" if len(engines) > 1 else ""
        lines.append(f"Engine {name}{how_many}: {ENGINES.get(name, 'not known here')}.")
    lines += _pace(results.runs)
    changes = {str(change["name"]): _change(change) for change in _changed(results.spec)}
    parts = []
    for node in ("mobile", "edge"):
        names = [str(name) for name in results.runs[f"device_{node}"].dropna().unique()]
        if names:
            words = (name + (f" ({changes[name]})" if name in changes else "") for name in names)
            parts.append(f"{node} {', '.join(words)}")
    lines += [f"Devices: {'; '.join(parts)}."] if parts else []
    lines += _hosts(results)
    lines += board_lines(results)
    lines += program_lines(results.runs)
    return lines + [time.line() for time in times]


def _hosts(results: Results) -> list[str]:
    """Returns a sentence about the processors of live runs, with the numbers of runs unless all
    were made on the same."""
    live = results.runs[~results.runs["engine"].eq(VIRTUAL)]
    known = [results.facts_of.get(str(key), {}) for key in live["run_key"]]
    counts = Counter(_host(facts) for facts in known if facts.keys() >= HOST)
    if not counts:
        return []
    whole = list(counts.values()) == [len(live)]
    parts = [host if whole else f"{host} ({_runs(count)})" for host, count in counts.items()]
    return [f"Host: {'; '.join(parts)}."]


def _host(facts: dict[str, str]) -> str:
    return f"{facts['cores']} core{'' if facts['cores'] == '1' else 's'} of {facts['cpu_model']}"


def _runs(count: int) -> str:
    return f"{count} run{'' if count == 1 else 's'}"


def _pace(runs: pd.DataFrame) -> list[str]:
    """Returns a sentence about live runs at their device's pace, and how well they kept it."""
    paced = runs[runs["pace"].eq(DEVICE_PACE)]
    if not len(paced):
        return []
    missed = pd.to_numeric(paced["pace_missed"], errors="coerce").sum()
    ratio = pd.to_numeric(paced["pace_ratio"], errors="coerce").median()
    took = f"; those of the mobile node took {ratio:.3f} times that (median)" if ratio > 0 else ""
    late = f"; the work of {missed:.0f} alone took longer (pace_missed)" if missed else ""
    return [
        f"Pace of the device, {len(paced)} runs: each stage took what the cost model of its device "
        f"charges{took}{late}."
    ]


def _changed(spec: object) -> Iterator[dict[str, object]]:
    """Yields devices of the experiment that change those of a file."""
    if isinstance(spec, dict):
        if isinstance(spec.get("device"), str) and isinstance(spec.get("name"), str):
            yield spec
        for value in spec.values():
            yield from _changed(value)
    elif isinstance(spec, list):
        for value in spec:
            yield from _changed(value)


def _change(change: dict[str, object]) -> str:
    """Returns text such as `what if: host with 1 core, 0.04 times its speed`."""
    parts = []
    if (cores := change.get("cores")) is not None:
        parts.append(f"{cores} core{'' if cores == 1 else 's'}")
    if (speed := change.get("speed")) is not None:
        parts.append(f"{speed:g} times its speed")
    if (background := change.get("background")) is not None:
        parts.append(f"{background:g} cores busy with other work")
    return f"what if: {change['device']} with {', '.join(parts) or 'no change'}"


def is_virtual(runs: pd.DataFrame) -> bool:
    return bool(len(runs)) and bool(runs["engine"].eq(VIRTUAL).all())
