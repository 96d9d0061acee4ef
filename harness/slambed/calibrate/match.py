# SPDX-License-Identifier: Apache-2.0
"""Finds cost models with which virtual runs reproduce the component times that a paper prints.

A component's mean is alpha * h + beta * r + w. h is what its stages cost on the base device, r how
often its stage with a fixed time occurs, w its other waiting time. The size-independent part of
that stage is not in h: beta replaces it, and may be smaller or larger. One round of runs gives h, r
and w for every condition; alpha and beta follow. All depend on the costs, so this takes a few
rounds.
"""

import tempfile
import threading
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from slambed.calibrate.seen import Seen, look
from slambed.calibrate.targets import Targets
from slambed.engines.virtual import VirtualRun
from slambed.errors import SlambedError
from slambed.files.yaml_source import YamlSource
from slambed.link.named_profile import read_profile
from slambed.metrics.events import EventLog, read_events
from slambed.spec.device import VIRTUAL, CostModel, Device, StageCost
from slambed.spec.experiment import DeviceChoice, Experiment
from slambed.spec.library import Library
from slambed.spec.masks import Masks, MasksAsked
from slambed.spec.matrix import Circumstances, expand, read_profiles
from slambed.spec.run_spec import RunSpec
from slambed.spec.system import Role

Values = NDArray[np.float64]

LARGEST_JITTER = 1.0
JITTER_GAIN = 0.7
"""Fraction of each step towards the printed spread, because other causes of spread change with
it."""
START_JITTER = 0.1


@dataclass
class Scale:
    """Scale of a component: its stages cost alpha times their cost on the base device, but the
    size-independent part of stage `fixed_on` is beta."""

    alpha: float
    beta_us: float = 0.0
    jitter: float = START_JITTER


@dataclass(frozen=True)
class Played:
    """A prepared sequence of a fit."""

    path: Path
    played_s: float
    checksum: str


@dataclass(frozen=True)
class Setting:
    """What the runs of a fit need."""

    sequences: Mapping[str, Played]
    """By dataset."""
    program: Path
    features: Path
    software: str
    jobs: int
    masks: Mapping[tuple[str, MasksAsked], Masks]
    """Maps (dataset, requested masks) to masks, for conditions that segment."""


