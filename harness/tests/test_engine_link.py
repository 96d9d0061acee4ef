# SPDX-License-Identifier: Apache-2.0
"""Two local nodes joined by the real relay; skipped where the relay is not built."""

import threading
from pathlib import Path

import pandas as pd
import pytest
from harness_parts import needs_root, run_spec, stand_in

from slambed.campaign.links import backend_for, open_for_run, read_profile
from slambed.engines.live_run import LiveRun
from slambed.engines.local import LocalEngine
from slambed.errors import SlambedError
from slambed.native import find_program
from slambed.spec.experiment import Playback
from slambed.spec.matrix import LinkSpec

RAMP = {"name": "up", "rtt_ms": {"ramp": {"from_ms": 10, "to_ms": 30, "rise_s": 2}}}


def relay_is_built() -> bool:
    try:
        find_program("slambed-relay")
    except SlambedError:
        return False
    return Path("/dev/net/tun").exists()


pytestmark = [
    needs_root,
    pytest.mark.skipif(not relay_is_built(), reason="needs slambed-relay ('make build') and TUN"),
]


def test_a_run_records_what_its_link_delivered(tmp_path: Path) -> None:
    profile = read_profile(RAMP, "here")
    link = LinkSpec(
        backend=backend_for("relay", profile), profile=profile.name, content=profile.content
    )
    spec = run_spec(edge=True, link=link, profile="up", playback=Playback(fps=10.0, end_s=2.0))
    raw, sequence = tmp_path / "raw", tmp_path / "sequence"
    raw.mkdir()
    sequence.mkdir()
    engine = LocalEngine(stand_in(tmp_path))
    live = LiveRun(spec, engine, sequence, 2.0, raw, open_for_run, threading.Event())
    result = live.execute()
    assert result.outcome == "completed"
    assert result.link is not None and result.link["backend"] == "relay"
    log = pd.read_parquet(raw / "link" / "link.parquet")
    probes = log[(log["series"] == "probe_rtt_ms") & (log["t_s"].between(0, 2))]
    assert len(probes) > 20
    # The kernel of the nodes sees the latency: it rises. (How exactly is the link's own test.)
    assert probes["value"].median() > 12
    assert result.link["proof"]["asked_ms_mean"] == pytest.approx(20, abs=2)
