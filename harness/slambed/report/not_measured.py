# SPDX-License-Identifier: Apache-2.0
"""Metrics that an experiment asks for and that no run has, with the reason."""

from dataclasses import fields

from slambed.metrics.metric import Metric
from slambed.metrics.run_data import Accuracy
from slambed.metrics.statistics import finite
from slambed.report.cells import metrics_asked
from slambed.report.kept_events import with_events
from slambed.report.load import Results
from slambed.report.metrics_versions import old_version
from slambed.report.setup import is_virtual

FROM_TRUTH = {field.name for field in fields(Accuracy)} | {"reloc_known_s"}
"""Keys of the metrics that need a ground truth."""


def not_measured(results: Results) -> list[str]:
    """Returns one line per reason, with the metrics that are in no table because of it."""
    found: dict[str, list[str]] = {}
    for item in _without_value(results):
        if not _is_left_to_live_runs(results, item):
            found.setdefault(_reason(results, item), []).append(item.key)
    return [f"{', '.join(keys)}: asked for, but {why}" for why, keys in found.items()]


def left_to_live_runs(results: Results) -> list[str]:
    """Returns a line about metrics that virtual runs cannot have, which is no fault of theirs."""
    keys = [i.key for i in _without_value(results) if _is_left_to_live_runs(results, i)]
    return [f"Only live runs measure {', '.join(keys)}."] if keys else []


def _without_value(results: Results) -> list[Metric]:
    """Returns the metrics asked for that no valid run has; none without valid runs."""
    runs, numbers = results.valid_runs, results.numbers()
    asked = map(results.metric, metrics_asked(results) if len(runs) else [])
    return [
        item
        for item in asked
        if item.is_number and not (item.key in numbers and len(finite(runs[item.key].to_numpy())))
    ]


def _is_left_to_live_runs(results: Results, item: Metric) -> bool:
    return item.live_only and item.key in results.numbers() and is_virtual(results.valid_runs)


def _reason(results: Results, item: Metric) -> str:
    runs = results.valid_runs
    if item.key not in results.numbers():
        return "no system of these runs reports it"
    counted, without = item.null_without
    if without and runs[counted].eq(0).all():
        return without
    if item.key in FROM_TRUTH and runs["groundtruth"].isna().all():
        return "no run has a ground truth"
    if old_version(runs) is not None and not len(with_events(results, runs)):
        return "the numbers are of an older version, and no run has events to compute it from"
    alone = "" if runs["device_edge"].notna().any() else ", and none has an edge"
    return f"no run has a value{alone} ({item.doc})"
