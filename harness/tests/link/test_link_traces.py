# SPDX-License-Identifier: Apache-2.0
"""Recorded RTTs and rates: parsing, windows, digests, and rejected input."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from slambed.errors import SlambedError
from slambed.link.named_profile import read_profile
from slambed.link.profile import Profile, load_profile, parse_profile
from slambed.link.summary import recorded_rate
from slambed.link.traces import at_full_paths, mean_rate_mbps, read_rate_trace
from slambed.spec.recorded_part import RecordedPart
from slambed.spec.run_spec import LinkSpec


def trace(tmp_path: Path, text: str, **keys: Any) -> Profile:
    file = tmp_path / "recorded.csv"
    file.write_text(text)
    return parse_profile({"rtt_ms": {"trace": {"file": str(file), **keys}}}, "here")


def test_a_csv_begins_at_run_time_zero(tmp_path: Path) -> None:
    profile = trace(tmp_path, "time_s,rtt_ms\n100.0,10\n100.5,20\n101.0,40\n")
    assert [profile.rtt_ms(t) for t in (0, 0.25, 0.5, 1.0, 9.0)] == [10, 15, 20, 40, 40]
    assert profile.duration == 1.0


def test_columns_units_window_and_hold(tmp_path: Path) -> None:
    text = "when(ms) lost delay(us)\n" + "".join(
        f"{1721032372703 + 50 * i} 0 {1000 * i}\n" for i in range(100)
    )
    profile = trace(
        tmp_path,
        text,
        time="when(ms)",
        time_unit="ms",
        rtt="delay(us)",
        rtt_unit="us",
        start_s=1.0,
        length_s=2.0,
        hold=True,
    )
    assert profile.rtt_ms(0) == pytest.approx(20)
    assert profile.rtt_ms(0.049) == pytest.approx(20)
    assert profile.rtt_ms(0.051) == pytest.approx(21)
    assert profile.duration == pytest.approx(2.0)


def test_a_link_names_its_traces_for_another_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the paths where this process finds them; what the link is stays the same."""
    data = tmp_path / "data"
    data.mkdir()
    (data / "recorded.csv").write_text("time_s,rtt_ms\n0,10\n0.5,20\n")
    (data / "rate").write_text("1\n2\n")
    monkeypatch.setenv("SLAMBED_DATA", str(data))
    profile = parse_profile(
        {
            "rtt_ms": {"sum": [5, {"trace": {"file": "recorded.csv"}}]},
            "up": {"rate": {"trace": "rate"}},
        },
        "here",
    )
    content, files = at_full_paths(profile.content)
    assert sorted(files) == [data / "rate", data / "recorded.csv"]
    monkeypatch.delenv("SLAMBED_DATA")
    with pytest.raises(SlambedError, match="not found"):
        parse_profile(profile.content, "there")
    found = parse_profile(content, "there")
    assert found.rtt_ms(0.5) == 25 and list(found.rate_traces.values()) == [[1, 2]]
    specs = [LinkSpec(backend="relay", profile="p", content=c) for c in (profile.content, content)]
    assert specs[0].meaning() == specs[1].meaning()


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("2026-11-26T17:15:30.250Z", "2026-11-26T17:15:30.750Z"),
        ("2026-11-26 17:15:30.250", "2026-11-26 17:15:30.750"),
        ("2026-11-26T23:59:59.750+01:00", "2026-11-26T23:00:00.250Z"),
    ],
)
@pytest.mark.parametrize("unit", ["s", "ns"])
def test_times_may_be_dates(tmp_path: Path, first: str, second: str, unit: str) -> None:
    profile = trace(tmp_path, f"time_s,rtt_ms\n{first},10\n{second},20\n", time_unit=unit)
    assert profile.duration == pytest.approx(0.5, abs=1e-6)
    assert profile.rtt_ms(0.25) == pytest.approx(15, abs=1e-3)


@pytest.mark.parametrize(
    "text",
    [
        "time_s\tsnr\trtt_ms\n0\t30\t10\n0.2\t\t12\n",
        "time_s\tplace\trtt_ms\n0,0\tmain hall\t10,0\n0,2\t\t12,0\n",
        "sep=;\ntime_s;rtt_ms\n0;10\n0,2;12\n",
        "sep=,\ntime_s,rtt_ms\n0,10\n0.2,12\n",
        '"time_s" "rtt_ms"\n0 10\n0.2 12\n',
    ],
)
def test_cells_of_a_table_stay_in_their_columns(tmp_path: Path, text: str) -> None:
    profile = trace(tmp_path, text)
    assert (profile.duration, profile.rtt_ms(0), profile.rtt_ms(0.2)) == (0.2, 10, 12)


