# SPDX-License-Identifier: Apache-2.0
"""Finds experiments, devices and systems by name in the checkout."""

import os
from pathlib import Path
from typing import TypeGuard, TypeVar

from pydantic import BaseModel

from slambed.errors import SlambedError
from slambed.files.outputs import at_home, is_file, resolved
from slambed.files.yaml_source import YamlSource, load_yaml, parse
from slambed.native import left_behind, repository_root
from slambed.spec.device import Device
from slambed.spec.experiment import Experiment
from slambed.spec.input_recipe import InputRecipe
from slambed.spec.shared_params import with_shared_params
from slambed.spec.sweep import changed, swept
from slambed.spec.system import System
from slambed.suggestion import suggestion

Model = TypeVar("Model", bound=BaseModel)
SYSTEM_FILE = "system.yaml"
SYSTEMS_VARIABLE = "SLAMBED_SYSTEMS"


class Library:
    """The YAML files of one checkout (or of a folder that looks like one, in tests)."""

    def __init__(self, root: Path | None = None) -> None:
        self.root = root or repository_root()
        self._read: dict[Path, tuple[int, BaseModel]] = {}
        """Devices and systems read so far, with the modification time of their file in ns."""

    def experiment(
        self, name: str, settings: list[str] | None = None
    ) -> tuple[Experiment, YamlSource]:
        """Loads an experiment by name (`quickstart`) or by path (ends in .yaml or .yml) and
        expands its grid. `settings` are `key=value` pairs that override the file."""
        if name.endswith((".yaml", ".yml")):
            path = Path(name)
        else:
            path = self.root / "experiments" / f"{name}.yaml"
            self._must_exist(path, "experiment", name, self.experiments())
        source = swept(changed(load_yaml(path), settings or []))
        _anchor_systems(source)
        _anchor_datasets(source)
        _anchor_profiles(source)
        experiment = parse(Experiment, source)
        if experiment.id != path.stem:
            raise source.complaint(
                f"id '{experiment.id}' is not the file's name", ("id",), f"write id: {path.stem}"
            )
        return experiment, source

    def input(self, name: str) -> tuple[InputRecipe, YamlSource]:
        """Loads a recipe of catalog/inputs/*.yaml."""
        path = self.root / "catalog" / "inputs" / f"{name}.yaml"
        self._must_exist(path, "input", name, self.inputs())
        source = load_yaml(path)
        recipe = parse(InputRecipe, source)
        if recipe.id != path.stem:
            raise source.complaint(
                f"id '{recipe.id}' is not the file's name", ("id",), f"write id: {path.stem}"
            )
        return recipe, source

    def inputs(self) -> list[str]:
        """Names of all input recipes."""
        return _stems(self.root / "catalog" / "inputs")

    def device(self, name: str) -> Device:
        """Loads a device of catalog/devices/*.yaml."""
        path = self.root / "catalog" / "devices" / f"{name}.yaml"
        self._must_exist(path, "device", name, self.devices())
        return self._named(Device, path)

    def devices(self) -> list[str]:
        return _stems(self.root / "catalog" / "devices")

    def system(self, name: str) -> System:
        """Loads a system from systems/*/system.yaml, a folder in $SLAMBED_SYSTEMS, or a file."""
        path = self.system_file(name)
        system = self._named(System, path)
        ours = path.is_relative_to(self.root / "systems")
        if not ours and system.runtime is None:
            raise SlambedError(f"{path}: a system that is not ours needs a section runtime")
        if not ours and system.name in self.systems():
            raise SlambedError(f"{path}: there is a system {system.name} already, name it anew")
        return system

    def system_file(self, name: str) -> Path:
        """Returns the path of a system's description. Raises SlambedError if there is none."""
        if name.endswith((".yaml", ".yml")):
            path = resolved(Path(name))
            self._must_exist(path, "system", name, self.systems())
            return path
        if os.sep in name or name in (".", ".."):
            file = Path(name, SYSTEM_FILE)
            raise SlambedError(f"{name} is no name of a system; give the path of its file, {file}")
        folders = [self.root / "systems", *_others()]
        found = [folder / name / SYSTEM_FILE for folder in folders]
        path = next((path for path in found if is_file(path)), found[0])
        self._must_exist(path, "system", name, self.known_systems())
        return path

    def experiments(self) -> list[str]:
        return _stems(self.root / "experiments")

    def systems(self) -> list[str]:
        """Names of all systems in the checkout."""
        return sorted(p.parent.name for p in (self.root / "systems").glob(f"*/{SYSTEM_FILE}"))

    def known_systems(self) -> list[str]:
        """Names of all systems in the checkout and in the folders of $SLAMBED_SYSTEMS."""
        own = (p.parent.name for folder in _others() for p in folder.glob(f"*/{SYSTEM_FILE}"))
        return sorted({*self.systems(), *own})

    @staticmethod
    def _must_exist(path: Path, kind: str, name: str, known: list[str]) -> None:
        if not is_file(path):
            what_now = left_behind(path) or suggestion(name, known)
            raise SlambedError(f"unknown {kind} '{name}', no {path}; {what_now}")

    def _named(self, model: type[Model], path: Path) -> Model:
        """Reads each file once, and again after it was modified."""
        changed_ns = path.stat().st_mtime_ns
        known_ns, known = self._read.get(path, (0, None))
        if known_ns == changed_ns and isinstance(known, model):
            return known
        source = load_yaml(path)
        if model is System:
            source = with_shared_params(source)
        item = parse(model, source)
        wanted = path.parent.name if path.name == SYSTEM_FILE else path.stem
        if getattr(item, "name", None) != wanted:
            whose = "folder" if path.name == SYSTEM_FILE else "file"
            raise source.complaint(f"name is not '{wanted}', as its {whose} is called", ("name",))
        self._read[path] = changed_ns, item
        return item


