# SPDX-License-Identifier: Apache-2.0
"""Recorded and generated sequences: catalog, readers, and the prepared form for playback."""
