# SPDX-License-Identifier: Apache-2.0
"""What files about a run say, as models: docs/reference has tables made from their fields."""
