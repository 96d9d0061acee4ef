# SPDX-License-Identifier: Apache-2.0
"""`slambed profile` and `slambed link`: what they print and write."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from command_line import refused, slambed
from link_parts import needs_relay
from typer.testing import CliRunner

from slambed.commands.link import app as link_app
from slambed.commands.profiles import app
from slambed.errors import ExitCode, SlambedError
from slambed.native import repository_root

RUNNER = CliRunner()


def test_a_profile_is_shown_as_table_and_picture(tmp_path: Path) -> None:
    picture = tmp_path / "sine.png"
    result = RUNNER.invoke(app, ["show", "sine", "--output", str(picture)], catch_exceptions=False)
    assert result.exit_code == 0
    assert "40.000" in result.stdout
    assert "crosses 40 ms" in result.stdout
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_the_mean_is_over_the_length_and_not_over_the_picture(tmp_path: Path) -> None:
    """The picture goes 5 % further, where the last value holds."""
    path = tmp_path / "rising.yaml"
    path.write_text("rtt_ms: {points: [[0, 0], [10, 100]]}\n")
    arguments = ["show", str(path), "--output", str(tmp_path / "x.png")]
    shown = RUNNER.invoke(app, arguments, catch_exceptions=False).stdout
    assert "RTT: mean 49.95 ms, 0.00 to 100.00 ms" in shown
    assert "crosses 40 ms 1 times in 10 s" in shown
    shown = RUNNER.invoke(app, [*arguments, "--until-s", "20"], catch_exceptions=False).stdout
    assert "RTT: mean 74.97 ms" in shown


def test_an_assumed_ping_interval_is_said(tmp_path: Path) -> None:
    lines = [f"64 bytes from 1.2.3.4: icmp_seq={i} ttl=57 time=9 ms" for i in range(1, 5)]
    (tmp_path / "hall.log").write_text("\n".join(lines))
    path = tmp_path / "hall.yaml"
    path.write_text("rtt_ms: {trace: {file: hall.log, format: ping}}\n")
    arguments = ["show", str(path), "--output", str(tmp_path / "x.png")]
    shown = RUNNER.invoke(app, arguments, catch_exceptions=False).stdout
    assert "note: hall.log has no time stamps, so its requests count as 1 s apart" in shown


def test_parameters_can_be_tried(tmp_path: Path) -> None:
    picture = tmp_path / "x.png"
    arguments = ["show", "ramp", "--set", "peak_ms=50", "--output", str(picture)]
    assert "to 50.00 ms" in RUNNER.invoke(app, arguments, catch_exceptions=False).stdout
    with pytest.raises(SlambedError, match="not name=number"):
        RUNNER.invoke(app, ["show", "ramp", "--set", "peak"], catch_exceptions=False)


def test_changed_numbers_are_not_described_as_the_files(tmp_path: Path) -> None:
    folder = repository_root() / "netem_profiles"
    own = "by default 0-85-0 ms"
    for name in ("ramp", str(folder / "ramp.yaml")):
        arguments = ["show", name, "--output", str(tmp_path / "x.png")]
        unchanged = RUNNER.invoke(app, arguments, catch_exceptions=False).stdout
        assert unchanged.startswith("ramp: Up") and own in unchanged.splitlines()[0]
        arguments += ["--set", "peak_ms=50", "--set", "hold_s=3"]
        first, second, *_ = RUNNER.invoke(app, arguments, catch_exceptions=False).stdout.split("\n")
        assert first == "ramp[peak_ms=50,hold_s=3]: changed, peak_ms = 50, hold_s = 3"
        assert second.startswith("the file, of its own numbers: Up") and own in second


def test_every_impairment_is_reported(tmp_path: Path) -> None:
    trace = tmp_path / "up.trace"
    trace.write_text("\n".join(str(ms) for ms in range(1, 2001, 3)))
    path = tmp_path / "mine.yaml"
    path.write_text(
        f"rtt_ms: 8\nup: {{rate: {{trace: {trace}}}}}\nloss: {{random: 0.01}}\n"
        "jitter: {sd_ms: 2}\ngaps: [{start_s: 3, length_s: 1, every_s: 9}]\n"
    )
    arguments = ["show", str(path), "--output", str(tmp_path / "mine.png")]
    shown = RUNNER.invoke(app, arguments, catch_exceptions=False).stdout
    for text in (f"rate {trace}", "normal jitter 2 ms", "loss 1.000%", "silence of 1 s at 3 s"):
        assert text in shown


def test_all_profiles_are_listed() -> None:
    shown = RUNNER.invoke(app, ["list"], catch_exceptions=False).stdout
    assert "ramp_85" in shown and "ijnc_wifi" in shown
    for heading in ("RTT [ms]", "length [s]"):
        assert heading in shown


def test_the_table_of_a_profile_has_units(tmp_path: Path) -> None:
    arguments = ["show", "ramp", "--output", str(tmp_path / "x.png")]
    shown = RUNNER.invoke(app, arguments, catch_exceptions=False).stdout
    for heading in ("time [s]", "RTT [ms]", "up [ms]", "down [ms]"):
        assert heading in shown


@pytest.mark.parametrize("until", ["-3", "0", "nan", "inf"])
def test_a_time_that_cannot_be_shown_is_refused(tmp_path: Path, until: str) -> None:
    picture = tmp_path / "x.png"
    arguments = ["show", "ramp", f"--until-s={until}", "--output", str(picture)]
    with pytest.raises(SlambedError, match=r"--until-s .* is not between"):
        RUNNER.invoke(app, arguments, catch_exceptions=False)
    assert not picture.exists()


def test_a_picture_that_cannot_be_written_is_reported(tmp_path: Path) -> None:
    arguments = ["show", "ramp", "--output", str(tmp_path / "nowhere" / "x.png")]
    with pytest.raises(SlambedError, match="No such file or directory; choose another --output"):
        RUNNER.invoke(app, arguments, catch_exceptions=False)


def test_logs_are_compared_in_one_picture(tmp_path: Path) -> None:
    t = np.arange(0, 5, 0.1)
    names = ["asked_rtt_ms", "probe_rtt_ms", "tcp_rtt_ms", "applied_up_ms", "applied_down_ms"]
    frame = pd.concat([pd.DataFrame({"t_s": t, "series": n, "value": 20.0}) for n in names])
    frame.to_csv(tmp_path / "relay_x.csv")
    frame.to_parquet(tmp_path / "netem_x.parquet")
    picture = tmp_path / "both.png"
    logs = [str(tmp_path / "relay_x.csv"), str(tmp_path / "netem_x.parquet")]
    RUNNER.invoke(link_app, ["compare", *logs, "--output", str(picture)], catch_exceptions=False)
    assert picture.read_bytes().startswith(b"\x89PNG")
    with pytest.raises(SlambedError, match="no such link log"):
        RUNNER.invoke(link_app, ["compare", "nowhere.csv"], catch_exceptions=False)


def link_log(path: Path, *names: str) -> Path:
    t = np.arange(0, 5, 0.1)
    frame = pd.concat([pd.DataFrame({"t_s": t, "series": n, "value": 20.0}) for n in names])
    path.parent.mkdir(parents=True, exist_ok=True)
    frame.to_parquet(path)
    return path


def test_logs_of_one_name_are_all_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[str] = []
    monkeypatch.setattr("slambed.link.plots.plot_links", lambda links, path: drawn.extend(links))
    places = ("x/a/link.parquet", "x/b/link.parquet", "y/b/link.parquet", "x/relay_ramp.parquet")
    logs = [str(link_log(tmp_path / place, "asked_rtt_ms")) for place in places]
    output = str(tmp_path / "links.png")
    assert slambed("link", "compare", *logs, logs[0], "--output", output)[0] == ExitCode.OK
    assert drawn == ["a", logs[1], logs[2], "relay, ramp"]


@pytest.mark.parametrize("name", ["link.png", "link.svg", "link.pdf"])
def test_the_log_of_a_real_network_is_drawn(tmp_path: Path, name: str) -> None:
    """Nothing is asked of it, it is only measured."""
    log, picture = link_log(tmp_path / "link.parquet", "probe_rtt_ms"), tmp_path / name
    code, _, err = slambed("link", "compare", str(log), "--output", str(picture))
    assert (code, err) == (ExitCode.OK, "") and picture.is_file()


@pytest.mark.parametrize(
    ("name", "content", "part"),
    [
        ("x.csv", b"a,b\n1,2\n", "it has no column series; give"),
        ("x.csv", b"t_s,series,value\nsoon,asked_rtt_ms,1\n", "could not convert"),
        ("x.csv", b"", "No columns to parse"),
        ("x.csv", b"\xff\xfe\x00", "can't decode"),
        ("x.csv", b"a\n1,2\n1,2,3\n", "Error tokenizing data"),
        ("x.parquet", b"PAR1", "is no link log"),
    ],
)
def test_what_is_no_link_log_is_one_line(
    tmp_path: Path, name: str, content: bytes, part: str
) -> None:
    (tmp_path / name).write_bytes(content)
    line = refused(ExitCode.BAD_INPUT, "link", "compare", str(tmp_path / name))
    assert f"{name} is no link log: " in line and part in line


@pytest.mark.parametrize("command", ["measure", "bench"])
def test_a_link_is_measured_for_a_second_at_least(command: str) -> None:
    for seconds in ("0", "-1"):
        line = refused(ExitCode.BAD_INPUT, "link", command, f"--seconds={seconds}")
        assert "'--seconds': Input should be greater than or equal to 1" in line


@needs_relay
def test_a_link_is_measured_with_its_tcp(tmp_path: Path) -> None:
    log, picture = tmp_path / "log.parquet", tmp_path / "link.png"
    arguments = ["measure", "rtt_40", "--backend", "relay", "--seconds", "2", "--tcp"]
    result = RUNNER.invoke(
        link_app, [*arguments, "--log", str(log), "--output", str(picture)], catch_exceptions=False
    )
    assert result.exit_code == 0
    assert "error_ms_median" in result.stdout
    tcp = pd.read_parquet(log).query("series == 'tcp_rtt_ms'")["value"]
    assert tcp.iloc[-1] == pytest.approx(40, abs=4)
    assert picture.exists()


def test_a_picture_that_nobody_asked_for_is_not_put_where_one_works(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path / "cache"))
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    shown = RUNNER.invoke(app, ["show", "sine"], catch_exceptions=False).stdout
    picture = tmp_path / "cache" / "pictures" / "profile_sine.png"
    assert f"plot: {picture}" in shown and picture.is_file()
    assert not list(here.iterdir())


def test_a_figure_is_reported_by_the_name_that_it_gets(tmp_path: Path) -> None:
    arguments = ["show", "ramp", "--output", str(tmp_path / "x")]
    result = RUNNER.invoke(app, arguments, catch_exceptions=False)
    assert f"plot: {tmp_path / 'x.png'}" in result.stdout.replace("\n", "")
    assert [file.name for file in tmp_path.iterdir()] == ["x.png"]
    with pytest.raises(SlambedError, match=r"unknown picture format .*x\.xyz; known: \.png"):
        RUNNER.invoke(app, [*arguments[:-1], str(tmp_path / "x.xyz")], catch_exceptions=False)