def test_an_empty_cell_is_no_cell_of_another_column(tmp_path: Path) -> None:
    with pytest.raises(SlambedError, match=r"not a time and a number but .*line 3"):
        trace(tmp_path, "time_s\trtt_ms\tx\n0\t12.5\t1\n0.2\t\t99\n0.4\t13\t1\n")


def test_a_line_of_excel_may_name_a_separator_that_the_table_has_not(tmp_path: Path) -> None:
    assert trace(tmp_path, "sep=,\ntime_s;rtt_ms\n0;10\n0,2;12\n").duration == pytest.approx(0.2)


def test_a_window_begins_between_two_samples(tmp_path: Path) -> None:
    text = "time_s,rtt_ms\n0,10\n0.2,12\n0.4,13\n"
    assert trace(tmp_path, text, start_s=0.1).rtt_ms(0) == pytest.approx(11)
    held = trace(tmp_path, text, start_s=0.1, hold=True)
    assert (held.rtt_ms(0), held.rtt_ms(0.1)) == (10, 12)
    assert trace(tmp_path, text, start_s=0.2).rtt_ms(0) == 12


def test_a_window_begins_and_ends_in_no_gap(tmp_path: Path) -> None:
    times = [n / 2 for n in (*range(20), *range(120, 200))]  # 0 to 9.5 s and 60 to 99.5 s
    text = "time_s,rtt_ms\n" + "".join(f"{t},{10 if t < 60 else 40}\n" for t in times)
    with pytest.raises(SlambedError, match=r"start_s is in a gap of 50.5 s, .*; move it to 60$"):
        trace(tmp_path, text, start_s=12)
    with pytest.raises(SlambedError, match=r"length_s ends in a gap of .*; shorten it to 9.5$"):
        trace(tmp_path, text, length_s=30)
    with pytest.raises(SlambedError, match=r"length_s ends in a gap of .*; shorten it to 4.5$"):
        trace(tmp_path, text, start_s=5, length_s=30)
    assert trace(tmp_path, text, start_s=60, length_s=30).rtt_ms(0) == 40
    assert trace(tmp_path, text, start_s=5, length_s=4.5).rtt_ms(9) == 10
    assert trace(tmp_path, text, start_s=12, max_gap_s=60).rtt_ms(0) < 40


def test_a_trace_has_a_length_where_the_run_decides_how_much_of_it_plays(tmp_path: Path) -> None:
    for folder in ("near", "far"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "rtt.csv").write_text("time_s,rtt_ms\n0,10\n1,20\n")
    near = {"trace": {"file": "near/rtt.csv", "start_s": 0.75}}
    far = {"trace": {"file": "far/rtt.csv"}}
    again = {"repeat": {"of": far, "period_s": 0.5}}
    both = parse_profile({"rtt_ms": {"sum": [near, far]}}, "test", tmp_path)
    parts = (RecordedPart("near/rtt.csv", 0.75, 0.25), RecordedPart("far/rtt.csv", 0, 1))
    assert both.recorded == parts
    assert list(map(str, parts)) == ["near/rtt.csv from 0.75 s on", "far/rtt.csv"]
    assert not parse_profile({"rtt_ms": again}, "test", tmp_path).recorded


def test_a_recording_that_is_shorter_than_asked_is_told(tmp_path: Path) -> None:
    text = "time_s,rtt_ms\n0,10\n0.2,12\n"
    assert "lasts 0.2 s from start_s on, of the 9 s" in trace(tmp_path, text, length_s=9).remarks[0]


@pytest.mark.parametrize(
    ("text", "keys", "message"),
    [
        (
            "t,rtt_s\n0,0.1\n",
            {"time": "t", "rtt": "rtt_s"},
            "'rtt_s' is in s by its name",
        ),
        (
            "time_ms,rtt_ms\n0,1\n",
            {"time": "time_ms"},
            "'time_ms' is in ms by its name",
        ),
        ("time_s,rtt_ms\n0,1\n", {"ping_interval_s": 0.2}, "ping_interval_s means nothing with"),
        ("x", {"format": "ping", "rtt_unit": "us"}, "rtt_unit means nothing with format: ping"),
        (
            "".join(f"64 bytes from a: icmp_seq={i} ttl=1 time=1 ms\n" for i in range(3)),
            {},
            "no column 'time_s'.*is it a log of ping. Say 'format: ping'",
        ),
    ],
)
def test_keys_that_do_not_go_with_the_file_are_named(
    tmp_path: Path, text: str, keys: dict[str, object], message: str
) -> None:
    with pytest.raises(SlambedError, match=message):
        trace(tmp_path, text, **keys)


