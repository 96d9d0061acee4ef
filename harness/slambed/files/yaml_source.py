# SPDX-License-Identifier: Apache-2.0
"""YAML that remembers the line of every key, so that a complaint can name it."""

import re
import types
from dataclasses import dataclass, field
from datetime import date
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, Union, get_args, get_origin

import yaml
from pydantic import AfterValidator, BaseModel, Field, ValidationError
from pydantic_core import PydanticCustomError

from slambed.errors import SlambedError
from slambed.files.encodings import decode_text
from slambed.files.yaml_text import problem_of, with_parser
from slambed.suggestion import suggestion

Location = tuple[str | int | float, ...]
KINDS = {
    "bool_type": "true or false",
    "int_type": "an integer",
    "float_type": "a number",
    "int_parsing": "an integer",
    "float_parsing": "a number",
    "string_type": "text",
    "list_type": "a list",
    "tuple_type": "a list",
    "dict_type": "a mapping",
    "model_type": "a mapping",
}
"""Error type of pydantic -> what was expected, in terms of YAML."""
_EXPECTED = "expected"
"""Type of the errors of `matching`."""
_POWER_OF_TEN = re.compile(r"([+-]?\d+)(?:\.(\d*))?[eE]([+-]?)(\d+)")
"""Numbers such as 1e9, which YAML 1.1 reads as text: it wants a point and a sign."""
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+")
_OTHER_BASE = re.compile(r"[+-]?(?:0_*[0-7][0-7_]*$|[\d_.]*:)")
"""Numbers that YAML 1.1 reads in another base, which nobody means."""
Model = TypeVar("Model", bound=BaseModel)


class MisplacedError(ValueError):
    """What a validator of a whole model raises for a mistake further inside, at `location`."""

    def __init__(self, message: str, location: Location) -> None:
        super().__init__(message)
        self.location = location


@dataclass(frozen=True)
class YamlSource:
    """A parsed YAML file: its data, and where each key and list entry is written."""

    path: Path
    data: Any
    written_at: dict[Location, int | str] = field(repr=False)
    """Line (from 1), or the option of the command line that replaced it: `--set KEY=VALUE`."""

    def place_of(self, location: Location) -> str:
        """Returns where the deepest part of `location` is written, in words."""
        written: int | str = 1
        for length in range(len(location), 0, -1):
            if (found := self.written_at.get(location[:length])) is not None:
                written = found
                break
        return written if isinstance(written, str) else f"{self.path} line {written}"

    def complaint(self, what: str, location: Location = (), advice: str = "") -> SlambedError:
        """Returns an error of the form `what, where; advice`, like every error of slambed."""
        return SlambedError(
            f"{what}, {self.place_of(location)}" + (f"; {advice}" if advice else "")
        )


def load_yaml(path: Path) -> YamlSource:
    """Reads one YAML document safely (no Python tags); duplicate keys are errors."""
    return YamlSource(path, *_parsed(_text(path), str(path)))


def value_of(text: str, where: str) -> Any:
    """Parses a value that stands alone, such as one of the command line, like one in a file."""
    return _parsed(text, where)[0]


def _text(path: Path) -> str:
    try:
        return decode_text(path.read_bytes(), str(path))
    except FileNotFoundError:
        raise SlambedError(f"no such file: {path}") from None
    except OSError as error:
        raise SlambedError(f"cannot read {path}: {error}") from None


def _parsed(text: str, where: str) -> tuple[Any, dict[Location, int | str]]:
    """Returns the data, and the line of each key and list entry."""
    try:
        return with_parser(lambda parser: _read(parser(text), where))
    except yaml.YAMLError as error:
        problem, line = problem_of(error, text)
        raise SlambedError(f"not YAML: {problem}, {where} line {line}") from None


def _read(loader: yaml.SafeLoader, where: str) -> tuple[Any, dict[Location, int | str]]:
    written_at: dict[Location, int | str] = {}
    try:
        root = loader.get_single_node()
        data = None if root is None else _construct(loader, root, (), written_at, where)
    finally:
        loader.dispose()
    return data, written_at


