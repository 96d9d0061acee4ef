# SPDX-License-Identifier: Apache-2.0
"""A cost model in a device file: what is replaced and what is kept."""

from pathlib import Path

import pytest
import yaml
from pydantic import ValidationError

from slambed.calibrate.device_file import write_model
from slambed.errors import SlambedError
from slambed.files.yaml_source import read_model
from slambed.native import repository_root
from slambed.spec.device import Accelerator, CostModel, Device, StageCost
from slambed.spec.library import Library

DEVICE = """\
# SPDX-License-Identifier: Apache-2.0
name: board
title: A board
limits: {}
# Fitted long ago.
model:
  cores: 4
  speed: 1
  stages:
    loop_close: {a_us: 5, b_us: 20}
    track:      {a_us: 100}
"""


NOTED = """\
# SPDX-License-Identifier: Apache-2.0
name: board
title: 'A board'  # in the lab
notes: >-
  Two
  lines.
limits: {}
# Fitted long ago.
model:
  cores: 4
  speed: 1
  stages:
    loop_close: {a_us: 5, b_us: 20}  # guessed
    track:      {a_us: 100}  # old
# what follows
hardware: none
"""


def stages_in(path: Path) -> dict[str, StageCost]:
    model = yaml.safe_load(path.read_text(encoding="utf-8"))["model"]
    return dict(CostModel.model_validate(model).stages)


def test_stages_that_were_not_measured_keep_their_cost(tmp_path: Path) -> None:
    path = tmp_path / "board.yaml"
    path.write_text(DEVICE, encoding="utf-8")
    model = CostModel(cores=2, stages={"track": StageCost(a_us=70), "fuse": StageCost(c_us=2)})
    write_model(path, model, {"": "Fitted now."}, "title")
    text = path.read_text(encoding="utf-8")
    assert stages_in(path) == {
        "fuse": StageCost(c_us=2),
        "loop_close": StageCost(a_us=5, b_us=20),
        "track": StageCost(a_us=70),
    }
    assert "cores: 2" in text and "title: A board" in text
    assert "Fitted now." in text and "Fitted long ago." not in text


def test_what_somebody_wrote_beside_it_stays(tmp_path: Path) -> None:
    """Comments, quotes, folded text, and remarks on stages that were not measured again."""
    path = tmp_path / "board.yaml"
    path.write_text(NOTED)
    write_model(
        path,
        CostModel(cores=2, stages={"track": StageCost(a_us=70.25)}),
        {
            "": "Fitted now,\nfrom a run.",
            "track": "12 of them",
        },
        "title",
    )
    assert (
        path.read_text()
        == """\
# SPDX-License-Identifier: Apache-2.0
name: board
title: 'A board'  # in the lab
notes: >-
  Two
  lines.
limits: {}
# Fitted now,
# from a run.
model:
  cores: 2
  speed: 1
  stages:
    loop_close: {a_us: 5, b_us: 20}  # guessed
    track: {a_us: 70.25} # 12 of them
# what follows
hardware: none
"""
    )
    write_model(path, CostModel(cores=2, stages={"track": StageCost(a_us=1)}), {}, "title")
    assert "    track: {a_us: 1}\n# what follows\nhardware: none\n" in path.read_text()
    assert "Fitted now" not in path.read_text()


@pytest.mark.parametrize(
    "name", sorted(p.stem for p in (repository_root() / "catalog" / "devices").glob("*.yaml"))
)
def test_a_device_of_ours_with_its_own_model_written_again_is_the_same(
    name: str, tmp_path: Path
) -> None:
    ours = repository_root() / "catalog" / "devices" / f"{name}.yaml"
    path = tmp_path / ours.name
    path.write_text(ours.read_text())
    before = read_model(Device, path)
    if before.model is None:
        return
    write_model(path, before.model, {"": "The same."}, "another title")
    assert read_model(Device, path) == before
    write_model(path, before.model, {"": "And again."}, "another title")
    assert path.read_text().count("# And again.") == 1 and "The same." not in path.read_text()


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ('title: "a\\u0007b"', "'title': expected text without control characters"),
        ("title: a\nlimits: {cores: 100000}", "'limits.cores': input should be less than or equal"),
        (
            "title: a\nlimits: {memory_mb: 99999999}",
            "'limits.memory_mb': input should be",
        ),
    ],
)
def test_what_no_device_has_is_refused(line: str, complaint: str, tmp_path: Path) -> None:
    path = tmp_path / "board.yaml"
    limits = "" if "limits" in line else "\nlimits: {}"
    path.write_text(f"name: board\n{line}{limits}\n")
    with pytest.raises(SlambedError, match=complaint):
        read_model(Device, path)


