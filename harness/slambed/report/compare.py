# SPDX-License-Identifier: Apache-2.0
"""Paper | ours | interval | verdict, with the reason."""

from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

from slambed.metrics.comparison import fisher
from slambed.metrics.statistics import Interval, wilson
from slambed.report.lookup import Pool, find_runs, matching, our_value
from slambed.report.papers import Paper, PaperMetric, PublishedTable
from slambed.report.tables import Table

Verdict = Literal["reproduced", "same ordering", "close", "differs", "not run"]

FEWEST_RUNS = 5
"""Fewer runs cannot reproduce anything: their interval holds almost every value."""
WIDEST_SHARE = 40.0
"""A share whose 95 % interval is wider than this many points confirms nothing."""
WIDEST_MEAN = 0.35
"""A mean whose interval is wider than this part of the published value confirms nothing."""
CLOSE = 0.10
"""Within this part of the published value two means are called the same."""
SAME_P = 0.05
"""Shares are called the same while Fisher's exact test does not tell them apart at this level."""
SHARE_UNIT = "%"


@dataclass(frozen=True)
class Comparison:
    """One published number beside ours (paper's unit)."""

    source: str
    row: str
    column: str
    metric: str
    unit: str
    published: float
    spread: float | None
    ours: Interval | None
    verdict: Verdict
    reason: str
    engine: str
    coordinates: dict[str, Any]
    stand_in: bool = False
    published_runs: int | None = None


def compare_paper(paper: Paper, pool: Pool) -> list[Comparison]:
    """Every numeric table cell and every stated result of a paper, per kind of engine."""
    found: list[Comparison] = []
    for engine in pool.engines() or ["live"]:
        for table in paper.tables:
            found += _table(paper, table, pool.about(paper, table.id).of_engine(engine), engine)
        found += _claims(paper, pool, engine)
    return found


def _table(paper: Paper, table: PublishedTable, pool: Pool, engine: str) -> list[Comparison]:
    cells: list[Comparison] = []
    for row in table.rows.values():
        for key, value in row.values.items():
            column = table.columns[key]
            number, spread = _number(value)
            if number is None:
                continue
            coordinates = {**table.conditions, **column.dims, **row.dims}
            named = column.dims.get("metric") or row.metric
            name = key if named == "per_column" else str(named)
            unit = (column.unit if row.unit == "per_column" else row.unit) or ""
            runs = table.conditions.get("runs")
            base = Comparison(
                source=table.id, row=row.label, column=column.label, metric=name, unit=unit,
                published=number, spread=spread, ours=None, verdict="not run", reason="",
                engine=engine, coordinates={**coordinates, "metric": name},
                published_runs=runs if isinstance(runs, int) else None,
            )  # fmt: skip
            cells.append(_measure(paper, pool, base))
    return [_judge(cell, cells, paper) for cell in cells]


def _claims(paper: Paper, pool: Pool, engine: str) -> list[Comparison]:
    found: list[Comparison] = []
    for claim in paper.claims:
        number, _ = _number(claim.value)
        if claim.kind not in ("result", "qualitative") or (
            number is None and claim.kind == "result"
        ):
            continue
        base = Comparison(
            source=claim.id, row=claim.metric, column=claim.system or "", metric=claim.metric,
            unit=claim.unit or "", published=float("nan") if number is None else number,
            spread=None, ours=None, verdict="not run",
            reason=claim.note or "stated in words", engine=engine,
            coordinates={**claim.conditions, "system": claim.system},
        )  # fmt: skip
        if claim.kind == "qualitative" or number is None:
            found.append(replace(base, reason="stated in words: " + (claim.note or claim.where)))
            continue
        measured = _measure(paper, pool.about(paper, claim.id).of_engine(engine), base)
        if claim.op in ("eq", "approx") or measured.ours is None:
            found.append(_judge(measured, [], paper))
        else:
            found.append(_judge_bound(measured, str(claim.op)))
    return found


def _number(value: object) -> tuple[float | None, float | None]:
    """A printed number and its spread; None for words, flags and sets."""
    if isinstance(value, bool) or value is None or isinstance(value, str):
        return None, None
    if isinstance(value, list):
        return (float(value[0]), float(value[1])) if len(value) == 2 else (None, None)
    return float(str(value)), None