def test_a_unit_that_is_said_goes_before_a_name(tmp_path: Path) -> None:
    text = "t,rtt_s\n0,0.01\n0.2,0.02\n"
    assert trace(tmp_path, text, time="t", rtt="rtt_s", rtt_unit="s").rtt_ms(0) == 10


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"jitter": {"sd_ms": 5, "tail": 2}}, "tail is of pareto jitter"),
        (
            {"jitter": {"shape": "pareto", "mean_ms": 5, "max_ms": 1}},
            "mean_ms 5 is not below",
        ),
        ({"params": {"p": 20}}, "nothing uses parameter 'p'"),
        ({"rate_sha256": {"zzz": "abc"}}, "no rate has the trace 'zzz'"),
    ],
)
def test_what_has_no_effect_in_a_profile_is_named(keys: dict[str, object], message: str) -> None:
    with pytest.raises(SlambedError, match=message):
        parse_profile({"name": "p", "rtt_ms": 5, **keys}, "here")


def test_a_profile_in_place_names_its_trace_from_the_file(tmp_path: Path) -> None:
    (tmp_path / "own.csv").write_text("time_s,rtt_ms\n0,10\n1,20\n")
    inline = {"name": "me", "rtt_ms": {"trace": {"file": "own.csv"}}}
    assert read_profile(inline, "here", tmp_path).name == "me"
    with pytest.raises(SlambedError, match=r"'own\.csv' not found"):
        read_profile(inline, "here")


def test_a_ping_log(tmp_path: Path) -> None:
    text = "PING a (1.2.3.4) 56(84) bytes of data.\n" + "".join(
        f"64 bytes from 1.2.3.4: icmp_seq={i} ttl=57 time={10.0 + i} ms\n" for i in (1, 2, 3)
    )
    assert trace(tmp_path, text, format="ping").rtt_ms(1.0) == pytest.approx(12)


@pytest.mark.parametrize(
    ("text", "keys", "message"),
    [
        ("time_s,rtt_ms\n0,1\n0.5,2\n9,3\n", {}, "gap of 8.5 s in the trace at 0.5 s"),
        ("time_s,rtt_ms\n0,1\n0.5,2\n0.4,3\n", {}, "time goes back by 0.1 s at 0.500 s"),
        ("time_s,rtt_ms\n0,1\n0.5,-2\n", {}, "negative latency -2 ms at 0.500 s"),
        ("time_s,rtt_ms\n0,1\n0.5,nan\n", {}, "RTT is not a number, .* line 3"),
        ("time_s,rtt_ms\n0,1\nnan,2\n", {}, "time is not a number.*line 3"),
        ("time_s,rtt_ms\n0,1\n0.5\n", {}, "not a time and a number.*line 3"),
        ("time_s,rtt\n0,1\n", {}, "no column 'rtt_ms'.*did you mean 'rtt'"),
        (
            "time_s,rtt_ms\n0,0,12,5\n1,0,13,1\n",
            {},
            "4 cells under 2 names.*line 2; expected one .* point",
        ),
        ("time_s,rtt_ms,rtt_ms\n0,12,99\n", {}, "column 'rtt_ms' is there twice"),
        ("time_s,rtt_ms\n9,1\n8,2\n", {}, "time goes back to 1 s before the first sample"),
        (
            "time_s,rtt_ms\n0,1\n2000,2\n",
            {},
            r"samples are 2000 s apart, .*; correct time_unit \(s\)",
        ),
        ("time_s,rtt_ms\n", {}, "no samples"),
        ("time_s,rtt_µs\n0,1\n", {"rtt": "rtt_µs"}, "'rtt_µs' is in us by its name"),
        ("time_s,rttSec\n0,1\n", {"rtt": "rttSec"}, "'rttSec' is in s by its name"),
        ("time_s,rtt in seconds\n0,1\n", {"rtt": "rtt in seconds"}, "is in s by its name"),
        ("0.0,10\n0.2,11\n", {}, "has no names; write 'time_s,rtt_ms' above it"),
        ("time_s,rtt_ms\n46000.000001,1\n46000.000003,1\n", {}, "samples are 2e-06 s apart"),
        ("time_s,rtt_ms\n5,1\n5,1\n5,1\n6,2\n", {}, "most samples share one"),
        ("time_s,rtt_ms\n17:15:30.0,1\n", {}, "times are numbers or dates such as 2026-"),
        ("nothing here\n", {"format": "ping"}, "no samples"),
        (f"time_s,rtt_ms\n0,{'1' * 131073}\n", {}, "no table: field larger than"),
        ("time_s,rtt_ms\n0,1\n0.5,2\n", {"start_s": 60.0}, "no samples between"),
        ("time_s,rtt_ms\n0,1\n", {"rtt_unit": "minutes"}, "rtt_unit"),
        ("time_s,rtt_ms\n0,1\n", {"sha256": "00"}, "not the expected content"),
    ],
)
def test_a_bad_trace_gets_one_clear_line(
    tmp_path: Path, text: str, keys: dict[str, Any], message: str
) -> None:
    with pytest.raises(SlambedError, match=message) as caught:
        trace(tmp_path, text, **keys)
    assert "\n" not in str(caught.value)


