# SPDX-License-Identifier: Apache-2.0
"""systems/<name>/system.yaml: roles, channels, parameters (docs/reference/system.md)."""

from collections.abc import Mapping
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from slambed.data.layouts import SENSORS
from slambed.errors import SlambedError
from slambed.files.names import Title, Word, must_be_word
from slambed.files.yaml_source import Location, MisplacedError
from slambed.spec.runtime import Runtime
from slambed.spec.stages import OwnStage, check_stages
from slambed.suggestion import suggestion

STRICT = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)
Scalar = bool | int | float | str
Role = Literal["mobile", "edge"]
KINDS: dict[str, type] = {
    "int": int, "float": float, "bool": bool, "str": str, "path": str, "network": str,
}  # fmt: skip


def _must_differ(key: str, names: list[str]) -> None:
    """Environment variables have the names in capital letters."""
    for index, name in enumerate(names):
        for other in names[:index]:
            if name.upper() == other.upper():
                place: Location = (key, name) if key == "params" else (key, index)
                both = f"'{other}' and '{name}'" if name != other else f"'{name}' twice"
                raise MisplacedError(f"{key}: {both}, one environment variable for two", place)


class Parameter(BaseModel):
    """One parameter of a system: its type, range, default and the source of its value."""

    model_config = STRICT

    type: Literal["int", "float", "bool", "str", "path", "network"]
    """`path`: an input file, empty for none; only its content is in the run key, and `dataset`
    selects the prior map that the dataset's file names. `network`: a network of catalog/networks/,
    empty for none; the harness runs the segmentation (docs/explanation/masks.md), and nodes do not
    receive this parameter."""
    role: Role | None = None
    """For a path: the only node that receives the file; both if not given."""
    default: Scalar
    """Value where neither variant nor experiment gives one."""
    min: int | float | None = None
    """Smallest value, itself allowed; of numbers only."""
    max: int | float | None = None
    """Largest value, itself allowed; of numbers only."""
    choices: list[Scalar] | None = None
    """All values that are allowed."""
    unit: str = ""
    """Unit of the value, for tables."""
    source: str = ""
    """Where the value comes from."""
    doc: str = ""
    """What it does."""

    @model_validator(mode="after")
    def _default_is_legal(self) -> "Parameter":
        if self.role is not None and self.type != "path":
            raise ValueError("role belongs to parameters of type path")
        numbers = self.type in ("int", "float")
        if not numbers and not (self.min is None and self.max is None):
            raise ValueError("min and max belong to numbers")
        self.check(self.default)
        return self

    def check(self, value: object) -> Scalar:
        """Returns the value in this parameter's type. Raises ValueError if it is not allowed."""
        wanted = KINDS[self.type]
        if wanted is float and type(value) is int:
            value = float(value)
        # bool is an int in Python: compare exact types.
        if type(value) is not wanted:
            raise ValueError(f"{value!r} is not {'an ' if self.type == 'int' else 'a '}{self.type}")
        assert isinstance(value, bool | int | float | str)
        if self.choices is not None and value not in self.choices:
            raise ValueError(f"{value!r} is none of {', '.join(map(str, self.choices))}")
        if isinstance(value, int | float) and not isinstance(value, bool):
            unit = f" {self.unit}" if self.unit else ""
            if self.min is not None and value < self.min:
                raise ValueError(f"{value} is below the minimum {self.min}{unit}")
            if self.max is not None and value > self.max:
                raise ValueError(f"{value} is above the maximum {self.max}{unit}")
        return value


class ParameterError(SlambedError):
    """A parameter that an experiment gives to a system is unknown, or its value is not legal."""

    def __init__(self, message: str, name: str) -> None:
        super().__init__(message)
        self.name = name


class OwnMetric(BaseModel):
    """A metric that a system defines from its own events; it appears in summary.json of the
    system's runs."""

    model_config = STRICT

    doc: str
    """What it measures."""
    event: str
    """Type of the events that it is computed from."""
    take: Literal["count", "seconds", "sum", "mean", "median", "p95", "min", "max", "last", "rate"]
    """`seconds`: sums the playback time from each such event to the next of its type. `rate`:
    the rate in Hz of work that takes the mean of this field, in ms."""
    field: str = ""
    """Field of the event; empty for `count` and `seconds`."""
    node: Role | None = None
    """Node whose events count; null: both."""
    where: dict[str, Scalar | list[Scalar]] = Field(default_factory=dict)
    """Uses only events whose fields have this value (or one of these values) ..."""
    unless: dict[str, Scalar | list[Scalar]] = Field(default_factory=dict)
    """... and excludes events with these values."""
    label: str = ""
    """Name in tables and figures; empty: the key in words."""
    unit: str = ""
    """Unit of the stored value."""
    shown: str = ""
    """Unit in tables and figures; the stored value is multiplied by `scale`."""
    scale: float = 1.0
    """What the stored value is multiplied by for tables."""
    digits: int = Field(default=1, ge=0, le=9)
    """Decimals in tables."""
    better: Literal["lower", "higher", "neither"] = "neither"
    """Which direction is better."""
    relevant_share: float = Field(default=0.10, ge=0)
    """Smallest change of the median, as a share, that the gate reports."""
    relevant_step: float = Field(default=0.0, ge=0)
    """Smallest change of the median, in the stored unit, that the gate reports."""
    gated: bool = False
    """Whether the regression gate judges it."""

    @model_validator(mode="after")
    def _takes_what_is_there(self) -> "OwnMetric":
        if (self.take in ("count", "seconds")) == bool(self.field):
            raise ValueError(f"take: {self.take} {'has no' if self.field else 'needs a'} field")
        return self


