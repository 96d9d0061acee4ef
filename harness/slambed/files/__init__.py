# SPDX-License-Identifier: Apache-2.0
"""Atomic files, checked JSON and YAML files, and files that a user named."""
