#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""tutorials.py [PAGE ...]: plays pages of docs/tutorials, and writes their outputs and pictures.

A page is played in an empty folder, from top to bottom, as its reader would do it:

- A block with a title is a file: ```yaml title="hall.yaml" writes hall.yaml.
- A ```console block holds commands behind `$ `, each followed by what it prints.
- `<!-- made: FILE -->` above a picture names a file that a command has left in the folder; * is
  any text. The picture in docs/ is a copy of it, or shows its top as Chromium does if it is a page.

What a command prints must be what stands there, but for

- a line `...`, which is any number of lines, and `...` within a line, which is any text;
- how long something took, and keys of runs, which follow from the sources (all forms: VARYING);
- lines that prepare a sequence, because one that is kept is not prepared again;
- blanks at the end of a line.

A command must succeed, unless the page shows its line `error: ...`. The folder is shown as
/home/you/try, the cache as /home/you/.cache/slambed.

The tests hold the pages to this (harness/tests/repository/test_tutorials.py). Where an output has
changed on purpose, this program writes the new one; lines `...` stay where they can be placed. Read
the page after that: its sentences may quote the old numbers.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parent.parent
PAGES = ROOT / "docs" / "tutorials"
PROMPT = "$ "
ANYTHING = "..."
HOME = "/home/you"
COLUMNS = 160
"""Of the terminal: no table is folded."""
WIDEST_PX = 1000
"""Of a picture in docs/."""
SETTINGS = {
    ".png": [cv2.IMWRITE_PNG_COMPRESSION, 9],
    ".jpg": [cv2.IMWRITE_JPEG_QUALITY, 80],
    ".webp": [cv2.IMWRITE_WEBP_QUALITY, 50],
}
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
WINDOW_PX = (1200, 840)
SETTLED_MS = 3000
"""Of the page's own clock, until its scripts have drawn."""
LONGEST_S = 600
"""Of one command."""
FENCE = re.compile(r"^```(?P<kind>\w*)(?: title=\"(?P<title>[^\"]+)\")?\s*$")
PICTURE = re.compile(
    r"^<!-- made: (?P<made>\S+) -->\n\n?!\[[^]]*\]\((?P<target>[^)]+)\)", re.MULTILINE
)
TIME = r"(?:\d+ h )?(?:\d+ min )?[\d.]+ s"
VARYING = [
    (re.compile(rf"\({TIME}; {TIME} left\)"), "(TIME)"),
    (re.compile(rf"about {TIME}"), "about TIME"),
    (re.compile(rf"\b(takes|took|in) {TIME}"), r"\1 TIME"),
    (
        re.compile(r"takes [\d.]+ ms \(median, without limits\)"),
        "takes TIME (median, without limits)",
    ),
    (re.compile(r"\b[0-9a-f]{16}\b"), "KEY"),
    (re.compile(r"(prepared/\w+)-[0-9a-f]{12}\b"), r"\1-KEY"),
]
ONCE = re.compile(r"^(preparing|generating) .*\n?", re.MULTILINE)
PIXELS_APART, SHARE_APART = 64, 0.03
"""So much may so many of a picture's pixels differ: fonts are drawn differently elsewhere."""


@dataclass
class Command:
    """Of a ```console block: what is typed, and what stands below it."""

    line: int
    typed: str
    shown: str = ""
    printed: str | None = None
    exit_code: int = 0

    def differs(self) -> bool:
        """Whether it prints something else now."""
        return not matches(self.shown, self.printed or "")

    def fails(self) -> bool:
        """Whether it ends with an error that the page does not show."""
        return self.exit_code != 0 and not re.search("^error: ", self.shown, re.MULTILINE)


@dataclass
class Block:
    """Between two fences: a file, or commands."""

    first: int
    last: int
    title: str
    text: str
    commands: list[Command] = field(default_factory=list)


def blocks(text: str) -> list[Block]:
    """Those that are played: with a title, or of commands."""
    found: list[Block] = []
    lines = text.splitlines()
    begin: tuple[int, str, str] | None = None
    for number, line in enumerate(lines):
        if begin is None:
            if fence := FENCE.match(line):
                begin = (number, fence["kind"], fence["title"] or "")
        elif line.startswith("```"):
            first, kind, title = begin
            body = lines[first + 1 : number]
            if kind == "console":
                found.append(Block(first, number, "", "", _commands(body, first + 2)))
            elif title:
                found.append(Block(first, number, title, "\n".join([*body, ""])))
            begin = None
    return found


