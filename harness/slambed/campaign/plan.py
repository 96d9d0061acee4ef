# SPDX-License-Identifier: Apache-2.0
"""From an experiment file to its runs on this host."""

import hashlib
import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

from slambed.campaign.datasets import (
    Sequence,
    kept_sequence,
    must_be_here,
    other_rate,
    prepare_sequence,
    prior_map_of,
    sensor_of,
    sequence_id,
    stand_in,
)
from slambed.campaign.ledger import utc_now
from slambed.campaign.masks import Notify, make_masks, networks_of
from slambed.campaign.runs_beyond_plan import of_other_engines
from slambed.campaign.store import ATTEMPTS, STORE
from slambed.errors import MissingDataError, SlambedError
from slambed.files.yaml_source import YamlSource
from slambed.link.impairments import outages_within
from slambed.link.named_profile import adds_nothing, backend_for, read_profile
from slambed.spec import inputs
from slambed.spec.board import NETWORK, Board
from slambed.spec.device import LOCAL, VIRTUAL
from slambed.spec.experiment import (
    HOST_PACE,
    MOST_RUNS,
    Experiment,
    Playback,
    SystemChoice,
    assumed,
    has_cuts,
)
from slambed.spec.host_speed import load_host_speed
from slambed.spec.library import Library
from slambed.spec.masks import MasksAsked
from slambed.spec.matrix import (
    END_SLACK_S,
    Circumstances,
    NamedProfile,
    expand,
    needs_link,
    read_profiles,
)
from slambed.spec.run_spec import RunSpec
from slambed.spec.software import software_of_systems
from slambed.spec.system import System

RESERVED = (STORE, ATTEMPTS, "papers", "inference", "bisect")
"""Folders of `results/` that are not experiments."""
Provider = Callable[[str], Path]
"""Name of a prepared input -> its file, which is created if missing."""


Files = tuple[Experiment, YamlSource, Library, list[NamedProfile]]
"""An experiment and everything read for it."""


@dataclass
class Plan:
    """An experiment resolved for this host."""

    experiment: Experiment
    specs: list[RunSpec]
    sequences: dict[str, Sequence]
    circumstances: Circumstances
    left_out: list[str]
    """Skipped datasets that are not on this machine, with how to get them."""
    remarks: list[str] = field(default_factory=list)
    """What was assumed about the link's recordings."""


def repetitions(experiment: Experiment, asked: int | str | None) -> int:
    """Returns the runs per cell: a number, `paper`, or the experiment's default."""
    if asked is None or asked == "default":
        return experiment.runs.default
    if asked == "paper":
        if experiment.runs.paper is None:
            raise SlambedError(f"experiment {experiment.id} has no runs.paper; give a number")
        return experiment.runs.paper
    if (isinstance(asked, int) or asked.isdecimal()) and 1 <= (count := int(asked)) <= MOST_RUNS:
        return count
    raise SlambedError(
        f"--runs {asked} is neither a number from 1 to {MOST_RUNS:,} nor 'paper' nor 'default'"
    )


def check(
    experiment: Experiment, source: YamlSource, library: Library, engine: str = ""
) -> list[NamedProfile]:
    """Validates an experiment without preparing or starting anything."""
    must_be_free(experiment.id)
    for role in ("mobile", "edge"):
        named = getattr(experiment.devices, role)
        if isinstance(named, str) and role in experiment.devices.model_fields_set:
            _must_be_a_device(named, role, source, library)
    profiles = read_profiles(experiment, source, read_profile)
    _check_profiles(experiment, source, profiles)
    kept = _kept_sequences(experiment)
    first_runs(experiment, source, library, profiles, engine, kept)
    _check_readers(experiment, source, library)
    for index, name in enumerate(experiment.datasets):
        try:
            sensor = sensor_of(name)
            if experiment.missing_datasets == "refuse":
                must_be_here(name)
            if name not in kept:
                kept_sequence(name)
        except SlambedError as error:
            raise _of_dataset(error, source, index) from None
        _check_sensor(sensor, experiment, source, library, index)
    return profiles


def must_be_free(name: str) -> None:
    """Raises SlambedError for the name of an experiment that is a folder of results/."""
    if name in RESERVED:
        raise SlambedError(
            f"no experiment may be called '{name}', as a folder of results/ is; take another name"
        )


def _must_be_a_device(name: str, role: str, source: YamlSource, library: Library) -> None:
    """Also of a role that no system has."""
    try:
        library.device(name)
    except SlambedError as error:
        raise source.complaint(str(error), ("devices", role)) from None


