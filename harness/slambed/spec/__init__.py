# SPDX-License-Identifier: Apache-2.0
"""Models of the YAML files of an experiment, and the expansion into its runs."""
