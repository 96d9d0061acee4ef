# SPDX-License-Identifier: Apache-2.0
"""Judges statements about several cells or events: reductions, increases, gaps, ratios,
differences, maxima, one number for each, time windows, times."""

from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pandas as pd

from slambed.metrics.loss_times import in_window, loss_times_of
from slambed.papers.lookup import Pool
from slambed.papers.margins import margin_of_cell, published_of
from slambed.papers.measured import Measured, measure
from slambed.papers.published import (
    At,
    Difference,
    Each,
    EventTimes,
    Gap,
    Increase,
    MaxOver,
    Operand,
    Paper,
    PublishedCell,
    Ratio,
    Reduction,
    WindowShare,
)
from slambed.papers.verdicts.means import Effect, judge_effect, judge_mean
from slambed.papers.verdicts.model import (
    FEWEST_RUNS,
    Mean,
    Outcome,
    Share,
    Verdict,
    not_run,
    too_few,
)
from slambed.papers.verdicts.shares import judge_share
from slambed.papers.verdicts.statements import (
    ABOUT_MARGIN,
    REDUCTION_MARGIN,
    Pair,
    judge_about,
    judge_bound,
    judge_difference,
    judge_difference_bound,
    judge_gap,
    judge_ratio,
    judge_reduction,
    judge_reduction_bound,
    judge_set,
    judge_up_to,
    judge_up_to_more,
    judge_window,
    pair_by_seed,
)

BOUND_OPS: dict[str, Literal["lt", "le", "gt", "ge"]] = {
    "lt": "lt", "le": "le", "gt": "gt", "ge": "ge",
}  # fmt: skip
AS_REDUCTION: dict[str, Literal["lt", "le", "gt", "ge"]] = {
    "lt": "gt", "le": "ge", "gt": "lt", "ge": "le",
}  # fmt: skip
"""Less than x times is more than 1 - x less."""
WORST: tuple[Outcome, ...] = ("differs", "not_run", "inconclusive", "reproduced")
"""Outcomes from worst to best; several numbers together get the worst of theirs."""


def judge_quantity(
    paper: Paper, pool: Pool, cells: dict[str, PublishedCell], cell: PublishedCell
) -> tuple[Verdict, Measured]:
    """Returns the verdict on a claim with a `quantity`, and the runs of its `of` side."""
    claim = cell.claim
    assert claim is not None and claim.quantity is not None
    quantity = claim.quantity
    about = pool.about(paper, cell.source)
    if isinstance(quantity, WindowShare | EventTimes):
        of = _measured(paper, about, cells, quantity.of)
        if not of.there:
            return not_run(of.found.reason), of
        if isinstance(quantity, EventTimes):
            return _times(about, cell, quantity, of, margin_of_cell(paper, cells, cell, []).value)
        assert of.found.runs is not None
        return _window(of.found.runs, cell, quantity, of)
    if isinstance(quantity, MaxOver):
        return _up_to(paper, about, cells, cell, quantity)
    if isinstance(quantity, Each):
        return _each(paper, about, cells, cell, quantity)
    if isinstance(quantity, Reduction | Increase | Gap | Ratio | Difference):
        return _two(paper, about, cells, cell, quantity)
    why = "an ordering: judged among the contrasts"
    nothing = _measured(paper, about, cells, quantity.operands()[0])
    return not_run(why), replace(nothing, values=np.zeros(0))


def _measured(
    paper: Paper, pool: Pool, cells: dict[str, PublishedCell], operand: Operand
) -> Measured:
    metric = (operand if isinstance(operand, At) else cells[operand]).metric
    return measure(paper, pool, metric, *_coordinates(cells, operand))


def _coordinates(
    cells: dict[str, PublishedCell], operand: Operand
) -> tuple[str | None, dict[str, Any]]:
    """Returns the system and the conditions of an operand."""
    at = operand if isinstance(operand, At) else cells[operand]
    return at.system, dict(at.conditions)


def _dataset(cells: dict[str, PublishedCell], operand: Operand) -> object:
    """Returns the paper's sequence of an operand."""
    return _coordinates(cells, operand)[1].get("dataset")


