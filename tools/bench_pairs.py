# SPDX-License-Identifier: Apache-2.0
"""Computations of bench_against.py and bench_summary.py: pairs of times, verdicts and the history.

It uses only the standard library, because the host's own Python runs it.
"""

import json
import math
import statistics
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

Times = dict[str, float]
"""CPU time in us by benchmark, of one side in one round."""

ALARMS = 0.01
"""Largest probability of any false alarm when nothing is slower by more than the limit."""
PLAIN = 0.05
"""Error probability of the interval of a benchmark that is not suspected."""
SLOWER, FASTER = "slower", "faster"
NO_DIFFERENCE, INCONCLUSIVE = "no difference shown", "inconclusive"


class BadInputError(Exception):
    """Bad input; its message is one line for the user."""


@dataclass(frozen=True)
class Finding:
    name: str
    base_us: float
    now_us: float
    spread: float
    """Median absolute deviation of the pairs' ratios, divided by their median."""
    ratio: float
    """Median of the pairs' ratios, now / yardstick."""
    low: float
    high: float
    pairs: int
    verdict: str
    more_pairs: int = 0
    """Additional pairs that would make an inconclusive result conclusive; 0: too near the limit."""


def tail(pairs: int, most: int) -> float:
    """Returns P(sum of signed ranks <= most) for `pairs` symmetric values."""
    ways = [1] + [0] * max(most, 0)
    for rank in range(1, pairs + 1):
        for total in range(len(ways) - 1, rank - 1, -1):
            ways[total] += ways[total - rank]
    return sum(ways) / 2**pairs if most >= 0 else 0.0


def interval(ratios: list[float], wrong: float) -> tuple[float, float]:
    """Returns a confidence interval of the true ratio with error probability `wrong`.

    Inverts Wilcoxon's signed-rank test: sorts the pairwise means of the logarithms and drops as
    many at both ends as the test allows. The noise must have the same distribution on both sides,
    of any shape. With too few pairs for `wrong` the interval is unbounded.
    """
    logs = [math.log(ratio) for ratio in ratios]
    walsh = sorted((a + b) / 2 for n, a in enumerate(logs) for b in logs[n:])
    if tail(len(logs), 0) > wrong / 2:
        return 0.0, math.inf
    skipped = 0
    while tail(len(logs), skipped + 1) <= wrong / 2:
        skipped += 1
    return math.exp(walsh[skipped]), math.exp(walsh[-1 - skipped])


def judge(name: str, base: list[float], now: list[float], limit: float, wrong: float) -> Finding:
    """Returns the verdict on one benchmark; base[i] and now[i] are a pair."""
    ratios = [mine / theirs for mine, theirs in zip(now, base, strict=True)]
    middle = statistics.median(ratios)
    low, high = interval(ratios, wrong)
    more = 0
    if low > 1 + limit:
        verdict = SLOWER
    elif high < 1 / (1 + limit):
        verdict = FASTER
    elif high <= 1 + limit:
        verdict = NO_DIFFERENCE
    else:
        verdict = INCONCLUSIVE
        more = more_pairs(middle, low, high, limit, len(ratios), wrong)
    spread = statistics.median(abs(ratio - middle) for ratio in ratios) / middle
    middles = statistics.median(base), statistics.median(now)
    return Finding(name, *middles, spread, middle, low, high, len(ratios), verdict, more)


def more_pairs(
    middle: float, low: float, high: float, limit: float, pairs: int, wrong: float
) -> int:
    """Estimates the missing pairs: the interval narrows with the square root of their number."""
    least = math.ceil(math.log2(2 / wrong))
    if math.isinf(high):
        return max(1, least - pairs)
    away = abs(math.log(middle / (1 + limit)))
    width = math.log(high / low) / 2
    wanted = math.ceil(pairs * (width / away) ** 2) if away > 0.002 else 0
    return max(wanted - pairs, 1) if wanted else 0


def paired(rounds: list[tuple[Times, Times]], name: str) -> tuple[list[float], list[float]]:
    return [base[name] for base, _ in rounds], [now[name] for _, now in rounds]


def compare(
    names: list[str],
    measure: Callable[[list[str], int], list[tuple[Times, Times]]],
    rounds: int,
    limit: float,
) -> list[Finding]:
    """Measures all benchmarks, then measures again, and longer, those that look slower.

    Suspects are judged by their new pairs only, which avoids selection bias. ALARMS is divided only
    among the suspects (Bonferroni), so that few pairs suffice.
    """
    screened = measure(names, rounds)
    found = {name: judge(name, *paired(screened, name), limit, PLAIN) for name in names}
    suspects = [name for name in names if found[name].ratio > 1 + limit / 2]
    if suspects:
        wrong = 2 * ALARMS / len(suspects)
        confirmed = measure(suspects, max(2 * rounds + 1, math.ceil(math.log2(2 / wrong))))
        for name in suspects:
            found[name] = judge(name, *paired(confirmed, name), limit, wrong)
    return sorted(found.values(), key=lambda finding: -finding.ratio)


def alternating(rounds: int) -> list[bool]:
    """Returns for each pair whether the yardstick comes first: A B, B A, A B, ..."""
    return [number % 2 == 0 for number in range(rounds)]


def only_one_side(base: list[str], now: list[str]) -> list[str]:
    """Returns one line per benchmark that only one side has."""
    lines = [f"only now: {name}" for name in now if name not in base]
    return lines + [f"only in the yardstick: {name}" for name in base if name not in now]


def rounded(value: float) -> str:
    """Formats a value with three significant digits, never in scientific notation."""
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def table(found: list[Finding]) -> list[str]:
    """Returns the lines of a Markdown table, in the order of the findings."""
    lines = [
        "| benchmark | yardstick, us | now, us | ratio | interval | pairs | verdict |",
        "|---|---:|---:|---:|---|---:|---|",
    ]
    for one in found:
        verdict = one.verdict
        if verdict == INCONCLUSIVE:
            verdict += f": {one.more_pairs} more" if one.more_pairs else ": at the limit"
        known = f"{one.low:.2f} to {one.high:.2f}" if one.low else ""
        lines.append(
            f"| {one.name} | {rounded(one.base_us)} | {rounded(one.now_us)} | {one.ratio:.2f} "
            f"| {known} | {one.pairs} | {verdict} |"
        )
    return lines


def read_history(path: Path) -> list[dict[str, object]]:
    """Reads earlier measurements, oldest first."""
    rows = []
    for number, line in enumerate(path.read_text("utf-8").splitlines() if path.exists() else [], 1):
        try:
            row = json.loads(line)
            row["commit"] + row["benchmark"] + row["date"]
        except (ValueError, KeyError, TypeError) as why:
            what = f"{path}: line {number} is not a measurement"
            raise BadInputError(f"{what}; delete the line or name another --history") from why
        rows.append(row)
    return rows


def newest_other(rows: list[dict[str, object]], commit: str) -> str | None:
    """Returns the newest other commit of the history. Changed trees do not count."""
    others = [str(row["commit"]) for row in rows if row["commit"] != commit]
    return next((other for other in reversed(others) if not other.endswith("-changed")), None)


def append_history(path: Path, rows: list[dict[str, object]]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8") as file:
        file.writelines(json.dumps(row) + "\n" for row in rows)


def processor() -> str:
    """Returns the processor's model name from /proc/cpuinfo."""
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
    except OSError:
        lines = []
    models = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(models, "unknown")
