# SPDX-License-Identifier: Apache-2.0
"""Regression tests of results: nightly gate, trends, diff of two folders, bisection of commits."""
