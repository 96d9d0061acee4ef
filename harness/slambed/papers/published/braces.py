# SPDX-License-Identifier: Apache-2.0
"""Ids of several cells written as one text with braces."""

import re


def expanded(text: str) -> list[str]:
    """Expands `a{b,c}d` to abd and acd; of several braces, the last one varies fastest."""
    found = re.search(r"\{([^{}]*)\}", text)
    if found is None:
        return [text]
    before, after = text[: found.start()], text[found.end() :]
    parts = (part.strip() for part in found[1].split(","))
    return [one for part in parts for one in expanded(before + part + after)]