def test_replies_of_a_clock_that_was_set_back_do_not_vanish(tmp_path: Path) -> None:
    text = "".join(
        f"[{1.7e9 + 0.2 * i - (3600 if i > 5 else 0):.6f}] 64 bytes from 1.2.3.4: icmp_seq={i} "
        f"ttl=64 time={10 * i} ms\n"
        for i in range(1, 9)
    )
    with pytest.raises(SlambedError, match=r"time goes back to 3599.* was the clock set"):
        trace(tmp_path, text, format="ping")


def test_a_trace_is_found_beside_its_profile(tmp_path: Path) -> None:
    (tmp_path / "mine.csv").write_text("time_s,rtt_ms\n0,5\n1,5\n")
    (tmp_path / "mine.yaml").write_text("rtt_ms: {trace: {file: mine.csv}}\n")
    profile = load_profile(tmp_path / "mine.yaml")
    assert profile.rtt_ms(0.5) == 5
    assert len(profile.content["rtt_ms"]["trace"]["sha256"]) == 64


@pytest.mark.parametrize("named", [lambda path: path, lambda path: {"profile": path, "name": "x"}])
def test_a_run_finds_what_lies_beside_a_profile_file(
    tmp_path: Path, named: Callable[[str], Any]
) -> None:
    (tmp_path / "mine.csv").write_text("time_s,rtt_ms\n0,5\n1,5\n")
    (tmp_path / "mine.up").write_text("1\n2\n")
    (tmp_path / "mine.yaml").write_text(
        "rtt_ms: {sum: [1, {trace: {file: mine.csv}}]}\nup: {rate: {trace: mine.up}}\n"
    )
    first = parse_profile(named(str(tmp_path / "mine.yaml")), "exp.yaml")
    of_a_run = parse_profile(json.loads(json.dumps(first.content)), "a run's content")
    assert of_a_run.rtt_ms(0.5) == 6
    assert list(of_a_run.rate_traces.values()) == [[1, 2]]
    assert of_a_run.content == first.content


def test_a_changed_profile_takes_its_traces_and_not_those_beside_the_experiment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for folder, rtt_ms in (("data", 5), ("experiments", 90)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "mine.csv").write_text(f"time_s,rtt_ms\n0,{rtt_ms}\n")
    monkeypatch.setenv("SLAMBED_DATA", str(tmp_path / "data"))
    file = tmp_path / "mine.yaml"
    file.write_text("params: {more_ms: 0}\nrtt_ms: {sum: [$more_ms, {trace: {file: mine.csv}}]}\n")
    changed = {"profile": str(file), "params": {"more_ms": 1}, "name": "changed"}
    assert parse_profile(changed, "exp.yaml", tmp_path / "experiments").rtt_ms(0) == 6


def test_the_folder_of_a_trace_is_in_no_run_key(tmp_path: Path) -> None:
    meanings = []
    for folder in (tmp_path / "a", tmp_path / "b"):
        folder.mkdir()
        (folder / "mine.csv").write_text("time_s,rtt_ms\n0,5\n1,5\n")
        (folder / "mine.up").write_text("1\n2\n")
        (folder / "mine.yaml").write_text(
            "rtt_ms: {trace: {file: mine.csv}}\nup: {rate: {trace: mine.up}}\n"
        )
        content = dict(load_profile(folder / "mine.yaml").content)
        meanings.append(LinkSpec(backend="relay", profile="mine", content=content).meaning())
    assert meanings[0] == meanings[1]
    (tmp_path / "b/mine.up").write_text("1\n3\n")
    content = dict(load_profile(tmp_path / "b/mine.yaml").content)
    other = LinkSpec(backend="relay", profile="mine", content=content).meaning()
    assert other != meanings[0]


def test_a_catalog_trace_keeps_its_name() -> None:
    rate = load_profile("cloudslam_lte_like").content["up"]["rate"]
    assert rate["trace"] == "traces/cloudslam_lte_like.up"


