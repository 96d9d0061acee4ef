# SPDX-License-Identifier: Apache-2.0
"""Segmentation of people and other moving objects: networks, their masks, and a mask cache per
sequence."""

TRUTH = "truth"
"""Name of the generator's ground-truth masks: an upper bound, not a network."""
WITH_INPUT = "--with-input"
"""Option of the segmenter to exit at the end of its standard input."""
