# SPDX-License-Identifier: Apache-2.0
"""The run that somebody means: a folder, or some digits of a key."""

from pathlib import Path

from slambed.errors import SlambedError

LEAST_DIGITS = 4


def find_run(run: str, results: Path) -> Path:
    """A run folder by its path, or by its key or the beginning of it.

    Where an experiment has the run, the folder is the one there: what is not resolved leads to the
    experiment. A run that several experiments share is one. Raises SlambedError for none or many.
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
    raise SlambedError(
        f"no run '{run}' in {results}; give a run folder or at least {LEAST_DIGITS} digits of a key"
    )
