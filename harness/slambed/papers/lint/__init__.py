# SPDX-License-Identifier: Apache-2.0
"""Checks the files of papers."""
