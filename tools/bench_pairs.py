# SPDX-License-Identifier: Apache-2.0
"""What bench_against.py and bench_summary.py compute: pairs of times, verdicts and the history.

The standard library alone: the host's own Python runs it.
"""

import json
import math
import statistics
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

Times = dict[str, float]
"""CPU time in us by benchmark, as one side has it in one round."""

ALARMS = 0.01
"""At most so often is anything called slower where nothing is slower by more than the limit."""
PLAIN = 0.05
"""What is not suspected has an interval that is wrong so often."""
SLOWER, FASTER = "slower", "faster"
NO_DIFFERENCE, INCONCLUSIVE = "no difference shown", "inconclusive"


class BadInputError(Exception):
    """One line for the user."""


@dataclass(frozen=True)
class Finding:
    name: str
    base_us: float
    now_us: float
    spread: float
    """Median absolute deviation of the pairs' ratios from their median, over it."""
    ratio: float
    """Median of the pairs' ratios, now over yardstick."""
    low: float
    high: float
    pairs: int
    verdict: str
    more_pairs: int = 0
    """Pairs that would decide, where these do not; 0: it lies too near the limit."""


def tail(pairs: int, most: int) -> float:
    """Chance that the sum of signed ranks of `pairs` symmetric values is at most `most`."""
    ways = [1] + [0] * max(most, 0)
    for rank in range(1, pairs + 1):
        for total in range(len(ways) - 1, rank - 1, -1):
            ways[total] += ways[total - rank]
    return sum(ways) / 2**pairs if most >= 0 else 0.0


def interval(ratios: list[float], wrong: float) -> tuple[float, float]:
    """Between which ratios the true one lies, but for `wrong` of all cases, half on each side.

    Wilcoxon's signed ranks turned around: means of two logarithms, sorted, with as many left out at
    both ends as the test allows. Asks for noise that is alike on both sides, of any distribution.
    Too few pairs for so rare an error have no ends.
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
    """The verdict on one benchmark; base and now are in the order of their pairs."""
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
    """An interval narrows with the square root of the pairs."""
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
    """Looks at everything, then measures anew, and longer, what looks slower.

    What was suspected is judged by its new pairs alone, so having been picked does not favor it,
    and ALARMS is shared among the suspects alone (Bonferroni), so that few pairs suffice.
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
    """Whether the yardstick comes first in each pair: A B, B A, A B, ..."""
    return [number % 2 == 0 for number in range(rounds)]


def only_one_side(base: list[str], now: list[str]) -> list[str]:
    """A line per benchmark that has no partner."""
    lines = [f"only now: {name}" for name in now if name not in base]
    return lines + [f"only in the yardstick: {name}" for name in base if name not in now]


def rounded(value: float) -> str:
    """Three digits that mean something, never in powers of ten."""
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def table(found: list[Finding]) -> list[str]:
    """Markdown, what became slower first."""
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
    """Lines of earlier measurements, oldest first."""
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
    """The newest commit of the history that is not this one; changed trees are no yardstick."""
    others = [str(row["commit"]) for row in rows if row["commit"] != commit]
    return next((other for other in reversed(others) if not other.endswith("-changed")), None)


def append_history(path: Path, rows: list[dict[str, object]]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8") as file:
        file.writelines(json.dumps(row) + "\n" for row in rows)


def processor() -> str:
    """The model's name as Linux reports it."""
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
    except OSError:
        lines = []
    models = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(models, "unknown")
