# SPDX-License-Identifier: Apache-2.0
"""Models of the files about a run; tables in docs/formats.md are generated from their fields."""