def _construct(
    loader: yaml.SafeLoader,
    node: yaml.Node,
    location: Location,
    written_at: dict[Location, int | str],
    where: str,
) -> Any:
    written_at.setdefault(location, node.start_mark.line + 1)
    if isinstance(node, yaml.MappingNode):
        loader.flatten_mapping(node)  # puts what `<<` merges before the mapping's own keys
        mapping: dict[str | int | float, Any] = {}
        for key_node, value_node in node.value:
            key = loader.construct_object(key_node)
            line = key_node.start_mark.line + 1
            if not isinstance(key, str | int | float) or isinstance(key, bool):
                # YAML 1.1 reads an unquoted `on` or `no` as true/false.
                raise SlambedError(f"a key is {_key_in_words(key)}, {where} line {line}")
            written_at[(*location, key)] = line
            mapping[key] = _construct(loader, value_node, (*location, key), written_at, where)
        return mapping
    if isinstance(node, yaml.SequenceNode):
        return [
            _construct(loader, child, (*location, index), written_at, where)
            for index, child in enumerate(node.value)
        ]
    value = loader.construct_object(node)
    if type(value) in (int, float) and _OTHER_BASE.match(node.value):
        line = node.start_mark.line + 1
        raise SlambedError(
            f"'{node.value}' is {value} in YAML (a leading 0 is octal, a ':' base 60), {where} "
            f"line {line}; write it in decimal, or quote it"
        )
    return value


def parse(model: type[Model], source: YamlSource) -> Model:
    """Validates `source` against `model`; the first error becomes one line with its place."""
    if not isinstance(source.data, dict):
        raise source.complaint("expected a mapping of keys")
    try:
        return model.model_validate(source.data)
    except ValidationError as error:
        raise _explain(model, source, error.errors()) from None


def read_model(model: type[Model], path: Path) -> Model:
    """Reads a YAML file that is one `model`. The same text returns the same cached object, which
    callers must not change: a campaign and its report read each dataset and paper several times."""
    found: Model = _model(model, path, _text(path))
    return found


@lru_cache(maxsize=512)
def _model(model: type[Model], path: Path, text: str) -> Model:
    return parse(model, YamlSource(path, *_parsed(text, str(path))))


def _explain(model: type[BaseModel], source: YamlSource, items: list[Any]) -> SlambedError:
    """Reports an unknown key first: it explains a "missing" one next to it."""
    # Union branches add their own names to the location, which are not in the file. Missing keys
    # and keys set by the command line (--set) are not in the file either.
    open_ends = ("missing", "extra_forbidden")
    found = [(_written(source, _place(i), i["type"] in open_ends), i) for i in items]
    found = [(place, item) for place, item in found if not _is_inside(place, item, found)]
    location, first = min(found, key=lambda pair: pair[1]["type"] != "extra_forbidden")
    name = ".".join(str(part) for part in location)
    if first["type"] == "extra_forbidden":
        key = str(location[-1])
        known = _fields_at(model, location[:-1])
        return source.complaint(f"unknown key '{key}'", location, suggestion(key, known))
    if first["type"] == "missing":
        return source.complaint(f"key '{name}' is missing", location)
    message = mistake([item for place, item in found if place == location])
    return source.complaint(f"'{name}': {message}" if name else message, location)


def _place(item: Any) -> Location:
    inside = getattr(item.get("ctx", {}).get("error"), "location", ())
    return (*item["loc"], *inside)


def _is_inside(location: Location, item: Any, found: list[tuple[Location, Any]]) -> bool:
    """A mapping where a plain name is also allowed: report the mistake inside the mapping
    instead."""
    deeper = (place[: len(location)] == location != place for place, _ in found)
    return item["type"] in KINDS and any(deeper)


def _written(source: YamlSource, location: Location, open_end: bool) -> Location:
    """Returns the part of `location` that is in the file; with `open_end` also its last key."""
    kept: Location = ()
    for index, part in enumerate(location):
        last = index == len(location) - 1
        if (*kept, part) in source.written_at or (last and open_end):
            kept = (*kept, part)
    return kept


