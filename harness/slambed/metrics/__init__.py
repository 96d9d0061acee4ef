# SPDX-License-Identifier: Apache-2.0
"""What a run was worth: pure functions from recorded files to numbers:
docs/reference/metrics.md."""