def _others() -> list[Path]:
    """Folders of systems outside the checkout."""
    folders = os.environ.get(SYSTEMS_VARIABLE, "").split(os.pathsep)
    return [Path(part).resolve() for part in folders if part]


def _anchor_systems(source: YamlSource) -> None:
    """Resolves `system: ./mine/system.yaml` relative to the experiment's file."""
    entries = source.data.get("systems") if isinstance(source.data, dict) else None
    for entry in entries if isinstance(entries, list) else []:
        named = entry.get("system") if isinstance(entry, dict) else None
        if _is_file_name(named):
            entry["system"] = str(resolved(source.path.parent / at_home(named)))


def _anchor_datasets(source: YamlSource) -> None:
    """Resolves `datasets: [./mine/dataset.yaml]`, also of one system, likewise."""
    if not isinstance(source.data, dict):
        return
    entries = source.data.get("systems")
    for owner in (source.data, *(entries if isinstance(entries, list) else [])):
        names = owner.get("datasets") if isinstance(owner, dict) else None
        if not isinstance(names, list):
            continue
        for index, name in enumerate(names):
            if _is_file_name(name):
                names[index] = str(resolved(source.path.parent / at_home(name)))


def _anchor_profiles(source: YamlSource) -> None:
    """Resolves `profiles: [./mine.yaml]` likewise; a file that is not there is looked for in the
    current folder."""
    link = source.data.get("link") if isinstance(source.data, dict) else None
    profiles = link.get("profiles") if isinstance(link, dict) else None
    if not isinstance(profiles, list):
        return
    for index, item in enumerate(profiles):
        named = item.get("profile") if isinstance(item, dict) else item
        if not _is_file_name(named) or not is_file(source.path.parent / at_home(named)):
            continue
        beside = str(resolved(source.path.parent / at_home(named)))
        if isinstance(item, dict):
            item["profile"] = beside
        else:
            profiles[index] = beside


def _is_file_name(name: object) -> TypeGuard[str]:
    return isinstance(name, str) and name.endswith((".yaml", ".yml"))


def _stems(folder: Path) -> list[str]:
    return sorted(path.stem for path in folder.glob("*.yaml"))
