# SPDX-License-Identifier: Apache-2.0
"""What names and titles in YAML files may consist of."""

import re
from typing import Annotated

from pydantic import AfterValidator, StringConstraints

from slambed.files.yaml_source import Location, MisplacedError, in_words, matching

_WORD_PATTERN = r"^[A-Za-z_][A-Za-z0-9_]*$"
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f]")
_OF_A_WORD = "a name of letters (a to z), digits and '_', no digit first"
_OF_A_NAME = "letters (a to z), digits, '_', '.' and '-', a letter or digit first"

Name = Annotated[str, *matching(r"^[A-Za-z0-9][A-Za-z0-9_.-]*$", f"a name of {_OF_A_NAME}")]
"""Name of an experiment, a device or a machine."""
Id = Annotated[str, *matching(r"^[a-z0-9][a-z0-9_]*$", "a name of small letters, digits and '_'")]
"""Name of a dataset or a network, as of its file."""
FileName = Annotated[
    str,
    *matching(
        r"^([A-Za-z0-9][A-Za-z0-9_.-]*)?$",
        f"the name of a file, without a folder: {_OF_A_NAME}",
    ),
]
"""Name of a file, or empty."""
Word = Annotated[str, *matching(_WORD_PATTERN, _OF_A_WORD)]
"""Name that a program can use."""
Address = Annotated[
    str, *matching(r"^[^-\s]\S*$", "an address without blanks that does not begin with '-'")
]
"""Of a machine, for ssh."""
Sha256 = Annotated[
    str,
    StringConstraints(to_lower=True),
    *matching(r"^[0-9a-f]{64}$", "64 hexadecimal digits"),
]
"""Digest of a file."""


def _one_line(text: str) -> str:
    line = " ".join(text.split())
    if _CONTROL.search(line):
        raise ValueError("expected text without control characters")
    return line


Title = Annotated[str, AfterValidator(_one_line)]
"""One line for lists and reports; lines of a longer text are joined."""


def must_be_word(name: str, location: Location) -> None:
    """Raises MisplacedError for a key that programs cannot get as the name of an environment
    variable."""
    if not re.fullmatch(_WORD_PATTERN, name):
        raise MisplacedError(f"expected {_OF_A_WORD}, not {in_words(name)}", location)
