# SPDX-License-Identifier: Apache-2.0
"""Results as pages in the browser: for this machine alone, and only to be looked at."""
