# SPDX-License-Identifier: Apache-2.0
"""Sequences, recorded and generated: catalogue, readers, and the prepared form for playback."""
