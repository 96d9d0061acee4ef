# SPDX-License-Identifier: Apache-2.0
"""Plans of inferences: errors in one line, and whether results keep to a plan."""

import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
import yaml
from checkout import needs_git
from command_line import refused
from infer_parts import plan_content

from slambed.errors import ExitCode, SlambedError
from slambed.infer.inference_plan import find_plan, plan_files
from slambed.infer.keys import Key, split_key
from slambed.infer.registered import Registration, commit_of, registered_lines
from slambed.infer.rows import changed_device
from slambed.papers.published import cells_of, read_papers
from slambed.spec.device import CostModel, Device, DeviceChange, Limits, StageCost

Change = Callable[[dict[str, Any]], object]


def written(folder: Path, change: Change) -> Path:
    content = plan_content("room", "dark")
    change(content)
    path = folder / "dark.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False))
    return path


def spread(plan: dict[str, Any]) -> dict[str, Any]:
    found = plan["open"]["spread"]
    assert isinstance(found, dict)
    return found


@pytest.mark.parametrize(
    ("change", "output"),
    [
        (lambda p: p["open"].clear(), "nothing is open"),
        (lambda p: spread(p).update(range=[0.9, 0.1]), "range 0.9 to 0.1 is reversed"),
        (lambda p: spread(p).update(range=[0.5, 0.5]), "is reversed or empty"),
        (lambda p: spread(p).pop("range"), "one of range, values, cases"),
        (lambda p: spread(p).update(values=[0.1, 0.2]), "one of range, values, cases"),
        (lambda p: spread(p).update(set="jitter.track"), "'jitter.track' cannot be set"),
        (lambda p: spread(p).update(set="devices.middle.speed"), "cannot be set"),
        (lambda p: spread(p).update(printed="much"), "printed 'much' is no number"),
        (lambda p: p["open"]["pictures"].update(values=["room"]), "two values at least"),
        (lambda p: p["open"]["pictures"].update(values=["a", "a"]), "two values at least"),
        (lambda p: p["held_out"].append("small.T1.losses.helped"), "held out and fitted too"),
        (lambda p: p["fit"].append("small.T1.losses.helped"), "named twice"),
        (lambda p: p["fit"].clear(), "fit"),
        (lambda p: p["held_out"].clear(), "held_out"),
        (lambda p: p["full"].update(first_runs=50), "final_runs 6 is below first_runs 50"),
        (lambda p: p["full"].update(first_runs=1), "first_runs"),
        (lambda p: p["success"][0].pop("at_least"), "fitted_inside takes at_least"),
        (lambda p: p["success"].append({"says": "s", "kind": "rises", "cells": ["small.T9.a.b",
         "small.T1.losses.helped"]}), "neither fitted nor held out"),
        (lambda p: p["success"].append({"says": "s", "kind": "rank", "at_least": 0.9,
         "cells": ["small.T1.losses.{helped,alone}"]}), "3 cells at least"),
        (lambda p: p.update(id="other"), "id 'other' is not the file's name"),
        (lambda p: p.update(held_in=[]), "held_in"),
    ],
)  # fmt: skip
def test_a_wrong_plan_is_one_line_with_its_place(
    tmp_path: Path, change: Change, output: str
) -> None:
    path = written(tmp_path, change)
    line = refused(ExitCode.BAD_INPUT, "infer", str(path), "--dry-run", cwd=tmp_path)
    assert output in line and "dark.yaml line" in line


def test_an_unknown_plan_lists_the_known_ones(tmp_path: Path) -> None:
    line = refused(ExitCode.BAD_INPUT, "infer", "dynnet_t3", cwd=tmp_path)
    assert "unknown plan 'dynnet_t3'" in line and "dynnet_t2" in line


def test_every_plan_of_the_checkout_is_whole_and_its_cells_are_printed() -> None:
    files = plan_files()
    assert files
    for name, file in files.items():
        plan, _ = find_plan(name)
        assert file.parents[1].name == plan.paper
        known = cells_of(read_papers([plan.paper])[0])
        assert set(plan.fit) | set(plan.held_out) <= set(known)
        # The item for the sequence's appearance counts as one of the three scalars, even as a list
        # of values.
        kinds = [item for item in plan.open.values() if item.range or str(item.set).startswith("d")]
        assert len(kinds) <= 3, "more scalars are no fit but a search for one"
        assert len(plan.open) - len(kinds) <= 4, "readings of what the paper may mean"


def test_keys_name_what_is_set() -> None:
    assert split_key("params.n_orb") == Key("params", "n_orb")
    assert split_key("devices.mobile.jitter.track") == Key("devices", "mobile", "jitter.track")
    assert split_key("datasets./data/a.b") == Key("datasets", "/data/a.b")


