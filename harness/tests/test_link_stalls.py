# SPDX-License-Identifier: Apache-2.0
"""Links on which nothing moved are told in a report."""

import pandas as pd

from slambed.report.link_stalls import stalled_links


def test_cells_with_a_stalled_link_are_lines() -> None:
    runs = pd.DataFrame(
        {"cell": ["a", "a", "b", "c"], "link_stalls": [0, 2, 0, None], "lost": [False] * 4}
    )
    (line,) = stalled_links(runs)
    assert line.startswith("a: in 1 of 2 runs the link stalled, at most 2 times")
    assert stalled_links(runs.drop(columns="link_stalls")) == []
