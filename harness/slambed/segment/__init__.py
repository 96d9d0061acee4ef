# SPDX-License-Identifier: Apache-2.0
"""Who and what moves in a picture: networks, their masks, and masks kept per sequence."""

TRUTH = "truth"
"""Name of the masks that the generator knows: an upper bound, never a network."""
WITH_INPUT = "--with-input"
"""Option of the segmenter: it ends with its standard input."""
