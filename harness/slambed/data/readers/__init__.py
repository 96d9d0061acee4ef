# SPDX-License-Identifier: Apache-2.0
"""Dataset readers, found by module name: `reader: tum` in a dataset file is readers/tum.py.

A reader module defines one class `Reader(SequenceReader)`; a new file in this folder adds a format.
"""

from __future__ import annotations

import importlib
import pkgutil

from slambed.data.readers.base import ReaderOptions, SequenceReader
from slambed.errors import SlambedError
from slambed.suggestion import suggestion

__all__ = ["ReaderOptions", "SequenceReader", "load_reader", "reader_names"]


def reader_names() -> list[str]:
    """Returns the names allowed for `reader:`."""
    return sorted(module.name for module in pkgutil.iter_modules(__path__) if module.name != "base")


def load_reader(name: str) -> type[SequenceReader]:
    """Returns the reader class of the module with this name."""
    if name not in reader_names():
        raise SlambedError(f"reader '{name}' does not exist; {suggestion(name, reader_names())}")
    module = importlib.import_module(f"{__name__}.{name}")
    reader: type[SequenceReader] = module.Reader
    return reader
