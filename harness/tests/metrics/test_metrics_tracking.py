# SPDX-License-Identifier: Apache-2.0
"""Track losses and relocalization times from frame events."""

import pytest

from slambed.metrics.events import EventLog
from slambed.metrics.tracking import tracking_of


def test_giving_up_a_young_map_is_a_loss() -> None:
    states = ["not_initialized", "ok", "ok", "not_initialized", "ok", "lost", "lost"]
    events = [
        {"t_ns": i, "type": "frame_tracked", "node": "mobile", "seq_s": float(i), "state": state}
        for i, state in enumerate(states)
    ]
    found = tracking_of(EventLog(events))
    assert found.loss_times_s == (3.0, 5.0)
    assert found.frames_tracked == 3


def frames_of(*rows: tuple[float, str, int]) -> EventLog:
    """Time, state and number of features of each frame."""
    return EventLog(
        [
            {"node": "mobile", "t_ns": int(s * 1e9), "type": "frame_tracked"}
            | {"seq_s": s, "state": state, "features": features}
            for s, state, features in rows
        ]
    )


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ([(0, "ok", 900), (1, "ok", 900)], None),
        # Covered from 1 to 3; sees again at 3 and is relocalized at 4.
        ([(0, "ok", 900), (1, "lost", 3), (2, "lost", 3), (3, "lost", 800), (4, "ok", 900)], 1.0),
        # Relocalized at once.
        ([(0, "ok", 900), (1, "lost", 3), (2, "ok", 900)], 0.0),
        # Lost with enough features: counts from the loss. The longer of two times counts.
        ([(0, "ok", 900), (1, "lost", 800), (3, "ok", 900), (4, "lost", 800), (5, "ok", 9)], 2.0),
        # Never relocalized: counts up to the end.
        ([(0, "ok", 900), (1, "lost", 0), (2, "lost", 900), (5, "lost", 900)], 3.0),
        # A new map is no relocalization.
        ([(0, "ok", 900), (1, "lost", 900), (2, "not_initialized", 900), (3, "ok", 900)], None),
        # Starts lost in a prior map.
        ([(0, "lost", 900), (1, "lost", 900), (2, "ok", 900)], 2.0),
        ([(0, "lost", 900), (2, "lost", 900)], 2.0),
    ],
)
def test_relocalization_counts_from_when_something_is_seen(
    rows: list[tuple[float, str, int]], expected: float | None
) -> None:
    assert tracking_of(frames_of(*rows)).reloc_s_max == expected
