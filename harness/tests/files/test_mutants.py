# SPDX-License-Identifier: Apache-2.0
"""No traceback for anybody's file: what every reader says of mutants of valid inputs.

A mutant is accepted, and what it means is sound, or refused in one line that names a file. To
repeat one: `SLAMBED_MUTANTS=SEED-SEED pytest harness/tests/files/test_mutants.py -k READER`.
"""

from __future__ import annotations

import os
import re
import signal
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType

import pytest
from mutated_readers import SUBJECTS, Subject, UnsoundError
from mutator import Files, empty, write

from slambed.errors import ExitCode, SlambedError
from slambed.failures import line_and_code

COUNT, NIGHTLY_COUNT = 200, 5000
GIVEN = "SLAMBED_MUTANTS"
"""Seeds to take instead, FIRST-LAST."""
LONGEST_S = 5.0
"""Of CPU time, for inputs of a few kilobytes."""
LARGEST_BYTES = 300 << 20
"""More memory than this nobody needs for them."""
LONGEST_LINE = 1500
_UNAVOIDED = re.compile(
    rb"libpng (error|warning): (bad adaptive filter value|Not enough image data|IDAT: .*)\n"
    rb"|(Corrupt JPEG data|Premature end of JPEG|Inconsistent progression|Invalid SOS).*\n"
    rb"|Warning: unknown JFIF revision number .*\n"
)
"""What libpng says beside our line of a PNG whose checksums are right and whose pixels are not, and
libjpeg of a JPEG that it shows as far as it can: OpenCV does not report that."""
SHOWN = 12
PLACES = {"'tiny'", "walk", "cache/prepared", "tiny/experiment.json"}
"""What a line may name besides the files of the input."""
OURS = {"in", "out", "stderr", "mutant"}


class Hang(BaseException):
    """Nothing may catch it."""


@dataclass
class Findings:
    """What came of the mutants of one reader."""

    outcomes: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        return ", ".join(f"{count} {kind}" for kind, count in sorted(self.outcomes.items()))


@contextmanager
def _limited() -> Iterator[None]:
    def strike(number: int, frame: FrameType | None) -> None:
        raise Hang(f"not done after {LONGEST_S:g} s of CPU time")

    before = signal.signal(signal.SIGPROF, strike)
    signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


@contextmanager
def _standard_error(kept: Path) -> Iterator[None]:
    """Libraries in C write there past Python."""
    before = os.dup(2)
    with kept.open("wb") as file:
        os.dup2(file.fileno(), 2)
    try:
        yield
    finally:
        os.dup2(before, 2)
        os.close(before)


def _forget_peak() -> None:
    Path("/proc/self/clear_refs").write_text("5")


def _peak_bytes(name: str) -> int:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(name):
            return int(line.split()[1]) << 10
    return 0


def judge(subject: Subject, files: Files, place: Path, meaning: str) -> tuple[str, str]:
    """What kind of outcome it is, and what is wrong with it."""
    source, work = empty(place / "in"), empty(place / "out")
    try:
        write(files, source)
    except (OSError, ValueError):
        return "no file system takes it", ""
    there = _listed(source)
    _forget_peak()
    before_bytes = _peak_bytes("VmRSS")
    kind, wrong = "", ""
    said = place / "stderr"
    try:
        with _limited(), _standard_error(said), warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            found = subject.read(source, work)
        kind = "same meaning" if found == meaning else "another meaning"
    except SlambedError as error:
        kind = "one line"
        wrong = _wrong_line(error, there | set(subject.files()))
    except UnsoundError as unsound:
        wrong = f"accepted, {unsound}"
    except (Exception, Hang) as error:
        where = traceback.extract_tb(error.__traceback__)[-3:]
        steps = " < ".join(f"{Path(w.filename).name}:{w.lineno}" for w in reversed(where))
        wrong = f"{type(error).__name__}: {str(error)[:300]} at {steps}"
    if not wrong and warned:
        wrong = f"warns: {warned[0].message} at {Path(warned[0].filename).name}:{warned[0].lineno}"
    if not wrong and (printed := _UNAVOIDED.sub(b"", said.read_bytes())):
        wrong = f"a library prints: {printed[:200].decode('utf-8', 'replace')}"
    grown = _peak_bytes("VmHWM") - before_bytes
    if not wrong and grown > LARGEST_BYTES:
        wrong = f"takes {grown >> 20} MiB"
    if not wrong and (stray := _listed(source) ^ there):
        wrong = f"changed the input folder: {min(stray)}"
    if not wrong and {path.name for path in place.iterdir()} != OURS:
        wrong = "wrote outside its folder"
    halves = [p for p in work.rglob("*") if "partial" in p.name or ".old-" in p.name]
    if not wrong and halves:
        wrong = f"left {halves[0].relative_to(work)}"
    return kind, wrong


def _listed(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def _wrong_line(error: SlambedError, there: set[str]) -> str:
    line, code = line_and_code(error)
    if code not in (ExitCode.BAD_INPUT, ExitCode.ENVIRONMENT) or not line.strip():
        return f"exit code {code}: {line}"
    if len(line.splitlines()) != 1:
        return f"several lines: {line!r}"
    if not line.isprintable():
        return f"what no terminal should get: {line[:300]!r}"
    if len(line) > LONGEST_LINE:
        return f"{len(line)} characters: {line[:200]}"
    if "bug of slambed" in line:
        return line
    names = {Path(name).name for name in there} | {
        "'tiny'",
        "walk",
        "cache/prepared",
        "tiny/experiment.json",
    }
    if not any(name in line for name in names):
        return f"names no file: {line}"
    return ""


def seeds(count: int) -> range:
    given = os.environ.get(GIVEN)
    if not given:
        return range(count)
    first, _, last = given.partition("-")
    return range(int(first), int(last or first) + 1)


def examine(subject: Subject, chosen: range, place: Path) -> Findings:
    source = empty(place / "in")
    write(subject.files(), source)
    meaning = subject.read(source, empty(place / "out"))
    findings = Findings()
    for seed in chosen:
        files, steps = subject.mutant(seed)
        # For whoever ends a process that hangs in C, where no alarm strikes.
        (place / "mutant").write_text(f"{subject.name} {seed} {steps}")
        kind, wrong = judge(subject, files, place, meaning)
        findings.outcomes["wrong" if wrong else kind] += 1
        if wrong:
            findings.wrong.append(f"{subject.name} {seed} ({'; '.join(steps)}): {wrong}")
    return findings


def check(subject: Subject, chosen: range, place: Path) -> None:
    began = time.process_time()
    with tempfile.TemporaryDirectory(dir=place) as folder:
        findings = examine(subject, chosen, Path(folder))
    took = time.process_time() - began
    print(f"{subject.name}: {len(chosen)} mutants, {findings}, {took:.1f} s of CPU time")
    repeat = f"repeat one: {GIVEN}=SEED pytest {Path(__file__).name} -k {subject.name}"
    assert not findings.wrong, "\n".join([*findings.wrong[:SHOWN], repeat])


@pytest.mark.parametrize("subject", SUBJECTS, ids=lambda subject: subject.name)
def test_a_mutant_is_read_or_refused_in_one_line(subject: Subject, tmp_path: Path) -> None:
    check(subject, seeds(COUNT), tmp_path)


@pytest.mark.nightly
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("subject", SUBJECTS, ids=lambda subject: subject.name)
def test_thousands_of_mutants(subject: Subject, tmp_path: Path) -> None:
    check(subject, seeds(NIGHTLY_COUNT), tmp_path)
