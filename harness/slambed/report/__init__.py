# SPDX-License-Identifier: Apache-2.0
"""From runs to tables, figures and pages (docs/reference/report.md)."""