class Fit:
    """A fit in progress."""

    def __init__(self, targets: Targets, source: YamlSource, library: Library) -> None:
        self.targets = targets
        self._source = source
        self._library = library
        self._base = {
            role: library.device(fitted.device if fitted.given else fitted.like)
            for role, fitted in targets.devices.items()
        }
        for role, device in self._base.items():
            if device.model is None:
                raise SlambedError(f"device {device.name} of {role} has no cost model to scale")
        self._kept = {role: self._stages_kept(role) for role in targets.devices}
        self._demand_stages()
        self.scales = {c.name: Scale(targets.devices[c.node].factor) for c in targets.components}
        self.seen: dict[tuple[str, str], Seen] = {}
        """Maps (component, condition) to the result of the last round."""

    def _demand_stages(self) -> None:
        """Raises SlambedError for a component with a stage that has no cost to scale."""
        for component in self.targets.components:
            device = self._base[component.node]
            stages = device.model.stages if device.model else {}
            if missing := {*component.stages, *component.along} - set(stages):
                raise SlambedError(
                    f"component {component.name}: device {device.name} has no stage "
                    f"{min(missing)} to scale; write its cost first"
                )
        for role, fitted in self.targets.devices.items():
            model = self._base[role].model
            if missing := set(fitted.threads) - set(model.stages if model else {}):
                raise SlambedError(
                    f"threads: device {self._base[role].name} has no stage {min(missing)}"
                )

    def _stages_kept(self, role: Role) -> dict[str, StageCost]:
        fitted = self.targets.devices[role]
        if not fitted.kept:
            return {}
        model = self._library.device(fitted.device).model
        stages = model.stages if model else {}
        if missing := set(fitted.kept) - set(stages):
            raise SlambedError(
                f"device {fitted.device} has no stage {min(missing)} to keep; write its cost first"
            )
        return {name: stages[name] for name in fitted.kept}

    def model(self, role: Role) -> CostModel:
        """Returns the current model of a device."""
        fitted, base = self.targets.devices[role], self._base[role].model
        assert base is not None
        if fitted.given:
            return base
        stages = {
            name: scaled(cost, fitted.factor, cost.jitter) for name, cost in base.stages.items()
        }
        for component in self.targets.components:
            if component.node != role:
                continue
            found = self.scales[component.name]
            for name in component.stages:
                beta_us = found.beta_us if name == component.fixed_on else None
                jitter = found.jitter if component.sd_ms else base.stages[name].jitter
                stages[name] = scaled(base.stages[name], found.alpha, jitter, beta_us)
            for name in component.along:
                cost = base.stages[name]
                stages[name] = scaled(cost, found.alpha, cost.jitter)
        return base.model_copy(update={"cores": fitted.cores, "stages": stages | self._kept[role]})

    def models(self, role: Role) -> dict[str, CostModel]:
        """Returns the models to write, by device: the fitted one, and those with its stages."""
        fitted, own = self.targets.devices[role], self.model(role)
        found = {fitted.device: own}
        for name in fitted.also:
            other = self._library.device(name).model
            if other is None:
                raise SlambedError(
                    f"device {name} has no cost model whose stages could be replaced"
                )
            stages = in_threads(own.stages, fitted.threads, other.cores)
            found[name] = other.model_copy(update={"stages": stages})
        return found

    def error_percent(self, component: str, condition: str) -> float:
        """Returns the error of the last simulated mean relative to the printed one."""
        (target,) = (c.mean_ms[condition] for c in self.targets.components if c.name == component)
        return 100 * (self.seen[component, condition].mean / target - 1)

    def round(self, setting: Setting) -> None:
        """Simulates all conditions with the current models, then moves towards the targets."""
        self.look_again(setting)
        for component in self.targets.components:
            if component.stages:
                self.improve(component.name)

    def look_again(self, setting: Setting, as_written: bool = False) -> None:
        """Simulates all conditions with the current models, or with those of the device files."""
        devices = {} if as_written else self._devices()
        for condition, logs in self._simulate(setting, devices).items():
            for component in self.targets.components:
                if condition in component.mean_ms:
                    self.seen[component.name, condition] = look(component, logs)

    def improve(self, name: str) -> None:
        """Moves a component's scale towards its printed means."""
        (component,) = (c for c in self.targets.components if c.name == name)
        scale = self.scales[name]
        conditions = list(component.mean_ms)
        seen = [self.seen[component.name, condition] for condition in conditions]
        target = np.array([component.mean_ms[condition] for condition in conditions])
        rate = np.array([s.fixed for s in seen])
        beta_ms = scale.beta_us * 1e-3
        busy = np.array([s.busy for s in seen])
        base = np.maximum(busy - beta_ms * rate, 1e-6) / scale.alpha
        waits = np.array([s.mean for s in seen]) - busy
        # Computing time is the target without waits, but at least a tenth of the target.
        wanted = np.maximum(target - waits, target / 10)
        most = component.fixed_at_most if component.fixed_on is not None else 0.0
        alpha, beta_ms = solve(base, rate, wanted, most)
        kept = self.targets.damping
        scale.alpha = scale.alpha**kept * alpha ** (1 - kept)
        scale.beta_us = kept * scale.beta_us + (1 - kept) * beta_ms * 1e3
        if component.sd_ms:
            relative = [component.sd_ms[c] / component.mean_ms[c] for c in component.sd_ms]
            asked, shown = float(np.mean(relative)), float(np.mean([s.sd / s.mean for s in seen]))
            step = (asked / max(shown, 1e-3)) ** JITTER_GAIN
            scale.jitter = float(np.clip(scale.jitter * step, 0.01, LARGEST_JITTER))

    def _simulate(
        self, setting: Setting, devices: Mapping[str, Device]
    ) -> dict[str, list[EventLog]]:
        specs = self._specs(setting, devices)
        with tempfile.TemporaryDirectory(prefix="slambed-fit-") as folder:

            def simulate(spec: RunSpec) -> EventLog:
                raw = Path(folder) / spec.run_key
                raw.mkdir()
                played = setting.sequences[self.targets.dataset_of(spec.label)]
                run = VirtualRun(
                    spec, played.path, played.played_s, raw, setting.program, setting.features
                )
                result = run.execute(threading.Event())
                if result.outcome != "completed":
                    raise SlambedError(f"a run of the fit failed: {result.reason}")
                return read_events(raw)

            with ThreadPoolExecutor(setting.jobs) as threads:
                logs = list(threads.map(simulate, specs))
        found: dict[str, list[EventLog]] = {}
        for spec, log in zip(specs, logs, strict=True):
            found.setdefault(spec.label, []).append(log)
        return found

    def _specs(self, setting: Setting, devices: Mapping[str, Device]) -> list[RunSpec]:
        library = _FittedLibrary(self._library, devices)
        found: list[RunSpec] = []
        for dataset, played in setting.sequences.items():
            experiment = experiment_on(self.targets, dataset)
            profiles = read_profiles(experiment, self._source, read_profile)
            host = Circumstances(
                VIRTUAL,
                {profile.name: VIRTUAL for profile in profiles},
                setting.software,
                {dataset: (dataset, played.checksum)},
                masks=setting.masks,
            )
            found += expand(experiment, self._source, library, profiles, host, self.targets.runs)
        return found

    def _devices(self) -> dict[str, Device]:
        return {
            fitted.device: self._base[role].model_copy(
                update={"name": fitted.device, "model": self.model(role)}
            )
            for role, fitted in self.targets.devices.items()
        }


