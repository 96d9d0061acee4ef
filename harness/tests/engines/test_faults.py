# SPDX-License-Identifier: Apache-2.0
"""`faults:` of an experiment: parsing, timing and configuration."""

import os
import re
import signal
import subprocess
import time
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest
from harness_parts import EXPERIMENT, run_spec
from test_spec import HOST, complaint, complaint_of, matrix, named
from waiting import until

from slambed.engines.base import ProcessWatch, is_stopped
from slambed.engines.docker import DockerNode
from slambed.engines.faults import FaultDriver, RunEdge, steps, write_planned
from slambed.engines.virtual import sim_config
from slambed.errors import ExitCode, SlambedError
from slambed.link.named_profile import backend_for, read_profile
from slambed.link.profile import parse_profile
from slambed.metrics.events import read_events
from slambed.metrics.faults import faults_in_words, spans
from slambed.spec.experiment import Playback
from slambed.spec.faults import Fault, check_faults, with_cuts
from slambed.spec.library import Library
from slambed.spec.matrix import Circumstances, expand, read_profiles
from slambed.spec.run_spec import LinkSpec, RunSpec

KILL = Fault(at_s=1, edge="kill")
RESTART = Fault(at_s=2, edge="restart")
FREEZE = Fault(at_s=4, edge="freeze", for_s=1.5)
CUT = Fault(at_s=5, link="cut", for_s=2)
ALL = [KILL, RESTART, FREEZE, CUT]


def with_faults(text: str) -> str:
    return EXPERIMENT.replace("seed: 7", f"seed: 7\nfaults: {text}")


@pytest.mark.parametrize(
    ("faults", "parts"),
    [
        ("[{at_s: 1, edge: kil}]", ["'kill', 'freeze' or 'restart'", "'kil'", "line 16"]),
        ("[{at_s: 1}]", ["give one of edge", "line 16"]),
        ("[{at_s: 1, edge: kill, link: cut}]", ["give one of edge"]),
        ("[{at_s: -1, edge: kill}]", ["greater than or equal to 0", "-1"]),
        ("[{edge: kill}]", ["'faults.0.at_s' is missing"]),
        ("[{at_s: 1, edge: kill, for: 3}]", ["unknown key 'for'", "'for_s'"]),
        ("[{at_s: 1, edge: kill, for_s: 3}]", ["kill has no for_s"]),
        ("[{at_s: 1, edge: freeze}]", ["freeze needs for_s"]),
        ("[{at_s: 1, link: cut, for_s: 1.0e+9}]", ["for_s", "100000"]),
        ("[{at_s: 1, link: cut, for_s: 1e9}]", ["number is 1.0e+9"]),
        ("[{at_s: 1, link: cut, for_s: 0}]", ["greater than 0"]),
        ("[{at_s: 2, edge: kill}, {at_s: 1, link: cut, for_s: 1}]", ["not in the order of at_s"]),
        ("[{at_s: 1, edge: restart}]", ["restart at 1 s: the edge is alive then"]),
        ("[{at_s: 1, edge: kill}, {at_s: 2, edge: kill}]", ["kill at 2 s: the edge is dead then"]),
        (
            "[{at_s: 1, edge: freeze, for_s: 2}, {at_s: 2, edge: kill}]",
            ["kill at 2 s: frozen until 3 s"],
        ),
        (
            "[{at_s: 1, link: cut, for_s: 2}, {at_s: 2, link: cut, for_s: 2}]",
            ["cut at 2 s: cut until 3 s"],
        ),
    ],
)
def test_a_mistake_is_one_line_with_its_place(
    tmp_path: Path, faults: str, parts: list[str]
) -> None:
    text = complaint(tmp_path, "seed: 7", f"seed: 7\nfaults: {faults}")
    assert "tiny.yaml line 16" in text
    for part in parts:
        assert part in text


def test_a_fault_may_be_over_when_the_next_begins() -> None:
    freezes = [Fault(at_s=t, edge="freeze", for_s=1) for t in (1, 2)]
    assert check_faults(freezes) == freezes
    assert check_faults(ALL) == ALL


