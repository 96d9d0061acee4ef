# SPDX-License-Identifier: Apache-2.0
"""The CPUs of this process."""

import os


def own_cpus() -> list[int]:
    """Returns the numbers of the CPUs that this process may use, in order: those of the host, or
    fewer in a container or under `taskset`."""
    return sorted(os.sched_getaffinity(0))
