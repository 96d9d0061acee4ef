# SPDX-License-Identifier: Apache-2.0
"""A cost model in a device file: what is replaced and what stays."""

from pathlib import Path

import pytest
import yaml
from pydantic import ValidationError

from slambed.calibrate.device_file import stages_in, write_model
from slambed.spec.device import Accelerator, CostModel, StageCost

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


def test_stages_that_were_not_measured_keep_their_cost(tmp_path: Path) -> None:
    path = tmp_path / "board.yaml"
    path.write_text(DEVICE, encoding="utf-8")
    model = CostModel(cores=2, stages={"track": StageCost(a_us=70), "fuse": StageCost(c_us=2)})
    write_model(path, model, {"": "Fitted now."}, "title")
    text = path.read_text(encoding="utf-8")
    assert stages_in(text) == {
        "fuse": StageCost(c_us=2),
        "loop_close": StageCost(a_us=5, b_us=20),
        "track": StageCost(a_us=70),
    }
    assert "cores: 2" in text and "title: A board" in text
    assert "Fitted now." in text and "Fitted long ago." not in text


def test_a_file_without_a_model_has_no_stages() -> None:
    assert stages_in("name: board\n") == {}
    assert stages_in("") == {}


def test_a_new_file_holds_the_model_alone(tmp_path: Path) -> None:
    path = tmp_path / "fresh.yaml"
    write_model(path, CostModel(cores=1, stages={"track": StageCost(a_us=1)}), {}, "Fresh")
    assert stages_in(path.read_text(encoding="utf-8")) == {"track": StageCost(a_us=1)}


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
