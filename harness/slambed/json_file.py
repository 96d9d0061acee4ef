# SPDX-License-Identifier: Apache-2.0
"""JSON objects from files that a killed program may have left torn."""

import json
from pathlib import Path
from typing import Any


def read_object(path: Path) -> dict[str, Any] | None:
    """A JSON object, None when it is not there or not whole."""
    try:
        content = json.loads(path.read_bytes())
    except (OSError, ValueError):
        return None
    return content if isinstance(content, dict) else None


def object_or_empty(
    path: Path, problems: list[str] | None = None, needed: bool = False
) -> dict[str, Any]:
    """The object, or an empty one; what cannot be read (or is `needed` and missing) becomes a line
    in `problems`."""
    told = problems if problems is not None else []
    try:
        content = json.loads(path.read_bytes())
    except FileNotFoundError:
        if needed:
            told.append(f"{path.name}: missing")
        return {}
    except (OSError, ValueError) as error:
        told.append(f"{path.name}: unreadable ({error})")
        return {}
    return content if isinstance(content, dict) else {}
