# SPDX-License-Identifier: Apache-2.0
"""Processes of a run: messages between them, exit codes, namespaces and standard streams."""
