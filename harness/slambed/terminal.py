# SPDX-License-Identifier: Apache-2.0
"""Where tables are printed."""

import os
import sys

from rich.console import Console

WIDTH_WITHOUT_TERMINAL = 160


def console() -> Console:
    """A log file or pipe has no width: wide tables are not folded there. Text is shown as it is:
    the unit in `RTT [ms]` is no markup."""
    if sys.stdout.isatty() or "COLUMNS" in os.environ:
        return Console(markup=False)
    return Console(width=WIDTH_WITHOUT_TERMINAL, markup=False)