def _commands(body: list[str], first: int) -> list[Command]:
    found: list[Command] = []
    for number, line in enumerate(body, first):
        if line.startswith(PROMPT):
            found.append(Command(number, line.removeprefix(PROMPT)))
        elif not found:
            raise ValueError(f"line {number}: an output without a command")
        else:
            found[-1].shown += line + "\n"
    return found


def normal(text: str) -> str:
    """Without what may be another next time."""
    text = "\n".join(line.rstrip() for line in ONCE.sub("", text).splitlines())
    for pattern, instead in VARYING:
        text = pattern.sub(instead, text)
    return text.strip("\n")


def matches(shown: str, printed: str) -> bool:
    """Whether an output is the one that stands there."""
    parts = []
    for line in normal(shown).splitlines():
        if line == ANYTHING:
            parts.append(r"(?:.*\n)*")
        else:
            parts.append(".*".join(map(re.escape, line.split(ANYTHING))) + r"\n")
    text = normal(printed)
    return re.fullmatch("".join(parts), text + "\n" if text else "") is not None


class Player:
    """A reader's machine: an empty folder, and `slambed` and `python` as commands."""

    def __init__(self, place: Path, cache: Path, programs: Path) -> None:
        self.folder = place / "home" / "you" / "try"
        self.folder.mkdir(parents=True)
        self._shown = {
            str(cache): f"{HOME}/.cache/slambed",
            str(place / "home"): "/home",
        }
        self._environment = {
            **os.environ,
            "HOME": str(self.folder.parent),
            "PATH": f"{programs}:{os.environ['PATH']}",
            "PYTHONPATH": str(ROOT / "harness"),
            "COLUMNS": str(COLUMNS),
            "SLAMBED_CACHE": str(cache),
            "SLAMBED_DATA_BESIDE": "no",
            "NO_COLOR": "1",
        }

    def play(self, block: Block) -> None:
        """Writes the file, or runs the commands and keeps what they print."""
        if block.title:
            path = self.folder / block.title
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block.text, encoding="utf-8")
        for command in block.commands:
            done = subprocess.run(
                ["bash", "-c", command.typed],
                cwd=self.folder,
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                timeout=LONGEST_S,
                check=False,
            )
            command.exit_code = done.returncode
            command.printed = done.stdout
            for inside, outside in self._shown.items():
                command.printed = command.printed.replace(inside, outside)

    def made(self, pattern: str) -> Path:
        """The picture that the one file of that name is or, if it is a page, looks like."""
        found = sorted(self.folder.glob(pattern))
        if len(found) != 1:
            raise ValueError(f"{pattern} is {len(found)} files")
        return photograph(found[0]) if found[0].suffix == ".html" else found[0]


def programs(place: Path) -> Path:
    """A folder with the commands of this environment, for these sources."""
    folder = place / "bin"
    folder.mkdir()
    start = "import sys; sys.argv.pop(0); from slambed.start import main; main()"
    (folder / "slambed").write_text(
        f"#!/bin/sh\nexec '{sys.executable}' -c '{start}' slambed \"$@\"\n"
    )
    (folder / "python").write_text(f"#!/bin/sh\nexec '{sys.executable}' \"$@\"\n")
    for path in folder.iterdir():
        path.chmod(0o755)
    return folder


def browser() -> str | None:
    """The first Chromium of this machine."""
    return next((found for name in BROWSERS if (found := shutil.which(name))), None)


def photograph(page: Path) -> Path:
    """The top of a page, as a picture beside it. Raises ValueError where there is no Chromium."""
    program, target = browser(), page.with_suffix(".top.png")
    if program is None:
        raise ValueError(f"a picture of {page.name} needs one of: {', '.join(BROWSERS)}")
    command = [
        program, "--headless", "--disable-gpu", "--hide-scrollbars",
        f"--window-size={WINDOW_PX[0]},{WINDOW_PX[1]}",
        f"--virtual-time-budget={SETTLED_MS}", f"--screenshot={target}",
        # Chromium's sandbox does not support root.
        *(["--no-sandbox"] if os.geteuid() == 0 else []), page.resolve().as_uri(),
    ]  # fmt: skip
    subprocess.run(command, check=True, capture_output=True, timeout=LONGEST_S)
    return target


