# SPDX-License-Identifier: Apache-2.0
"""Starts, watches and stops the two nodes of a run, in containers or in bare namespaces."""
