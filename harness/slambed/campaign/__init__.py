# SPDX-License-Identifier: Apache-2.0
"""From an experiment to its results: order, ledger, resume, atomic run folders."""