def test_lines_of_a_title_are_joined(tmp_path: Path) -> None:
    path = tmp_path / "board.yaml"
    path.write_text("name: board\nlimits: {}\ntitle: |\n  one\n  two\n")
    assert read_model(Device, path).title == "one two"


@pytest.mark.parametrize("text", ["- a list\n", "name: [\n", ""])
def test_what_is_no_device_is_one_line(text: str, tmp_path: Path) -> None:
    path = tmp_path / "board.yaml"
    path.write_text(text)
    with pytest.raises(SlambedError, match=r"board\.yaml") as raised:
        write_model(path, CostModel(cores=1, stages={}), {}, "title")
    assert "\n" not in str(raised.value) and path.read_text() == text


def test_a_new_file_holds_the_model_alone(tmp_path: Path) -> None:
    path = tmp_path / "fresh.yaml"
    write_model(path, CostModel(cores=1, stages={"track": StageCost(a_us=1)}), {}, "Fresh")
    assert stages_in(path) == {"track": StageCost(a_us=1)}
    assert "title: Fresh" in path.read_text() and "name: fresh" in path.read_text()


def test_accelerators_come_back_from_the_file_and_change_no_key_of_other_devices(
    tmp_path: Path,
) -> None:
    plain = CostModel(cores=1, stages={"track": StageCost(a_us=1)})
    assert plain.model_dump() == {
        "cores": 1,
        "speed": 1.0,
        "stages": {"track": {"a_us": 1.0, "b_us": 0.0, "c_us": 0.0, "jitter": 0.0}},
    }
    model = CostModel(
        cores=1,
        accelerators={"gpu": Accelerator(lanes=2, speed=3)},
        stages={"infer": StageCost(a_us=1, accelerator="gpu")},
    )
    path = tmp_path / "fast.yaml"
    write_model(path, model, {}, "Fast")
    written = yaml.safe_load(path.read_text(encoding="utf-8"))["model"]
    assert CostModel.model_validate(written, strict=False) == model
    with pytest.raises(ValidationError, match="none of accelerators"):
        CostModel(cores=1, stages={"infer": StageCost(a_us=1, accelerator="gpu")})


UPDATE_SHARES = {
    "clean_map": 0.0703,
    "insert_keyframes": 0.8772,
    "update_reference": 0.0016,
    "update_last_frame": 0.0509,
}
"""IJNC 2025, Table 2."""
FITTED_TO_AN_UPDATE = {"raspberry_pi_4", "raspberry_pi_4_ijnc"}


LIVE_ONLY = {"core_1", "core_1_2", "core_1_4", "core_1_8"}
"""Devices without a cost model: shares of a core for programs that run live only."""


def test_devices_without_a_cost_model_are_those_for_live_runs() -> None:
    library = Library()
    assert {name for name in library.devices() if library.device(name).model is None} == LIVE_ONLY


@pytest.mark.parametrize("name", sorted(set(Library().devices()) - LIVE_ONLY))
def test_every_device_can_play_both_nodes_of_an_update(name: str) -> None:
    """Its stages have costs, in the paper's proportions unless a fit found others."""
    model = Library().device(name).model
    assert model is not None
    wanted = {"parse", "parse_text", "prepare_update", "relocalize", "serialize", "serialize_text"}
    if name == "jetson_tx2":
        wanted.remove("prepare_update")  # a mobile node has no such stage
    assert wanted | UPDATE_SHARES.keys() <= model.stages.keys()
    whole = model.stages["apply_update"]
    for stage, share in UPDATE_SHARES.items():
        part = model.stages[stage]
        assert part.a_us > 0 and part.b_us > 0
        if name not in FITTED_TO_AN_UPDATE:
            assert part.a_us == pytest.approx(share * whole.a_us, rel=2e-3)
            assert part.b_us == pytest.approx(share * whole.b_us, rel=2e-3)
            assert part.jitter == whole.jitter


@pytest.mark.parametrize("name", ["edge_i7_6700k", "edge_i7_6700k_1_core", "vehicle_e5_2680v2"])
def test_cloudslams_machines_have_as_many_cores_live_as_in_their_model(name: str) -> None:
    device = Library().device(name)
    assert device.model is not None
    assert device.limits.cores == device.model.cores
