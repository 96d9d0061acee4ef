# SPDX-License-Identifier: Apache-2.0
"""Shows results as read-only pages in the browser, on this machine only."""