def test_faults_are_for_systems_with_an_edge_and_part_of_the_key(tmp_path: Path) -> None:
    plain = matrix(tmp_path)
    failing = matrix(tmp_path, with_faults("[{at_s: 1, edge: kill}]"))
    for before, after in zip(plain, failing, strict=True):
        assert (after.run_key == before.run_key) == (after.system == "solo")
        assert after.faults == ([] if after.system == "solo" else [KILL])
        assert RunSpec.model_validate_json(after.model_dump_json()) == after
    assert "faults" not in plain[0].meaning()


def test_a_system_may_have_its_own_faults(tmp_path: Path) -> None:
    text = with_faults("[{at_s: 1, edge: kill}]").replace(
        "    variant: better\n", "    variant: better\n    faults: []\n"
    )
    assert all(spec.faults == [] for spec in matrix(tmp_path, text))
    own = "    variant: better\n    faults: [{at_s: 1, link: cut, for_s: 2}]\n"
    text = EXPERIMENT.replace("    variant: better\n", own)
    (spec, *_) = [s for s in matrix(tmp_path, text) if s.system == "pair"]
    assert spec.link is not None and spec.link.content["gap_mode"] == "drop"
    assert spec.link.content["gaps"] == [{"start_s": 1.0, "length_s": 2.0}]
    line = complaint(
        tmp_path, "- {system: solo}", "- {system: solo, faults: [{at_s: 1, edge: kill}]}"
    )
    assert "solo has no edge that could fail" in line and "line 4" in line


def test_a_fault_after_the_end_of_playback_is_refused(tmp_path: Path) -> None:
    late = "[{at_s: 1, edge: kill}, {at_s: 2, edge: restart}]"
    line = complaint(tmp_path, "seed: 7", f"seed: 7\nfaults: {late}")
    assert "restart at 2 s: playback is over at 2 s" in line and "line 16" in line
    own = f"    variant: better\n    faults: {late}\n"
    assert "line 7" in complaint(tmp_path, "    variant: better\n", own)
    text = with_faults(late)
    later = text.replace("end_s: 2", "start_s: 0.5, end_s: 2")
    assert "over at 1.5 s" in complaint_of(tmp_path, later)
    # If frames wait for tracking, a run may last longer than its sequence.
    assert matrix(tmp_path, text.replace("mode: realtime", "mode: every_frame"))
    open_end = text.replace(", end_s: 2", "")
    assert matrix(tmp_path, open_end)
    short, long = (replace(HOST, played_s={"room": seconds}) for seconds in (1.9, 2.1))
    assert "over at 1.9 s" in complaint_of(tmp_path, open_end, short)
    assert matrix(tmp_path, open_end, host=long)


def test_an_end_after_that_of_the_sequence_is_refused(tmp_path: Path) -> None:
    """A stand-in for a sequence may be shorter; that is not the user's mistake."""
    text = with_faults("[]")
    short = replace(HOST, played_s={"room": 0.9}, datasets={"room": ("room", "abc")})
    line = complaint_of(tmp_path, text, short)
    assert "end_s 2 is after the end of room, which lasts 0.9 s" in line and "line 9" in line
    assert matrix(tmp_path, text, host=replace(short, played_s={"room": 1.9}))
    assert matrix(tmp_path, text, host=replace(short, datasets={"room": ("other", "abc")}))
    # A window starts where its file says; its end counts from the begin of the whole sequence.
    text = text.replace("end_s: 2", "end_s: 115")
    window = replace(short, playbacks={"room": Playback(start_s=105, end_s=115)})
    assert matrix(tmp_path, text, host=replace(window, played_s={"room": 10.0}))
    line = complaint_of(tmp_path, text, replace(window, played_s={"room": 5.0}))
    assert "end_s 115 is after the end of room, which lasts 110.0 s" in line and "line 9" in line


def test_faults_need_an_edge(tmp_path: Path) -> None:
    text = with_faults("[{at_s: 1, link: cut, for_s: 1}]")
    alone = re.sub(r"  - system: pair\n(    .*\n)+", "", text)
    line = complaint_of(tmp_path, alone)
    assert "there are faults but no system has an edge" in line and "line 13" in line


