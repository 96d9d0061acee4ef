# SPDX-License-Identifier: Apache-2.0
"""Moves a helper container out of its cpu cgroup, where the kernel may refuse real-time
priority."""

import contextlib
import os

from slambed.sampling.cgroup import mounted


def leave_cpu_group() -> None:
    """Moves this process to the root cgroup of the v1 cpu controller, like a process of the host.

    With CONFIG_RT_GROUP_SCHED all other cgroups have no real-time budget. Without permission
    nothing changes, and the link and limits logs report that there is no real-time priority.
    """
    v1, _ = mounted()
    if (cpu := v1.get("cpu")) is not None:
        with contextlib.suppress(OSError):
            (cpu / "cgroup.procs").write_text(str(os.getpid()))
