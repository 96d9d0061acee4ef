# SPDX-License-Identifier: Apache-2.0
"""Published numbers and ours: what papers print, which runs it is about, verdicts, plans, pages."""
