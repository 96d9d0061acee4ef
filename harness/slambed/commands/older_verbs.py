# SPDX-License-Identifier: Apache-2.0
"""Former names of commands, which still work in this release and print the new name."""

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
    """Returns the command line with today's command, and a note if the name is a former one."""
    if not arguments or arguments[0] not in OLDER:
        return arguments, ""
    now = OLDER[arguments[0]]
    note = (
        f"note: 'slambed {arguments[0]}' is 'slambed {' '.join(now)}' now; "
        "the next release will not have the old name"
    )
    return [*now, *arguments[1:]], note
