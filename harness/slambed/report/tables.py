# SPDX-License-Identifier: Apache-2.0
"""Tables that print as terminal (rich), CSV, Markdown or LaTeX."""

import csv
import io
from collections.abc import Callable
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path

from rich.console import RenderableType

from slambed.errors import SlambedError
from slambed.files.outputs import writing
from slambed.link.impairments import Side
from slambed.link.profile import parse_profile
from slambed.link.summary import impairments, outages, rtt_words
from slambed.metrics.metric import Metric
from slambed.metrics.statistics import Interval
from slambed.report.cells import Cell
from slambed.report.load import Results
from slambed.report.terminal_table import TerminalTable
from slambed.spec.board import NETWORK
from slambed.spec.device import VIRTUAL

LATEX_SPECIAL = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_",
    "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    # LaTeX's default font encoding has other characters in these three places.
    "<": r"\textless{}", ">": r"\textgreater{}", "|": r"\textbar{}",
}  # fmt: skip


@dataclass
class Table:
    """Text cells under headings; `name` is a file name, `caption` a sentence."""

    name: str
    caption: str
    headings: list[str]
    rows: list[list[str]] = field(default_factory=list)
    words: int = 1
    """Number of leading text columns; the others are numbers and right-aligned."""

    def csv(self) -> str:
        """Returns CSV with a heading line."""
        out = io.StringIO()
        csv.writer(out, lineterminator="\n").writerows([self.headings, *self.rows])
        return out.getvalue()

    def markdown(self) -> str:
        """Returns a GitHub table."""
        lines = [self.headings, ["---"] * self.words + ["---:"] * (len(self.headings) - self.words)]
        lines += self.rows
        return "\n".join("| " + " | ".join(_bar(c) for c in line) + " |" for line in lines) + "\n"

    def latex(self) -> str:
        """Returns a `tabular` with booktabs rules, ready for a paper."""
        columns = "l" * self.words + "r" * (len(self.headings) - self.words)
        body = [" & ".join(map(_latex, row)) + r" \\" for row in self.rows]
        return "\n".join(
            [
                f"% {self.caption}",
                r"\begin{tabular}{" + columns + "}",
                r"\toprule",
                " & ".join(map(_latex, self.headings)) + r" \\",
                r"\midrule",
                *body,
                r"\bottomrule",
                r"\end{tabular}",
                "",
            ]
        )

    def rich(self) -> RenderableType:
        """Returns the table for a terminal of any width."""
        return TerminalTable(self)


def check_format(path: Path) -> None:
    """Raises SlambedError for an unknown format; called before anything is computed."""
    if path.suffix not in (".csv", ".md"):
        raise SlambedError(f"unknown table format {path}; known: .csv, .md")


def write_table(table: Table, path: Path) -> None:
    """Writes a table to the path of --output in the format of its suffix."""
    with writing(path):
        path.write_text(table.markdown() if path.suffix == ".md" else table.csv())


def _bar(text: str) -> str:
    return text.replace("|", r"\|")


def _latex(text: str) -> str:
    return "".join(LATEX_SPECIAL.get(letter, letter) for letter in text)


def with_interval(metric: Metric, value: Interval | None) -> str:
    """Returns value and interval in the shown unit, or the range of too few runs."""
    if value is None:
        return "-"
    if value.count == 1:
        return metric.show(value.value)
    return f"{metric.show(value.value)} {around(metric.show, value)}"


def around(show: Callable[[float], str], value: Interval) -> str:
    """Returns `[low, high]` for an interval, `(least to largest)` for a range."""
    low, high = show(value.low), show(value.high)
    return f"({low} to {high})" if value.is_range else f"[{low}, {high}]"


def change_with_interval(metric: Metric, change: Interval) -> str:
    """Returns a change and its interval; infinite where a run of one side alone failed."""

    def show(value: float) -> str:
        return metric.show(value) if isfinite(value) else f"{value:g}"

    return f"{show(change.value)} {around(show, change)}"


