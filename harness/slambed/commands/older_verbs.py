# SPDX-License-Identifier: Apache-2.0
"""Names that commands had before: they work for this release and say the new one."""

OLDER = {
    "plots": ["report"],
    "losses": ["report", "--losses"],
    "truth": ["diff", "--truth"],
    "compare": ["papers", "compare"],
    "paper": ["papers", "run"],
    "view": ["explain", "--path"],
    "profile": ["profiles"],
}


def renewed(arguments: list[str]) -> tuple[list[str], str]:
    """The command line with today's name of its command, and a note about it where that is new."""
    if not arguments or arguments[0] not in OLDER:
        return arguments, ""
    now = OLDER[arguments[0]]
    note = (
        f"note: 'slambed {arguments[0]}' is 'slambed {' '.join(now)}' now; "
        "the old name goes with the next release"
    )
    return [*now, *arguments[1:]], note
