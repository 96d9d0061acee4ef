# SPDX-License-Identifier: Apache-2.0
"""The mobile node of a run on another machine, through its Docker daemon over ssh
(docs/how-to/use-a-real-board.md)."""
