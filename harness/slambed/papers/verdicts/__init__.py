# SPDX-License-Identifier: Apache-2.0
"""The rules by which a published number or ordering is judged (docs/explanation/verdicts.md).

Pure functions of numbers; their error rates are simulated
(docs/logbook/2026-11-22-error-rates-of-verdicts.md, "Error rates").
"""
