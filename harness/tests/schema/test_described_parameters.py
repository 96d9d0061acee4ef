# SPDX-License-Identifier: Apache-2.0
"""The programs' descriptions of their systems agree with system.yaml."""

import json
import subprocess

import pytest

from slambed.native import find_program
from slambed.spec.library import Library

pytestmark = pytest.mark.programs

LIBRARY = Library()
OURS = [name for name in LIBRARY.systems() if LIBRARY.system(name).runtime is None]


@pytest.fixture(scope="module")
def described() -> dict[str, dict[str, object]]:
    command = [str(find_program("slambed-node")), "--describe"]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    content: dict[str, dict[str, object]] = json.loads(done.stdout)
    return content


def test_own_messages_are_reported_with_their_numbers(
    described: dict[str, dict[str, object]],
) -> None:
    own = {name: system["messages"] for name, system in described.items() if system["messages"]}
    semantic = ["SEMANTIC_KEYFRAME", "OPT_RESULT", "MASK", "NO_MASK", "KEYFRAME_REFUSED"]
    assert own == {
        "edgeslam_semantic": {name: 128 + place for place, name in enumerate(semantic)},
        "example_backpressure": {"BACKLOG": 128},
    }


def test_every_system_is_in_the_programs(described: dict[str, dict[str, object]]) -> None:
    assert sorted(described) == sorted(OURS)


@pytest.mark.parametrize("name", OURS)
def test_parameters_have_the_same_ranges(
    described: dict[str, dict[str, object]], name: str
) -> None:
    fields = {"type", "min", "max", "choices"}
    written = {
        parameter: {k: v for k, v in found.model_dump().items() if k in fields and v is not None}
        for parameter, found in LIBRARY.system(name).params.items()
        if found.type != "network"  # the harness's own
    }
    assert described[name]["params"] == written


@pytest.mark.parametrize("name", OURS)
def test_channels_are_the_same(described: dict[str, dict[str, object]], name: str) -> None:
    assert described[name]["channels"] == LIBRARY.system(name).channels
