# SPDX-License-Identifier: Apache-2.0
"""Which runs somebody means: `--only` and `--force` of run, `--a` and `--b` of diff.

A cell (`*/rtt_40`; `*` is any text), or what its runs have: `system=edgeslam`, and several such
with commas between, all of which must hold: `system=edgeslam,link=rtt_*`.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase

from slambed.errors import SlambedError

CELL = "cell"
PARAMS = "params."
KEYS = ("system", "variant", "label", "dataset", "link", "device", "edge", "engine", "pace")
"""What a selection may name besides a cell; and `params.<name>`."""
SYNTAX = f"a cell (* is any text), or KEY=VALUE,... of {', '.join(KEYS)}, {PARAMS}NAME"
NO_LINK, NO_EDGE = "no link", "no edge"
_KEY = rf"(?:{'|'.join(KEYS)}|params\.\w+)="

Facts = Mapping[str, tuple[str, ...]]
"""What a run is called, by key; it may have several names (a system with and without variant)."""


@dataclass(frozen=True)
class Selection:
    """One of these, as it was written."""

    text: str
    conditions: tuple[tuple[str, str], ...]
    """(key, pattern); all must hold."""

    @classmethod
    def of(cls, text: str) -> "Selection":
        """A name that has no known key is one of a cell."""
        if re.match(_KEY, text) is None:
            return cls(text, ((CELL, text),))
        parts = (part.partition("=") for part in re.split(rf",\s*(?={_KEY})", text))
        return cls(text, tuple((key, pattern.strip()) for key, _, pattern in parts))

    @property
    def keys(self) -> frozenset[str]:
        """What it is about."""
        return frozenset(key for key, _ in self.conditions)

    def holds(self, facts: Facts) -> bool:
        """Whether a run is meant."""
        return all(
            any(fnmatchcase(name, pattern) for name in facts.get(key, ()))
            for key, pattern in self.conditions
        )

    def missed(self, runs: list[Facts], option: str) -> SlambedError:
        """That it means none of these: which of its words does not, and what there is."""
        for key, pattern in self.conditions:
            known = list(dict.fromkeys(name for facts in runs for name in facts.get(key, ())))
            if not any(fnmatchcase(name, pattern) for name in known):
                break
        else:
            return SlambedError(f"{option} {self.text} is no cell: no run has all of that")
        reported = ", ".join(known) or "none"
        if key != CELL:
            return SlambedError(f"{option} {self.text} is no cell; {key}: {reported}")
        hint = f"; or KEY=VALUE of {', '.join(KEYS)}, {PARAMS}NAME" if "=" in self.text else ""
        return SlambedError(f"{option} {self.text} is no cell; cells: {reported}{hint}")


def meant(runs: list[Facts], texts: Iterable[str], option: str) -> list[bool]:
    """For each run whether one of the selections means it; all where there is none. Raises
    SlambedError for one that means no run."""
    selections = [Selection.of(text) for text in texts]
    for selection in selections:
        if not any(selection.holds(facts) for facts in runs):
            raise selection.missed(runs, option)
    return [not selections or any(s.holds(facts) for s in selections) for facts in runs]


def facts_of(
    cell: str,
    system: str,
    variant: str,
    labels: Iterable[str],
    dataset: str,
    link: str | None,
    device: str | None,
    edge: str | None,
    engine: str,
    pace: str | None,
    params: Mapping[str, object],
) -> dict[str, tuple[str, ...]]:
    """What a run is called, whether it is still to be executed or was."""
    found: dict[str, tuple[str, ...]] = {
        CELL: (cell,),
        "system": (system, f"{system}:{variant}"),
        "variant": (variant,),
        "label": tuple(dict.fromkeys(labels)),
        "dataset": (dataset,),
        "link": (link or NO_LINK,),
        "device": (device or "",),
        "edge": (edge or NO_EDGE,),
        "engine": (engine,),
        "pace": (pace or "",),
    }
    return found | {f"{PARAMS}{name}": (_word(value),) for name, value in params.items()}


def _word(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, int | float) else str(value)
