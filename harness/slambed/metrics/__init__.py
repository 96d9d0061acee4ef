# SPDX-License-Identifier: Apache-2.0
"""Metrics of a run: pure functions from recorded files to numbers (docs/reference/metrics.md)."""
