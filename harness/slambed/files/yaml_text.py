# SPDX-License-Identifier: Apache-2.0
"""Safe YAML parsing (no Python tags), with the C parser where PyYAML has it: 10 times as fast."""

import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import yaml
from yaml.constructor import ConstructorError
from yaml.reader import ReaderError

DEEPEST = 100
"""Levels of a document. The parser in C crashes on some ten thousands of them."""
MOST_VALUES = 1_000_000
"""Of a document, with what its aliases stand for: nine lines can stand for a billion."""
LARGEST = 2**63 - 1
"""Of whole numbers: what is larger fits no program that reads what is made of it."""
_OF_A_VALUE = (ValueError, IndexError, KeyError, OverflowError, TypeError, AttributeError)
"""PyYAML's own way to refuse `!!int x`, a month 13 and a number of 5,000 digits."""
_UNKNOWN_TAG = re.compile(r"could not determine a constructor for the tag '([^']*)'")
Read = TypeVar("Read")
if TYPE_CHECKING:
    _Base = yaml.SafeLoader
else:
    _Base = object


class _Checked(_Base):
    """Everything that a document can be wrong by is a YAMLError."""

    def __init__(self, text: str) -> None:
        _must_be_flat(text)
        super().__init__(text)

    def get_single_node(self) -> yaml.Node | None:
        """The document, which is finite and has each key once."""
        root: yaml.Node | None = super().get_single_node()
        if root is not None:
            _count(root, {}, 1)
        return root

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        """The value of a node."""
        try:
            value = super().construct_object(node, deep)
        except _OF_A_VALUE:
            kind = node.tag.rpartition(":")[2]
            shown = f"'{node.value[:40]}'" if isinstance(node, yaml.ScalarNode) else "this"
            raise ConstructorError(
                None, None, f"{shown} is not of type {kind}", node.start_mark
            ) from None
        if type(value) is int and not -LARGEST <= value <= LARGEST:
            problem = f"'{node.value[:40]}' is larger than {LARGEST}"
            raise ConstructorError(None, None, problem, node.start_mark)
        return value


class _Plain(_Checked, yaml.SafeLoader):
    pass


class _Fast(_Checked, getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    pass


FAST: type[yaml.SafeLoader] = _Fast


def with_parser(read: Callable[[type[yaml.SafeLoader]], Read]) -> Read:
    """Calls `read` with the C parser and, if that fails, with the Python one. The latter accepts
    some valid YAML that the former rejects (`{a:}`), and its errors are clearer."""
    try:
        return read(FAST)
    except yaml.YAMLError:
        return read(_Plain)


def problem_of(error: yaml.YAMLError, text: str) -> tuple[str, int]:
    """Returns what is wrong with `text`, and in which line (from 1)."""
    if isinstance(error, ReaderError):
        # The parser says so before it counts lines.
        code = error.character if isinstance(error.character, int) else ord(error.character)
        return f"{error.reason}: {code:#x}", text.count("\n", 0, error.position) + 1
    mark = getattr(error, "problem_mark", None)
    problem = getattr(error, "problem", None) or str(error).splitlines()[0]
    if problem == "but found another document":
        problem = "a second document begins with '---', expected one"
    if (tag := _UNKNOWN_TAG.search(problem)) is not None:
        problem = f"unknown tag '{tag[1].removeprefix('tag:yaml.org,2002:')}'"
    problem = problem.replace("'<stream end>'", "the end of the file")
    return problem, 1 if mark is None else mark.line + 1


def read_yaml(text: str) -> Any:
    """Parses the single document in `text`. Raises yaml.YAMLError, for a key that is given twice,
    too."""
    return with_parser(lambda parser: yaml.load(text, Loader=parser))


def _must_be_flat(text: str) -> None:
    """Levels are counted before they are built, but only where there may be too many."""
    longest = max(map(len, text.splitlines()), default=0)
    if text.count("[") + text.count("{") + 2 * longest <= DEEPEST:
        return
    level = 0
    for event in yaml.parse(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader)):
        if isinstance(event, yaml.CollectionStartEvent):
            level += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            level -= 1
        if level > DEEPEST:
            raise _too_deep(event.start_mark)


def _count(node: yaml.Node, counts: dict[int, int], level: int) -> int:
    """Values in a node; 0 of one that is being counted, which is inside itself then."""
    known = counts.get(id(node))
    if known == 0:
        raise ConstructorError(None, None, "an alias stands for what it is in", node.start_mark)
    if known is not None:
        return known
    if level > DEEPEST:
        raise _too_deep(node.start_mark)
    counts[id(node)] = 0
    inside: list[yaml.Node] = []
    if isinstance(node, yaml.SequenceNode):
        inside = node.value
    elif isinstance(node, yaml.MappingNode):
        _must_be_once(node)
        inside = [part for pair in node.value for part in pair]
    total = 1 + sum(_count(part, counts, level + 1) for part in inside)
    if total > MOST_VALUES:
        problem = f"more than {MOST_VALUES:,} values, with what aliases stand for"
        raise ConstructorError(None, None, problem, node.start_mark)
    counts[id(node)] = total
    return total


def _must_be_once(mapping: yaml.MappingNode) -> None:
    """PyYAML would take the last of two values of a key."""
    written: set[tuple[str, str]] = set()
    for key, _ in mapping.value:
        if isinstance(key, yaml.ScalarNode) and key.value != "<<":
            if (name := (key.tag, key.value)) in written:
                problem = f"key '{key.value}' is given twice"
                raise ConstructorError(None, None, problem, key.start_mark)
            written.add(name)


def _too_deep(mark: Any) -> ConstructorError:
    return ConstructorError(None, None, f"more than {DEEPEST} levels", mark)
