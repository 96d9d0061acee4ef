# SPDX-License-Identifier: Apache-2.0
"""Processes of a run: how they talk, how they ended, their namespaces and standard streams."""
