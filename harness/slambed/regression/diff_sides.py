# SPDX-License-Identifier: Apache-2.0
"""The two sides of `slambed diff`: their runs, their names, and how their cells are matched."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import pandas as pd

from slambed.errors import SlambedError
from slambed.report.cells import text
from slambed.report.load import Results
from slambed.report.selected import facts_of_runs, selected
from slambed.report.tables import Table
from slambed.spec.selection import (
    CELL,
    KEYS,
    NO_EDGE,
    NO_LINK,
    PARAMS,
    Selection,
)

Key = tuple[str, ...]
MOST_NAMES = 3
"""Most systems (links, devices) of a side that are reported by name."""
LONGEST_NAME = 24
"""Most characters of a column heading."""
SHORT_COMMIT = 7
COLUMNS = {
    "system": "label", "device": "device_mobile", "edge": "device_edge", "dataset": "dataset",
    "link": "profile", "engine": "engine",
}  # fmt: skip
"""Maps a fact of a side to the column of the runs."""
WHERE = ("dataset", "link")
"""What cells are matched by, besides the label."""
ABSENT = {"link": NO_LINK, "edge": NO_EDGE}


@dataclass(frozen=True)
class Side:
    """Some runs of a results folder."""

    results: Results
    asked: tuple[str, ...] = ()
    """The selections that chose the runs; empty for all runs of the folder."""

    @classmethod
    def of(cls, results: Results, asked: Iterable[str], option: str) -> "Side":
        """Returns the selected runs. Raises SlambedError for a selection without runs."""
        texts = tuple(asked)
        return cls(selected(results, texts, option), texts)

    @property
    def keys(self) -> frozenset[str]:
        """Returns the keys of the selections."""
        return frozenset().union(*(Selection.of(text).keys for text in self.asked))

    @cached_property
    def facts(self) -> dict[str, list[str]]:
        """Returns the facts of a side by name: folder, systems, devices, datasets, links, engine,
        commit."""
        runs = self.results.runs
        found = {"folder": [str(self.results.folder)]}
        for name, column in COLUMNS.items():
            values = list(runs[column]) if column in runs else []
            found[name] = list(dict.fromkeys(text(v) or ABSENT.get(name, "-") for v in values))
        changed = "+" if "True" in self.results.facts.get("dirty", {}) else ""
        found["commit"] = [f"{commit}{changed}" for commit in self.results.facts.get("commit", ())]
        return found


@dataclass(frozen=True)
class Sides:
    """A and B."""

    a: Side
    b: Side

    @classmethod
    def of(
        cls, a: Results, b: Results | None, of_a: Iterable[str] = (), of_b: Iterable[str] = ()
    ) -> "Sides":
        """Makes the sides from two folders, or from two parts of one (`b` is None). Raises
        SlambedError if the parts are not selected or share a run."""
        of_a, of_b = tuple(of_a), tuple(of_b)
        if b is None and not (of_a and of_b):
            raise SlambedError(
                f"{a.folder} is one folder: name a second one, or say with --a and --b what of it "
                f"to compare{_varied(a.runs)}"
            )
        made = cls(Side.of(a, of_a, "--a"), Side.of(a if b is None else b, of_b, "--b"))
        if b is None:
            shared = set(made.a.results.runs["run_key"]) & set(made.b.results.runs["run_key"])
            if shared:
                runs = made.a.results.runs
                cells = list(dict.fromkeys(runs[runs["run_key"].isin(shared)]["cell"].map(text)))
                raise SlambedError(
                    f"--a and --b both mean {_words_of('combination', cells)}; select more closely"
                )
        return made

    @cached_property
    def differing(self) -> list[str]:
        """Returns the names of the facts in which the sides differ, in reporting order."""
        return [name for name, value in self.a.facts.items() if value != self.b.facts[name]]

    @property
    def names(self) -> tuple[str, str]:
        """Returns short names of the sides, from the first fact in which they differ."""
        if not self.differing:
            return "", ""
        first = self.differing[0]
        if first == "folder":
            return _folders(self.a.results.folder, self.b.results.folder)
        reported = _chosen(self.a.asked, self.b.asked), _chosen(self.b.asked, self.a.asked)
        a, b = (
            _words_of(first, side.facts[first])
            if len(side.facts[first]) == 1 or not asked
            else asked
            for side, asked in zip((self.a, self.b), reported, strict=True)
        )
        return _cut(a), _cut(b)

    @property
    def descriptions(self) -> tuple[str, str]:
        """Returns descriptions: how each side was selected, what differs, then what both share."""
        same = self._in_words(self.a, self.shared)
        a, b = ("; ".join(filter(None, (own, same))) for own in self._apart())
        return a, b

    @property
    def shared(self) -> list[str]:
        """Returns the names of the facts that both sides share."""
        return [name for name in self.a.facts if name not in self.differing]

    @property
    def lines(self) -> list[str]:
        """Returns `A: ...`, `B: ...` and `Both: ...`, and how many runs are on both sides."""
        a, b = self._apart()
        reported = {"A": a, "B": b, "Both": self._in_words(self.a, self.shared)}
        lines = [f"{who}: {words}" for who, words in reported.items() if words]
        if self.same:
            of = len(self.a.results.runs)
            lines.append(f"{self.same} of {of} runs of A are the same in B, in every value")
        return lines

    @cached_property
    def same(self) -> int:
        """Returns how many runs are on both sides, as in a copy: equal in their keys and in every
        value."""
        a, b = self.a.results.runs, self.b.results.runs
        columns = [name for name in a if name in b]
        if "run_key" not in columns or not set(a["run_key"]) & set(b["run_key"]):
            return 0
        ours, theirs = (
            runs.loc[runs["run_key"].isin(other["run_key"]), columns].astype(str)
            for runs, other in ((a, b), (b, a))
        )
        return len(ours.merge(theirs))

    def _apart(self) -> tuple[str, str]:
        a, b = (
            "; ".join(filter(None, (" or ".join(side.asked), self._in_words(side, self.differing))))
            for side in (self.a, self.b)
        )
        return a, b

    def _in_words(self, side: Side, names: list[str]) -> str:
        return "; ".join(
            f"{name} {_words_of(name, side.facts[name])}" for name in names if side.facts[name]
        )

    def headings(self) -> tuple[str, str]:
        a, b = self.names
        return (f"A: {a}", f"B: {b}") if a and b else ("A", "B")

    def matched(self) -> list[tuple[str, pd.DataFrame, pd.DataFrame]]:
        """Returns (cell, its runs in A, in B) for cells of equal label, dataset and link, except
        for keys that both sides select on. Raises SlambedError where that would pool cells."""
        ours, theirs = self._pools
        return [
            (own.called(other), own.runs, other.runs)
            for key, own in ours.items()
            if (other := theirs.get(key)) is not None
        ]

    def alone(self) -> list[tuple[str, str]]:
        """Returns (cell, the letter of the side without a valid run of it)."""
        ours, theirs = self._pools
        return [(own.cell, "B") for key, own in ours.items() if key not in theirs] + [
            (other.cell, "A") for key, other in theirs.items() if key not in ours
        ]

    @cached_property
    def _pools(self) -> tuple[dict[Key, "Pooled"], dict[Key, "Pooled"]]:
        """Returns the cells of A and of B by the key that they are matched by."""
        valid = [self.a.results.valid_runs, self.b.results.valid_runs]
        chosen = self.a.keys & self.b.keys
        labels = _labels(*valid)
        drop = {c for c in WHERE if chosen & {c, CELL} and _apart(*(t[COLUMNS[c]] for t in valid))}
        a, b = (
            self._pooled(letter, runs, own, drop)
            for letter, runs, own in zip("AB", valid, labels, strict=True)
        )
        return a, b

    def _pooled(
        self, letter: str, runs: pd.DataFrame, labels: dict[str, str], drop: set[str]
    ) -> dict[Key, "Pooled"]:
        """Maps the key that cells are matched by to the cell."""
        found: dict[Key, Pooled] = {}
        for cell, rows in runs.groupby(_cells(runs), sort=False):
            first = rows.iloc[0]
            shown = labels[text(first["label"])]
            where = ["" if c in drop else text(first[COLUMNS[c]]) for c in WHERE]
            key = (" ".join(_words(shown)), *where)
            if key in found:
                raise SlambedError(
                    f"{letter} has two combinations where the other side may have one: "
                    f"{found[key].cell} and {cell}; select more closely, as in "
                    f"--{letter.lower()} link=..."
                )
            in_common = "/".join(filter(None, (shown, *where)))
            found[key] = Pooled(str(cell), in_common, rows)
        return found


@dataclass(frozen=True)
class Pooled:
    """A cell of a side."""

    cell: str
    in_common: str
    """Its name without the parts in which the sides may differ."""
    runs: pd.DataFrame

    def called(self, other: "Pooled") -> str:
        """Returns one name for this cell and that of the other side."""
        if self.cell == other.cell:
            return self.cell
        return self.in_common or f"{self.cell} | {other.cell}"


def _apart(a: pd.Series, b: pd.Series) -> bool:
    """Returns whether each side has a single value and these differ."""
    left, right = set(a.map(text)), set(b.map(text))
    return len(left) == len(right) == 1 and left != right


def _cells(runs: pd.DataFrame) -> pd.Series:
    """Returns the name of each run's cell, as in its report."""
    if "cell" in runs:
        return runs["cell"].map(text)
    parts = [runs[name].map(text) for name in ("label", "dataset", "profile")]
    return parts[0] + "/" + parts[1] + parts[2].map(lambda link: f"/{link}" if link else "")


