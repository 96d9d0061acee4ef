# SPDX-License-Identifier: Apache-2.0
"""Sequences, recorded and generated: catalogue, readers, and the prepared form for playback."""

from slambed.data.catalog import Catalog, prepare
from slambed.data.prepared import PreparedSequence, PreparedWriter

__all__ = ["Catalog", "PreparedSequence", "PreparedWriter", "prepare"]
