# SPDX-License-Identifier: Apache-2.0
"""Input files of runs that are produced by other runs: created once, cached by key, verified
before use."""

import hashlib
import json
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from slambed.campaign.ledger import utc_now
from slambed.campaign.plan import Plan, Provider, make_plan
from slambed.campaign.virtual_task import VirtualTask
from slambed.data.places import cache_folder, making
from slambed.errors import SlambedError
from slambed.files.json_file import object_or_empty
from slambed.metrics.collect import read_log
from slambed.metrics.summary import Summary
from slambed.native import SIMULATION, find_program
from slambed.spec import inputs
from slambed.spec.device import VIRTUAL
from slambed.spec.experiment import DeviceChoice, Experiment, Runs, SystemChoice
from slambed.spec.input_recipe import YIELDED, InputRecipe
from slambed.spec.library import Library
from slambed.spec.run_spec import KEY_DIGITS, canonical_json
from slambed.spec.software import host_software

RECORD = "input.json"
Notify = Callable[[str], None]


@dataclass(frozen=True)
class PreparedInput:
    """The file of a recipe, with the record of its creation."""

    file: Path
    sha256: str
    record: dict[str, Any]


def inputs_folder() -> Path:
    """Returns the cache folder of prepared inputs."""
    return cache_folder() / "inputs"


def prepare_input(name: str, library: Library, notify: Notify) -> PreparedInput:
    """Returns the file of a recipe, from the cache or created now by its run.

    Raises SlambedError if the run does not meet the recipe's conditions; then nothing is kept.
    """
    plan, recipe = _plan(name, library, lambda other: prepare_input(other, library, notify).file)
    folder = inputs_folder() / f"{recipe.id}-{_key(plan, recipe)}"
    if (ready := _open(folder, recipe, notify)) is not None:
        return ready
    with making(inputs_folder(), recipe.id, f"makes {recipe.id}", notify):
        if (ready := _open(folder, recipe, notify)) is None:
            notify(f"making input {recipe.id}: {recipe.title}")
            _make(folder, plan, recipe)
            ready = _open(folder, recipe, notify)
    assert ready is not None
    return ready


def kept_input(name: str, library: Library) -> PreparedInput:
    """Returns the file from the cache. Raises SlambedError if it would have to be created."""
    plan, recipe = _plan(name, library, lambda other: kept_input(other, library).file)
    ready = _open(inputs_folder() / f"{recipe.id}-{_key(plan, recipe)}", recipe)
    if ready is None:
        raise SlambedError(f"input {name} is not there; make it: slambed inputs prepare {name}")
    return ready


def find_prepared(name: str) -> list[PreparedInput]:
    """Returns every existing file of a recipe, newest first, including those of other sources or
    data."""
    found = []
    for record in inputs_folder().glob(f"{name}-*/{RECORD}"):
        content = object_or_empty(record)
        if content.get("id") == name and (file := record.parent / str(content["file"])).is_file():
            found.append(PreparedInput(file, str(content["sha256"]), content))
    return sorted(found, key=lambda item: str(item.record.get("made_utc")), reverse=True)


def _silent(line: str) -> None:
    """Does nothing."""


def _plan(name: str, library: Library, provide: Provider) -> tuple[Plan, InputRecipe]:
    recipe, source = library.input(name)
    wanted = {"save_map": True} if recipe.yields == "map" else {}
    experiment = Experiment(
        id=f"input_{recipe.id}",
        title=recipe.title,
        systems=[
            SystemChoice(
                system=recipe.system, variant=recipe.variant, params=recipe.params | wanted
            )
        ],
        datasets=[recipe.dataset],
        playback=recipe.playback,
        devices=DeviceChoice(mobile=recipe.device),
        engine="virtual",
        runs=Runs(default=1),
        seed=recipe.seed,
    )
    if library.system(recipe.system).has_edge:
        raise source.complaint(f"system {recipe.system} has an edge: inputs are made by one node")
    software = host_software(program=SIMULATION)
    # A recipe is judged by its conditions: a reference run has no reference itself.
    plan = make_plan(experiment, source, library, [], VIRTUAL, software, 1, provide, judged=False)
    return plan, recipe


def _key(plan: Plan, recipe: InputRecipe) -> str:
    """Key over the run's meaning, the kept file and the conditions."""
    meaning = {
        "run": plan.specs[0].meaning(),
        "yields": recipe.yields,
        "must": recipe.must.model_dump(),
    }
    return hashlib.sha256(canonical_json(meaning).encode()).hexdigest()[:KEY_DIGITS]


def _open(folder: Path, recipe: InputRecipe, notify: Notify = _silent) -> PreparedInput | None:
    """Returns the cached input if its checksum matches; a damaged file is created again."""
    record = object_or_empty(folder / RECORD)
    file = folder / YIELDED[recipe.yields]
    if not record or not file.is_file():
        return None
    if inputs.sha256_of(file) != record.get("sha256"):
        notify(f"{file} is damaged: its SHA-256 is not the recorded one; it is made again")
        return None
    return PreparedInput(file, str(record["sha256"]), record)


def _make(folder: Path, plan: Plan, recipe: InputRecipe) -> None:
    (spec,), (sequence,) = plan.specs, plan.sequences.values()
    raw = folder.with_name(f".{folder.name}.partial")
    shutil.rmtree(raw, ignore_errors=True)
    raw.mkdir(parents=True)
    try:
        task = VirtualTask(
            spec,
            raw,
            sequence.path,
            sequence.played_s(spec.playback),
            find_program(SIMULATION),
            cache_folder() / "features",
            sys.argv,
        )
        summary = task.execute()
        if not summary.completed:
            raise SlambedError(f"input {recipe.id}: {summary['outcome_reason']}")
        found = _facts(raw, summary)
        if broken := recipe.must.broken_by(found):
            raise SlambedError(
                f"input {recipe.id}: its run does not fulfill catalog/inputs/{recipe.id}.yaml: "
                f"{'; '.join(broken)}; nothing was kept"
            )
        name = YIELDED[recipe.yields]
        kept = raw / "mobile" / name
        record = {
            "format": "slambed-input", "version": 1, "id": recipe.id, "yields": recipe.yields,
            "file": name, "sha256": inputs.sha256_of(kept), "size_bytes": kept.stat().st_size,
            "found": found, "keyframes": summary["keyframes"],
            "map_points": summary["map_points"], "run_key": spec.run_key,
            "dataset": spec.dataset, "sequence_checksum": spec.sequence_checksum,
            "software": spec.software, "inputs": spec.inputs, "made_utc": utc_now(),
        }  # fmt: skip
        whole = folder.with_name(f".{folder.name}.whole")
        shutil.rmtree(whole, ignore_errors=True)
        whole.mkdir()
        kept.rename(whole / name)
        (whole / RECORD).write_text(json.dumps(record, indent=1) + "\n")
        shutil.rmtree(folder, ignore_errors=True)
        whole.rename(folder)
    finally:
        shutil.rmtree(raw, ignore_errors=True)


def _facts(raw: Path, summary: Summary) -> dict[str, float]:
    """Returns the values that conditions can test."""
    bundles = [e for e in read_log(raw).of("stage") if e.get("name") == "global_bundle"]
    return {
        "coverage": summary.number("coverage") or 0.0,
        "loops_closed": summary.number("loops_closed") or 0.0,
        "global_bundles": float(len(bundles)),
    }
