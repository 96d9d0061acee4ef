# SPDX-License-Identifier: Apache-2.0
"""Files about a run are models: written bytes stay the same, and truncated files or files of
other versions are read as far as possible."""

import json
import math
from pathlib import Path
from typing import Literal

import pytest
from harness_parts import run_spec

from slambed.campaign.manifest import manifest
from slambed.engines.result import RunResult
from slambed.files.json_file import Record
from slambed.link.facts import LinkDetails, LinkFacts, RelaySummary
from slambed.link.proof import LinkProof
from slambed.metrics.summary import Summary
from slambed.records.kept_spec import KeptSpec
from slambed.records.manifest import EngineFacts, Manifest
from slambed.schema.field_table import field_rows
from slambed.spec.run_spec import RunSpec

KEPT = Path(__file__).with_name("kept_manifest.json")
"""Manifest of a live run with an edge over the relay, written when manifests were dictionaries."""


def test_a_manifest_has_the_bytes_that_it_had_as_a_dictionary() -> None:
    text = KEPT.read_text()
    kept = Manifest.read(KEPT)
    assert kept is not None
    # The RunSpec has its own model, which gets new fields.
    content = kept.as_json() | {"spec": json.loads(text)["spec"]}
    assert json.dumps(content, indent=1, allow_nan=False) + "\n" == text


def test_what_is_read_of_a_spec_is_the_same_of_a_file_and_of_a_run_to_be_made() -> None:
    kept = Manifest.read(KEPT)
    assert kept is not None
    spec = RunSpec.model_validate(json.loads(KEPT.read_text())["spec"])
    assert KeptSpec.of(spec).model_copy(update={"run_key": None}) == kept.kept
    assert Manifest(spec=spec).kept.device_name("edge") == "edge_i7_6700t"
    assert (kept.kept.is_virtual, kept.kept.tolerances.rtt_error_ms_median) == (False, 1.0)


def test_a_manifest_is_written_in_its_order_without_what_an_engine_does_not_say() -> None:
    result = RunResult("completed", None, link=LinkFacts.virtual())
    made = manifest(run_spec(), EngineFacts(image_id=None), ["slambed"], result, "now", 0.5, 1, 9)
    keys = [*made.model_copy(update={"warnings": [], "results_sha256": "x"}).as_json()]
    assert keys == [name for name in Manifest.model_fields if name in keys]
    assert not {"image", "plans", "invalid_reason"} & {*keys}
    assert {"image_id", "sidecar", "frames_offered"} <= {*keys}
    tagged = manifest(
        run_spec(), EngineFacts(image="a", image_id="b"), [], result, "now", 0.5, 1, 9
    )
    assert (tagged.as_json()["image"], tagged.as_json()["image_id"]) == ("a", "b")


@pytest.mark.parametrize(
    "text",
    ["", "{", "[]", "null", '{"limits": 5}', '{"invalid_reasons": "late"}', '{"attempt": "first"}'],
)
def test_a_torn_or_foreign_manifest_is_none(tmp_path: Path, text: str) -> None:
    path = tmp_path / "manifest.json"
    path.write_text(text)
    problems: list[str] = []
    assert Manifest.read(path) is None
    assert Manifest.read_or_complain(path, problems) == Manifest()
    assert len(problems) == 1 and problems[0].startswith("manifest.json: unreadable (")
    path.unlink()
    assert Manifest.read(path) is None
    assert Manifest.read_or_complain(path, problems) == Manifest() and len(problems) == 1


def test_a_manifest_of_another_version_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    path = tmp_path / "manifest.json"
    path.write_text('{"spec": {"engine": "virtual", "color": 3}, "mood": "fine", "cores": 2}')
    found = Manifest.read(path)
    assert found is not None and found.kept.is_virtual and found.cores == 2
    assert found.as_json() == {"spec": {"engine": "virtual"}, "cores": 2}


@pytest.mark.parametrize(
    ("old", "outcome", "reason", "invalid_reasons"),
    [
        ({"outcome": "mobile_died", "invalid_reason": "signal 11"}, "died", "signal 11", []),
        ({"outcome": "timeout"}, "timed_out", None, []),
        ({"outcome": "completed"}, "completed", None, []),
        (
            {"outcome": "invalid", "invalid_reason": "late", "link": {"invalid_reason": "RTT"}},
            "completed", None, ["late", "RTT"],
        ),
    ],
)  # fmt: skip
def test_a_manifest_of_an_older_version_is_read_with_the_names_of_today(
    old: dict[str, object], outcome: str, reason: str | None, invalid_reasons: list[str]
) -> None:
    found = Manifest.model_validate_json(json.dumps(old))
    assert (found.outcome, found.outcome_reason, found.invalid_reasons) == (
        outcome,
        reason,
        invalid_reasons,
    )


def test_what_a_link_could_not_measure_is_null_in_the_file_and_nan_here() -> None:
    nan = math.nan
    proof = LinkProof(False, "no RTT was measured", 0, 0.0, 0.2, nan, nan, nan, nan, nan, nan)
    text = json.dumps(LinkFacts(proof=proof).as_json(), allow_nan=False)
    assert '"error_ms_median": null' in text and '"late_ms_p99": null' in text
    back = LinkFacts.model_validate_json(text).proof
    assert back is not None and math.isnan(back.bias_ms) and back.base_ms == 0.2


def test_a_torn_summary_of_the_relay_says_nothing(tmp_path: Path) -> None:
    path = tmp_path / "relay_summary.json"
    path.write_text('{"up": {"packets"')
    assert RelaySummary.read(path) is None
    assert LinkDetails(relay=RelaySummary()).as_json() == {"relay": {}}


class Place(Record):
    """Where something is."""

    x_m: float
    """From the left."""
    name: str | None = None
    """RTT of |it|."""


class Map(Record):
    """Of places."""

    places: dict[str, list[Place]]
    """By town."""
    best: Place | None = None
    """Of all."""
    kind: Literal["old", "new"] = "old"
    """Of the map."""


class Undescribed(Record):
    """Has a field without a word."""

    x_m: float


def test_a_table_follows_from_the_fields_of_a_record() -> None:
    assert list(field_rows(Map)) == [
        ["`places`", "object of list of object", "", "by town"],
        ["`places.*[].x_m`", "float", "m", "from the left"],
        ["`places.*[].name`", "str or null", "", r"RTT of \|it\|"],
        ["`best`", "object or null", "", "of all; as `places`"],
        ["`kind`", "`old` or `new`", "", "of the map"],
    ]
    assert [row[0] for row in field_rows(Map, (Place,), ("kind",))] == ["`places`", "`best`"]
    with pytest.raises(ValueError, match=r"Undescribed\.x_m has no docstring"):
        list(field_rows(Undescribed))


def test_a_summary_is_valid_only_where_it_says_true(tmp_path: Path) -> None:
    path = tmp_path / "summary.json"
    path.write_text('{"valid": 1, "outcome": "completed", "coverage": 0.5, "variant": "x"}')
    found = Summary.read(path)
    assert found is not None and not found.valid and found.completed
    assert (found.number("coverage"), found.number("variant"), found.text("variant")) == (
        0.5,
        None,
        "x",
    )
    path.write_text("[1]")
    assert Summary.read(path) is None