def test_the_virtual_engine_refuses_to_kill(tmp_path: Path) -> None:
    library = Library(tmp_path)
    matrix(tmp_path, with_faults("[{at_s: 0, link: cut, for_s: 1}, {at_s: 1, edge: kill}]"))
    experiment, source = library.experiment("tiny")
    host = Circumstances("virtual", HOST.link_backends, HOST.software, HOST.datasets)
    profiles = read_profiles(experiment, source, named)
    with pytest.raises(SlambedError) as caught:
        # Virtual devices need cost models; these systems are checked first.
        expand(
            experiment.model_copy(update={"systems": experiment.systems[1:]}),
            source,
            library,
            profiles,
            host,
            1,
        )
    assert "engine virtual cannot kill a node" in str(caught.value)
    assert "line 16" in str(caught.value) and "use docker or local" in str(caught.value)


def test_a_cut_is_a_gap_that_drops() -> None:
    content = with_cuts(read_profile("rtt_20", "here").content, ALL)
    profile = parse_profile(content, "here")
    assert [(g.start_s, g.length_s) for g in profile.gaps] == [(5.0, 2.0)]
    assert profile.gap_mode == "drop" and profile.rtt_ms(0) == 20
    with pytest.raises(ValueError, match="own gaps hold them"):
        with_cuts({"gaps": [{"start_s": 1, "length_s": 1}]}, [CUT])
    own = with_cuts({"gaps": [{"start_s": 1.0, "length_s": 1.0}], "gap_mode": "drop"}, [CUT])
    assert len(own["gaps"]) == 2
    assert with_cuts({"rtt": 1}, [KILL]) == {"rtt": 1}


def test_a_cut_needs_the_relay() -> None:
    profile = read_profile("rtt_20", "here")
    assert backend_for("auto", profile, cut=True) == "relay"
    with pytest.raises(SlambedError, match="use backend relay"):
        backend_for("netem", profile, cut=True)


def test_a_restart_ends_a_kill_and_the_rest_ends_by_itself() -> None:
    found = [(s.at_s, s.fault, s.begins) for s in steps(ALL)]
    assert found == [
        (1, "kill", True),
        (2, "kill", False),
        (4, "freeze", True),
        (5, "cut", True),
        (5.5, "freeze", False),
        (7, "cut", False),
    ]


@dataclass
class Doings:
    """An edge that records the actions on it."""

    driver: FaultDriver | None = None
    done: list[Any] = field(default_factory=list)

    def kill(self) -> None:
        assert self.driver is not None and self.driver.edge_is_dead
        self.done.append("kill")

    def freeze(self, frozen: bool) -> None:
        self.done.append("freeze" if frozen else "thaw")

    def start_again(self) -> None:
        assert self.driver is not None and self.driver.edge_is_dead
        self.done.append("start")


def driver_at(now_s: float, faults: list[Fault], folder: Path) -> tuple[FaultDriver, Doings]:
    """Returns a driver whose run began `now_s` ago."""
    edge = Doings()
    edge.driver = FaultDriver(faults, edge, folder)
    edge.driver.start(time.monotonic_ns() - round(now_s * 1e9))
    return edge.driver, edge


def test_what_is_due_happens_in_its_order(tmp_path: Path) -> None:
    driver, edge = driver_at(5.2, ALL, tmp_path)
    assert driver.wait_s(10) == 0
    driver.act()
    assert edge.done == ["kill", "start", "freeze"] and not driver.edge_is_dead
    assert 0 < driver.wait_s(10) <= 0.3 and driver.wait_s(0.01) == 0.01
    driver.finish()  # a frozen edge could not end
    assert edge.done[-1] == "thaw" and driver.wait_s(10) == 10
    driver.write()
    events = read_events(tmp_path).of("fault_began", "fault_ended")
    assert {event["node"] for event in events} == {"harness"}
    assert [(e["type"], e["target"], e["fault"]) for e in events][-1] == (
        "fault_ended",
        "edge",
        "freeze",
    )
    (cut,) = [e for e in events if e["fault"] == "cut"]
    assert cut["t_ns"] == 5_000_000_000  # the link cuts itself on time


def test_a_fault_that_came_late_is_not_the_one_that_was_asked_for(tmp_path: Path) -> None:
    for behind_s, complaints in ((0.3, []), (1.2, ["freeze came at 5.2 s, not at 4.0 s"])):
        driver, _ = driver_at(4 + behind_s, [FREEZE], tmp_path)
        driver.act()
        driver.finish()  # the run ends before the freeze; the host is not late
        assert len(driver.invalid_reasons) == len(complaints)
        for reason, expected in zip(driver.invalid_reasons, complaints, strict=True):
            assert reason.endswith(expected)


