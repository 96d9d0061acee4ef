# SPDX-License-Identifier: Apache-2.0
"""Sequences, recorded and generated: catalog, readers, and the prepared form for playback."""
