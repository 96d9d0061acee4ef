# SPDX-License-Identifier: Apache-2.0
"""What files about a run say, as models: docs/formats.md has tables made from their fields."""
