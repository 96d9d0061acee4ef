# SPDX-License-Identifier: Apache-2.0
"""Parameters are defined once: the C++ header is generated from system.yaml."""

from pathlib import Path

import pytest
from harness_parts import write_library

from slambed import document
from slambed.spec.library import Library
from slambed.spec.parameter_header import parameter_header


def test_every_header_is_what_system_yaml_says() -> None:
    found = document.headers()
    assert len(found) == len(Library().systems())
    for path, text in found.items():
        assert path.read_text(encoding="utf-8") == text, f"run: {document.COMMAND}"


def test_types_ranges_and_choices_are_there_and_defaults_are_not(tmp_path: Path) -> None:
    write_library(tmp_path)
    path = tmp_path / "systems" / "solo" / "system.yaml"
    path.write_text(
        path.read_text()
        + "  gain: {type: float, default: 0.25, min: 0.1, max: 1}\n"
        + "  way: {type: str, default: up, choices: [up, down]}\n"
        + '  map: {type: path, default: ""}\n'
        + "  jpeg_quality: {type: int, default: 77, min: 1, max: 100}\n"
        + "  n_m: {type: float, default: 0.5, min: 0, max: 1}\n"
        + '  net: {type: network, default: ""}\n'
    )
    text = parameter_header(Library(tmp_path).system("solo"))
    assert "namespace slambed::solo {" in text
    for line in (
        'integer("n_orb", 100, 4000),',
        'real("gain", 0.1, 1),',
        'choice("way", {"up", "down"}),',
        'path("map"),',
    ):
        assert f"      ParameterSpec::{line}\n" in text
    assert "0.25" not in text and "77" not in text
    assert '"net"' not in text  # the harness's own


def test_a_number_without_a_range_is_refused(tmp_path: Path) -> None:
    write_library(tmp_path)
    path = tmp_path / "systems" / "solo" / "system.yaml"
    path.write_text(path.read_text().replace(", max: 4000", ""))
    with pytest.raises(ValueError, match="parameter n_orb: a number needs min and max"):
        parameter_header(Library(tmp_path).system("solo"))
