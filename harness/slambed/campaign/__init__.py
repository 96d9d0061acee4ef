# SPDX-License-Identifier: Apache-2.0
"""From an experiment to its results: order of runs, ledger, resuming, atomic run folders."""