@dataclass
class Stubborn:
    """A node that ignores signals."""

    pid: int

    def freeze(self, frozen: bool) -> None: ...

    def is_frozen(self) -> bool:
        return False

    def exit_code(self) -> None: ...


def test_a_freeze_that_did_not_happen_is_not_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("slambed.engines.faults.SIGNAL_TIMEOUT_S", 0.05)
    nodes: Any = {"edge": Stubborn(os.getpid())}
    edge = RunEdge(None, None, nodes, None, ExitStack())  # type: ignore[arg-type]
    driver = FaultDriver([FREEZE], edge, tmp_path)
    driver.start(time.monotonic_ns() - round(4.5e9))
    with pytest.raises(SlambedError, match="the edge node was not frozen") as caught:
        driver.act()
    assert caught.value.code == ExitCode.ENVIRONMENT
    driver.write()
    assert list(tmp_path.iterdir()) == []


class Container:
    """A container for the kernel's freezer, which stops no process as a signal does."""

    def __init__(self) -> None:
        self.attrs = {"State": {"Paused": False}}
        self.paused = False

    def pause(self) -> None:
        self.paused = True

    def unpause(self) -> None:
        self.paused = False

    def reload(self) -> None:
        self.attrs = {"State": {"Paused": self.paused}}


def test_a_paused_container_is_frozen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("slambed.engines.faults.SIGNAL_TIMEOUT_S", 0.05)
    node, container = DockerNode.__new__(DockerNode), Container()
    node.pid, node.container, node.several_processes = os.getpid(), container, True
    node._code, node._watch = None, ProcessWatch(os.getpid())
    nodes: Any = {"edge": node}
    edge = RunEdge(None, None, nodes, None, ExitStack())  # type: ignore[arg-type]
    edge.freeze(True)
    assert container.paused and node.is_frozen()
    edge.freeze(False)
    assert not container.paused and not node.is_frozen()
    node._watch.close()


def test_a_stopped_process_is_frozen() -> None:
    with subprocess.Popen(["sleep", "60"]) as process:
        process.send_signal(signal.SIGSTOP)
        until(lambda: is_stopped(process.pid), "the stop")
        process.send_signal(signal.SIGCONT)
        until(lambda: not is_stopped(process.pid), "the end of the stop")
        process.kill()
    assert not is_stopped(process.pid)


def test_a_dead_edge_stays_dead_without_a_restart(tmp_path: Path) -> None:
    driver, edge = driver_at(3, [KILL], tmp_path)
    driver.act()
    driver.finish()
    assert edge.done == ["kill"] and driver.edge_is_dead


def test_a_run_without_faults_leaves_no_log(tmp_path: Path) -> None:
    driver, _ = driver_at(3, [], tmp_path)
    driver.act()
    driver.write()
    write_planned([], 10, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_the_summary_names_what_happened(tmp_path: Path) -> None:
    write_planned([KILL, FREEZE, CUT], 6, tmp_path)  # the cut outlasts the run
    found = spans(read_events(tmp_path).of("fault_began", "fault_ended"))
    assert [(s.fault, s.begin_s, s.end_s) for s in found] == [
        ("kill", 1.0, None),
        ("freeze", 4.0, 5.5),
        ("cut", 5.0, None),
    ]
    assert faults_in_words(read_events(tmp_path).events) == "kill 1.0-, freeze 4.0-5.5, cut 5.0-"
    assert faults_in_words([]) is None


def test_the_simulation_is_given_when_the_edge_stands_still() -> None:
    host = Library().device("host")
    link = LinkSpec(backend="virtual", profile="none", content={"name": "none", "rtt_ms": 0})
    changes: dict[str, Any] = {"device_mobile": host, "device_edge": host, "link": link}
    world = sim_config(run_spec(edge=True, faults=[FREEZE, CUT], **changes), 10, None).as_json()
    assert world["edge_frozen_s"] == [[4.0, 5.5]]
    assert sim_config(run_spec(edge=True, **changes), 10, None).edge_frozen_s == []