def _kept_sequences(experiment: Experiment) -> dict[str, Sequence]:
    """Returns the datasets that are already prepared. Errors about a dataset are not reported
    here."""
    kept: dict[str, Sequence] = {}
    for name in experiment.datasets:
        with suppress(SlambedError):
            if (sequence := kept_sequence(name)) is not None:
                kept[name] = sequence
    return kept


def _check_profiles(
    experiment: Experiment, source: YamlSource, profiles: list[NamedProfile]
) -> None:
    """A board has a real link, which cannot be emulated."""
    if experiment.roles is None:
        return
    for index, profile in enumerate(profiles):
        if not adds_nothing(profile):
            raise source.complaint(
                f"profile '{profile.name}' emulates a link, but to board "
                f"{experiment.roles.mobile.called} there is a real one",
                ("link", "profiles", index),
                "write link.profiles: [none]",
            )


def notes(experiment: Experiment, library: Library) -> list[str]:
    """Returns remarks on replaced datasets and how to get the originals, defaults that the
    experiment relies on, and what cannot be measured for its systems."""
    fps = experiment.playback.fps
    stand_ins = [line for line in map(stand_in, experiment.datasets) if line]
    return (
        assumed(experiment)
        + _of_board(experiment)
        + stand_ins
        + [line for name in experiment.datasets if (line := other_rate(name, fps))]
        + [
            f"{system.name} reads a recorded folder at its own speed, whatever playback.mode says: "
            "frames dropped, tracking times and live poses are not known, and left empty"
            for system in _readers(experiment, library)
        ]
    )


def remarks_on(profiles: list[NamedProfile], longest_s: float = math.inf) -> list[str]:
    """Returns what was assumed about the recordings of link profiles, which are longer than the
    longest run, and whose outages all begin after it, if its length is known."""
    assumed_of_files = [f"profile {p.name}: {line}" for p in profiles for line in p.remarks]
    too_long = [
        f"profile {p.name}: a run plays the first {longest_s:.0f} s of "
        f"{part.length_s:.0f} s in {part}; start_s chooses another part"
        for p in profiles
        for part in dict.fromkeys(p.recorded)
        if part.length_s > longest_s + END_SLACK_S
    ]
    too_late = [
        f"profile {p.name}: its outages begin after the end of a run, at {longest_s:.0f} s"
        for p in profiles
        if p.content.get("gaps")
        and math.isfinite(longest_s)
        and not outages_within(p.content, longest_s)
    ]
    return assumed_of_files + too_long + too_late


def unplayed(experiment: Experiment, profiles: list[NamedProfile]) -> list[str]:
    """Returns a remark on profiles that every system's own list leaves out."""
    if any(choice.profiles is None for choice in experiment.systems):
        return []
    played = {name for choice in experiment.systems for name in choice.profiles or ()}
    left_out = [profile.name for profile in profiles if profile.name not in played]
    if not left_out:
        return []
    return [f"no system plays {', '.join(left_out)} of link.profiles: each has profiles of its own"]


def at_host_pace(specs: list[RunSpec]) -> list[str]:
    """Returns a remark for live runs of our systems whose stages take less than on their device."""
    boards = dict.fromkeys(
        spec.device_mobile.name
        for spec in specs
        if spec.engine != VIRTUAL
        and spec.pace == HOST_PACE
        and spec.runtime is None
        and spec.board is None
        and spec.device_mobile.board is not None
        and spec.device_mobile.model is not None
    )
    if not boards:
        return []
    remedy = "--set pace=device makes them as long as there"
    if any(spec.runtime is not None for spec in specs):
        remedy = "pace: device is for experiments without programs that are not slambed's"
    return [
        f"computing times are this machine's with the limits of {', '.join(boards)}, usually much "
        f"shorter than on the device; {remedy}"
    ]


def _end_before_end_s(
    experiment: Experiment, sequences: Mapping[str, Sequence], names: Mapping[str, tuple[str, str]]
) -> list[str]:
    """Returns a remark for each shorter sequence that replaces the one that `end_s` was meant
    for. Where nothing is replaced, the same is a mistake (`expand`)."""
    end_s = experiment.playback.end_s
    if end_s is None:
        return []
    lasting = {name: (found, sequences[found].times_s[-1]) for name, (found, _) in names.items()}
    return [
        f"{found} ends at {last_s:.0f} s, before playback.end_s {end_s:g}"
        for name, (found, last_s) in lasting.items()
        if found != name and last_s + END_SLACK_S < end_s
    ]


