# SPDX-License-Identifier: Apache-2.0
"""Progress that meets a lost terminal fails no campaign: SIGHUP decides what becomes of it."""

import errno
import io

import pytest
from harness_parts import run_spec
from rich.console import Console

from slambed.campaign.progress import CampaignProgress


class Terminal(io.StringIO):
    """A terminal that refuses everything printed once `error` is set."""

    error: int | None = None

    def isatty(self) -> bool:
        return True

    def write(self, text: str) -> int:
        if self.error is not None:
            raise OSError(self.error, "refused")
        return super().write(text)


def report_on(terminal: Terminal, error: int, is_bar: bool) -> None:
    """Reports a run that ends, one that fails and the end, on a terminal that fails meanwhile."""
    spec = run_spec()
    console = Console(file=terminal, force_terminal=is_bar)
    with CampaignProgress(console, 2, 1.0) as progress:
        progress.run_started(spec)
        terminal.error = error
        progress.run_ended(spec, "completed")
        progress.run_started(spec)
        progress.run_failed(spec, "it was killed", last=True)


@pytest.mark.parametrize("is_bar", [True, False])
def test_a_lost_terminal_fails_no_report(is_bar: bool) -> None:
    report_on(Terminal(), errno.EIO, is_bar)


def test_a_full_disk_behind_the_output_is_still_an_error() -> None:
    with pytest.raises(OSError, match="refused"):
        report_on(Terminal(), errno.ENOSPC, is_bar=False)
