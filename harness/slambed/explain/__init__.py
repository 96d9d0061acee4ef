# SPDX-License-Identifier: Apache-2.0
"""Explains what happened in one live or virtual run, as a figure and in text."""