def _measure(paper: Paper, pool: Pool, base: Comparison) -> Comparison:
    metric = paper.metrics.get(base.metric)
    if metric is None:
        return replace(base, reason=f"no number of ours for '{base.metric}'")
    found = find_runs(paper, pool, base.coordinates)
    if found.runs is None:
        return replace(base, reason=found.reason)
    ours = our_value(pool, found.runs, metric)
    if isinstance(ours, str):
        return replace(base, reason=ours)
    return replace(base, ours=ours, reason=metric.note, stand_in=found.stand_in)


def _judge(cell: Comparison, table: list[Comparison], paper: Paper) -> Comparison:
    if cell.ours is None:
        return cell
    notes = [cell.reason] if cell.reason else []
    if cell.stand_in:
        notes.append("on a stand-in sequence")
    same = _agrees(cell)
    if same and not cell.stand_in:
        return replace(cell, verdict="reproduced", reason="; ".join([same, *notes]))
    agree, against = _ordering(cell, table, paper)
    short = _too_little(cell)
    if agree and not against:
        how = f"same ordering as in {agree} comparisons of this table"
        return replace(cell, verdict="same ordering", reason="; ".join([how, *notes]))
    if short and not against:
        return replace(cell, verdict="not run", reason="; ".join([short, *notes]))
    if against:
        first = f"ordering reversed against {against[0]}"
        more = f" and {len(against) - 1} more" if len(against) > 1 else ""
        return replace(cell, verdict="differs", reason="; ".join([first + more, *notes]))
    if same:
        # Another sequence cannot reproduce the number; that it comes out alike is worth saying.
        return replace(cell, verdict="close", reason="; ".join([same, *notes]))
    return replace(cell, verdict="differs", reason="; ".join([_distance(cell), *notes]))


def _agrees(cell: Comparison) -> str:
    """Why ours and the published value are the same within what both can tell, or nothing."""
    ours = cell.ours
    if ours is None or _too_little(cell):
        return ""
    if (bad := _published_bad(cell)) is not None:
        assert cell.published_runs is not None
        p_value = fisher(bad, cell.published_runs, round(ours.value / 100 * ours.count), ours.count)
        return f"shares not told apart (Fisher, p {p_value:.2g})" if p_value > SAME_P else ""
    low, high = _published_interval(cell)
    if ours.low <= high and low <= ours.high:
        return "intervals overlap" if low < high else "published value inside our interval"
    if cell.published and abs(ours.value - cell.published) <= CLOSE * abs(cell.published):
        return f"within {CLOSE:.0%}"
    return ""


def _published_bad(cell: Comparison) -> int | None:
    """How many of the paper's runs a share stands for, where the runs are printed."""
    if cell.unit == SHARE_UNIT and cell.published_runs and cell.metric.endswith("ratio"):
        return round(cell.published / 100 * cell.published_runs)
    return None


def _published_interval(cell: Comparison) -> tuple[float, float]:
    """What the paper's own number can be: its Wilson interval for a share of known runs, and the
    printed spread as a standard error where the runs are known. Else the bare number."""
    runs = cell.published_runs
    if runs and (bad := _published_bad(cell)) is not None:
        found = wilson(bad, runs).scaled(100)
        return found.low, found.high
    if cell.spread is not None and runs:
        half = 1.96 * cell.spread / runs**0.5
        return cell.published - half, cell.published + half
    return cell.published, cell.published


def _too_little(cell: Comparison) -> str:
    """Why our interval confirms nothing, or nothing."""
    ours = cell.ours
    if ours is None:
        return ""
    if ours.count < FEWEST_RUNS:
        return f"{ours.count} runs are too few to tell, {FEWEST_RUNS} are the least"
    width = ours.high - ours.low
    if cell.unit == SHARE_UNIT and cell.metric.endswith("ratio"):
        limit = WIDEST_SHARE
    else:
        limit = WIDEST_MEAN * abs(cell.published)
    return f"our interval of {ours.count} runs is too wide to tell" if width > limit > 0 else ""


