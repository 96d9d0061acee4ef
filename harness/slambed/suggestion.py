# SPDX-License-Identifier: Apache-2.0
"""Suggestions for mistyped names."""

from collections.abc import Iterable
from difflib import get_close_matches


def suggestion(word: str, known: Iterable[str]) -> str:
    """Returns `did you mean 'x'?` for a near miss, else the list of known names."""
    names = sorted({str(name) for name in known})  # a key of YAML may be a number
    return _near(word, names) or (f"known: {', '.join(names)}" if names else "")


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Returns `, did you mean 'x'?` for a near miss, else nothing; the known names are listed
    elsewhere."""
    near = _near(word, [str(name) for name in known])
    return f", {near}" if near else ""


def _near(word: str, names: list[str]) -> str:
    in_any_case = {name.lower(): name for name in names}
    close = get_close_matches(word.lower(), in_any_case, n=1, cutoff=0.6)
    # A name's beginning, as `ate` of ate_rmse_m, is too short to be near.
    longer = [name for name in in_any_case if name.startswith(f"{word.lower()}_")]
    found = (close or longer)[:1]
    return f"did you mean '{in_any_case[found[0]]}'?" if found else ""
