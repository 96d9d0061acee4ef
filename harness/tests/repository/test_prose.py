# SPDX-License-Identifier: Apache-2.0
"""Pages for readers: no sentence above 30 words, and none of the words that only this project uses.

Code, tables, generated parts and headings are left out. Logbook and reference may be dense.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from slambed.native import repository_root

PAGES = ("README.md", "docs/index.md")
FOLDERS = ("docs/tutorials", "docs/how-to", "docs/explanation", "docs/papers")
LONGEST = 30
"""Words of a sentence."""
OURS = {
    r"\bwhoever\b": "the one who acts, or 'if you'",
    r"\b(to be|not) trusted\b": "valid",
    r"\bof which nothing\b": "a sentence with a subject that acts",
    r"\bby its own\b": "'on its own', or by what",
    r"\bat hand\b": "'here', 'current', or its name",
    r"\bstands? (on|beside)\b": "'depends on', 'next to'",
    r"\b(put|puts|putting) (\w+ )?beside\b": "compare",
    r"\b(is|are|was|were|be|been) told\b": "reported, shown",
    r"\bas it is (?!possible|likely|clear)": "unchanged",
}
"""What a reader of the field does not know as a term, and what to write instead."""
FENCE = re.compile(r"^\s*(```+|~~~+)")
ITEM = re.compile(r"^\s*([-*+]|\d+\.)\s+")
# A sentence ends before a capital letter, a digit, code, a quote or our name.
SHORT = "".join(rf"(?<!\b{word})" for word in (r"e\.g", r"i\.e", "vs", "cf", "Sec", "Fig"))
END = re.compile(SHORT + r"[.?!][)\"'*_]*\s+(?=[A-Z0-9`\"'(*_\[]|slambed\b)")
WORD = re.compile(r"[^\s]*[^\W_][^\s]*")


@dataclass(frozen=True)
class Sentence:
    """One sentence, and the line that it begins in."""

    line: int
    text: str

    @property
    def words(self) -> int:
        return len(WORD.findall(self.text))


def paragraphs(text: str) -> Iterator[list[tuple[int, str]]]:
    """Lines with their numbers, joined to paragraphs and list items; no code, tables, headings."""
    block: list[tuple[int, str]] = []
    fence = ""
    hidden = ""
    for number, line in enumerate(text.splitlines(), 1):
        opened = FENCE.match(line)
        if fence or opened:
            if opened and not fence:
                fence = opened[1]
            elif opened and opened[1].startswith(fence):
                fence = ""
            ended = True
        elif hidden or line.lstrip().startswith(("<!--", "<")):
            generated = re.match(r"<!-- table (\S+):", line)
            if generated:
                hidden = f"<!-- end of table {generated[1]} -->"
            elif hidden:
                hidden = "" if hidden in line else hidden
            elif line.lstrip().startswith("<!--") and "-->" not in line:
                hidden = "-->"
            ended = True
        else:
            code = line.startswith("    ") and not block
            ended = not line.strip() or line.lstrip().startswith(("|", "#", "![")) or code
        if (ended or ITEM.match(line)) and block:
            yield block
            block = []
        if not ended:
            block.append((number, ITEM.sub("", line, count=1)))
    if block:
        yield block


def plain(line: str) -> str:
    """The line as it is read: pictures gone, links as their text, code as one word."""
    line = re.sub(r"!\[[^]]*\]\([^)]*\)", "", line)
    line = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", line)
    return re.sub(r"`+[^`]*`+", "`code`", line)


def sentences(text: str) -> Iterator[Sentence]:
    for block in paragraphs(text):
        joined, lines = "", []
        for number, line in block:
            lines.append((len(joined), number))
            joined += line.strip() + " "
        begins = 0
        for end in [*(found.end() for found in END.finditer(joined)), len(joined)]:
            part = joined[begins:end].strip()
            if part:
                number = max(line for start, line in lines if start <= begins)
                yield Sentence(number, plain(part))
            begins = end


def pages() -> list[Path]:
    root = repository_root()
    single = [root / name for name in PAGES if (root / name).exists()]
    return single + [path for name in FOLDERS for path in sorted((root / name).rglob("*.md"))]


def complaints(path: Path, text: str) -> Iterator[str]:
    for sentence in sentences(text):
        where = f"{path}:{sentence.line}"
        if sentence.words > LONGEST:
            yield f"{where}: {sentence.words} words: {sentence.text[:60]}..."
        for word, better in OURS.items():
            if found := re.search(word, sentence.text, re.IGNORECASE):
                yield f"{where}: '{found[0]}': write {better}"


def test_pages_for_readers_have_short_sentences_and_words_of_the_field() -> None:
    root = repository_root()
    found = [
        line
        for path in pages()
        for line in complaints(path.relative_to(root), path.read_text(encoding="utf-8"))
    ]
    assert not found, "\n".join(["", *found])


def test_readme_links_to_what_is_there() -> None:
    root = repository_root()
    for name in ("README.md", "CHANGELOG.md"):
        text = (root / name).read_text(encoding="utf-8")
        targets = re.findall(r"\]\(([^)\s#]+)[^)]*\)", text)
        targets += re.findall(r"(?:href|src)=\"([^\"#]+)", text)
        missing = [t for t in targets if ":" not in t and not (root / t).exists()]
        assert not missing, f"{name} links to {missing}"


def test_only_prose_is_read() -> None:
    text = """# A heading which is not a sentence

One sentence. And `code with many words in it` is
one word; [a link](https://example.org/x_y) its text.

- an item
  that goes on
- another, e.g. Edge-SLAM

| a | table |
<!-- table run: generated -->
whoever writes this is a program
<!-- end of table run -->
```console
$ whoever reads this
```

    whoever indents this
"""
    found = [(s.line, s.words, s.text) for s in sentences(text)]
    assert found == [
        (3, 2, "One sentence."),
        (3, 9, "And `code` is one word; a link its text."),
        (6, 5, "an item that goes on"),
        (8, 3, "another, e.g. Edge-SLAM"),
    ]
    assert not list(complaints(Path("page.md"), text))


def test_a_long_sentence_and_a_word_of_ours_are_named_with_their_line() -> None:
    text = "Short.\nWhoever reads\nthis.\n\n" + "word " * 31 + "\n"
    assert list(complaints(Path("page.md"), text)) == [
        "page.md:2: 'Whoever': write the one who acts, or 'if you'",
        "page.md:5: 31 words: " + ("word " * 31)[:60] + "...",
    ]
