# SPDX-License-Identifier: Apache-2.0
"""Reports name stalled links."""

from types import SimpleNamespace
from typing import Any, cast

import pandas as pd
import pytest

from slambed.metrics.run_data import RunData
from slambed.metrics.values import link_stalls
from slambed.report.link_stalls import stalled_links


@pytest.mark.parametrize(
    ("events", "stalls"),
    [([], None), (["connected"], 0), (["connected", "stalled", "flowing", "stalled"], 2)],
)
def test_stalls_are_counted_where_channels_report_themselves(
    events: list[str], stalls: int | None
) -> None:
    links: list[dict[str, Any]] = [{"type": "link", "event": event} for event in events]
    log = SimpleNamespace(of=lambda kind: [link for link in links if link["type"] == kind])
    assert link_stalls(cast(RunData, SimpleNamespace(log=log))) == stalls


def test_cells_with_a_stalled_link_are_lines() -> None:
    runs = pd.DataFrame(
        {"cell": ["a", "a", "b", "c"], "link_stalls": [0, 2, 0, None], "lost": [False] * 4}
    )
    (line,) = stalled_links(runs)
    assert line.startswith("a: in 1 of 2 runs the link stalled, at most 2 times")
    assert not list(stalled_links(runs.drop(columns="link_stalls")))
