# SPDX-License-Identifier: Apache-2.0
"""CPU as share of a whole device, as `top` and papers about small boards print it."""

from collections.abc import Mapping
from typing import Any


def device_cores(spec: Mapping[str, Any], manifest: Mapping[str, Any], role: str) -> float | None:
    """Cores of the whole device, in those that its CPU time is counted in; None where unlimited.

    Virtual: the cores of its cost model. Live: the CPU quota that the kernel granted, which is what
    all cores of the emulated board are worth on this host.
    """
    device = spec.get(f"device_{role}")
    if spec.get("engine") == "virtual":
        model = device.get("model") if isinstance(device, Mapping) else None
        cores = model.get("cores") if isinstance(model, Mapping) else None
        return float(cores) if isinstance(cores, int | float) else None
    limits = manifest.get("limits")
    of_node = limits.get(role) if isinstance(limits, Mapping) else None
    granted = of_node.get("granted") if isinstance(of_node, Mapping) else None
    quota = granted.get("quota_cores") if isinstance(granted, Mapping) else None
    return float(quota) if isinstance(quota, int | float) and quota > 0 else None


def share_of_device(percent_of_core: float | None, cores: float | None) -> float | None:
    """Percent of the whole device."""
    return percent_of_core / cores if percent_of_core is not None and cores else None
