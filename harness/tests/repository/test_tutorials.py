# SPDX-License-Identifier: Apache-2.0
"""Every tutorial does what stands there.

A page is played in an empty folder, its commands typed as they stand there, and what they print is
compared with the page. What may differ, and how a page is written so that it can be played, says
tools/tutorials.py, which also writes changed outputs and pictures into the pages:

    .venv/bin/python tools/tutorials.py [PAGE ...]

Two pages are played whenever tests run, the others in the nightly.
"""

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType

import pytest
from virtual_parts import needs_programs

from slambed.native import repository_root

DOCS = repository_root() / "docs"
PAGES = sorted((DOCS / "tutorials").glob("*.md"))
IN_THE_GATE = {"own-slam", "own-recording"}
MOST_BYTES = 150_000
MOST_BYTES_IN_README = 60_000
"""Of a picture that README.md shows, because everybody loads that page."""


def _tool() -> ModuleType:
    path = repository_root() / "tools" / "tutorials.py"
    spec = importlib.util.spec_from_file_location("tutorials", path)
    assert spec is not None and spec.loader is not None
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


TOOL = _tool()
PLAYED = [page for page in PAGES if TOOL.blocks(page.read_text(encoding="utf-8"))]


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(scope="module")
def commands(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return TOOL.programs(tmp_path_factory.mktemp("commands"))


@needs_programs
@pytest.mark.timeout(900)
@pytest.mark.parametrize(
    "page",
    [
        pytest.param(
            page, id=page.stem, marks=[] if page.stem in IN_THE_GATE else pytest.mark.nightly
        )
        for page in PLAYED
    ],
)
def test_a_tutorial_does_what_stands_there(
    page: Path, tmp_path: Path, cache: Path, commands: Path
) -> None:
    player = TOOL.Player(tmp_path, cache, commands)
    wrong = []
    for block in TOOL.blocks(page.read_text(encoding="utf-8")):
        player.play(block)
        for command in block.commands:
            if command.fails() or command.differs():
                where = f"{page.name}:{command.line}: {command.typed}"
                wrong.append(f"{where}\n{command.printed}\ninstead of\n{command.shown}")
    assert not wrong, "\n".join(wrong)
    for pattern, picture in TOOL.pictures(page):
        if pattern.endswith(".html") and TOOL.browser() is None:
            continue
        assert TOOL.same_picture(player.made(pattern), picture), f"{pattern} is not {picture}"


def test_all_tutorials_are_played() -> None:
    assert {page.stem for page in PAGES} - {page.stem for page in PLAYED} == {"index"}
    assert {page.stem for page in PLAYED} > IN_THE_GATE
    index = (DOCS / "tutorials" / "index.md").read_text(encoding="utf-8")
    assert all(f"({page.name})" in index for page in PLAYED)


def test_every_picture_of_a_tutorial_is_made_by_it_and_small() -> None:
    for page in PLAYED:
        shown = page.read_text(encoding="utf-8").count("\n![")
        assert shown == len(TOOL.pictures(page)), page.name
        assert all(picture.is_file() for _, picture in TOOL.pictures(page)), page.name
    for picture in (DOCS / "pictures").iterdir():
        assert picture.stat().st_size <= MOST_BYTES, picture.name


def test_pictures_of_the_readme_are_made_by_tutorials() -> None:
    readme = (DOCS.parent / "README.md").read_text(encoding="utf-8")
    shown = [DOCS.parent / found for found in re.findall(r"<img src=\"([^\"]+)", readme)]
    assert len(shown) == 2
    made = {picture for page in PLAYED for _, picture in TOOL.pictures(page)}
    for picture in shown:
        assert picture in made and picture.stat().st_size <= MOST_BYTES_IN_README, picture.name


PRINTED = """\
preparing synthetic_room: once, it is kept
[1/2] alone: completed (11 s; 1 min 32 s left)
[2/2] offloaded: completed (2 s; 0 s left)
run 1af4c2a0be762f6f  0.26 cm
"""


@pytest.mark.parametrize(
    ("shown", "equal"),
    [
        (PRINTED, True),
        ("...\nrun 0123456789abcdef  0.26 cm\n", True),
        ("[1/2] alone: completed (3 s; 2 s left)\n...\n", True),
        ("[1/2] alone: ...\n[2/2] offloaded: completed (9 s; 1 s left)\n...\n", True),
        ("...\nrun 0123456789abcdef  0.27 cm\n", False),
        ("[1/2] alone: completed (3 s; 2 s left)\n", False),
        ("...\nrun 0123456789abcdef  0.26 cm\nreport: there\n", False),
        ("", False),
    ],
)
def test_only_what_is_declared_may_differ(shown: str, equal: bool) -> None:
    assert TOOL.matches(shown, PRINTED) is equal
    assert TOOL.matches("", "") and not TOOL.matches("something", "")


def test_a_page_is_read_as_files_and_commands() -> None:
    text = (
        'A file:\n\n```yaml title="a.yaml"\nid: a\n```\n\n```sh\nsudo not-played\n```\n\n'
        "```console\n$ one\nfirst\n\nlast\n$ two\n```\n"
    )
    file, typed = TOOL.blocks(text)
    assert (file.title, file.text) == ("a.yaml", "id: a\n")
    assert [(c.line, c.typed, c.shown) for c in typed.commands] == [
        (12, "one", "first\n\nlast\n"),
        (16, "two", ""),
    ]
    with pytest.raises(ValueError, match="without a command"):
        TOOL.blocks("```console\nlost words\n```\n")


def test_an_output_is_renewed_where_it_is_another_one() -> None:
    (block,) = TOOL.blocks("```console\n$ a\n...\nkept (3 s; 2 s left)\n$ b\nold\n```\n")
    same, other = block.commands
    same.printed, other.printed = "much\nkept (9 s; 8 s left)\n", "new  \n"
    assert TOOL.renewed(block) == ["$ a", "...", "kept (3 s; 2 s left)", "$ b", "new"]


@pytest.mark.parametrize(
    ("shown", "renewed"),
    [
        ("old\n", ["first", "table", "1 2", "last"]),
        ("...\nold\n", ["...", "last"]),
        ("old\n...\n", ["first", "..."]),
        ("old\n...\ntable\n9 9\n...\nold\n", ["first", "...", "table", "1 2", "...", "last"]),
        ("...\nanother table\n9 9\n...\nold\n", ["first", "table", "1 2", "last"]),
    ],
)
def test_what_a_page_leaves_out_stays_left_out(shown: str, renewed: list[str]) -> None:
    assert TOOL.elided(shown, "preparing room: once\nfirst\ntable  \n1 2\nlast\n") == renewed


def test_a_command_fails_only_where_the_page_shows_its_error() -> None:
    expected, unexpected = TOOL.Command(1, "a", "error: no\n"), TOOL.Command(1, "a", "fine\n")
    expected.exit_code = unexpected.exit_code = 2
    assert not expected.fails() and unexpected.fails()