def _ordering(cell: Comparison, table: list[Comparison], paper: Paper) -> tuple[int, list[str]]:
    """Comparisons with cells that differ in one coordinate: how many agree, and which clearly do
    not (our intervals are apart, the other way round)."""
    agree, against = 0, []
    for other in table:
        if other.ours is None or cell.ours is None or not _neighbours(cell, other):
            continue
        published = cell.published - other.published
        ours = cell.ours.value - other.ours.value
        if published == 0 or _overlap_published(cell, other):
            continue
        if published * ours > 0:
            agree += 1
        elif cell.ours.high < other.ours.low or other.ours.high < cell.ours.low:
            against.append(f"{other.row}, {other.column}")
    return agree, against


def _overlap_published(cell: Comparison, other: Comparison) -> bool:
    """The paper itself cannot tell these two apart."""
    a, b = _published_interval(cell), _published_interval(other)
    return a[0] < a[1] and b[0] < b[1] and a[0] <= b[1] and b[0] <= a[1]


def _neighbours(cell: Comparison, other: Comparison) -> bool:
    if cell.metric != other.metric or cell is other:
        return False
    keys = set(cell.coordinates) | set(other.coordinates)
    differing = [k for k in keys if cell.coordinates.get(k) != other.coordinates.get(k)]
    return len(differing) == 1


def _judge_bound(cell: Comparison, op: str) -> Comparison:
    """A claim such as `less than`: our whole interval must be on one side."""
    ours = cell.ours
    assert ours is not None
    below = op in ("lt", "le")
    holds = ours.high <= cell.published if below else ours.low >= cell.published
    broken = ours.low > cell.published if below else ours.high < cell.published
    notes = [cell.reason] if cell.reason else []
    if cell.stand_in:
        notes.append("on a stand-in sequence")
    if holds:
        verdict: Verdict = "same ordering" if cell.stand_in else "reproduced"
        return replace(cell, verdict=verdict, reason="; ".join(["the bound holds", *notes]))
    if broken:
        return replace(cell, verdict="differs", reason="; ".join(["the bound is broken", *notes]))
    undecided = "undecided: our interval includes the bound"
    return replace(cell, verdict="not run", reason="; ".join([undecided, *notes]))


def _distance(cell: Comparison) -> str:
    assert cell.ours is not None
    if cell.published == 0 or cell.unit == SHARE_UNIT:
        return f"{cell.ours.value - cell.published:+.3g} {cell.unit}".rstrip()
    return f"{cell.ours.value / cell.published:.2f} times the published value"


def comparison_table(name: str, caption: str, rows: list[Comparison]) -> Table:
    """The published numbers beside ours."""
    engines = {row.engine for row in rows}
    table = Table(
        name,
        caption,
        ["where", "row", "column", "metric", "paper", "ours", "interval", "runs", "verdict",
         "reason"],
        words=4,
    )  # fmt: skip
    for row in rows:
        digits = _digits(row.published)
        spread = f" ± {row.spread:g}" if row.spread is not None else ""
        published = "-" if row.published != row.published else f"{row.published:g}{spread}"
        where = row.source + (f" ({row.engine})" if len(engines) > 1 else "")
        ours = row.ours
        table.rows.append(
            [
                where, row.row, row.column, row.metric, f"{published} {row.unit}".strip(),
                f"{ours.value:.{digits}f}" if ours else "-",
                f"[{ours.low:.{digits}f}, {ours.high:.{digits}f}]" if ours else "-",
                str(ours.count) if ours else "-", row.verdict, row.reason,
            ]
        )  # fmt: skip
    return table


def _digits(number: float) -> int:
    """One digit more than printed, as the paper's rounding hides the next one."""
    text = f"{number:g}"
    return min(4, (len(text.split(".")[1]) if "." in text else 0) + 1)


def tally(rows: list[Comparison]) -> str:
    """`3 reproduced, 2 same ordering, 0 close, 1 differs, 40 not run`."""
    return ", ".join(f"{sum(r.verdict == n for r in rows)} {n}" for n in get_args(Verdict))


def metric_of(paper: Paper, row: Comparison) -> PaperMetric | None:
    """Which number of ours stands beside this one."""
    return paper.metrics.get(row.metric)


__all__ = ["Comparison", "compare_paper", "comparison_table", "matching", "metric_of", "tally"]
