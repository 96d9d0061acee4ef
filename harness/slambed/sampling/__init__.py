# SPDX-License-Identifier: Apache-2.0
"""What each node uses and is granted, read from its cgroup."""
