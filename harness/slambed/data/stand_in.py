# SPDX-License-Identifier: Apache-2.0
"""The one sentence about a sequence that is played instead of another one."""


def played_instead(played: str, wanted: str) -> str:
    """For terminal, titles and pages: whoever reads the numbers must not put them beside those of
    the other sequence."""
    return f"{played} is played instead of {wanted}: numbers of the two cannot be compared"
