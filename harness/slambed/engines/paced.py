# SPDX-License-Identifier: Apache-2.0
"""What the nodes of a live run are given about the devices whose pace they keep."""

from collections.abc import Mapping

from slambed.records.run_config import PacedDevice, PacedDevices
from slambed.spec.device import Device, Limits
from slambed.spec.system import Role


def paced_devices(devices: Mapping[Role, Device], limits: Mapping[Role, Limits]) -> PacedDevices:
    """Each node's device, and what its limits make of one of its cores on this host."""
    found: dict[str, PacedDevice] = {}
    for role, device in devices.items():
        assert device.model is not None  # checked where the device was chosen
        found[role] = PacedDevice(share=device.share_on(limits[role]), device=device.model)
    return PacedDevices.model_validate(found)
