# SPDX-License-Identifier: Apache-2.0
"""CPU use as a share of the whole device, as `top` and papers about small boards report it."""

from slambed.records.kept_spec import KeptSpec
from slambed.records.manifest import Manifest
from slambed.spec.system import Role


def device_cores(spec: KeptSpec, manifest: Manifest, role: Role) -> float | None:
    """Returns the cores of the whole device, in the unit of its CPU time; None if unlimited.

    Virtual: the cores of its cost model. Live at its pace: those cores, converted to host CPUs.
    Other live runs: the granted CPU quota, which equals all cores of the emulated board on this
    host.
    """
    if spec.is_virtual:
        cores = spec.model_cores(role)
        return None if cores is None else float(cores)
    limits = (manifest.limits or {}).get(role)
    if spec.is_paced and limits is not None and limits.asked is not None:
        cores = spec.model_cores(role)
        share = limits.asked.thread_cores or limits.asked.quota_cores or 1.0
        return None if cores is None else cores * min(share, 1.0)
    granted = None if limits is None else limits.granted
    return (granted.quota_cores or None) if granted is not None else None


def share_of_device(percent_of_core: float | None, cores: float | None) -> float | None:
    """Returns percent of the whole device."""
    return percent_of_core / cores if percent_of_core is not None and cores else None
