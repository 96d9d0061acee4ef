# SPDX-License-Identifier: Apache-2.0
"""What made the numbers of a report: engines and devices, in sentences."""

from collections.abc import Iterator

import pandas as pd

from slambed.report.compute_times import compute_times
from slambed.report.load import Results
from slambed.spec.device import VIRTUAL

ENGINES = {
    "docker": "containers under the limits of their device, in real time",
    "local": "processes under the limits of their device, in real time",
    VIRTUAL: "simulated time; computing time and link are models, not measurements",
}
NO_LIMITS = (
    "Virtual runs have no limits: the time of every stage comes from the model of its device."
)


def setup_lines(results: Results) -> list[str]:
    """Engines with how many runs each made, the devices of each node, and their compute times."""
    if not len(results.runs):
        return []
    lines: list[str] = []
    engines = results.runs["engine"].dropna().value_counts(sort=False)
    for engine, count in engines.items():
        name = str(engine)
        how_many = f", {count} runs" if len(engines) > 1 else ""
        lines.append(f"Engine {name}{how_many}: {ENGINES.get(name, 'not known here')}.")
    changes = {str(change["name"]): _change(change) for change in _changed(results.spec)}
    parts = []
    for node in ("mobile", "edge"):
        names = [str(name) for name in results.runs[f"device_{node}"].dropna().unique()]
        if names:
            told = (name + (f" ({changes[name]})" if name in changes else "") for name in names)
            parts.append(f"{node} {', '.join(told)}")
    lines += [f"Devices: {'; '.join(parts)}."] if parts else []
    return lines + [time.line() for time in compute_times(results)]


def _changed(spec: object) -> Iterator[dict[str, object]]:
    """Devices of the experiment that are those of a file with changes."""
    if isinstance(spec, dict):
        if isinstance(spec.get("device"), str) and isinstance(spec.get("name"), str):
            yield spec
        for value in spec.values():
            yield from _changed(value)
    elif isinstance(spec, list):
        for value in spec:
            yield from _changed(value)


def _change(change: dict[str, object]) -> str:
    """`what if: host with 1 core, 0.04 times its speed`."""
    parts = []
    if (cores := change.get("cores")) is not None:
        parts.append(f"{cores} core{'' if cores == 1 else 's'}")
    if (speed := change.get("speed")) is not None:
        parts.append(f"{speed:g} times its speed")
    return f"what if: {change['device']} with {', '.join(parts) or 'no change'}"


def is_virtual(runs: pd.DataFrame) -> bool:
    """None of these runs was made in real time."""
    return bool(len(runs)) and bool(runs["engine"].eq(VIRTUAL).all())
