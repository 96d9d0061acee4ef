# SPDX-License-Identifier: Apache-2.0
"""What each node really uses and is granted, read from its control group."""