def _of_board(experiment: Experiment) -> list[str]:
    """Returns a remark on settings that do not apply to a mobile node on a board."""
    if experiment.roles is None:
        return []
    given = [experiment.devices.mobile, *(choice.devices.mobile for choice in experiment.systems)]
    names = [item if isinstance(item, str) else item.name for item in given if item is not None]
    asked = ", ".join(dict.fromkeys(name for name in names if name != "host"))
    if not asked:
        return []
    return [
        f"devices.mobile ({asked}) is not applied: board {experiment.roles.mobile.called} is the "
        "device itself, without limits"
    ]


def _readers(experiment: Experiment, library: Library) -> list[System]:
    """Returns its systems that read a recorded folder, each once."""
    named = dict.fromkeys(choice.system for choice in experiment.systems)
    systems = [library.system(name) for name in named]
    return [s for s in systems if s.runtime is not None and s.runtime.reads is not None]


def _check_readers(experiment: Experiment, source: YamlSource, library: Library) -> None:
    for system in _readers(experiment, library):
        if experiment.playback.stop_at_first_loss:
            raise source.complaint(
                f"system {system.name} reads a recorded folder, so nobody sees when it loses "
                "track; leave stop_at_first_loss out",
                ("playback", "stop_at_first_loss"),
            )


def planned_runs(experiment: Experiment, source: YamlSource, library: Library) -> int:
    """Returns the number of runs if all datasets are available."""
    profiles = read_profiles(experiment, source, read_profile)
    cells = first_runs(experiment, source, library, profiles, experiment.engine)
    return len(cells) * repetitions(experiment, None)


def first_runs(
    experiment: Experiment,
    source: YamlSource,
    library: Library,
    profiles: list[NamedProfile],
    engine: str,
    kept: Mapping[str, Sequence] = MappingProxyType({}),
) -> list[RunSpec]:
    """Returns the first run of every cell, without knowledge of the host.

    `kept`: the datasets that are already prepared; the others are named by the sequence they will
    become, without its content.
    """
    nowhere = {
        name: (kept[name].id if name in kept else _id_of(name), name)
        for name in experiment.datasets
    }
    played_s = {name: known.played_s(experiment.playback) for name, known in kept.items()}
    anyhow = {profile.name: "" for profile in profiles}
    engine = engine if engine in (LOCAL, VIRTUAL) else ""
    maps = {name: prior_map_of(name) for name in experiment.datasets if wants_maps(experiment)}
    prior = {name: (made, made) for name, made in maps.items() if made is not None}
    playbacks = {name: known.playback(experiment.playback) for name, known in kept.items()}
    host = Circumstances(engine, anyhow, "", nowhere, played_s, playbacks, prior)
    return expand(experiment, source, library, profiles, host, runs=1)


def _id_of(name: str) -> str:
    """Returns by which name the runs on a dataset are known; an unknown one is reported later."""
    try:
        return sequence_id(name)
    except SlambedError:
        return name


def wants_maps(experiment: Experiment) -> bool:
    """Returns whether any system starts with the prior map of its dataset."""
    return any(inputs.FROM_DATASET in choice.params.values() for choice in experiment.systems)


def _of_dataset(error: SlambedError, source: YamlSource, index: int) -> SlambedError:
    return SlambedError(f"{error} ({source.place_of(('datasets', index))})", error.code)


def _check_sensor(
    sensor: str, experiment: Experiment, source: YamlSource, library: Library, index: int
) -> None:
    """Checks that every system supports the sensor of the dataset."""
    for choice in experiment.systems:
        sensors = library.system(choice.system).sensors
        if sensor not in sensors and experiment.datasets[index] in experiment.datasets_of(choice):
            raise source.complaint(
                f"dataset {experiment.datasets[index]} is {sensor}, system {choice.system} plays "
                + " and ".join(sensors),
                ("datasets", index),
            )


