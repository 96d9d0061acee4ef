# SPDX-License-Identifier: Apache-2.0
"""The stored RunSpec of a finished run, possibly of an old version: the fields that are read
back."""

from typing import Annotated, Any

from pydantic import Field, JsonValue

from slambed.files.json_file import Record
from slambed.older_names import PARAMETERS, in_keys
from slambed.spec.device import VIRTUAL
from slambed.spec.experiment import DEVICE_PACE, HOST_PACE
from slambed.spec.system import Role


class KeptModel(Record):
    """Fields of a cost model."""

    cores: int | None = None


class KeptDevice(Record):
    """Fields of a device."""

    name: str | None = None
    model: KeptModel | None = None


class KeptLink(Record):
    """Fields of a link."""

    backend: str | None = None
    content: dict[str, Any] = Field(default_factory=dict)


class KeptPlayback(Record):
    """Fields of the playback."""

    stop_at_first_loss: bool = False


class KeptRuntime(Record):
    """Fields of a runtime."""

    reads: str | None = None


class KeptTolerances(Record):
    """Tolerances of a valid run; null: not checked."""

    rtt_error_ms_median: float | None = None
    rtt_error_ms_p99: float | None = None
    host_stall_ms_max: float | None = None
    cpu_wait_share_max: float | None = None


class KeptSpec(Record):
    """The fields of a RunSpec that are read of finished runs. Fields change between versions of
    slambed, and a run stays readable without them."""

    run_key: str | None = None
    experiment: str | None = None
    cell: str | None = None
    repetition: int | None = None
    label: str | None = None
    system: str | None = None
    variant: str | None = None
    params: Annotated[dict[str, JsonValue] | None, in_keys(PARAMETERS)] = None
    inputs: Annotated[dict[str, str], in_keys(PARAMETERS)] = Field(default_factory=dict)
    system_folder: str | None = None
    runtime: KeptRuntime | None = None
    dataset: str | None = None
    playback: KeptPlayback | None = None
    device_mobile: KeptDevice | str | None = None
    device_edge: KeptDevice | str | None = None
    profile: str | None = None
    link: KeptLink | None = None
    engine: str | None = None
    software: str | None = None
    pace: str = HOST_PACE
    seed: int | None = None
    tolerances: KeptTolerances = KeptTolerances()

    @staticmethod
    def of(spec: Any) -> "KeptSpec":
        """Reads a RunSpec object, or one as JSON."""
        return KeptSpec.model_validate(spec, from_attributes=True)

    @property
    def is_virtual(self) -> bool:
        """True for a run in virtual time."""
        return self.engine == VIRTUAL

    @property
    def is_paced(self) -> bool:
        """True for a live run whose stages took the time that the devices' cost models charge."""
        return self.pace == DEVICE_PACE

    @property
    def reads_folder(self) -> bool:
        """True if the system read a recorded folder, so that frame times were not observed."""
        return self.runtime is not None and self.runtime.reads is not None

    def device_name(self, role: Role) -> str | None:
        """Returns the device name of a node; None without the node."""
        device = self.device_mobile if role == "mobile" else self.device_edge
        return device.name if isinstance(device, KeptDevice) else device

    def model_cores(self, role: Role) -> int | None:
        """Returns the number of cores in a device's cost model."""
        device = self.device_mobile if role == "mobile" else self.device_edge
        model = device.model if isinstance(device, KeptDevice) else None
        return None if model is None else model.cores
