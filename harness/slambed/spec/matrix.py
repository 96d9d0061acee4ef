# SPDX-License-Identifier: Apache-2.0
"""Expands an experiment into its runs."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from slambed.errors import SlambedError
from slambed.files.yaml_source import Location, YamlSource
from slambed.spec import inputs
from slambed.spec.board import Board
from slambed.spec.chosen_board import chosen_board, must_go_to_board
from slambed.spec.chosen_device import chosen_device
from slambed.spec.device import LOCAL, VIRTUAL
from slambed.spec.experiment import (
    DEVICE_PACE,
    HOST_PACE,
    Experiment,
    Playback,
    SystemChoice,
)
from slambed.spec.faults import Fault, with_cuts
from slambed.spec.library import Library
from slambed.spec.masks import Masks, MasksAsked
from slambed.spec.recorded_part import RecordedPart
from slambed.spec.run_spec import LinkSpec, RunSpec
from slambed.spec.system import ParameterError, Scalar, System
from slambed.suggestion import suggestion

END_SLACK_S = 1.0
"""Tolerance for `end_s`: a sequence of 20 s ends with its last frame, shortly before 20 s, and
some lengths are given rounded."""


@dataclass(frozen=True)
class NamedProfile:
    """A link profile as an experiment refers to it: its name and its checked content."""

    name: str
    content: dict[str, Any]
    remarks: tuple[str, ...] = ()
    """What was assumed about its files, a line each."""
    recorded: tuple[RecordedPart, ...] = ()
    """Recordings of which a run plays as much as it lasts."""


@dataclass(frozen=True)
class Circumstances:
    """Facts that the host decides and not the experiment file. Those that change results are in
    the run key."""

    engine: str
    link_backends: Mapping[str, str]
    """Profile name -> link backend on this host."""
    software: str
    datasets: Mapping[str, tuple[str, str]]
    """Name in the experiment -> (id of the dataset found, checksum of its prepared sequence)."""
    played_s: Mapping[str, float] = field(default_factory=dict)
    """Dataset name -> playback duration, once known; in no run key."""
    playbacks: Mapping[str, Playback] = field(default_factory=dict)
    """Dataset name -> playback options, where the dataset's file extends the experiment's."""
    prior_maps: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    """Dataset name -> (path, SHA-256) of the prior map named in its file."""
    masks: Mapping[tuple[str, MasksAsked], Masks] = field(default_factory=dict)
    """(dataset name, requested settings) -> computed masks."""
    references: Mapping[str, str] = field(default_factory=dict)
    """Dataset name -> path of the run that other runs on this dataset are compared with."""
    software_of: Mapping[str, str] = field(default_factory=dict)
    """System -> tag of the sources that it links; `software` where unknown."""
    board: Board | None = None
    """The machine of the mobile nodes, if the experiment selects one and it has been contacted."""
    host_speed: float | None = None
    """Core speed measured by `slambed calibrate --host`, read when the campaign began."""


ProfileReader = Callable[[str | float | dict[str, Any], str, Path | None], NamedProfile]
"""(profile as written, its place in the file, the file's folder) -> checked profile."""


def read_profiles(
    experiment: Experiment, source: YamlSource, reader: ProfileReader
) -> list[NamedProfile]:
    """Returns all checked profiles of the experiment."""
    if experiment.link is None:
        return []
    profiles: list[NamedProfile] = []
    for index, item in enumerate(experiment.link.profiles):
        place = ("link", "profiles", index)
        where = source.place_of(place)
        profile = reader(item, where, source.path.parent)
        if profile.name in {p.name for p in profiles}:
            raise source.complaint(f"profile '{profile.name}' is given twice", place)
        profiles.append(profile)
    return profiles


def needs_link(experiment: Experiment, library: Library) -> bool:
    """Returns whether any of the systems has an edge node."""
    return any(library.system(choice.system).has_edge for choice in experiment.systems)


def expand(
    experiment: Experiment,
    source: YamlSource,
    library: Library,
    profiles: list[NamedProfile],
    host: Circumstances,
    runs: int,
) -> list[RunSpec]:
    """Returns all runs in the order of the file: system, dataset, profile, repetition."""
    specs: list[RunSpec] = []
    _end_must_be_inside(experiment, source, host)
    board = chosen_board(experiment, source, host.engine, host.board)
    for index, choice in enumerate(experiment.systems):
        place = ("systems", index)
        try:
            system = library.system(choice.system)
            must_be_playable(system, host.engine)
            paced = experiment.pace == DEVICE_PACE and host.engine != VIRTUAL
            if paced and system.runtime is not None:
                raise SlambedError(
                    f"system {system.name} is a program of its own, whose stages nobody can hold "
                    "up (pace: device)"
                )
            variant = system.choose_variant(choice.variant)
            params = system.resolve(variant, choice.params)
            label = label_of(choice, system)
            wanted = MasksAsked.of(system, params, label)
            asked = wanted.with_table(params) if wanted else []
            params = system.for_nodes(params)
            named = {name: str(params[name]) for name in system.file_params if params[name]}
            files = {
                n: inputs.find_input(p, source.path.parent)
                for n, p in named.items()
                if p != inputs.FROM_DATASET
            }
            digests = {name: inputs.sha256_of(path) for name, path in files.items()}
            if board is not None:
                must_go_to_board(system, params, board)
        except ParameterError as error:
            raise source.complaint(str(error), (*place, "params", error.name)) from None
        except SlambedError as error:
            raise source.complaint(str(error), place) from None
        if system.has_edge and experiment.link is None:
            raise source.complaint(f"system {system.name} has an edge but there is no link", place)
        faults = _faults(experiment, choice, system, source, place, host)
        of_role = partial(chosen_device, experiment, index, source, library, host.engine, system)
        mobile = of_role("mobile") if board is None else board.device
        edge = of_role("edge") if system.has_edge else None
        live = host.engine != VIRTUAL
        boards = live and any(d is not None and d.board for d in (mobile, edge))
        for dataset in _datasets_of(experiment, choice, source, index):
            if dataset not in host.datasets:
                continue  # skipped, see Experiment.missing_datasets
            found, checksum = host.datasets[dataset]
            masks = [
                host.masks.get((dataset, want), Masks(network=want.network, n_m=want.n_m))
                for want in asked
            ]
            paths: dict[str, Scalar] = {name: str(path) for name, path in files.items()}
            sums = dict(digests)
            for name in sorted(named.keys() - files.keys()):
                if dataset not in host.prior_maps:
                    line = f"parameter '{name}': dataset {dataset} names no prior_map in its file"
                    raise source.complaint(line, place)
                paths[name], sums[name] = host.prior_maps[dataset]
            for profile in _profiles_of(choice, profiles, source, index):
                cell = "/".join([label, found, *([profile.name] if profile else [])])
                for repetition in range(runs):
                    specs.append(
                        RunSpec(
                            experiment=experiment.id,
                            cell=cell,
                            repetition=repetition,
                            label=label,
                            system=system.name,
                            variant=variant,
                            roles=system.roles,
                            channels=system.channels,
                            params=params | paths,
                            inputs=sums,
                            masks=masks[0] if masks else None,
                            further_masks=masks[1:],
                            edge_inputs=[name for name in system.edge_files if name in sums],
                            runtime=system.runtime,
                            system_folder=folder_of(system, choice.system, library),
                            reference=host.references.get(dataset, ""),
                            dataset=found,
                            sequence_checksum=checksum,
                            playback=host.playbacks.get(dataset, experiment.playback),
                            device_mobile=mobile,
                            device_edge=edge,
                            board=board,
                            profile=profile.name if profile else None,
                            link=_link(system, profile, host.link_backends, faults, source),
                            faults=faults,
                            engine=host.engine,
                            pace=DEVICE_PACE if paced else HOST_PACE,
                            # A repetition has the same seed in every cell, so that cells differ
                            # only in what is compared.
                            seed=experiment.seed + repetition,
                            software=host.software_of.get(system.name, host.software),
                            host_speed=host.host_speed if boards else None,
                            max_run_mb=experiment.max_run_mb,
                            tolerances=experiment.tolerances,
                        )
                    )
    if experiment.faults and not needs_link(experiment, library):
        raise source.complaint("there are faults but no system has an edge", ("faults",))
    _refuse_twins(specs, source)
    return specs


def must_be_playable(system: System, engine: str) -> None:
    """Raises SlambedError if this engine cannot execute a system with its own program."""
    if system.runtime is None:
        return
    if system.runtime.gpus and engine == LOCAL:
        raise SlambedError(
            f"system {system.name} asks for a GPU, which engine local gives no program; use "
            "--engine docker, or leave gpu out"
        )
    if engine == VIRTUAL:
        raise SlambedError(
            f"system {system.name} is a program of its own, whose time engine virtual cannot know; "
            "use --engine local or docker"
        )


def folder_of(system: System, named: str, library: Library) -> str:
    """Folder of a system with its own program; empty for a built-in system."""
    return "" if system.runtime is None else str(library.system_file(named).parent)


def label_of(choice: SystemChoice, system: System) -> str:
    """Returns the row name in tables: the label in the file, or else system and variant."""
    if choice.label:
        return choice.label
    variant = system.choose_variant(choice.variant)
    return system.name if not system.variants else f"{system.name}:{variant}"


def _datasets_of(
    experiment: Experiment, choice: SystemChoice, source: YamlSource, index: int
) -> list[str]:
    """Returns the datasets of a system. Raises SlambedError for one that the experiment lacks."""
    for position, name in enumerate(choice.datasets or []):
        if name not in experiment.datasets:
            raise source.complaint(
                f"dataset '{name}' is not among the experiment's datasets",
                ("systems", index, "datasets", position),
                suggestion(name, experiment.datasets),
            )
    return experiment.datasets_of(choice)


def _profiles_of(
    choice: SystemChoice, profiles: list[NamedProfile], source: YamlSource, index: int
) -> list[NamedProfile] | list[None]:
    if not profiles:
        return [None]
    if choice.profiles is None:
        return profiles
    names = [profile.name for profile in profiles]
    for position, name in enumerate(choice.profiles):
        if name not in names:
            raise source.complaint(
                f"profile '{name}' is not among link.profiles",
                ("systems", index, "profiles", position),
                suggestion(name, names),
            )
    return [profile for profile in profiles if profile.name in choice.profiles]


def _link(
    system: System,
    profile: NamedProfile | None,
    backends: Mapping[str, str],
    faults: list[Fault],
    source: YamlSource,
) -> LinkSpec | None:
    if not system.has_edge or profile is None:
        return None
    try:
        content = with_cuts(profile.content, faults)
    except ValueError as error:
        line = f"profile '{profile.name}': {error}"
        raise source.complaint(line, ("link", "profiles")) from None
    return LinkSpec(backend=backends[profile.name], profile=profile.name, content=content)


def _faults(
    experiment: Experiment,
    choice: SystemChoice,
    system: System,
    source: YamlSource,
    place: Location,
    host: Circumstances,
) -> list[Fault]:
    """Returns the faults of the system or else of the experiment; none for a system without an
    edge."""
    own = choice.faults is not None
    faults = choice.faults if choice.faults is not None else experiment.faults
    at: Location = (*place, "faults") if own else ("faults",)
    if not system.has_edge:
        if own and faults:
            raise source.complaint(f"system {system.name} has no edge that could fail", at)
        return []
    end_s = _playback_end_s(experiment.playback, experiment.datasets_of(choice), host)
    for index, fault in enumerate(faults):
        if host.engine == VIRTUAL and fault.edge in ("kill", "restart"):
            raise source.complaint(
                f"engine virtual cannot {fault.edge} a node", (*at, index), "use docker or local"
            )
        if fault.at_s >= end_s:
            line = f"{fault.kind} at {fault.at_s:g} s: playback is over at {end_s:g} s"
            raise source.complaint(line, (*at, index))
    return faults


def _playback_end_s(playback: Playback, datasets: list[str], host: Circumstances) -> float:
    """Returns the run time at which the shortest playback of these datasets ends, as far as known;
    otherwise infinity."""
    if playback.mode != "realtime":
        return math.inf  # a frame may take arbitrarily long
    asked = [] if playback.end_s is None else [playback.end_s - playback.start_s]
    known = [host.played_s[name] for name in datasets if name in host.played_s]
    return min([*asked, *known], default=math.inf)


def _end_must_be_inside(experiment: Experiment, source: YamlSource, host: Circumstances) -> None:
    """Rejects an end beyond that of the sequence as a mistake. A stand-in for a sequence may be
    shorter. Times count from the begin of the sequence, also for a window of it, whose file names
    where its playback starts."""
    end_s = experiment.playback.end_s
    if end_s is None:
        return
    for name, (found, _) in host.datasets.items():
        played_s = host.played_s.get(name)
        if played_s is None or (found != name and "/" not in name):
            continue
        start_s = host.playbacks.get(name, experiment.playback).start_s
        if end_s - start_s > played_s + END_SLACK_S:
            raise source.complaint(
                f"playback.end_s {end_s:g} is after the end of {found}, which lasts "
                f"{start_s + played_s:.1f} s",
                ("playback", "end_s"),
                "leave it out to play all of it",
            )


def _refuse_twins(specs: list[RunSpec], source: YamlSource) -> None:
    seen: dict[str, RunSpec] = {}
    cells: dict[tuple[str, int], str] = {}
    for spec in specs:
        key = spec.run_key
        if (twin := seen.get(key)) is not None:
            raise source.complaint(
                f"combinations '{twin.cell}' and '{spec.cell}' are the same", ("systems",)
            )
        if cells.setdefault((spec.cell, spec.repetition), key) != key:
            raise source.complaint(
                f"two different combinations are called '{spec.cell}'",
                ("systems",),
                "give them labels",
            )
        seen[key] = spec
