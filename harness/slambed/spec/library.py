# SPDX-License-Identifier: Apache-2.0
"""Finds experiments, devices and systems by name in the checkout."""

from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel

from slambed.errors import SlambedError
from slambed.native import repository_root
from slambed.spec.device import Device
from slambed.spec.experiment import Experiment
from slambed.spec.input_recipe import InputRecipe
from slambed.spec.sweep import changed, swept
from slambed.spec.system import System
from slambed.spec.yaml_source import YamlSource, load_yaml, parse, suggestion

Model = TypeVar("Model", bound=BaseModel)


class Library:
    """The YAML files of one checkout (or of a folder that looks like one, in tests)."""

    def __init__(self, root: Path | None = None) -> None:
        self.root = root or repository_root()

    def experiment(
        self, name: str, settings: list[str] | None = None
    ) -> tuple[Experiment, YamlSource]:
        """An experiment by name (`quickstart`) or by path (anything that ends in .yaml), its grid
        written out; `settings` are `key=value` and go before what the file says."""
        if name.endswith((".yaml", ".yml")):
            path = Path(name)
        else:
            path = self.root / "experiments" / f"{name}.yaml"
            self._must_exist(path, "experiment", name, self.experiments())
        source = swept(changed(load_yaml(path), settings or []))
        experiment = parse(Experiment, source)
        if experiment.id != path.stem:
            raise source.complaint(
                f"id '{experiment.id}' is not the file's name", ("id",), f"write id: {path.stem}"
            )
        return experiment, source

    def input(self, name: str) -> tuple[InputRecipe, YamlSource]:
        """A recipe of inputs/*.yaml."""
        path = self.root / "inputs" / f"{name}.yaml"
        self._must_exist(path, "input", name, self.inputs())
        source = load_yaml(path)
        recipe = parse(InputRecipe, source)
        if recipe.id != path.stem:
            raise source.complaint(
                f"id '{recipe.id}' is not the file's name", ("id",), f"write id: {path.stem}"
            )
        return recipe, source

    def inputs(self) -> list[str]:
        """Names of all recipes of inputs."""
        return _stems(self.root / "inputs")

    def device(self, name: str) -> Device:
        """A device of devices/*.yaml."""
        path = self.root / "devices" / f"{name}.yaml"
        self._must_exist(path, "device", name, self.devices())
        return self._named(Device, path)

    def devices(self) -> list[str]:
        """Names of all devices."""
        return _stems(self.root / "devices")

    def system(self, name: str) -> System:
        """A system of systems/*/system.yaml."""
        path = self.root / "systems" / name / "system.yaml"
        self._must_exist(path, "system", name, self.systems())
        return self._named(System, path)

    def experiments(self) -> list[str]:
        """Names of all experiments."""
        return _stems(self.root / "experiments")

    def systems(self) -> list[str]:
        """Names of all systems."""
        return sorted(p.parent.name for p in (self.root / "systems").glob("*/system.yaml"))

    @staticmethod
    def _must_exist(path: Path, kind: str, name: str, known: list[str]) -> None:
        if not path.is_file():
            raise SlambedError(f"unknown {kind} '{name}', no {path}; {suggestion(name, known)}")

    @staticmethod
    def _named(model: type[Model], path: Path) -> Model:
        source = load_yaml(path)
        item = parse(model, source)
        wanted = path.parent.name if path.name == "system.yaml" else path.stem
        if getattr(item, "name", None) != wanted:
            raise source.complaint(f"name is not '{wanted}', as the file's name says", ("name",))
        return item


def _stems(folder: Path) -> list[str]:
    return sorted(path.stem for path in folder.glob("*.yaml"))
