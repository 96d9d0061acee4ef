# SPDX-License-Identifier: Apache-2.0
"""slambed: a reproducible testbed for edge-offloaded visual SLAM."""

__version__ = "0.1.0"