def test_a_device_is_changed_in_one_thing_more() -> None:
    first = changed_device("pi", split_key("devices.mobile.jitter.track"), 0.5)
    second = changed_device(first, split_key("devices.mobile.speed"), 2.0)
    assert second == {"device": "pi", "jitter": {"track": 0.5}, "speed": 2.0,
                      "name": "pi_speed2.0_track-0.5"}  # fmt: skip
    assert changed_device("pi", split_key("devices.mobile"), "nano") == "nano"
    model = CostModel(cores=1, stages={"track": StageCost(a_us=5.0, jitter=0.1)})
    device = Device(name="pi", title="pi", limits=Limits(), model=model)
    changed = DeviceChange.model_validate(second).applied_to(device)
    assert changed.model is not None
    assert changed.model.stages["track"] == StageCost(a_us=5.0, jitter=0.5)
    assert changed.model.speed == 2.0 and model.stages["track"].jitter == 0.1
    cheaper = DeviceChange(device="pi", name="x", stages={"track": StageCost(b_us=1.0)})
    assert cheaper.applied_to(device).model == CostModel(
        cores=1, stages={"track": StageCost(b_us=1.0)}
    )
    for change in ({"jitter": {"trac": 0.1}}, {"stages": {"trac": {}}}):
        unknown = DeviceChange.model_validate({"device": "pi", "name": "x", **change})
        with pytest.raises(ValueError, match=r"no cost of stage 'trac'; .*track"):
            unknown.applied_to(device)


def git(folder: Path, *arguments: str) -> str:
    named = ["-c", "user.name=n", "-c", "user.email=n@example.org"]
    command = ["git", "-C", str(folder), *named, *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


@needs_git
def test_a_commit_holds_files_only_as_they_are(tmp_path: Path) -> None:
    first, second = tmp_path / "a.yaml", tmp_path / "b.yaml"
    first.write_text("a: 1\n")
    second.write_text("b: 1\n")
    assert commit_of([first]) == (None, "a.yaml is in no git repository")
    git(tmp_path, "init")
    git(tmp_path, "add", "a.yaml")
    git(tmp_path, "commit", "-m", "one")
    head = git(tmp_path, "rev-parse", "HEAD")
    assert commit_of([first]) == (head, "")
    assert commit_of([first, second]) == (None, "b.yaml is not committed")
    git(tmp_path, "add", "b.yaml")
    assert commit_of([first, second]) == (None, "b.yaml has changes that are not committed")
    git(tmp_path, "commit", "-m", "two")
    first.write_text("a: 2\n")
    assert commit_of([first, second]) == (None, "a.yaml has changes that are not committed")


def runs(digests: list[str | None], commits: list[str | None]) -> pd.DataFrame:
    return pd.DataFrame({"plan.inference/x": digests, "plan_commit.inference/x": commits})


@pytest.mark.parametrize(
    ("digests", "commits", "commit", "output", "bad"),
    [
        (["d", "d"], ["c" * 40, "c" * 40], "e" * 40, ["before 2 of 2 runs"], 0),
        (["d", "d"], ["c" * 40, None], "e" * 40, ["1 of 2 runs were made before the plan was"], 1),
        (["d", "old"], ["c" * 40, "c" * 40], "e" * 40, ["1 of 2 runs were made under another"], 1),
        (["d", None], ["c" * 40, None], "e" * 40, ["1 of 2 runs do not say"], 1),
        (["d", "d"], [None, None], None, ["is not registered: why", "2 of 2 runs were made"], 2),
    ],
)
def test_a_page_reports_what_does_not_keep_to_its_plan(
    digests: list[str | None], commits: list[str | None], commit: str | None, output: list[str],
    bad: int,
) -> None:  # fmt: skip
    registration = Registration("inference/x", "d", commit, "why")
    lines = registered_lines(registration, runs(digests, commits))
    assert sum(line.bad for line in lines) == bad
    message = " ".join(line.text for line in lines)
    assert all(part in message for part in output), message


def test_runs_of_a_time_before_there_were_plans_say_nothing() -> None:
    registration = Registration("inference/x", "d", "c" * 40)
    (line,) = registered_lines(registration, pd.DataFrame({"run_key": ["k"]}))
    assert line.bad and "1 of 1 runs do not say" in line.text


def test_a_torn_plan_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "torn.yaml"
    path.write_text("id: [\n")
    with pytest.raises(SlambedError, match="not YAML"):
        find_plan(str(path))
