# SPDX-License-Identifier: Apache-2.0
"""What `slambed check-system` reports about the metrics that a system declares."""

from collections.abc import Sequence

from slambed.metrics.declared import fits
from slambed.metrics.events import Event
from slambed.metrics.tracking import values_of
from slambed.spec.system import OwnMetric


def about_metric(item: OwnMetric, recorded: Sequence[Event], frames: int) -> str:
    """Reports whether the events of a metric occur. They are optional: a loss or a loop closure
    may not happen in so few frames, nor in every run."""
    events = [event for event in recorded if event["type"] == item.event]
    chosen = [event for event in events if fits(item, event)]
    if item.field and chosen and not len(values_of(chosen, item.field)):
        return f"event '{item.event}' comes, but none has a number '{item.field}'"
    if chosen:
        return f"event '{item.event}' comes, {len(chosen)} times"
    none = "0" if item.take == "count" else "empty"
    which = f"an event '{item.event}'" + (" with what it asks for" if events else "")
    return (
        f"optional, and there is none here: {which} did not come in these {frames} frames; in a "
        f"run without one the metric is {none}"
    )
