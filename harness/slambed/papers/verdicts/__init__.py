# SPDX-License-Identifier: Apache-2.0
"""The rules by which a published number or ordering is judged (docs/results.md).

Pure functions of numbers: how often they err is simulated (docs/metrics.md, "Error rates").
"""
