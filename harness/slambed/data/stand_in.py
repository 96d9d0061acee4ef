# SPDX-License-Identifier: Apache-2.0
"""The messages for a sequence that is played instead of another one."""

NOT_COMPARABLE = "numbers of the two cannot be compared"


def played_instead(played: str, wanted: str) -> str:
    """Returns the message of a paper's page: results of the two sequences must not be compared."""
    return f"{played} is played instead of {wanted}: {NOT_COMPARABLE}"


def used_instead(played: str, wanted: str, asked: str = "") -> str:
    """Returns the message of an experiment for terminal and pages. `asked`: the dataset of the
    experiment's file that led to these sequences, if it is known."""
    of = f"dataset {asked}: " if asked else ""
    missing = f"the recorded sequence ({wanted}) was not found"
    return f"{of}{missing}, so {played} is used; {NOT_COMPARABLE}"