def test_a_mahimahi_trace(tmp_path: Path) -> None:
    file = tmp_path / "up"
    file.write_text("\n".join(str(ms) for ms in range(2, 1001, 2)) + "\n")
    assert mean_rate_mbps(read_rate_trace(str(file), None)) == pytest.approx(6.0)
    profile = parse_profile({"rtt_ms": 1, "up": {"rate": {"trace": str(file)}}}, "here")
    assert profile.up.rate is not None and profile.down.rate is None
    assert profile.content["rate_sha256"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("5\n3\n", "time goes back.*line 2"),
        ("5\nx\n", "'x' is not a whole number.*line 2"),
        ("9" * 400 + "\n", "'99999999999999999999' is more than 1000000000 ms.*line 1"),
        ("", "no delivery opportunities"),
    ],
)
def test_a_bad_rate_trace_gets_one_clear_line(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "up"
    file.write_text(text)
    with pytest.raises(SlambedError, match=message):
        read_rate_trace(str(file), None)


def ping_trace(tmp_path: Path, lines: list[str], **keys: Any) -> Profile:
    return trace(tmp_path, "\n".join(lines) + "\n", format="ping", **keys)


UNIX_REPLY = "64 bytes from 1.2.3.4: icmp_seq={seq} ttl=57 time={ms} ms"


@pytest.mark.parametrize(
    "reply",
    [
        UNIX_REPLY,
        "64 Bytes von 1.2.3.4: icmp_seq={seq} ttl=57 Zeit={ms} ms",
        "64 octets de 1.2.3.4 : icmp_seq={seq} ttl=57 temps={ms} ms",
        "64 字节 来自 1.2.3.4: icmp_seq={seq} ttl=57 时间={ms} 毫秒",
        "64 bytes from 1.2.3.4: seq={seq} ttl=57 time={ms} ms",
        "1.2.3.4 : [{seq}], 84 bytes, {ms} ms (11.4 avg, 0% loss)",
        "Reply from 1.2.3.4: bytes=32 time={ms}ms TTL=57",
        "Antwort von 1.2.3.4: Bytes=32 Zeit={ms}ms TTL=57",
        "Réponse de 1.2.3.4 : octets=32 temps={ms} ms TTL=57",
        "Reply from ::1: time={ms}ms",
        "1.2.3.4 からの応答: バイト数 =32 時間 ={ms}ms TTL=57",
    ],
)
def test_ping_logs_of_any_system_and_language(tmp_path: Path, reply: str) -> None:
    lines = ["PING a (1.2.3.4) 56(84) bytes of data.", ""]
    lines += [reply.format(seq=i, ms=10 * i) for i in (1, 2, 3)]
    lines += ["", "--- a ping statistics ---", "    Minimum = 10ms, Maximum = 30ms, Average = 20ms"]
    profile = ping_trace(tmp_path, lines)
    assert [profile.rtt_ms(t) for t in (0, 1, 2)] == pytest.approx([10, 20, 30])
    assert profile.duration == pytest.approx(2)


def test_a_decimal_comma_is_one(tmp_path: Path) -> None:
    lines = [UNIX_REPLY.format(seq=i, ms=f"1{i},5") for i in (1, 2)]
    assert ping_trace(tmp_path, lines).rtt_ms(1) == pytest.approx(12.5)


def test_windows_counts_requests_without_a_reply(tmp_path: Path) -> None:
    reply = "Reply from 1.2.3.4: bytes=32 time<1ms TTL=57"
    assert ping_trace(tmp_path, [reply, "Request timed out.", reply]).duration == 2


def test_what_may_not_be_meant_is_a_remark(tmp_path: Path) -> None:
    lines = [UNIX_REPLY.format(seq=i, ms=10) for i in (1, 2, 3, 7, 8)]
    (remark,) = [r for r in ping_trace(tmp_path, lines, max_gap_s=4).remarks if "nothing was" in r]
    assert "nothing was recorded for 4 s from 2 s on" in remark and "under gaps" in remark
    (tmp_path / "log.txt").write_text("\n".join(lines))
    written = {"rtt_ms": {"trace": {"file": "log.txt", "format": "ping", "max_gap_s": 4}}}
    said = parse_profile(written, "x", tmp_path).remarks
    cut = {"gaps": [{"start_s": 2.5, "length_s": 3}], "gap_mode": "drop"}
    assert set(said) - set(parse_profile({**written, **cut}, "x", tmp_path).remarks) == {
        remark.replace(remark.split(":")[0], "log.txt")
    }
    elsewhere = {"gaps": [{"start_s": 0.2, "length_s": 0.5}, {"start_s": 7, "length_s": 1}]}
    assert parse_profile({**written, **elsewhere}, "x", tmp_path).remarks == said
    late = {"rtt_ms": {"delayed": {"by_s": 10, "of": written["rtt_ms"]}}}
    assert parse_profile({**late, **cut}, "x", tmp_path).remarks == said
    at_its_time = {"gaps": [{"start_s": 12.5, "length_s": 3}]}
    assert len(parse_profile({**late, **at_its_time}, "x", tmp_path).remarks) == len(said) - 1
    small = trace(tmp_path, "time_s,rtt_ms\n0,0.02\n0.5,0.03\n1,0.022\n")
    (remark,) = small.remarks
    assert "its RTT is 0.022 ms in the median; give rtt_unit" in remark


def test_one_lost_reply_is_no_gap_and_two_are(tmp_path: Path) -> None:
    numbers = [1, 2, 3, 5, 6]
    lines = [UNIX_REPLY.format(seq=i, ms=i) for i in numbers]
    assert ping_trace(tmp_path, lines).duration == 5
    lines[3:] = [UNIX_REPLY.format(seq=i, ms=i) for i in (7, 8)]
    with pytest.raises(
        SlambedError, match=r"gap of 4.0 s in the trace at 2.0 s.*max_gap_s"
    ) as error:
        ping_trace(tmp_path, lines)
    assert str(error.value).endswith("or correct ping_interval_s")
    # Half an interval after the last reply, until half an interval before the next one.
    assert (
        "'gaps: [{start_s: 2.5, length_s: 3}]' (run time) with 'gap_mode: drop' beside rtt_ms"
        in str(error.value)
    )
    assert "'max_gap_s: 4' under trace" in str(error.value)


def test_an_outage_is_suggested_to_the_millisecond_however_late(tmp_path: Path) -> None:
    times = [*np.arange(0.0, 1234.0, 0.5), 1240.0, 1240.5]
    lines = "".join(f"{t},20\n" for t in times)
    with pytest.raises(SlambedError, match=r"start_s: 1233.75, length_s: 6\}"):
        trace(tmp_path, f"time_s,rtt_ms\n{lines}")


def test_a_recorded_rate_of_one_packet_and_one_with_silence_are_told() -> None:
    side = Mock()
    for times_ms, told in (
        ([1], "mean 12.00 Mbit/s; begins again after 0.001 s"),
        ([12], "mean 1.00 Mbit/s; begins again after 0.012 s"),
        ([100, 5000], "0.00 to 0.01"),
        ([500, 1000, 1500, 2000], "mean 0.02 Mbit/s, in single seconds 0.02 to 0.02"),
    ):
        side.rate.trace = "rate.log"
        assert told in recorded_rate(side, {"rate.log": times_ms})


def test_duplicates_and_replies_out_of_order(tmp_path: Path) -> None:
    replies = [(1, "10 ms"), (3, "30 ms"), (2, "20 ms"), (2, "99 ms (DUP!)")]
    lines = [f"64 bytes from a: icmp_seq={n} ttl=1 time={expected}" for n, expected in replies]
    profile = ping_trace(tmp_path, lines)
    assert [profile.rtt_ms(t) for t in (0, 1, 2)] == pytest.approx([10, 20, 30])


def test_sequence_numbers_wrap(tmp_path: Path) -> None:
    lines = [UNIX_REPLY.format(seq=n % 65536, ms=n - 65500) for n in range(65530, 65540)]
    profile = ping_trace(tmp_path, lines)
    assert profile.duration == 9 and profile.rtt_ms(9) == pytest.approx(39)


def test_an_assumed_interval_is_said(tmp_path: Path) -> None:
    replies = [UNIX_REPLY.format(seq=i, ms=9) for i in range(1, 5)]
    assumed = ping_trace(tmp_path, replies)
    (line,) = assumed.remarks
    assert "no time stamps" in line and "1 s apart" in line and "ping_interval_s" in line
    assert parse_profile(assumed.content, "again").remarks == assumed.remarks
    told = ping_trace(tmp_path, replies, ping_interval_s=0.2)
    assert told.duration == pytest.approx(0.6) and not told.remarks
    stamped = [f"[{1700000000 + 0.2 * i:.6f}] {reply}" for i, reply in enumerate(replies)]
    assert not ping_trace(tmp_path, stamped).remarks


def test_stamps_of_a_log_count_instead_of_an_interval(tmp_path: Path) -> None:
    """A timestamp belongs to the reply; its request was sent one RTT earlier."""
    lines = [
        f"[{1714560000 + 0.2 * i + 0.1 * i:.6f}] " + UNIX_REPLY.format(seq=i, ms=100 * i)
        for i in range(1, 4)
    ]
    profile = ping_trace(tmp_path, lines, ping_interval_s=1.0)
    assert profile.duration == pytest.approx(0.4, abs=1e-5)
    assert profile.rtt_ms(0.2) == pytest.approx(200, abs=0.1)


@pytest.mark.parametrize(
    "line",
    [
        "[17145600{i:02}.5] 1.2.3.4 : [{i}], 64 bytes, 500 ms (50 avg, 0% loss)",
        "17145600{i:02}.5 64 bytes from 1.2.3.4: icmp_seq={i} ttl=57 time=500 ms",
        "2026-11-26 17:21:{i:02}.5 64 bytes from 1.2.3.4: icmp_seq={i} ttl=57 time=500 ms",
    ],
    ids=["fping -D", "ts %.s", "ts, dates"],
)
def test_stamps_of_other_programs(tmp_path: Path, line: str) -> None:
    profile = ping_trace(tmp_path, [line.format(i=i) for i in (10, 12, 13)], max_gap_s=3)
    assert profile.duration == pytest.approx(3) and not profile.remarks


@pytest.mark.parametrize(
    ("stamp", "step_s"),
    [
        ("Nov 26 17:21:{i:02}.5 ", 1),
        ("Nov 26 17:21:{i:02} robot ping[7]: ", 1),
        ("17:21:{i:02}.500000 ", 1),
        ("0.{i:02}0000 ", 0.01),
        ("[2026-11-26 17:21:{i:02}.500000] ", 1),
    ],
)
def test_stamps_of_ts_and_syslog_count(tmp_path: Path, stamp: str, step_s: float) -> None:
    line = stamp + "64 bytes from 1.2.3.4: icmp_seq={i} ttl=57 time=1 ms"
    profile = ping_trace(tmp_path, [line.format(i=i) for i in (10, 11, 13)], max_gap_s=3)
    assert profile.duration == pytest.approx(3 * step_s) and not profile.remarks


def test_a_time_of_day_passes_midnight(tmp_path: Path) -> None:
    reply = " 64 bytes from 1.2.3.4: icmp_seq={} ttl=57 time=1 ms"
    clocks = ["23:59:59.5", "00:00:00.5", "00:00:01.5"]
    lines = [clock + reply.format(i) for i, clock in enumerate(clocks)]
    assert ping_trace(tmp_path, lines).duration == pytest.approx(2)


def test_a_clock_that_was_set_back_by_a_day_is_no_midnight(tmp_path: Path) -> None:
    reply = "64 bytes from 1.2.3.4: icmp_seq={} ttl=57 time=1 ms"
    stamps = [1700086400.5, 1700086401.5, 1700000002.5, 1700000003.5]
    lines = [f"[{stamp:.6f}] " + reply.format(i) for i, stamp in enumerate(stamps)]
    with pytest.raises(SlambedError, match="time goes back"):
        ping_trace(tmp_path, lines)


def test_a_duplicate_in_the_same_second_is_no_second_reply(tmp_path: Path) -> None:
    reply = "Nov 26 17:21:{:02} 64 bytes from 1.2.3.4: icmp_seq={} ttl=57 time=1 ms"
    lines = [reply.format(10 + i, i) for i in range(3)]
    lines.insert(1, lines[0] + " (DUP!)")
    assert ping_trace(tmp_path, lines).duration == pytest.approx(2)


def test_a_line_of_stamps_alone_is_read_in_time(tmp_path: Path) -> None:
    lines = ["[1]" * 100_000 + f"x: icmp_seq={i} ttl=57 time=1 ms" for i in range(3)]
    with pytest.raises(SlambedError):
        ping_trace(tmp_path, lines)


@pytest.mark.parametrize(
    "stamps",
    [
        ["[1795651784,4]", "[1795651785,4]", "[1795651786,4]"],
        ["[   99.8]", "[  100.8]", "[  101.8]"],
        ["17:15:30,000", "17:15:31,000", "17:15:32,000"],
        ["Dec 31 23:59:59.8", "Jan  1 00:00:00.8", "Jan  1 00:00:01.8"],
        [f"Nov 26 17:15:30 [{1795651784.4 + i}]" for i in range(3)],
    ],
)
def test_stamps_of_other_forms_are_read(tmp_path: Path, stamps: list[str]) -> None:
    reply = " 64 bytes from 1.2.3.4: icmp_seq={} ttl=57 time=1 ms"
    lines = [stamp + reply.format(2 * i) for i, stamp in enumerate(stamps)]
    assert ping_trace(tmp_path, lines).duration == pytest.approx(2)


@pytest.mark.parametrize(
    ("lines", "complaint"),
    [
        (["64 bytes from 1.2.3.4: icmp_seq=1 ttl=57 time=1,234.5 ms"], "is no latency"),
        (
            [
                "64 bytes from a.b (1.2.3.4): icmp_seq=1 ttl=57 time=1 ms",
                "64 bytes from 1.2.3.4: icmp_seq=2 ttl=57 time=1 ms",
                "64 bytes from 1.2.3.5: icmp_seq=3 ttl=57 time=1 ms",
            ],
            "replies of 1.2.3.4 and of 1.2.3.5",
        ),
        (
            [
                "64 octets de a.b (1.2.3.4) : icmp_seq=1 ttl=57 temps=1 ms",
                "64 octets de 1.2.3.5\xa0: icmp_seq=2 ttl=57 temps=1 ms",
            ],
            "replies of 1.2.3.4 and of 1.2.3.5",
        ),
        (
            [
                f"{0.2 + (i % 2) / 1000:.6f} 64 bytes from 1.2.3.4: icmp_seq={i} ttl=57 time=1 ms"
                for i in range(9)
            ],
            "like the differences of 'ts -i'",
        ),
    ],
)
def test_a_log_that_would_give_another_trace_is_refused(
    tmp_path: Path, lines: list[str], complaint: str
) -> None:
    with pytest.raises(SlambedError) as error:
        ping_trace(tmp_path, lines)
    assert complaint in str(error.value)


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        (
            "{i}795651784400 64 bytes from 1.2.3.4: icmp_seq={i} ttl=57 time=1 ms",
            "its lines begin with a time of an unknown form",
        ),
        (
            "\x1b[32m[{i}]\x1b[0m 64 bytes from 1.2.3.4: icmp_seq={i} ttl=57 time=1 ms",
            "its lines begin with a time of an unknown form",
        ),
        (
            "Nov 26 17:21:10 64 bytes from 1.2.3.4: icmp_seq={i} ttl=57 time=1 ms",
            "its stamps are whole seconds, with several replies in one",
        ),
        (
            "2026-13-26 17:21:{i:02}.5 64 bytes from 1.2.3.4: icmp_seq={i} ttl=57 time=1 ms",
            "its lines begin with a time of an unknown form",
        ),
        (
            "26.11.2026 17:21:{i:02} Antwort von 1.2.3.4: Bytes=32 Zeit=12ms TTL=57",
            "its lines begin with a time of an unknown form",
        ),
    ],
)
def test_stamps_that_cannot_be_used_are_not_taken_for_none(
    tmp_path: Path, line: str, complaint: str
) -> None:
    lines = [line.format(i=i) for i in (10, 11, 12)]
    with pytest.raises(SlambedError, match=f"{complaint}, .*; give ping_interval_s"):
        ping_trace(tmp_path, lines)
    assert ping_trace(tmp_path, lines, ping_interval_s=0.2).duration == pytest.approx(0.4)