def _labels(a: pd.DataFrame, b: pd.DataFrame) -> tuple[dict[str, str], dict[str, str]]:
    """Maps the labels of each side to what they are matched by. Labels that both sides have are
    kept. Else words that all labels of a side share and the other side lacks become a *: `static
    n_orb 500` and `alone n_orb 500` become `* n_orb 500`. With one system on each side, the match
    is empty."""
    labels = [list(dict.fromkeys(side["label"].dropna().astype(str))) for side in (a, b)]
    if len(labels[0]) == len(labels[1]) == 1:
        return {labels[0][0]: ""}, {labels[1][0]: ""}
    if set(labels[0]) & set(labels[1]):
        return {x: x for x in labels[0]}, {x: x for x in labels[1]}
    common = [set.intersection(*(set(_words(x)) for x in own)) if own else set() for own in labels]
    shared = common[0] & common[1]
    left, right = (
        {label: _starred(label, all_have - shared) for label in own}
        for own, all_have in zip(labels, common, strict=True)
    )
    return left, right


_BETWEEN = r"[\s:,;()]+"


def _words(label: str) -> list[str]:
    return [word for word in re.split(_BETWEEN, label) if word]


def _starred(label: str, words: set[str]) -> str:
    parts = re.split(f"({_BETWEEN})", label)
    starred = "".join("*" if part in words else part for part in parts)
    return re.sub(rf"\*(?:{_BETWEEN}\*)+", "*", starred)


