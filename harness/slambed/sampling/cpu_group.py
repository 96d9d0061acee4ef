# SPDX-License-Identifier: Apache-2.0
"""A helper container leaves its CPU group: there the kernel may refuse real-time priority."""

import contextlib
import os

from slambed.sampling.cgroup import mounted


def leave_cpu_group() -> None:
    """Into the root group of the v1 cpu controller, as a process of the host is.

    With CONFIG_RT_GROUP_SCHED every other group has no real-time share. Without the permission
    nothing changes, and the log of link and limits says that there is no real-time priority.
    """
    v1, _ = mounted()
    if (cpu := v1.get("cpu")) is not None:
        with contextlib.suppress(OSError):
            (cpu / "cgroup.procs").write_text(str(os.getpid()))
