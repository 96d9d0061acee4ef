# SPDX-License-Identifier: Apache-2.0
"""The message for a sequence that is played instead of another one."""


def played_instead(played: str, wanted: str, asked: str = "") -> str:
    """Returns the message for terminals and pages. `asked`: the dataset of the experiment's file
    that led to these sequences, if it is known."""
    of = f"dataset {asked}: " if asked else ""
    return f"{of}{played} is played instead of {wanted}: numbers of the two cannot be compared"
