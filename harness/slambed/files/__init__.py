# SPDX-License-Identifier: Apache-2.0
"""Files that are whole or not there, JSON and YAML with checks, files that a user named."""
