# SPDX-License-Identifier: Apache-2.0
"""Selection of runs: `--only` and `--force` of run, `--a` and `--b` of diff.

A selection is the name of a combination (`*/rtt_40`; `*` matches any text) or a property such as
`system=edgeslam`. Comma-separated properties must all hold: `system=edgeslam,link=rtt_*`.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from slambed.errors import SlambedError

CELL = "cell"
PARAMS = "params."
KEYS = ("system", "variant", "label", "dataset", "link", "device", "edge", "engine", "pace")
"""Properties that a selection may test besides the cell name and `params.<name>`."""
SYNTAX = (
    "a combination such as alone/room/none (* is any text), "
    f"or KEY=VALUE,... of {', '.join(KEYS)}, {PARAMS}NAME"
)
NO_LINK, NO_EDGE = "no link", "no edge"
_KEY = rf"(?:{'|'.join(KEYS)}|params\.\w+)="

Facts = Mapping[str, tuple[str, ...]]
"""Names of a run by property; one property may have several (a system with and without variant)."""


def fits(name: str, pattern: str) -> bool:
    """Returns whether a name fits a pattern in which `*` is any text and nothing else is special:
    names have brackets, as in `ramp[peak_ms=50]`."""
    return re.fullmatch(".*".join(map(re.escape, pattern.split("*"))), name, re.S) is not None


@dataclass(frozen=True)
class Selection:
    """One selection, with the text it was parsed from."""

    text: str
    conditions: tuple[tuple[str, str], ...]
    """(property, pattern) pairs; all must match."""

    @classmethod
    def of(cls, text: str) -> "Selection":
        """Parses a selection; text without a known key is a cell name."""
        if re.match(_KEY, text) is None:
            return cls(text, ((CELL, text),))
        parts = (part.partition("=") for part in re.split(rf",\s*(?={_KEY})", text))
        return cls(text, tuple((key, pattern.strip()) for key, _, pattern in parts))

    @property
    def keys(self) -> frozenset[str]:
        """The properties that the selection tests."""
        return frozenset(key for key, _ in self.conditions)

    def holds(self, facts: Facts) -> bool:
        """Returns whether the selection matches a run."""
        return all(
            any(fits(name, pattern) for name in facts.get(key, ()))
            for key, pattern in self.conditions
        )

    def missed(self, runs: list[Facts], option: str) -> SlambedError:
        """Returns the error for a selection that matches no run: the failing condition and the
        known values."""
        for key, pattern in self.conditions:
            known = list(dict.fromkeys(name for facts in runs for name in facts.get(key, ())))
            if not any(fits(name, pattern) for name in known):
                break
        else:
            return SlambedError(f"{option} {self.text} is no combination: no run has all of that")
        reported = ", ".join(known) or "none"
        if key != CELL:
            return SlambedError(f"{option} {self.text} is no combination; {key}: {reported}")
        hint = f"; or KEY=VALUE of {', '.join(KEYS)}, {PARAMS}NAME" if "=" in self.text else ""
        return SlambedError(
            f"{option} {self.text} is no combination; combinations: {reported}{hint}"
        )


def meant(runs: list[Facts], texts: Iterable[str], option: str) -> list[bool]:
    """Returns for each run whether any selection matches it; without selections all match.
    Raises SlambedError for a selection that matches no run."""
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
    """Returns the properties of a planned or finished run."""
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
