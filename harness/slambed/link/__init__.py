# SPDX-License-Identifier: Apache-2.0
"""The emulated network between the two nodes: profiles, backends and the link proof
(docs/explanation/link.md)."""