def pictures(page: Path) -> list[tuple[str, Path]]:
    """What a command makes, and the picture of docs/ that is a copy of it."""
    found = PICTURE.finditer(page.read_text(encoding="utf-8"))
    return [(one["made"], (page.parent / one["target"]).resolve()) for one in found]


def same_picture(one: Path, other: Path) -> bool:
    """Whether two pictures show the same."""
    a, b = shown(one).astype(int), shown(other).astype(int)
    if a.shape != b.shape:
        return False
    apart = np.abs(a - b).max(axis=2) > PIXELS_APART
    return float(apart.mean()) <= SHARE_APART


def shown(picture: Path) -> NDArray[np.uint8]:
    """A picture as wide as a page shows it."""
    pixels = cv2.imread(str(picture), cv2.IMREAD_COLOR)
    scale = min(1.0, WIDEST_PX / pixels.shape[1])
    if scale < 1:
        pixels = cv2.resize(pixels, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return pixels


def copy_picture(source: Path, target: Path) -> None:
    """As wide as a page shows it, in the format of the copy's name."""
    target.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(target), shown(source), SETTINGS[target.suffix])


def elided(shown: str, printed: str) -> list[str]:
    """An output with `...` where the page has it now; whole where that cannot be placed."""
    lines = [line.rstrip() for line in ONCE.sub("", printed).strip("\n").splitlines()]
    parts: list[list[str]] = [[]]
    for line in shown.splitlines():
        if line == ANYTHING:
            parts.append([])
        else:
            parts[-1].append(line)
    if len(parts) == 1:
        return lines
    kept: list[str] = []
    for number, part in enumerate(parts):
        if number == len(parts) - 1:
            found = len(lines) - len(part)
        elif number == 0:
            found = 0
        else:
            same = [i for i, line in enumerate(lines) if normal(line) == normal(part[0])]
            if not same:
                return lines
            found = same[0]
        kept += ([ANYTHING] if number else []) + lines[found : found + len(part)]
    return kept


def renewed(block: Block) -> list[str]:
    """The lines of a block of commands with what they print now."""
    lines = []
    for command in block.commands:
        lines.append(PROMPT + command.typed)
        if command.differs():
            lines += elided(command.shown, command.printed or "")
        else:
            lines += command.shown.splitlines()
    return lines


def renew(page: Path, player: Player) -> bool:
    """Plays a page and writes it; False where a command fails that should not."""
    text = page.read_text(encoding="utf-8")
    lines, found, good = text.splitlines(), blocks(text), True
    for block in found:
        player.play(block)
        for command in block.commands:
            where = f"{page.name}:{command.line}: {command.typed}"
            if command.fails():
                good = False
                print(f"{where}: ends with {command.exit_code}\n{command.printed}")
            if command.differs():
                print(f"{where}: another output")
    for block in reversed(found):
        if block.commands:
            lines[block.first + 1 : block.last] = renewed(block)
    page.write_text("\n".join([*lines, ""]), encoding="utf-8")
    for pattern, target in pictures(page) if good else []:
        source = player.made(pattern)
        if not target.exists() or not same_picture(source, target):
            print(f"{target.relative_to(ROOT)}: another picture")
            copy_picture(source, target)
    return good


def main(names: list[str]) -> int:
    """Renews pages; 1 where a command fails that should not."""
    if unknown := set(names) - {page.stem for page in PAGES.glob("*.md")}:
        print(f"error: no page {min(unknown)} in {PAGES.relative_to(ROOT)}", file=sys.stderr)
        return 2
    good = True
    with tempfile.TemporaryDirectory(prefix="slambed-tutorials-") as folder:
        place = Path(folder)
        cache = Path(os.environ.get("SLAMBED_CACHE", place / "cache"))
        commands = programs(place)
        for page in sorted(PAGES.glob("*.md")):
            if not names or page.stem in names:
                good = renew(page, Player(place / page.stem, cache, commands)) and good
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
