# SPDX-License-Identifier: Apache-2.0
"""The mobile node of a run on another machine, by its Docker over ssh:
docs/how-to/use-a-real-board.md."""
