# SPDX-License-Identifier: Apache-2.0
"""Which runs are valid: host, link and limits as configured, independent of the system."""

import json
from pathlib import Path

import pytest
from results_factory import RawRun, spec_of, write_raw

from slambed.metrics.run_summary import summarize_run

EDGE_SPEC = spec_of("edgeslam", "static", "ramp_85", 0)


@pytest.fixture
def raw(tmp_path: Path) -> Path:
    return write_raw(tmp_path / "raw", RawRun(lost_at_s=((5.0, 6.5), (9.0, 9.5))))


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"invalid_reasons": ["mobile: CPU quota 2 cores instead of 1"]}, "CPU quota 2"),
        ({"link": {"base_rtt_ms": 9.0}}, "RTT error median"),
    ],
)
def test_runs_under_other_circumstances_than_asked_say_why(
    tmp_path: Path, change: dict, reason: str
) -> None:
    raw = write_raw(tmp_path / "raw", RawRun(manifest=change))
    found = summarize_run(raw, EDGE_SPEC)
    assert found["valid"] is False
    assert reason in found["invalid_reason"]


def test_an_error_of_the_rtt_is_reported_once(tmp_path: Path) -> None:
    lines = [
        "link: median RTT error 8.80 ms is above 1 ms",
        "mobile: CPU quota 2 cores instead of 1",
    ]
    change = {"link": {"base_rtt_ms": 9.0}, "invalid_reasons": lines}
    reported = summarize_run(write_raw(tmp_path / "raw", RawRun(manifest=change)), EDGE_SPEC)
    assert (
        reported["invalid_reason"].count("RTT error median") == 1
        and "link: " not in reported["invalid_reason"]
    )
    assert lines[1] in reported["invalid_reason"]


def test_the_error_of_the_rtt_is_judged_by_the_tolerances_that_hold_now(tmp_path: Path) -> None:
    """The link judged it too, by those of its day."""
    proof = {"asked_ms_mean": 40.0, "measured_ms_mean": 42.4, "error_ms_median": 2.4,
             "error_ms_p99": 4.0, "echoes": 200, "valid": False, "reason": "", "base_ms": 0.2,
             "answered_share": 1.0, "error_ms_max": None, "bias_ms": None}  # fmt: skip
    change = {
        "link": {"base_rtt_ms": 0.2, "proof": proof},
        "invalid_reasons": ["link: median RTT error 2.40 ms is above 1 ms"],
    }
    raw = write_raw(tmp_path / "raw", RawRun(manifest=change))
    strict = summarize_run(raw, EDGE_SPEC)
    assert strict["invalid_reason"] == "RTT error median 2.40 ms is above 1 ms"
    wide = EDGE_SPEC | {"tolerances": {"rtt_error_ms_median": 3.0}}
    assert summarize_run(raw, wide)["valid"] is True