def mistake(items: list[Any]) -> str:
    """Summarizes pydantic's errors about one place: what was expected, and what is written
    there."""
    kinds = dict.fromkeys(KINDS[item["type"]] for item in items if item["type"] in KINDS)
    first = items[0]
    if first["type"] in KINDS:
        if "a number" in kinds:
            kinds.pop("an integer", None)
        *others, last = kinds
        expected = f"{', '.join(others)} or {last}" if others else last
        of_text = first["type"] == "string_type" and type(first["input"]) in (int, float, bool)
        advice = " (quote it)" if of_text and not others else ""
        return f"expected {expected}, not {in_words(first['input'])}{advice}"
    if first["type"] == "invalid_key":
        return f"expected a name, not {in_words(first['input'])} (a decimal comma? write a point)"
    if (words := _expected_by(first)) is not None:
        return f"{words}, not {in_words(first['input'])}"
    message = str(first["msg"]).removeprefix("Value error, ").removeprefix("Assertion failed, ")
    shown = first["input"]
    scalar = isinstance(shown, str | int | float) and not isinstance(shown, bool)
    if scalar or first["type"] == "literal_error":
        message += f" (it is {in_words(shown)})"
    return message[:1].lower() + message[1:]


def matching(pattern: str, expected: str) -> tuple[Any, Any]:
    """Returns the annotations of a text that matches `pattern`. Another text is told as `expected`,
    because few readers know regular expressions."""

    def check(text: str) -> str:
        # `$` alone would accept an end of line after it.
        if not re.match(pattern, text) or text.endswith("\n"):
            raise PydanticCustomError(_EXPECTED, "{expected}", {"expected": f"expected {expected}"})
        return text

    return AfterValidator(check), Field(json_schema_extra={"pattern": pattern})


def _expected_by(item: Any) -> str | None:
    """Returns what was expected, of an error that says so itself or says it badly."""
    if item["type"] == "too_short" and item["ctx"].get("min_length") == 1:
        return "expected at least one entry"
    return str(item["msg"]) if item["type"] == _EXPECTED else None


def in_words(value: object) -> str:
    """Formats a YAML value for a complaint; a mapping or list only by its kind."""
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, date):
        return f"the date {value} (quote it)"
    if isinstance(value, bytes):
        return "binary data"
    if isinstance(value, str) and (power := _POWER_OF_TEN.fullmatch(value)):
        whole, fraction, sign, exponent = power.groups()
        number = f"{whole}.{fraction or 0}e{sign or '+'}{exponent}"
        return f"the text {value!r} (YAML's form of this number is {number})"
    if isinstance(value, str) and _DECIMAL_COMMA.fullmatch(value):
        return f"the text {value!r} (write a decimal point)"
    return "a list" if isinstance(value, list) else repr(value)


def _key_in_words(key: object) -> str:
    """Formats a key that is no text for a complaint."""
    words = in_words(key)
    return words if isinstance(key, list | dict | date) else f"{words} (quote it)"


def _fields_at(model: type[BaseModel], location: Location) -> list[str]:
    """Returns the keys that the model allows at a place in the file."""
    current: list[Any] = [model]
    for part in location:
        following: list[Any] = []
        for kind in current:
            if isinstance(kind, type) and issubclass(kind, BaseModel):
                if isinstance(part, str) and part in kind.model_fields:
                    following += _branches(kind.model_fields[part].annotation)
            elif get_origin(kind) is list:
                following += _branches(get_args(kind)[0])
            elif get_origin(kind) is dict:
                following += _branches(get_args(kind)[1])
        current = following
    return [
        name
        for kind in current
        if isinstance(kind, type) and issubclass(kind, BaseModel)
        for name in kind.model_fields
    ]


def _branches(annotation: Any) -> list[Any]:
    if get_origin(annotation) in (Union, types.UnionType):
        return [branch for arg in get_args(annotation) for branch in _branches(arg)]
    return [annotation]
