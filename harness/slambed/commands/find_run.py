# SPDX-License-Identifier: Apache-2.0
"""Finds a run by its folder or by the first digits of its key."""

from pathlib import Path

from slambed.errors import SlambedError

LEAST_DIGITS = 4


def find_run(run: str, results: Path) -> Path:
    """Returns a run folder by its path, its key, or the beginning of its key.

    Prefers the link inside an experiment's folder and does not resolve it, so that the path leads
    to the experiment. A run that several experiments share counts once. Raises SlambedError when no
    run or several match.
    """
    if (folder := Path(run)).is_dir():
        return folder.absolute()
    if len(run) >= LEAST_DIGITS:
        places = [*sorted(results.glob(f"*/runs/{run}*")), *sorted(results.glob(f"runs/{run}*"))]
        found: dict[str, Path] = {}
        for path in places:
            if path.is_dir():
                found.setdefault(path.name, path.absolute())
        if len(found) == 1:
            return next(iter(found.values()))
        if found:
            names = ", ".join(list(found)[:5])
            raise SlambedError(f"run '{run}' is not clear, {results}: {names}; give more digits")
    if keys := sorted(path.name for path in results.glob(f"{run}/runs/*")):
        raise SlambedError(
            f"{run} is an experiment; give one of its runs, such as {keys[0]} (all are in "
            f"{results / run}/summary.csv)"
        )
    raise SlambedError(
        f"no run '{run}' in {results}; give a run folder or at least {LEAST_DIGITS} digits of a "
        "key (column run_key of an experiment's summary.csv)"
    )