def test_steal_is_reported_as_steal(tmp_path: Path) -> None:
    raw = write_raw(tmp_path / "raw", RawRun(stall_ms=250))
    rows = [json.loads(line) for line in (raw / "samples.jsonl").read_text().splitlines()]
    for row in rows:
        row["host_steal_s"] = 5.0 + 0.2 * max(row["t_s"], 0.0)  # of two cores: 10 %
    (raw / "samples.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    found = summarize_run(raw, EDGE_SPEC | {"tolerances": {"host_stall_ms_max": 100.0}})
    assert found["host_steal_percent"] == pytest.approx(10, abs=0.2)
    assert "(steal: neighbors took 10.0 % of this host's CPU time)" in found["invalid_reason"]


def test_steal_of_a_board_is_none_of_the_hosts(tmp_path: Path) -> None:
    """Each machine counts from its own boot."""
    raw = write_raw(tmp_path / "raw", RawRun())
    rows = [json.loads(line) for line in (raw / "samples.jsonl").read_text().splitlines()]
    for row in rows:
        row["host_steal_s"] = 3000.0 if row["node"] == "edge" else 0.0
    (raw / "samples.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    manifest = json.loads((raw / "manifest.json").read_text())
    manifest["board"] = {
        "name": "pi", "address": "10.0.0.2", "edge_address": "10.0.0.1", "cores": 4,
        "architecture": "aarch64", "model": "a board", "kernel": "6.1.0",
    }  # fmt: skip
    (raw / "manifest.json").write_text(json.dumps(manifest))
    assert summarize_run(raw, EDGE_SPEC)["host_steal_percent"] == pytest.approx(0.0)


def test_a_stall_of_the_host_is_reported_and_judged_where_asked(tmp_path: Path) -> None:
    raw = write_raw(tmp_path / "raw", RawRun(stall_ms=250))
    found = summarize_run(raw, EDGE_SPEC)
    assert found["host_stall_ms_max"] == pytest.approx(250, abs=1e-6)
    assert found["valid"] is True
    strict = EDGE_SPEC | {"tolerances": {"host_stall_ms_max": 100.0}}
    judged = summarize_run(raw, strict)
    assert judged["invalid_reason"] == "the host stalled the mobile node for 250 ms, above 100 ms"
    calm = summarize_run(write_raw(tmp_path / "calm", RawRun()), strict)
    assert calm["host_stall_ms_max"] == pytest.approx(0, abs=1e-6)
    assert calm["valid"] is True
    virtual = summarize_run(raw, strict | {"engine": "virtual"})
    assert virtual["host_stall_ms_max"] is None


def test_waiting_for_a_processor_is_reported_and_judged_where_asked(tmp_path: Path) -> None:
    raw = write_raw(tmp_path / "raw", RawRun())
    rows = [json.loads(line) for line in (raw / "samples.jsonl").read_text().splitlines()]
    for row in rows:
        # Throttled for 10 ms per second, and delayed by others for as long as it computed.
        row["run_delay_s"] = row["cpu_s"] + row["throttled_s"]
    (raw / "samples.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    found = summarize_run(raw, EDGE_SPEC)
    assert found["cpu_wait_share"] == pytest.approx(0.5, abs=1e-9)
    assert found["valid"] is True
    judged = summarize_run(raw, EDGE_SPEC | {"tolerances": {"cpu_wait_share_max": 0.4}})
    assert judged["invalid_reason"] == (
        "the mobile node waited for a processor for 50% of the time in which it wanted one, "
        "above 40%"
    )
    assert summarize_run(raw, EDGE_SPEC | {"engine": "virtual"})["cpu_wait_share"] is None


@pytest.mark.parametrize(("backend", "valid"), [("relay", False), ("netem", True)])
def test_the_tail_of_the_relays_error_is_judged(tmp_path: Path, backend: str, valid: bool) -> None:
    proof = {"asked_ms_mean": 40.0, "measured_ms_mean": 40.4, "error_ms_median": 0.05,
             "error_ms_p99": 116.0, "echoes": 200, "valid": True, "reason": "", "base_ms": 0.2,
             "answered_share": 1.0, "error_ms_max": None, "bias_ms": None}  # fmt: skip
    link = {"base_rtt_ms": 0.2, "proof": proof}
    raw = write_raw(tmp_path / "raw", RawRun(manifest={"link": link}))
    spec = EDGE_SPEC | {"link": EDGE_SPEC["link"] | {"backend": backend}}
    found = summarize_run(raw, spec)
    assert found["valid"] is valid
    assert (found["invalid_reason"] == "RTT error p99 116.00 ms is above 20 ms") is not valid
    lenient = spec | {"tolerances": {"rtt_error_ms_p99": 200.0}}
    assert summarize_run(raw, lenient)["valid"] is True


def test_a_link_without_proof_is_invalid(raw: Path) -> None:
    for file in (raw / "link").iterdir():
        file.unlink()
    found = summarize_run(raw, EDGE_SPEC)
    assert found["rtt_error_ms_median"] is None
    assert "not measured" in found["invalid_reason"]


def test_the_links_own_proof_is_taken(tmp_path: Path) -> None:
    proof = {"asked_ms_mean": 40.0, "measured_ms_mean": 40.4, "error_ms_median": 0.05,
             "error_ms_p99": 0.7, "echoes": 200, "valid": True, "reason": "", "base_ms": 0.2,
             "answered_share": 1.0, "error_ms_max": None, "bias_ms": None}  # fmt: skip
    link = {"base_rtt_ms": 0.2, "proof": proof}
    raw = write_raw(tmp_path / "raw", RawRun(manifest={"link": link}))
    found = summarize_run(raw, EDGE_SPEC)
    assert (found["rtt_error_ms_median"], found["rtt_asked_ms_mean"]) == (0.05, 40.0)
    reported = {"link": link, "invalid_reasons": ["half of the echoes were lost"]}
    raw = write_raw(tmp_path / "raw2", RawRun(manifest=reported))
    assert summarize_run(raw, EDGE_SPEC)["invalid_reason"] == "half of the echoes were lost"