def _pair(of: Measured, base: Measured) -> Pair:
    """Pairs the sides by seed if both have the same repetitions, once each."""
    one, two = (
        dict(zip(base.repetitions, base.values, strict=False)),
        dict(zip(of.repetitions, of.values, strict=False)),
    )
    whole = len(one) == len(base.values) and len(two) == len(of.values)
    if whole and one.keys() == two.keys():
        return pair_by_seed([one[r] for r in sorted(one)], [two[r] for r in sorted(two)])
    return Pair(base.mean, of.mean)


def _two(
    paper: Paper, pool: Pool, cells: dict[str, PublishedCell], cell: PublishedCell, quantity: Ratio
) -> tuple[Verdict, Measured]:
    of = _measured(paper, pool, cells, quantity.of)
    base = _measured(paper, pool, cells, quantity.base)
    for side in (of, base):
        if not side.there:
            return not_run(side.found.reason), side
    of = replace(of, found=replace(of.found, stand_in=of.found.stand_in or base.found.stand_in))
    compares_sequences = _dataset(cells, quantity.of) != _dataset(cells, quantity.base)
    if of.found.dataset != base.found.dataset and not compares_sequences:
        return Verdict("inconclusive", "its two sides are on different sequences"), of
    claim = cell.claim
    assert claim is not None and cell.value is not None
    pair = _pair(of, base)
    digit = cell.resolution or 0.0
    written = paper.margins.get("reduction")
    margin = written.ratio if written is not None and written.ratio else REDUCTION_MARGIN
    if isinstance(quantity, Difference):
        scale = 100.0 if of.is_share else 1.0
        return _difference(pair, cell, scale), _of_two(quantity, of, base)
    if isinstance(quantity, Gap):
        return judge_gap(pair, cell.value / 100), _of_two(quantity, of, base)
    if isinstance(quantity, Increase):
        verdict = _increase(pair, cell.value, digit, str(claim.op))
        return verdict, _of_two(quantity, of, base)
    stated, small = (
        (cell.value / 100, digit / 100)
        if isinstance(quantity, Reduction)
        else (1 - cell.value, digit)
    )
    if claim.op in BOUND_OPS:
        ops = BOUND_OPS if isinstance(quantity, Reduction) else AS_REDUCTION
        return judge_reduction_bound(pair, ops[claim.op], stated), _of_two(quantity, of, base)
    if claim.op == "about":
        about = paper.margins.get("about")
        margin = max(margin, about.ratio if about is not None and about.ratio else 0.0)
    if isinstance(quantity, Reduction):
        return judge_reduction(pair, stated, small, margin), _of_two(quantity, of, base)
    return judge_ratio(pair, cell.value, small, margin), _of_two(quantity, of, base)


def _difference(pair: Pair, cell: PublishedCell, scale: float) -> Verdict:
    assert cell.claim is not None and cell.value is not None
    if (bound := BOUND_OPS.get(str(cell.claim.op))) is not None:
        return judge_difference_bound(pair, bound, cell.value, scale)
    return judge_difference(pair, cell.value, cell.resolution or 0.0, scale)


def _increase(pair: Pair, stated: float, digit: float, op: str) -> Verdict:
    """Judges `x % more`: ours must be within a third of the stated percentage, or a quarter for
    `about`."""
    if pair.fewest < FEWEST_RUNS:
        return too_few(pair.fewest, "difference", None)
    if not (pair.before.value > 0 and pair.after.value > 0):
        return Verdict("inconclusive", "an increase of or to nothing", scale="difference")
    left = pair.left()
    times = float(np.exp(left.value))
    effect = Effect(
        100 * (times - 1) - stated, float(np.hypot(100 * times * left.se, digit / 12**0.5)), left.df
    )
    margin = (ABOUT_MARGIN if op == "about" else REDUCTION_MARGIN) * abs(stated)
    verdict = judge_effect(
        effect, margin, "difference", "increase of ours - stated, delta method, in points"
    )
    message = f"ours {times - 1:+.1%}, stated {stated:+.3g} %"
    return replace(verdict, why=f"{message}; {verdict.why}")