class Variant(BaseModel):
    """A named set of parameter defaults."""

    model_config = STRICT

    title: Title = ""
    """One line for lists."""
    doc: str = ""
    """What a reader must know."""
    params: dict[str, Scalar] = Field(default_factory=dict)
    """Parameter -> value, instead of its default."""


class System(BaseModel):
    """A SLAM system as the harness sees it."""

    model_config = STRICT

    name: str
    """Name of the system, as of its folder."""
    title: Title
    """Name in tables and figures."""
    roles: list[Role]
    """`[mobile]`, or `[mobile, edge]`."""
    channels: list[Word] = Field(default_factory=list)
    """Names of the TCP channels between the nodes; a system on slambed's modules has `control`."""
    sensors: list[Literal["rgbd", "stereo", "mono"]] = Field(default=["rgbd"], min_length=1)
    """Sequences that it can play."""
    params: dict[str, Parameter] = Field(default_factory=dict)
    """Name -> parameter that an experiment can set."""
    variants: dict[str, Variant] = Field(default_factory=dict)
    """Name -> defaults of that variant; the first one is taken where none is named."""
    metrics: dict[str, OwnMetric] = Field(default_factory=dict)
    """The system's own metrics, by their key in summary.json."""
    stages: dict[str, OwnStage] = Field(default_factory=dict)
    """Stages that only this system has; device files need no cost for them."""
    runtime: Runtime | None = None
    """How the system's own program is started; null for a system built into slambed-node."""
    doc: str = ""
    """What a reader of the file must know."""

    @model_validator(mode="after")
    def _is_consistent(self) -> "System":
        if "mobile" not in self.roles or len(set(self.roles)) != len(self.roles):
            raise ValueError("roles must be [mobile] or [mobile, edge]")
        if self.has_edge and self.runtime is None and "control" not in self.channels:
            raise ValueError("a system with an edge needs the channel 'control'")
        if self.runtime is not None and (self.runtime.edge is not None) != self.has_edge:
            raise ValueError("runtime has an edge where roles have one, and only there")
        if self.channels and not self.has_edge:
            raise MisplacedError("channels need a role edge", ("channels",))
        for name in self.params:
            must_be_word(name, ("params", name))
        for key, names in (("channels", self.channels), ("params", list(self.params))):
            _must_differ(key, names)
        self._can_be_read()
        if self.stages and self.runtime is not None:
            raise ValueError("a program of its own has no stages: it takes the time it takes")
        check_stages(self.stages)
        networks = [name for name, p in self.params.items() if p.type == "network"]
        if len(networks) > 1 or (networks and not {"jpeg_quality", "n_m"} <= self.params.keys()):
            raise ValueError("a network is one parameter, beside jpeg_quality and n_m")
        for name, variant in self.variants.items():
            for key, value in variant.params.items():
                try:
                    self._checked(key, value)
                except SlambedError as error:
                    place = ("variants", name, "params", key)
                    raise MisplacedError(f"variant {name}: {error}", place) from None
        return self

    def _can_be_read(self) -> None:
        layout = None if self.runtime is None else self.runtime.reads
        others = [s for s in self.sensors if layout is not None and s not in SENSORS[layout]]
        if others:
            raise ValueError(
                f"a folder of layout {layout} holds no {others[0]} sequence; take it out of "
                "sensors, or read another layout"
            )

    @property
    def file_params(self) -> list[str]:
        """Names of the parameters that name an input file."""
        return sorted(name for name, p in self.params.items() if p.type == "path")

    @property
    def edge_files(self) -> list[str]:
        """Names of those parameters whose file only the edge receives."""
        return [name for name in self.file_params if self.params[name].role == "edge"]

    @property
    def network_param(self) -> str | None:
        """Name of the parameter that names a network."""
        return next((name for name, p in self.params.items() if p.type == "network"), None)

    def for_nodes(self, params: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """Returns the parameters that nodes receive."""
        return {name: v for name, v in params.items() if name != self.network_param}

    @property
    def has_edge(self) -> bool:
        """True when the system has an edge node and so needs a link."""
        return "edge" in self.roles

    def choose_variant(self, name: str | None) -> str:
        """Returns the given variant, or the first one."""
        known = list(self.variants) or ["default"]
        if name is None:
            return known[0]
        if name not in known:
            raise SlambedError(
                f"system {self.name} has no variant '{name}'; {suggestion(name, known)}"
            )
        return name

    def resolve(self, variant: str, overrides: Mapping[str, object]) -> dict[str, Scalar]:
        """Returns all parameters; later layers override earlier ones: system default, variant,
        experiment."""
        values: dict[str, Scalar] = {name: p.default for name, p in self.params.items()}
        chosen = self.variants[variant].params if variant in self.variants else {}
        for layer in (chosen, overrides):
            for name, value in layer.items():
                values[name] = self._checked(name, value)
        return {name: self.params[name].check(value) for name, value in sorted(values.items())}

    def _checked(self, name: str, value: object) -> Scalar:
        if name not in self.params:
            known = suggestion(name, self.params) or "it has none"
            message = f"unknown parameter '{name}' of system {self.name}; {known}"
            raise ParameterError(message, name)
        try:
            return self.params[name].check(value)
        except ValueError as error:
            message = f"parameter '{name}' of system {self.name}: {error}"
            raise ParameterError(message, name) from None
