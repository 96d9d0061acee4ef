# SPDX-License-Identifier: Apache-2.0
"""Makes a table of a record's fields: names, types, units, docstrings."""

import ast
import inspect
import textwrap
import types
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel, PlainSerializer
from pydantic.fields import FieldInfo

WITHOUT_UNIT = {"n_m"}
"""Symbols of a paper that end like a unit."""
UNITS = {
    "s": "s", "ms": "ms", "us": "us", "ns": "ns", "mb": "MiB", "bytes": "B", "percent": "%",
    "cores": "cores", "m": "m", "deg": "deg", "px": "px",
}  # fmt: skip
"""Maps a part of a key to its unit."""
WORDS = {str: "str", int: "int", float: "float", bool: "bool", type(None): "null"}


def field_rows(
    record: type,
    whole: tuple[type, ...] = (),
    skipped: tuple[str, ...] = (),
    prefix: str = "",
    described: dict[type, str] | None = None,
) -> Iterator[list[str]]:
    """Yields key, type, unit and meaning of every field, with those of nested records below it.

    Records in `whole` are not expanded; a record that occurs twice is expanded once; fields in
    `skipped` are left out. Raises ValueError for a field without a docstring.
    """
    meanings = docstrings(record)
    described = {} if described is None else described
    for name, kind in _fields(record):
        if name in skipped:
            continue
        if not (meaning := meanings.get(name, "")):
            raise ValueError(f"{record.__name__}.{name} has no docstring")
        inner, steps = _inner(kind)
        if inner in whole or not _is_record(inner):
            inner = None
        if inner is not None and inner in described:
            meaning += f"; as `{described[inner]}`"
        yield [f"`{prefix}{name}`", _type(kind), _unit(name, kind), meaning]
        if inner is not None and inner not in described:
            described[inner] = f"{prefix}{name}"
            yield from field_rows(inner, whole, (), f"{prefix}{name}{steps}.", described)


def _fields(record: type) -> Iterator[tuple[str, Any]]:
    if issubclass(record, BaseModel):
        yield from record.model_fields.items()
        return
    hints = get_type_hints(record, include_extras=True)
    assert is_dataclass(record)
    for item in fields(record):
        yield item.name, hints[item.name]


@cache
def docstrings(record: type) -> dict[str, str]:
    """Maps a field to the string below it."""
    (found,) = ast.parse(textwrap.dedent(inspect.getsource(record))).body
    assert isinstance(found, ast.ClassDef)
    described: dict[str, str] = {}
    for field, below in zip(found.body, found.body[1:], strict=False):
        if (
            isinstance(field, ast.AnnAssign)
            and isinstance(field.target, ast.Name)
            and isinstance(below, ast.Expr)
            and isinstance(below.value, ast.Constant)
        ):
            described[field.target.id] = in_a_row(str(below.value.value))
    return described


def in_a_row(sentence: str) -> str:
    """Returns a sentence in the form of a table cell."""
    text = " ".join(sentence.split()).removesuffix(".").replace("|", "\\|")
    return text if text[1:2].isupper() else text[:1].lower() + text[1:]


def _bare(kind: Any) -> Any:
    """Returns the type without validators and constraints."""
    if isinstance(kind, FieldInfo):
        return _bare(kind.annotation)
    return _bare(get_args(kind)[0]) if get_origin(kind) is Annotated else kind


def _members(kind: Any) -> list[Any]:
    """Returns the members of a union, or the type itself."""
    kind = _bare(kind)
    if get_origin(kind) in (Union, types.UnionType):
        return [member for part in get_args(kind) for member in _members(part)]
    return [kind]


def _is_record(kind: Any) -> bool:
    return isinstance(kind, type) and (issubclass(kind, BaseModel) or is_dataclass(kind))


def _inner(kind: Any) -> tuple[type | None, str]:
    """Returns the record in a field, and the path to it: `.*` for any key, `[]` for any index."""
    for member in _members(kind):
        origin, arguments = get_origin(member), get_args(member)
        if _is_record(member):
            return member, ""
        if origin is dict and (found := _inner(arguments[1]))[0] is not None:
            return found[0], f".*{found[1]}"
        if origin is list and (found := _inner(arguments[0]))[0] is not None:
            return found[0], f"[]{found[1]}"
    return None, ""


def _type(kind: Any) -> str:
    """Returns the type in terms of JSON."""
    words: list[str] = []
    checks = kind.metadata if isinstance(kind, FieldInfo) else get_args(kind)
    nan_is_null = any(isinstance(check, PlainSerializer) for check in checks)
    for member in [*_members(kind), *([type(None)] if nan_is_null else [])]:
        origin, arguments = get_origin(member), get_args(member)
        if origin is dict:
            words.append(f"object of {_type(arguments[1])}")
        elif origin is list:
            words.append(f"list of {_type(arguments[0])}")
        elif origin is tuple:
            words.append("pair of " + _type(arguments[0]))
        elif origin is Literal:
            words += [f"`{str(v).lower() if v is True else v}`" for v in arguments]
        else:
            words.append(WORDS.get(member, "object"))
    return " or ".join(dict.fromkeys(words))


def _unit(name: str, kind: Any) -> str:
    if name in WITHOUT_UNIT or not {int, float} & set(_numbers(kind)):
        return ""
    if name.endswith("bits_per_s"):
        return "bit/s"
    return next((UNITS[part] for part in reversed(name.split("_")) if part in UNITS), "")


def _numbers(kind: Any) -> Iterator[Any]:
    """Yields the plain types in a field."""
    for member in _members(kind):
        if get_args(member) and get_origin(member) is not Literal:
            for part in get_args(member):
                yield from _numbers(part)
        else:
            yield member
