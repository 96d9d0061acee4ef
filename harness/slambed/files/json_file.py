# SPDX-License-Identifier: Apache-2.0
"""JSON objects from files that a killed program may have left truncated."""

import json
from pathlib import Path
from typing import Any, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    JsonValue,
    SerializerFunctionWrapHandler,
    ValidationError,
    model_serializer,
)

UNREADABLE = (OSError, ValueError, RecursionError)
"""What a file is that holds no JSON: thousands of brackets are none, either."""


class Record(BaseModel):
    """A JSON object of a file, or a nested object with its own keys.

    Unknown keys of older and newer versions are ignored. Keys that were never set are not written:
    null means that a value was looked for and not found.
    """

    model_config = ConfigDict(extra="ignore", frozen=True)

    @classmethod
    def read(cls, path: Path) -> Self | None:
        """Reads a file; None if it is missing, truncated or no record of this kind."""
        try:
            return cls.model_validate_json(path.read_bytes())
        except UNREADABLE:
            return None

    @classmethod
    def read_or_complain(cls, path: Path, problems: list[str]) -> Self:
        """Reads a file. A missing file gives an empty record; so does an unreadable one, which
        also adds a line to `problems`."""
        try:
            return cls.model_validate_json(path.read_bytes())
        except FileNotFoundError:
            pass
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            what = ": ".join([*filter(None, [".".join(map(str, first["loc"]))]), first["msg"]])
            problems.append(f"{path.name}: unreadable ({what})")
        except OSError as error:
            problems.append(f"{path.name}: unreadable ({error})")
        return cls()

    @model_serializer(mode="wrap")
    def _only_what_was_set(self, serialize: SerializerFunctionWrapHandler) -> dict[str, JsonValue]:
        found: dict[str, JsonValue] = serialize(self)
        return {key: value for key, value in found.items() if key in self.model_fields_set}

    def as_json(self) -> dict[str, JsonValue]:
        """Returns the record as it is written."""
        return self.model_dump(mode="json")


def read_object(path: Path) -> dict[str, Any] | None:
    """Reads a JSON object; None if the file is missing or truncated."""
    try:
        return object_of(path.read_bytes())
    except OSError:
        return None


def object_of(text: bytes) -> dict[str, Any] | None:
    """A JSON object, None when it is none or not whole."""
    try:
        content = json.loads(text)
    except UNREADABLE:
        return None
    return content if isinstance(content, dict) else None


def object_or_empty(
    path: Path, problems: list[str] | None = None, needed: bool = False
) -> dict[str, Any]:
    """Reads a JSON object, empty on failure. An unreadable file, or a missing one that is
    `needed`, adds a line to `problems`."""
    complaints = problems if problems is not None else []
    try:
        content = json.loads(path.read_bytes())
    except FileNotFoundError:
        if needed:
            complaints.append(f"{path.name}: missing")
        return {}
    except UNREADABLE as error:
        complaints.append(f"{path.name}: unreadable ({error})")
        return {}
    return content if isinstance(content, dict) else {}


def read_list(path: Path) -> list[Any]:
    """Reads a JSON list; empty if the file is missing or truncated."""
    try:
        content = json.loads(path.read_bytes())
    except UNREADABLE:
        return []
    return content if isinstance(content, list) else []
