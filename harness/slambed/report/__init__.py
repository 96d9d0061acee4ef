# SPDX-License-Identifier: Apache-2.0
"""Makes tables, figures and pages from runs (docs/reference/report.md)."""