def _chosen(asked: tuple[str, ...], other: tuple[str, ...]) -> str:
    """Returns the part of a selection that the other one lacks, or all of it if there are
    several."""
    if not (len(asked) == len(other) == 1):
        return " or ".join(asked)
    own, its = Selection.of(asked[0]), Selection.of(other[0])
    apart = [
        f"{key.removeprefix(PARAMS)}={pattern}" if key.startswith(PARAMS) else pattern
        for key, pattern in own.conditions
        if key != CELL and (key, pattern) not in its.conditions
    ]
    return ", ".join(apart) or asked[0]


def _varied(runs: pd.DataFrame) -> str:
    """Returns an example of --a and --b for the first key with several values."""
    facts = facts_of_runs(runs)
    for key in KEYS:
        names = list(dict.fromkeys(own[key][0] for own in facts))
        if len(names) > 1:
            return f", as in --a '{key}={names[0]}' --b '{key}={names[1]}'"
    return ""


def _folders(a: Path, b: Path) -> tuple[str, str]:
    """Returns the paths of two folders without their common beginning and end."""
    left, right = list(a.parts), list(b.parts)
    while len(left) > 1 and len(right) > 1 and left[-1] == right[-1]:
        left, right = left[:-1], right[:-1]
    while len(left) > 1 and len(right) > 1 and left[0] == right[0]:
        left, right = left[1:], right[1:]
    return _cut(str(Path(*left))), _cut(str(Path(*right)))


def _words_of(name: str, values: list[str]) -> str:
    """Returns the first values; commits are shortened as in git."""
    more = len(values) - MOST_NAMES
    if name == "commit":
        values = [v[:SHORT_COMMIT] + ("+" if v.endswith("+") else "") for v in values]
    return ", ".join(values[:MOST_NAMES]) + (f" and {more} more" if more > 0 else "")


def _cut(name: str) -> str:
    """Shortens a long name to its ends, which often distinguish it from another."""
    if len(name) <= LONGEST_NAME:
        return name
    half = (LONGEST_NAME - 3) // 2
    return f"{name[:half]}...{name[-half:]}"


def sides_table(sides: Sides) -> Table:
    """Returns a table of what was compared. A cause of a change should be among the differing
    rows."""
    both = (sides.a, sides.b)
    rows = [["selected", *(" or ".join(s.asked) or "all runs" for s in both)]]
    rows += [[name, *(", ".join(s.facts[name]) or "-" for s in both)] for name in sides.a.facts]
    rows.append(
        [
            "valid runs",
            *(f"{len(s.results.valid_runs)} of {len(s.results.runs)}" for s in both),
        ]
    )
    rows.append(["first run", *(_first(s.results) for s in both)])
    for name in ("cpu_model", "cores", "kernel"):
        rows.append([name.replace("_", " "), *(_most(s.results, name) for s in both)])
    return Table("sides", "The two sides", ["", *sides.headings()], rows, words=3)


def _first(side: Results) -> str:
    return min(map(text, side.runs["started_utc"].dropna()), default="-")


def _most(side: Results, fact: str) -> str:
    return ", ".join(value[:40] for value in side.facts.get(fact, {})) or "-"
