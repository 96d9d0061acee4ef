# SPDX-License-Identifier: Apache-2.0
"""Says of which commits and days runs are, and whether this repository still has those commits."""

from functools import cache

from slambed.native import git, is_installed
from slambed.report.load import Results

MOST_COMMITS = 3
SHORT = 7
DAY = len("2026-11-25")
UNKNOWN = "unknown to this repository, so these runs cannot be continued"


def origin_words(experiments: list[Results]) -> list[str]:
    """Returns phrases such as `commit 6c9ad1d` and `played 2026-11-24 to 2026-11-25`; nothing for
    runs without these facts."""
    found = []
    commits = sorted({c for r in experiments for c in r.facts.get("commit", {})})
    if commits:
        short = list(dict.fromkeys(c[:SHORT] for c in commits))
        more = f" and {len(short) - MOST_COMMITS} more" if len(short) > MOST_COMMITS else ""
        dirty = any("True" in r.facts.get("dirty", {}) for r in experiments)
        gone = [c[:SHORT] for c in commits if not is_known(c)]
        note = ""
        if gone:
            which = "" if len(gone) == len(commits) else f"{', '.join(gone[:MOST_COMMITS])} "
            note = f" ({which}{UNKNOWN})"
        found.append(f"commit {', '.join(short[:MOST_COMMITS])}{more}{'+' if dirty else ''}{note}")
    if days := _days(experiments):
        span = days[0] if days[0] == days[-1] else f"{days[0]} to {days[-1]}"
        found.append(f"played {span}")
    return found


def _days(experiments: list[Results]) -> list[str]:
    started = [r.runs["started_utc"].dropna() for r in experiments if "started_utc" in r.runs]
    return sorted({str(time)[:DAY] for times in started for time in times})


@cache
def is_known(commit: str) -> bool:
    """Returns whether the repository has a commit; True where that cannot be told: without git,
    and in a shallow clone, which has few commits."""
    if is_installed():
        return True
    try:
        shallow = git("rev-parse", "--is-shallow-repository")
        if shallow.returncode or shallow.stdout.strip() != "false":
            return True
        return git("cat-file", "-e", f"{commit}^{{commit}}").returncode == 0
    except OSError:
        return True