@pytest.mark.parametrize("time", ["-8ms", "-3 ms", "nan ms", "1e400 ms"])
def test_a_time_that_is_no_latency_is_refused(tmp_path: Path, time: str) -> None:
    good = "Reply from 1.2.3.4: bytes=32 time=2ms TTL=57"
    lines = [good, good.replace("2ms", time), good]
    with pytest.raises(SlambedError, match=f"line 2: '={time}' is no latency"):
        ping_trace(tmp_path, lines)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "latin-1"])
def test_traces_in_any_encoding(tmp_path: Path, encoding: str) -> None:
    file = tmp_path / "mine.csv"
    file.write_bytes("time_s,rtt_ms\r\n0,1\r\n0.5,3,\r\n# Größe\r\n".encode(encoding))
    profile = parse_profile({"rtt_ms": {"trace": {"file": str(file)}}}, "here")
    assert profile.rtt_ms(0.5) == 3
    file.write_bytes("5\r\n7\r\n\r\n".encode(encoding))
    assert read_rate_trace(str(file), None) == [5, 7]


def test_a_stamp_that_is_no_time_is_none(tmp_path: Path) -> None:
    reply = "64 bytes from 1.2.3.4: icmp_seq={} ttl=57 time=1 ms"
    stamps = ["9" * 400, "1795651785.4", "1795651786.4"]
    lines = [f"[{stamp}] {reply.format(i)}" for i, stamp in enumerate(stamps)]
    assert ping_trace(tmp_path, lines).duration == pytest.approx(1)


def test_lines_of_comments_count(tmp_path: Path) -> None:
    with pytest.raises(SlambedError, match=r"not a time and a number but '0.1, x'.* line 5;"):
        trace(tmp_path, "# a\n# b\ntime_s,rtt_ms\n0,1\n0.1,x\n")


def test_semicolons_with_decimal_commas(tmp_path: Path) -> None:
    assert trace(tmp_path, "time_s;rtt_ms\n0;1,5\n0,5;3,5;\n").rtt_ms(0.25) == 2.5


def test_two_logs_in_one_file_are_not_one(tmp_path: Path) -> None:
    lines = [UNIX_REPLY.format(seq=i, ms=i) for i in (1, 2, 3)]
    with pytest.raises(SlambedError, match=r"icmp_seq 1 comes again.*give the log of one ping"):
        ping_trace(tmp_path, [*lines, "", *lines])
