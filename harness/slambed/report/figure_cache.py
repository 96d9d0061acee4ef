# SPDX-License-Identifier: Apache-2.0
"""Remembers which figures of a report exist: what each was drawn from, and its output."""

import hashlib
import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pandas as pd

import slambed
from slambed.files.json_file import read_object
from slambed.report.load import Results
from slambed.report.style import FigureWriter, SavedFigure

LIST = "drawn.json"
DRAWING = ("report", "metrics", "data")
"""Packages whose code affects figures."""
LIBRARIES = ("matplotlib", "numpy", "pandas", "scipy")
RUN_FILES = (
    "events.parquet", "samples.parquet", "link.parquet", "trajectory.txt", "trajectory_live.txt",
)  # fmt: skip


def made_of(rows: pd.DataFrame, *words: str) -> str:
    """Returns a digest of the rows that a figure shows."""
    whole = hashlib.sha256("\0".join(words).encode())
    whole.update(rows.to_csv(index=False).encode())
    return whole.hexdigest()


def files_of(results: Results, rows: pd.DataFrame) -> str:
    """Returns a digest of the files of these runs and their ground truths, by size and modification
    time."""
    paths = [results.run_dir(str(key)) / name for key in rows["run_key"] for name in RUN_FILES]
    paths += [results.groundtruth_file(str(name)) for name in rows["dataset"].dropna().unique()]
    whole = hashlib.sha256()
    for path in paths:
        try:
            status = path.stat()
        except OSError:
            whole.update(b"none ")
        else:
            whole.update(f"{status.st_size} {status.st_mtime_ns} ".encode())
    return whole.hexdigest()


@cache
def drawing_code() -> str:
    """Returns a digest of all code that draws."""
    root = Path(slambed.__file__).parent
    whole = hashlib.sha256(" ".join(map(version, LIBRARIES)).encode())
    for package in DRAWING:
        for path in sorted((root / package).rglob("*.py")):
            whole.update(path.read_bytes())
    return whole.hexdigest()


@dataclass
class Made:
    """The output of one job."""

    figures: list[SavedFigure] = field(default_factory=list)
    empty: list[str] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)

    @classmethod
    def of_json(cls, content: dict[str, Any]) -> "Made":
        """Restores it from JSON."""
        figures = [SavedFigure(**item) for item in content["figures"]]
        return cls(figures, content["empty"], content["problems"])


class FigureCache:
    """The figures of the folder's last report."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / LIST
        self._before = read_object(self._path) or {}
        self._now: dict[str, Made] = {}
        # If this report is killed while it draws, the next one must not reuse its figures.
        self._path.unlink(missing_ok=True)

    def keeps(self, made_of: str, results: Results, writer: FigureWriter) -> bool:
        """Returns whether all figures of a job exist; if so, they count as drawn."""
        key = self._key(made_of, writer)
        if (content := self._before.get(key)) is None:
            return False
        found = Made.of_json(content)
        if not all(writer.has(figure) for figure in found.figures):
            return False
        writer.saved += found.figures
        writer.empty += found.empty
        for line in found.problems:
            results.complain(line)
        self._now[key] = found
        return True

    @contextmanager
    def notes(self, made_of: str, results: Results, writer: FigureWriter) -> Iterator[None]:
        """Records what is drawn inside the context; nothing if it raises."""
        figures, empty = len(writer.saved), len(writer.empty)
        problems = len(results.problems)
        yield
        self._now[self._key(made_of, writer)] = Made(
            writer.saved[figures:], writer.empty[empty:], results.problems[problems:]
        )

    def write(self) -> None:
        """Writes the list for the next report."""
        content = {key: asdict(made) for key, made in self._now.items()}
        self._path.write_text(json.dumps(content, indent=1) + "\n")

    def _key(self, made_of: str, writer: FigureWriter) -> str:
        return _digest([drawing_code(), writer.command, made_of])


def _digest(words: Iterable[str]) -> str:
    return hashlib.sha256("\0".join(words).encode()).hexdigest()