def _of_two(quantity: Ratio, of: Measured, base: Measured) -> Measured:
    """Returns the quantity of every run relative to the base's mean, in the claim's unit. A share
    is one number over all runs and stays unchanged."""
    against = base.mean.value
    if of.is_share or not against:
        return of
    if isinstance(quantity, Difference):
        return replace(of, values=of.values - against)
    ratio = of.values / against
    if isinstance(quantity, Reduction):
        ratio = 100 * (1 - ratio)
    elif isinstance(quantity, Increase):
        ratio = 100 * (ratio - 1)
    elif isinstance(quantity, Gap):
        ratio = 100 * abs(ratio - 1)
    return replace(of, values=ratio)


def _each(
    paper: Paper, pool: Pool, cells: dict[str, PublishedCell], cell: PublishedCell, quantity: Each
) -> tuple[Verdict, Measured]:
    """Judges one number for several cells or differences: reproduced if each is, differs if one
    does. The decisive one is reported and shown, with the runs of all."""
    found: list[tuple[str, Measured, Pair | None]] = []
    for part in quantity.of:
        if isinstance(part, Difference):
            of, base = (_measured(paper, pool, cells, o) for o in (part.of, part.base))
            for side in (of, base):
                if not side.there:
                    return not_run(side.found.reason), side
            if of.found.dataset != base.found.dataset:
                return Verdict("inconclusive", "its two sides are on different sequences"), of
            found.append((_name_of(part.of), _of_two(part, of, base), _pair(of, base)))
            continue
        one = _measured(paper, pool, cells, part)
        if not one.there:
            return not_run(one.found.reason), one
        found.append((_name_of(part), one, None))
    sides = [side for _, side, _ in found]
    runs_of_all = next((side.found for side in sides if side.found.stand_in), sides[0].found)
    keys_of_all = tuple(key for side in sides for key in side.keys)
    worst: Verdict | None = None
    decisive = sides[0]
    for name, side, pair in found:
        if pair is not None:
            verdict = _difference(pair, cell, 100.0 if side.is_share else 1.0)
        else:
            verdict = _same_number(paper, cells, cell, side)
        if worst is None or WORST.index(verdict.outcome) < WORST.index(worst.outcome):
            worst, decisive = replace(verdict, why=f"{name}: {verdict.why}"), side
    assert worst is not None
    return worst, replace(decisive, found=runs_of_all, keys=keys_of_all)


def _name_of(operand: Operand) -> str:
    """Returns the id of a cell, or a system with what tells its runs from those of others."""
    if isinstance(operand, str):
        return operand
    told = [str(value) for name, value in operand.conditions.items() if name != "dataset"]
    return ", ".join([operand.system, *told])


def _same_number(
    paper: Paper, cells: dict[str, PublishedCell], cell: PublishedCell, side: Measured
) -> Verdict:
    stated = published_of(cell, side.is_share)
    if stated is None:
        return Verdict("inconclusive", "the paper prints no number of runs for this")
    assert cell.claim is not None
    if (bound := BOUND_OPS.get(str(cell.claim.op))) is not None:
        return judge_bound(side.share if side.is_share else side.mean, bound, stated.value)
    margin = margin_of_cell(paper, cells, cell, [])
    if isinstance(stated, Share):
        return judge_share(side.share, stated, margin.value)
    if cell.claim.op == "about":
        return judge_about(side.mean, stated)
    return judge_mean(side.mean, stated, margin.value, margin.kind)


