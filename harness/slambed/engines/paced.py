# SPDX-License-Identifier: Apache-2.0
"""Settings for nodes of a live run that keep the pace of their devices."""

from collections.abc import Mapping

from slambed.records.run_config import PacedDevice, PacedDevices
from slambed.spec.device import Device, Limits
from slambed.spec.system import Role


def paced_devices(devices: Mapping[Role, Device], limits: Mapping[Role, Limits]) -> PacedDevices:
    """Returns each node's device, and the share of a host CPU that equals one of its cores under
    its limits."""
    found: dict[str, PacedDevice] = {}
    for role, device in devices.items():
        assert device.model is not None  # checked when the device was chosen
        found[role] = PacedDevice(share=device.share_on(limits[role]), device=device.model)
    return PacedDevices.model_validate(found)
