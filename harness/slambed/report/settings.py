# SPDX-License-Identifier: Apache-2.0
"""Settings in which compared systems differ, so that a report does not leave them to a README."""

from slambed.report.load import Results
from slambed.report.tables import Table

PREFIX = "params."


def settings_table(results: Results) -> Table:
    """Returns a row per parameter whose value differs between two systems."""
    runs = results.runs
    labels = [str(label) for label in dict.fromkeys(runs["label"])]
    table = Table(
        "settings",
        "Settings that differ between the compared systems (- where a system has no such setting)",
        ["setting", *labels],
        words=1 + len(labels),
    )
    for column in (name for name in runs if str(name).startswith(PREFIX)):
        values = {
            label: sorted({_word(v) for v in rows[column].dropna()})
            for label, rows in runs.groupby("label", sort=False)
        }
        cells = [" / ".join(values.get(label, [])) or "-" for label in labels]
        if len({word for word in cells if word != "-"}) > 1:
            table.rows.append([str(column).removeprefix(PREFIX), *cells])
    table.rows.sort()
    return table


def _word(value: object) -> str:
    if isinstance(value, float) and value.is_integer():
        return f"{value:.0f}"
    return str(value).lower() if isinstance(value, bool) else str(value)