def cell_tables(cells: list[Cell], metrics: list[Metric], per_table: int = 5) -> list[Table]:
    """Returns the estimates of every cell, a few metrics per table so that it fits a page."""
    tables: list[Table] = []
    datasets = list(dict.fromkeys(cell.dataset for cell in cells))
    one = len(datasets) == 1
    failing = any(cell.faults for cell in cells)
    mixed = any(cell.hosts for cell in cells)
    few = any(v.is_range and v.count > 1 for cell in cells for v in cell.values.values())
    for start in range(0, len(metrics), per_table):
        part = metrics[start : start + per_table]
        tables.append(
            Table(
                f"cells_{start // per_table + 1}",
                "Median (or share) of the valid runs [95 % interval]"
                + (" (range of fewer than 6 runs)" if few else "")
                + (f", {datasets[0]}" if one else ""),
                ["system", *([] if one else ["dataset"]), "link"]
                + [*(["faults [s]"] if failing else []), *(["hosts"] if mixed else []), "runs"]
                + [m.heading for m in part],
                [
                    [
                        cell.label,
                        *([] if one else [cell.dataset]),
                        cell.profile,
                        *([cell.faults or "-"] if failing else []),
                        *([cell.hosts or "-"] if mixed else []),
                        f"{cell.valid}/{cell.runs}",
                        *(with_interval(m, cell.values.get(m.key)) for m in part),
                    ]
                    for cell in cells
                ],
                words=2 + (not one) + failing + mixed,
            )
        )
    return tables


def asked_links(results: Results) -> Table:
    """Returns what the profile of each link asks for."""
    rows: list[list[str]] = []
    for name in dict.fromkeys(results.runs["profile"].dropna()):
        if (content := results.links.get(name)) is None:
            continue
        try:
            profile = parse_profile(content, name)
        except SlambedError:  # a trace that is not on this machine
            rows.append([name, *["-"] * 4])
            continue
        ways = [_of_side(side) for side in (profile.up, profile.down)]
        silence = "; ".join(outages(profile)) or "none"
        rows.append([name, rtt_words(profile), *ways, silence])
    headings = ["link", "RTT [ms]", "up", "down", "outages"]
    return Table("links", "The links, as asked", headings, rows, words=len(headings))


def _of_side(side: Side) -> str:
    """Returns rate, jitter and loss of one direction; the rate also where it has no limit."""
    unlimited = [] if side.rate is not None else ["rate unlimited"]
    return "; ".join([*unlimited, *impairments(side)])


def link_table(results: Results) -> Table:
    """Returns requested and measured round-trip time of every cell with a link."""
    rows: list[list[str]] = []
    runs = results.runs[results.runs["link_backend"].notna()]
    mixed = results.runs["host"].nunique(dropna=False) > 1
    keys = ["cell", "host"] if mixed else ["cell"]
    for names, part in runs.assign(host=runs["host"].fillna("-")).groupby(keys, sort=False):
        real = part[part["link_backend"] != VIRTUAL]
        good = int(real["rtt_error_ms_median"].notna().sum())
        proven = f"{good}/{len(real)}" if len(real) else "modeled"
        if len(part) and part["link_backend"].eq(NETWORK).all():
            proven = "nothing asked"
        numbers = [
            _range(part[key].dropna().tolist())
            for key in (
                "rtt_asked_ms_mean",
                "rtt_measured_ms_mean",
                "rtt_error_ms_median",
                "rtt_error_ms_p99",
            )
        ]
        backends = ", ".join(sorted(set(part["link_backend"])))
        rows.append([*map(str, names), backends, proven, *numbers])
    headings = [
        *keys, "backend", "runs proven", "RTT asked, mean [ms]", "RTT measured, mean [ms]",
        "error, median [ms]", "error, p99 [ms]",
    ]  # fmt: skip
    return Table("link", "The link: smallest to largest run", headings, rows, words=1 + len(keys))


def limits_table(results: Results) -> Table:
    """Returns requested and granted limits of each node, and how long it was throttled."""
    rows: list[list[str]] = []
    keys = ["node", "device", "asked", "granted"]
    if len(results.limits):
        if results.runs["host"].nunique(dropna=False) > 1:
            keys.insert(0, "host")
        limits = results.limits.assign(host=results.limits["host"].fillna("-"))
        for names, part in limits.groupby(keys, dropna=False):
            throttled = part["throttled_s"].dropna().tolist()
            row = [*map(str, names), str(len(part)), _range([float(v) for v in throttled])]
            rows.append(row)
    headings = [*keys, "runs", "throttled, whole run [s]"]
    return Table("limits", "Limits asked and granted", headings, rows, words=len(keys))


def _range(values: list[float]) -> str:
    if not values:
        return "-"
    low, high = min(values), max(values)
    return f"{low:.2f}" if f"{low:.2f}" == f"{high:.2f}" else f"{low:.2f} to {high:.2f}"