def in_threads(
    stages: Mapping[str, StageCost], threads: Mapping[str, int], cores: int
) -> dict[str, StageCost]:
    """Returns the costs on a machine with so many cores, of stages that were fitted on one."""
    shared = {
        name: scaled(stages[name], 1 / count, stages[name].jitter)
        for name, count in threads.items()
        if cores >= count
    }
    return {**stages, **shared}


def experiment_on(targets: Targets, dataset: str) -> Experiment:
    """Returns an experiment with the conditions of a fit on this sequence."""
    return Experiment(
        id="fit",
        title=targets.title,
        systems=[
            choice.model_copy(update={"label": name})
            for name, choice in targets.conditions.items()
            if targets.dataset_of(name) == dataset
        ],
        datasets=[dataset],
        playback=targets.playback,
        link=targets.link,
        devices=DeviceChoice(**{role: f.device for role, f in targets.devices.items()}),
    )


def solve(base: Values, rate: Values, wanted: Values, most: float) -> tuple[float, float]:
    """Returns non-negative alpha and beta with the least relative errors of alpha * base + beta *
    rate to `wanted`. The share of beta * rate in the mean is at most `most`."""
    ones = np.ones(len(wanted))
    if most > 0:
        (alpha, beta), _ = nnls(np.column_stack([base / wanted, rate / wanted]), ones)
        fixed, scaled = beta * rate.mean(), alpha * base.mean()
        if fixed <= most * (fixed + scaled):
            return max(float(alpha), 1e-6), float(beta)
    tied = most / (1 - most) * base.mean() / rate.mean() if most > 0 else 0.0
    (alpha,), _ = nnls(((base + tied * rate) / wanted)[:, None], ones)
    return max(float(alpha), 1e-6), float(alpha * tied)


class _FittedLibrary(Library):
    """A library with the fitted devices in place of those of the checkout."""

    def __init__(self, library: Library, devices: Mapping[str, Device]) -> None:
        super().__init__(library.root)
        self._devices = devices

    def device(self, name: str) -> Device:
        return self._devices.get(name) or super().device(name)


def scaled(
    cost: StageCost, alpha: float, jitter: float, fixed_us: float | None = None
) -> StageCost:
    """Returns alpha * cost to four digits; `fixed_us` replaces the size-independent part."""
    return StageCost(
        a_us=_short(cost.a_us * alpha if fixed_us is None else fixed_us),
        b_us=_short(cost.b_us * alpha),
        c_us=_short(cost.c_us * alpha),
        jitter=_short(jitter),
        accelerator=cost.accelerator,
    )


def _short(value: float) -> float:
    return float(f"{value:.4g}")
