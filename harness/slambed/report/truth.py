# SPDX-License-Identifier: Apache-2.0
"""Compares virtual with live runs of the same cells: the error of the model."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from slambed.errors import SlambedError
from slambed.metrics.comparison import fisher
from slambed.metrics.stages import delays
from slambed.metrics.statistics import finite
from slambed.report.compute_times import CLOSE, compute_times
from slambed.report.kept_events import from_part, with_events
from slambed.report.load import Results
from slambed.report.tables import Table
from slambed.spec.device import VIRTUAL
from slambed.spec.experiment import DEVICE_PACE

Values = NDArray[np.float64]

CELL_KEYS = ["plain_label", "dataset", "profile"]
"""Columns that identify a cell in both; the link's backend may differ."""
TARGET_PERCENT = 15.0
"""Medians within this percentage count as the same (docs/explanation/virtual-time.md)."""
USUAL_ALPHA = 0.05
UPDATES = ("update_applied",)


@dataclass(frozen=True)
class Quantity:
    """A quantity with at most one value per run."""

    name: str
    unit: str
    of: Callable[[Results, pd.DataFrame], Values]


def _summary(key: str, factor: float = 1.0) -> Callable[[Results, pd.DataFrame], Values]:
    return lambda results, rows: finite(pd.to_numeric(rows[key], errors="coerce")) * factor


def _part(name: str) -> Callable[[Results, pd.DataFrame], Values]:
    """Returns a function for the median of a part of T_Total in each run."""

    def values(results: Results, rows: pd.DataFrame) -> Values:
        found = []
        for key in rows["run_key"]:
            log = results.events(key, UPDATES)
            delay = delays(log).get(name) if log is not None else None
            found.append(delay.median_ms if delay is not None else None)
        return finite(found)

    return values


OF_A_CORE, OF_THE_DEVICE = "% of a core", "% of the device"
"""Live runs at the device's pace are compared per device, because a core of the host differs from
one of the device."""
QUANTITIES = (
    Quantity("T_Total", "ms", _summary("update_delay_ms_median")),
    Quantity("T_MU", "ms", _part("T_MU")),
    Quantity("frames dropped", "", _summary("frames_dropped")),
    Quantity("keyframes in the map", "", _summary("keyframes")),
    Quantity("ATE RMSE", "cm", _summary("ate_rmse_m", 100)),
    Quantity("mobile CPU", OF_A_CORE, _summary("mobile_cpu_percent_mean")),
    Quantity("mobile CPU", OF_THE_DEVICE, _summary("mobile_cpu_device_percent")),
    Quantity("tracking", "ms", _summary("track_ms_median")),
)


def truth_table(live: Results, virtual: Results) -> Table:
    """Returns a row per cell and quantity. Raises SlambedError unless live and virtual runs share a
    cell."""
    for results, wanted in ((live, False), (virtual, True)):
        if not results.valid_runs["engine"].eq(VIRTUAL).eq(wanted).any():
            kind = "virtual" if wanted else "live"
            raise SlambedError(f"{results.folder} holds no {kind} run; make some first")
    ours, theirs = _cells(virtual, True), _cells(live, False)
    shared = [cell for cell in theirs if cell in ours]
    if not shared:
        raise SlambedError(f"{live.folder} and {virtual.folder} have no combination in common")
    table = Table(
        "truth",
        f"Virtual ({virtual.folder}) against live ({live.folder}), medians (least to most) of "
        f"runs; aim: within {TARGET_PERCENT:g} %"
        + _compute_times(live, virtual)
        + _without(live)
        + _without(virtual),
        ["cell", "quantity", "live", "virtual", "error", "error %", "within"],
        words=2,
    )
    for cell in shared:
        name = "/".join(part for part in cell if part)
        paced = theirs[cell]["pace"].eq(DEVICE_PACE).any()
        for quantity in QUANTITIES:
            if quantity.unit == (OF_A_CORE if paced else OF_THE_DEVICE):
                continue
            row = _row(quantity, quantity.of(live, theirs[cell]), quantity.of(virtual, ours[cell]))
            if row is not None:
                table.rows.append([name, *row])
        if (lost := _losses(theirs[cell], ours[cell])) is not None:
            table.rows.append([name, *lost])
    return table


def _compute_times(live: Results, virtual: Results) -> str:
    """Returns how far apart the compute times are, because all errors depend on these."""
    times = [time for time in compute_times(live) if not time.virtual]
    ran = {time.device: time.ran_ms for time in times}
    paced = {time.device for time in times if time.paced}
    lines = [
        f". {time.device} is {'two machines' if not 1 / CLOSE <= ratio <= CLOSE else 'one machine'}"
        f": extraction and tracking take {time.ran_ms:.1f} ms per frame virtually and "
        f"{ran[time.device]:.1f} ms live{' at its pace' if time.device in paced else ''} "
        f"({ratio:.1f} times)"
        for time in compute_times(virtual)
        if time.virtual and time.device in ran and (ratio := time.ran_ms / ran[time.device])
    ]
    return "".join(lines)


def _without(results: Results) -> str:
    """Returns from which runs T_MU is, if some have no events."""
    runs = results.valid_runs[results.valid_runs["device_edge"].notna()]
    part = from_part(with_events(results, runs, UPDATES), runs)
    return f". T_MU of {results.folder}: {part}" if part else ""


def _cells(results: Results, virtual: bool) -> dict[tuple[str, ...], pd.DataFrame]:
    runs = results.valid_runs
    runs = runs[runs["engine"].eq(VIRTUAL).eq(virtual)]
    if runs["pace"].nunique() > 1:
        raise SlambedError(
            f"{results.folder} holds live runs at two paces; play each into a folder of its own "
            "(--results)"
        )
    keys = runs[CELL_KEYS].astype(object).where(runs[CELL_KEYS].notna(), "")
    return {
        tuple(str(part) for part in cell): pd.DataFrame(runs.loc[rows.index])
        for cell, rows in keys.groupby(CELL_KEYS, sort=False)
    }


def _row(quantity: Quantity, live: Values, virtual: Values) -> list[str] | None:
    if not len(live) or not len(virtual):
        return None
    truth, model = float(np.median(live)), float(np.median(virtual))
    error = model - truth
    percent = 100 * error / truth if truth else (0.0 if not error else np.inf)
    return [
        f"{quantity.name} [{quantity.unit}]" if quantity.unit else quantity.name,
        _spread(live),
        _spread(virtual),
        f"{error:+.3g}",
        f"{percent:+.0f}",
        "yes" if abs(percent) <= TARGET_PERCENT else "no",
    ]


def _spread(values: Values) -> str:
    return f"{np.median(values):.3g} ({values.min():.3g} to {values.max():.3g})"


def _losses(live: pd.DataFrame, virtual: pd.DataFrame) -> list[str] | None:
    """Compares the runs whose losses were measured; None if one side has none."""
    a, b = (rows["lost"].dropna().eq(True) for rows in (live, virtual))
    if not len(a) or not len(b):
        return None
    lost_a, lost_b = int(a.sum()), int(b.sum())
    p_value = fisher(lost_a, len(a), lost_b, len(b))
    return [
        "runs with a track loss",
        f"{lost_a} of {len(a)}",
        f"{lost_b} of {len(b)}",
        f"p {p_value:.2f}",
        "",
        "yes" if p_value > USUAL_ALPHA else "no",
    ]