def make_plan(
    experiment: Experiment,
    source: YamlSource,
    library: Library,
    profiles: list[NamedProfile],
    engine: str,
    software: str,
    count: int,
    provide: Provider | None = None,
    judged: bool = True,
    foreign: Mapping[str, str] | None = None,
    notify: Notify = lambda line: None,
    netem: bool | None = None,
    board: Board | None = None,
    only_on: frozenset[str] | None = None,
) -> Plan:
    """Prepares the datasets, the inputs that their files name, and the masks of virtual runs;
    expands the matrix.

    `judged`: also prepare the reference that runs are compared with. Without `provide` no input is
    created. `foreign`: tags of systems with their own programs. `notify` is called before long
    work. `netem`: whether all of several hosts have netem; None means that this host executes the
    runs, and its speed enters their keys. `board`: the machine of the mobile nodes, if the
    experiment selects one. `only_on`: names of the datasets to plan runs on, of which there must be
    one in the experiment; None means all.
    """
    sequences: dict[str, Sequence] = {}
    names: dict[str, tuple[str, str]] = {}
    played_s: dict[str, float] = {}
    playbacks: dict[str, Playback] = {}
    left_out: list[str] = []
    for index, name in enumerate(experiment.datasets):
        if only_on is not None and name not in only_on:
            continue
        try:
            sequence = prepare_sequence(name, notify)
            played_s[name] = sequence.played_s(experiment.playback)
            playbacks[name] = sequence.playback(experiment.playback)
        except SlambedError as error:
            if isinstance(error, MissingDataError) and experiment.missing_datasets == "skip":
                left_out.append(str(error))
                continue
            raise _of_dataset(error, source, index) from None
        _check_sensor(sequence.sensor, experiment, source, library, index)
        sequences[sequence.id] = sequence
        names[name] = (sequence.id, sequence.checksum)
    if not sequences:
        raise SlambedError(f"no dataset of {source.path} is on this machine: {left_out[0]}")
    backends: dict[str, str] = {}
    if experiment.link is not None and needs_link(experiment, library):
        asked = experiment.link.backend
        backends = {p.name: VIRTUAL if board is None else NETWORK for p in profiles}
        if engine != VIRTUAL and board is None:
            cut = has_cuts(experiment)
            backends = {p.name: backend_for(asked, p, cut, netem) for p in profiles}
    prior: dict[str, tuple[str, str]] = {}
    references: dict[str, str] = {}
    by_name = {name: sequences[found] for name, (found, _) in names.items()}
    for name, sequence in by_name.items():
        if provide is None:
            break
        if wants_maps(experiment) and sequence.prior_map:
            made = provide(sequence.prior_map)
            prior[name] = (str(made), inputs.sha256_of(made))
        if judged and sequence.reference:
            references[name] = str(provide(sequence.reference))
    segmented = datasets_with_masks(experiment, library)
    by_name = {name: sequence for name, sequence in by_name.items() if name in segmented}
    wanted = masks_asked(experiment, library)
    masks = (
        make_masks(wanted, by_name, notify) if engine == VIRTUAL else networks_of(wanted, by_name)
    )
    linked = software_of_systems(software, {choice.system for choice in experiment.systems})
    circumstances = Circumstances(
        engine,
        backends,
        software,
        names,
        played_s,
        playbacks,
        prior,
        masks,
        references,
        software_of=linked | dict(foreign or {}),
        board=board,
        host_speed=load_host_speed().speed if netem is None else None,
    )
    specs = expand(experiment, source, library, profiles, circumstances, count)
    remarks = (
        unplayed(experiment, profiles)
        + _end_before_end_s(experiment, sequences, names)
        + remarks_on(profiles, max(played_s.values()))
        + at_host_pace(specs)
    )
    return Plan(experiment, specs, sequences, circumstances, left_out, remarks)


def masks_asked(experiment: Experiment, library: Library) -> list[MasksAsked]:
    """Returns the distinct segmentation settings of the experiment's systems."""
    found: dict[MasksAsked, None] = {}
    for choice in experiment.systems:
        found |= dict.fromkeys(_masks_of(choice, library))
    return list(found)


def datasets_with_masks(experiment: Experiment, library: Library) -> set[str]:
    """Returns the datasets that a system with segmentation plays."""
    return {
        name
        for choice in experiment.systems
        if _masks_of(choice, library)
        for name in experiment.datasets_of(choice)
    }


def _masks_of(choice: SystemChoice, library: Library) -> list[MasksAsked]:
    system = library.system(choice.system)
    params = system.resolve(system.choose_variant(choice.variant), choice.params)
    asked = MasksAsked.of(system, params, choice.label or choice.variant or "")
    return [] if asked is None else asked.with_table(params)


def experiment_json(
    plan: Plan, source: YamlSource, ordered: list[RunSpec], before: dict[str, Any]
) -> dict[str, Any]:
    """Returns the experiment as executed: the file's content, the host's decisions, all runs in
    order, and the last planned runs of other engines from the file `before`."""
    return {
        "experiment": plan.experiment.model_dump(mode="json"),
        "file": {
            "name": source.path.name,
            "sha256": hashlib.sha256(source.path.read_bytes()).hexdigest(),
        },
        "engine": plan.circumstances.engine,
        "link_backends": dict(plan.circumstances.link_backends),
        "software": plan.circumstances.software,
        "datasets": {name: found for name, (found, _) in plan.circumstances.datasets.items()},
        "stand_ins": {s.id: s.stands_in_for for s in plan.sequences.values() if s.stands_in_for},
        "written_utc": utc_now(),
        "runs": [
            *({"run_key": s.run_key, **s.model_dump(mode="json")} for s in ordered),
            *of_other_engines(before, plan.circumstances.engine),
        ],
    }
