# SPDX-License-Identifier: Apache-2.0
"""A virtual run whose nodes never connect ends at its limit of virtual time, with small files."""

import json
from pathlib import Path

import pytest
from command_line import slambed
from virtual_parts import make_sequence, needs_programs

from slambed.errors import ExitCode

EXPERIMENT = """\
id: apart
title: A link that loses everything
systems: [{{system: edgeslam, variant: static}}]
datasets: [{sequence}]
playback: {{mode: realtime, fps: 10}}
devices: {{mobile: host}}
link: {{profiles: [{{name: lossy, rtt_ms: 10, loss: {{random: 1}}}}]}}
engine: virtual
runs: {{default: 1}}
"""
LARGEST_BYTES = 2_000_000


@needs_programs
def test_nodes_that_never_connect_have_timed_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path / "cache"))
    sequence = make_sequence(tmp_path / "walk")
    path = tmp_path / "apart.yaml"
    path.write_text(EXPERIMENT.format(sequence=sequence))
    results = tmp_path / "results"
    code, out, err = slambed("run", str(path), "--no-figures", "--results", str(results))
    assert code == ExitCode.NOT_ALL_GOOD, out + err
    (only,) = (results / "apart" / "runs").iterdir()
    summary = json.loads((only / "summary.json").read_text())
    assert summary["outcome"] == "timed_out"
    manifest = json.loads((only / "manifest.json").read_text())
    assert "s of virtual time, after " in json.dumps(manifest)
    assert "s of virtual time, after " in out + err
    assert all(f.stat().st_size < LARGEST_BYTES for f in only.rglob("*") if f.is_file())
