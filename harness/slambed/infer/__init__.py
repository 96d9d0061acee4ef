# SPDX-License-Identifier: Apache-2.0
"""Fits a paper's unknown parameters to one of its tables and predicts the others."""
