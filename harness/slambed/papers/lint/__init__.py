# SPDX-License-Identifier: Apache-2.0
"""Whether a paper's file means what it says."""
