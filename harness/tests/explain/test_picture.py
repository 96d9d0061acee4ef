# SPDX-License-Identifier: Apache-2.0
"""The rows of a timeline are those for which a run has something to draw."""

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import pandas as pd
import pyarrow as pa
import pytest

from slambed.explain.picture import Window, figure_of
from slambed.explain.run_log import RunLog
from slambed.metrics.event_columns import EVENT_COLUMNS, frame_of

FRAME = {"t_s": 5.0, "type": "frame_tracked", "node": "mobile", "state": "ok"}
EDGE_STAGE = {"t_s": 1.0, "type": "stage", "node": "edge", "worker": "map", "name": "bundle",
              "wall_ms": 9.0}  # fmt: skip
MESSAGE = {"t_s": 1.2, "type": "message", "node": "edge", "channel": "frame", "direction": "up",
           "queued_ns": 10**9, "received_ns": 12 * 10**8}  # fmt: skip
RTT_SAMPLE = {"t_s": 2.0, "type": "rtt_sample", "node": "mobile", "source": "echo", "rtt_ms": 30.0}
PROBED = pd.DataFrame({"t_s": [0.0, 4.0], "series": "probe_rtt_ms", "value": [20.0, 40.0]})
NOT_DRAWN = pd.DataFrame({"t_s": [0.0], "series": "applied_up_ms", "value": [10.0]})


@pytest.mark.parametrize(
    ("events", "of_run", "rows"),
    [
        ([], {}, []),
        ([], {"link": NOT_DRAWN}, []),
        ([], {"link": PROBED}, ["RTT [ms]"]),
        ([], {"outages_s": ((1.0, 2.0),)}, ["RTT [ms]"]),
        ([RTT_SAMPLE], {}, ["RTT [ms]"]),
        ([MESSAGE], {}, ["messages"]),
        ([MESSAGE], {"link": PROBED}, ["messages", "RTT [ms]"]),
        ([EDGE_STAGE], {}, ["messages", "edge", "RTT [ms]"]),
    ],
)
def test_rows(events: list[dict[str, Any]], of_run: dict[str, Any], rows: list[str]) -> None:
    table = frame_of([FRAME, *events], EVENT_COLUMNS | {"t_s": pa.float64()})
    run = RunLog(Path("run"), "run", table, **{"link": None, **of_run})
    figure = figure_of(run, Window(0.0, run.end_s))
    assert [axes.get_ylabel() for axes in figure.axes] == ["", "mobile", *rows]
    plt.close(figure)


def test_the_rtt_of_a_system_without_stages_has_its_curve_and_outages() -> None:
    table = frame_of([FRAME, MESSAGE], EVENT_COLUMNS | {"t_s": pa.float64()})
    run = RunLog(Path("run"), "run", table, PROBED, outages_s=((1.0, 2.0),))
    figure = figure_of(run, Window(0.0, run.end_s))
    messages, rtt = figure.axes[2:]
    assert len(messages.collections[0].get_segments()) == 1
    assert list(rtt.lines[0].get_ydata()) == [20.0, 40.0]
    assert "outage" in rtt.get_legend_handles_labels()[1]
    plt.close(figure)
