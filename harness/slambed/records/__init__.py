# SPDX-License-Identifier: Apache-2.0
"""Models of the files about a run; tables in docs/reference are generated from their fields."""
