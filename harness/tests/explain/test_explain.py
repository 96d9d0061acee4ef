# SPDX-License-Identifier: Apache-2.0
"""The timeline and the story of a run agree with its events."""

import re
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from command_line import refused, slambed
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from virtual_parts import EXPERIMENT, make_sequence, needs_programs, write_experiment

from slambed.commands.explain import choose_window
from slambed.errors import ExitCode, SlambedError
from slambed.explain.picture import LOSS_COLOR, STATE_COLORS, Window, figure_of
from slambed.explain.run_log import RunLog, read_run
from slambed.explain.story import story

pytestmark = needs_programs


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Runs with a device that is too slow for its frames, and a lens that is covered for a
    while."""
    folder = tmp_path_factory.mktemp("explain")
    dark = ("--trajectory", "office", "--blackout-start-s", "3", "--blackout-end-s", "4.5")
    sequence = make_sequence(folder / "walk", 8, *dark)
    text = EXPERIMENT.replace("speed: 0.04", "speed: 0.018")
    path = write_experiment(folder, sequence, runs=1, text=text)
    code, out, err = slambed("run", str(path), "--no-figures", "--results", str(folder / "results"))
    assert code == ExitCode.OK, out + err
    return folder / "results"


def run_of(results: Path, label: str) -> RunLog:
    table = pd.read_csv(results / "walk" / "summary.csv")
    (key,) = table.loc[table["cell"].str.startswith(label), "run_key"]
    return read_run(results / "walk" / "runs" / key)


@pytest.fixture(scope="module")
def offloaded(results: Path) -> RunLog:
    log = run_of(results, "offloaded")
    # The events that the tests below need exist.
    for kind in ("track_lost", "frame_dropped", "update_applied", "rtt_sample", "keyframe_created"):
        assert len(log.of(kind)), kind
    return log


@pytest.fixture
def figure(offloaded: RunLog):
    figure = figure_of(offloaded, Window(0.0, offloaded.end_s))
    yield figure
    plt.close(figure)


def row(figure: Figure, label: str) -> Axes:
    (axes,) = [axes for axes in figure.axes if axes.get_ylabel() == label]
    return axes


def names(axes: Axes) -> list[str]:
    return [tick.get_text() for tick in axes.get_yticklabels()]


def test_every_message_is_a_line_from_sending_to_arrival(offloaded: RunLog, figure: Figure) -> None:
    messages = offloaded.of("message")
    arrived = messages[messages["received_ns"].notna() & (messages.get("dropped") != True)]  # noqa: E712
    drawn = [
        np.asarray(line)
        for lines in row(figure, "messages").collections
        if isinstance(lines, LineCollection)
        for line in lines.get_segments()
    ]
    assert len(drawn) == len(arrived) > 10
    asked = sorted(zip(arrived["queued_ns"] / 1e9, arrived["received_ns"] / 1e9, strict=True))
    assert np.allclose(sorted((line[0][0], line[1][0]) for line in drawn), asked)
    ups = sum(line[0][1] > line[1][1] for line in drawn)
    assert ups == (arrived["direction"] == "up").sum()


def test_losses_and_states_are_where_they_happened(offloaded: RunLog, figure: Figure) -> None:
    losses = [t for t in offloaded.losses_s()]
    for axes in figure.axes:
        dashed = [line for line in axes.lines if line.get_linestyle() == "--"]
        assert [line.get_xdata()[0] for line in dashed] == losses
        assert {line.get_color() for line in dashed} == {LOSS_COLOR}
    top = figure.axes[0]
    assert names(top) == [
        "tracking", "dropped frames", "keyframes created", "updates applied", "declined"
    ]  # fmt: skip
    strips = [c for c in top.collections if isinstance(c, PolyCollection)]
    states = offloaded.of("frame_tracked")["state"]
    changes = states[states != states.shift()]
    assert [to_hex(c.get_facecolor()[0]).upper() for c in strips] == [
        STATE_COLORS[state].upper() for state in changes
    ]
    lost_from = strips[list(changes).index("lost")].get_paths()[0].vertices[:, 0].min()
    assert lost_from == pytest.approx(losses[0])


def test_stages_lie_in_the_lanes_of_their_workers(offloaded: RunLog, figure: Figure) -> None:
    for node in ("mobile", "edge"):
        axes, stages = row(figure, node), offloaded.of("stage", node=node)
        assert set(names(axes)) == set(stages["worker"])
        for lane, worker in enumerate(names(axes)):
            own = stages[stages["worker"] == worker]
            boxes = [
                path.vertices
                for bars in axes.collections
                for path in bars.get_paths()
                if abs(path.vertices[:, 1].mean() - lane) < 0.5
            ]
            assert len(boxes) == len(own)
            ends = sorted(box[:, 0].max() for box in boxes)
            assert np.allclose(ends, sorted(own["t_s"]))


def test_the_rtt_shows_what_was_asked_and_what_the_socket_saw(
    offloaded: RunLog, figure: Figure
) -> None:
    axes = row(figure, "RTT [ms]")
    curves = {line.get_label(): line for line in axes.lines}
    samples = offloaded.of("rtt_sample")
    assert list(curves["tcp_info"].get_ydata()) == list(samples["rtt_ms"])
    assert set(curves["asked"].get_ydata()) == {12.0}
    assert axes.get_ylim()[1] > samples["rtt_ms"].max()


def test_the_story_counts_what_the_events_say(offloaded: RunLog) -> None:
    applied = offloaded.of("update_applied")
    assert len(applied) > 1
    events = offloaded.events.copy()
    events.loc[applied.index[0], "relocalization"] = True
    frames, *lines = story(replace(offloaded, events=events))
    tracked, dropped = offloaded.of("frame_tracked"), offloaded.of("frame_dropped")
    assert len(tracked) + len(dropped) == 80
    numbers = [float(n) for n in re.findall(r"[\d.]+", frames)]
    assert numbers == [
        80,
        round(offloaded.end_s, 1),
        (tracked["state"] == "ok").sum(),
        len(dropped),
        len(offloaded.losses_s()),
        len(offloaded.of("keyframe_created")),
    ]
    text = "\n".join(lines)
    asked = int(applied["relocalization"].fillna(False).iloc[1:].sum()) + 1
    applied_words = f"{len(applied)} map updates applied ({asked} of them for a relocalization)"
    assert f"{applied_words}, T_MU {applied['t_mu_ms'].mean():.0f} ms" in text
    for reason, count in offloaded.of("update_declined")["reason"].value_counts().items():
        assert f"{count} map update{'s' * (count > 1)} declined: {reason}" in text
    busy = offloaded.of("stage", node="mobile")
    busy = busy.loc[busy["worker"] == "tracking", "wall_ms"].sum() / 10 / offloaded.end_s
    assert f"mobile tracking: busy {busy:.0f} %" in text


def test_the_story_reports_what_preceded_the_loss(offloaded: RunLog) -> None:
    (loss_s,) = offloaded.losses_s()
    (line,) = [line for line in story(offloaded) if line.startswith("track lost at")]
    assert line.startswith(f"track lost at {loss_s:.2f} s: inliers ")
    before = offloaded.of("frame_tracked")
    before = before[before["t_s"].between(loss_s - 2, loss_s)]
    assert " ".join(str(int(n)) for n in before["inliers"].tail(6)) in line
    applied = offloaded.of("update_applied")["t_s"]
    last_s = applied[applied <= loss_s].max()
    assert f"last map update {loss_s - last_s:.2f} s before" in line


def test_a_run_without_an_edge_has_no_rows_for_it(results: Path) -> None:
    alone = run_of(results, "alone")
    figure = figure_of(alone, Window(0.0, alone.end_s))
    assert [axes.get_ylabel() for axes in figure.axes] == ["", "mobile"]
    plt.close(figure)


def test_windows(offloaded: RunLog) -> None:
    (loss_s,) = offloaded.losses_s()
    assert choose_window(offloaded, None, None, "loss") == Window(loss_s - 2, loss_s + 2)
    assert choose_window(offloaded, None, None, "1") == Window(0.0, 3.0)
    assert choose_window(offloaded, None, None, None) == Window(0.0, offloaded.end_s)
    assert choose_window(offloaded, -5.0, 900.0, None) == Window(0.0, offloaded.end_s)
    for begin, end, around in (
        (None, None, "500"), (None, None, "-1"), (None, None, "nan"),
        (900.0, None, None), (600.0, 900.0, None), (-5.0, -1.0, None), (-5.0, 0.0, None),
    ):  # fmt: skip
        with pytest.raises(SlambedError, match="outside the run, 0 to"):
            choose_window(offloaded, begin, end, around)


def test_the_command_finds_the_run_by_its_key_and_writes_the_picture(
    results: Path, offloaded: RunLog, tmp_path: Path
) -> None:
    key, target = offloaded.folder.name, tmp_path / "line.png"
    code, out, err = slambed(
        "explain", key[:6], "--results", str(results), "-o", str(target), "--around", "loss"
    )
    assert code == ExitCode.OK, err
    assert "track lost at" in out and target.read_bytes().startswith(b"\x89PNG")
    line = refused(ExitCode.BAD_INPUT, "explain", "0000", "--results", str(results))
    assert "no run '0000'" in line
    line = refused(
        ExitCode.BAD_INPUT, "explain", key, "--results", str(results), "--from", "3", "--to", "2"
    )
    assert "--to 2 is not after --from 3" in line
    wide = ("--results", str(results), "--from", "-5", "--to", "900")
    code, out, err = slambed("explain", key, "-o", str(target), *wide)
    assert code == ExitCode.OK, err
    assert "note: the run is from 0 to" in out
    nowhere = str(tmp_path / "nowhere" / "x.png")
    line = refused(ExitCode.BAD_INPUT, "explain", key, "--results", str(results), "-o", nowhere)
    assert "No such file or directory; choose another --output" in line
