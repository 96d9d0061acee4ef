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
    runs, numbers = results.valid_runs, results.numbers()
    found: dict[str, list[str]] = {}
    for key in metrics_asked(results) if len(runs) else []:
        item = results.metric(key)
        if item.is_number and not (key in numbers and len(finite(runs[key].to_numpy()))):
            found.setdefault(_reason(results, item), []).append(key)
    return [f"{', '.join(keys)}: asked for, but {why}" for why, keys in found.items()]


def _reason(results: Results, item: Metric) -> str:
    runs = results.valid_runs
    if item.key not in results.numbers():
        return "no system of these runs reports it"
    counted, without = item.null_without
    if without and runs[counted].eq(0).all():
        return without
    if item.key in FROM_TRUTH and runs["groundtruth"].isna().all():
        return "no run has a ground truth"
    if item.live_only and is_virtual(runs):
        return "only live runs measure it"
    if old_version(runs) is not None and not len(with_events(results, runs)):
        return "the numbers are of an older version, and no run has events to compute it from"
    alone = "" if runs["device_edge"].notna().any() else ", and none has an edge"
    return f"no run has a value{alone} ({item.doc})"