def _up_to(
    paper: Paper,
    pool: Pool,
    cells: dict[str, PublishedCell],
    cell: PublishedCell,
    quantity: MaxOver,
) -> tuple[Verdict, Measured]:
    sides: dict[str, tuple[Ratio, Measured, Measured]] = {}
    published: dict[str, float] = {}
    gains = all(isinstance(part, Difference) for part in quantity.over)
    first: Measured | None = None
    stand_in = False
    for number, part in enumerate(quantity.over):
        name = part.of if isinstance(part.of, str) else f"part {number + 1}"
        of, base = (_measured(paper, pool, cells, o) for o in (part.of, part.base))
        ends = [cells[o].value if isinstance(o, str) else None for o in (part.of, part.base)]
        if ends[0] is not None and ends[1]:
            published[name] = ends[0] - ends[1] if gains else 1 - ends[0] / ends[1]
        if first is None or (of.there and not first.there):
            first = of
        if of.there and base.there:
            sides[name] = part, of, base
            stand_in = stand_in or of.found.stand_in or base.found.stand_in
    assert first is not None and cell.value is not None
    if not sides:
        return not_run(first.found.reason), replace(first, values=np.zeros(0))
    at = max(published, key=lambda name: published[name]) if published else next(iter(sides))
    shown = _of_two(*sides[at]) if at in sides else first
    shown = replace(shown, found=replace(shown.found, stand_in=stand_in))
    pairs = {name: _pair(of, base) for name, (_, of, base) in sides.items()}
    digit = cell.resolution or 0.0
    if gains:
        scale = 100.0 if first.is_share else 1.0
        return judge_up_to_more(pairs, cell.value, at, digit, scale), shown
    return judge_up_to(pairs, cell.value / 100, at, digit / 100), shown


def _window(
    runs: pd.DataFrame, cell: PublishedCell, quantity: WindowShare, of: Measured
) -> tuple[Verdict, Measured]:
    """Judges the share of losses (`loss_times_s`) that begin in the window, or of runs with such a
    loss."""
    if "loss_times_s" not in runs:
        return not_run("loss_times_s was not measured"), replace(of, values=np.zeros(0))
    times = [loss_times_of(text) for text in runs["loss_times_s"]]
    inside = [in_window(run, quantity.from_s, quantity.to_s) for run in times]
    claim = cell.claim
    assert claim is not None
    if quantity.per == "runs" or cell.unit == "runs":
        if cell.value is None or not cell.runs:
            return Verdict("inconclusive", "the paper prints no number of runs"), of
        bad = cell.value if cell.unit == "runs" else cell.value / 100 * cell.runs
        ours = Share(sum(count > 0 for count in inside), len(times))
        return judge_share(ours, Share(round(bad), cell.runs)), of
    played = pd.to_numeric(runs["wall_s"], errors="coerce").median()
    share = (quantity.to_s - quantity.from_s) / float(played)
    if claim.op in BOUND_OPS and cell.value is not None and cell.unit == "%":
        lost = Share(sum(inside), sum(map(len, times)))
        return judge_bound(lost, BOUND_OPS[claim.op], cell.value / 100), of
    return judge_window(sum(inside), sum(map(len, times)), share), of


def _times(
    pool: Pool, cell: PublishedCell, quantity: EventTimes, of: Measured, margin: float
) -> tuple[Verdict, Measured]:
    """Judges the run times of events against the stated ones, the first against the first. It
    differs if no run has as many events as the paper states times."""
    logs = [pool.results[folder].events(key, (quantity.event,)) for folder, key in of.keys]
    times = [[e["t_ns"] * 1e-9 for e in log.of(quantity.event)] for log in logs if log is not None]
    if not times:
        return not_run("the events were not kept"), replace(of, values=np.zeros(0))
    claim = cell.claim
    assert claim is not None and isinstance(claim.value, list)
    stated = [Mean(float(value)) for value in claim.value]
    whole = [run for run in times if len(run) == len(stated)]
    firsts = replace(of, values=np.array([run[0] for run in times if run]), is_share=False)
    counts = f"{len(whole)} of {len(times)} runs have {len(stated)} of {quantity.event}"
    if not whole:
        few = len(times) < FEWEST_RUNS
        return Verdict("inconclusive" if few else "differs", counts), firsts
    ours = [Mean.of([run[place] for run in whole]) for place in range(len(stated))]
    verdict = judge_set(ours, stated, margin)
    if len(whole) < len(times) and verdict.outcome == "reproduced":
        verdict = replace(verdict, outcome="inconclusive")
    found = " and ".join(f"{mean.value:.0f}" for mean in ours)
    return replace(verdict, why=f"ours at {found} s; {counts}; {verdict.why}"), firsts
