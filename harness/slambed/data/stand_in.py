# SPDX-License-Identifier: Apache-2.0
"""The message for a sequence that is played instead of another one."""


def played_instead(played: str, wanted: str) -> str:
    """Returns the message for terminal, titles and pages: results of the two sequences must not
    be compared."""
    return f"{played} is played instead of {wanted}: numbers of the two cannot be compared"
