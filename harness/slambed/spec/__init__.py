# SPDX-License-Identifier: Apache-2.0
"""What an experiment says: YAML files as checked objects, and the runs they stand for."""
