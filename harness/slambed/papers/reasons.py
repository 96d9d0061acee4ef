# SPDX-License-Identifier: Apache-2.0
"""Counts the numbers of papers: judged, shown beside ours, set to match, settings; and those
without one of ours, by reason."""

from collections import Counter
from dataclasses import dataclass
from typing import Any, Literal

from slambed.papers.compare import Column, PaperVerdicts
from slambed.papers.judged import Judged, Mark
from slambed.papers.lookup import LIVE, matching
from slambed.report.tables import Table

Reason = Literal[
    "recording", "field_study", "not_in_print", "not_measured", "not_played", "no_events",
    "live", "virtual",
]  # fmt: skip
"""Why there is no number of ours. `live`, `virtual`: among runs of one kind, because only the other
kind was played."""
REASON_WORDS: dict[Reason, str] = {
    "recording": "recording not available",
    "field_study": "field study",
    "not_in_print": "no number in print",
    "not_measured": "not measured here",
    "not_played": "not played yet",
    "no_events": "played, events not kept",
    "live": "played live only",
    "virtual": "played in virtual time only",
}
COUNTED: dict[Reason, str] = {
    reason: words for reason, words in REASON_WORDS.items() if reason not in ("live", "virtual")
}
"""Reasons over all kinds of engines."""
Group = Literal["judged", "beside", "fitted", "setting", "none"]
GROUP_WORDS: dict[Group, str] = {
    "judged": "judged",
    "beside": "shown beside ours, not judged",
    "fitted": "set to match",
    "setting": "settings or repeated",
    "none": "without a number of ours",
}
"""Every printed number is in one of these groups."""
GROUP_OF: dict[Mark, Group] = {
    "R": "judged", "D": "judged", "I": "judged", "S": "beside", "F": "fitted", "P": "setting",
    "E": "none", "N": "none",
}  # fmt: skip


def reason_of(verdicts: PaperVerdicts, column: Column, row: Judged) -> Reason | None:
    """Returns why a number has none of ours; None if it has one, or needs none."""
    if row.mark == "E":
        return "no_events"
    if row.mark != "N":
        return None
    if (declared := row.cell.comparability.reason) is not None:
        return declared
    here = row.measured.found.runs is not None
    other = _other_kind(verdicts, column, row)
    if other is not None and (row.missing == "no_metric" or not here):
        return other
    # Runs from which the number cannot be had, such as runs that all lost track.
    if here or row.missing in ("no_system", "no_metric"):
        return "not_measured"
    dataset = verdicts.paper.datasets.get(str(row.cell.conditions.get("dataset")))
    if dataset is None or dataset.stand_in:
        return "not_played"
    # Only the recording itself can be played, and no run has it.
    played = matching(column.runs, {"dataset": dataset.match}) if len(column.runs) else column.runs
    return "not_played" if len(played) else "recording"


def _other_kind(verdicts: PaperVerdicts, column: Column, row: Judged) -> Reason | None:
    """Returns the kind of engine whose runs have the number."""
    for other in verdicts.columns:
        if other is not column and GROUP_OF[other.rows[row.cell.id].mark] != "none":
            return "live" if other.engine == LIVE else "virtual"
    return None


@dataclass(frozen=True)
class Count:
    """Counts of one paper, or of all."""

    groups: Counter[Group]
    reasons: Counter[Reason]

    @property
    def printed(self) -> int:
        return self.groups.total()

    def __add__(self, other: "Count") -> "Count":
        return Count(self.groups + other.groups, self.reasons + other.reasons)

    @property
    def because(self) -> str:
        """Returns `4 field study, 10 not played yet`, without a number if there is one reason."""
        found = [(self.reasons[r], words) for r, words in REASON_WORDS.items() if self.reasons[r]]
        if len(found) == 1:
            return found[0][1]
        return ", ".join(f"{number} {words}" for number, words in found)


def count(verdicts: PaperVerdicts, column: Column) -> Count:
    """Counts the numbers of one kind of engine."""
    rows = column.rows.values()
    reasons = (reason_of(verdicts, column, row) for row in rows)
    return Count(Counter(GROUP_OF[row.mark] for row in rows), Counter(r for r in reasons if r))


def count_paper(verdicts: PaperVerdicts) -> Count:
    """Counts a paper's numbers over all kinds of engines, each number once."""
    best = _furthest(verdicts)
    return Count(
        Counter(GROUP_OF[row.mark] for row, _ in best.values()),
        Counter(reason for _, reason in best.values() if reason is not None),
    )


def _furthest(verdicts: PaperVerdicts) -> dict[str, tuple[Judged, Reason | None]]:
    """Returns every number from the kind of engine where it got furthest (the order of
    `GROUP_WORDS`)."""
    order = list(GROUP_WORDS)
    found = {}
    for name in verdicts.cells:
        column = min(verdicts.columns, key=lambda c: order.index(GROUP_OF[c.rows[name].mark]))
        row = column.rows[name]
        found[name] = row, reason_of(verdicts, column, row)
    return found


def count_table(pages: list[PaperVerdicts]) -> Table:
    """Returns one column per paper, and one for all of them."""
    counts = {v.paper.id: count_paper(v) for v in pages}
    if len(counts) > 1:
        counts["all"] = sum(counts.values(), Count(Counter(), Counter()))
    table = Table("counts", "Printed numbers", ["", *counts])
    table.rows.append(["printed", *(str(c.printed) for c in counts.values())])
    for group, words in GROUP_WORDS.items():
        table.rows.append([words, *(str(c.groups[group]) for c in counts.values())])
    for reason, words in COUNTED.items():
        table.rows.append([f"- {words}", *(str(c.reasons[reason]) for c in counts.values())])
    return table


def count_json(pages: list[PaperVerdicts]) -> dict[str, Any]:
    """Returns the counts of each paper, with the ids of the numbers without one of ours."""
    found: dict[str, Any] = {}
    for verdicts in pages:
        counted = count_paper(verdicts)
        found[verdicts.paper.id] = {
            "printed": counted.printed,
            "groups": {group: counted.groups[group] for group in GROUP_WORDS},
            "without": {reason: counted.reasons[reason] for reason in COUNTED},
            "numbers": [
                {"id": name, "reason": reason, "why": row.why}
                for name, (row, reason) in _furthest(verdicts).items()
                if reason is not None
            ],
        }
    return found
