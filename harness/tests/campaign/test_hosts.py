# SPDX-License-Identifier: Apache-2.0
"""Several hosts, tested without any: hosts.yaml, assignment of runs, keys, retries, tables."""

import errno
import json
import threading
from collections import Counter
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pandas as pd
import pytest
from command_line import refused
from harness_parts import run_spec
from virtual_parts import Quiet

from slambed.campaign import host_run
from slambed.campaign import hosts as hosts_module
from slambed.campaign.backlog import Backlog
from slambed.campaign.folder import ResultFolder
from slambed.campaign.host_connection import Credentials, HostConnection
from slambed.campaign.host_executor import HostExecutor, Place, preference
from slambed.campaign.host_messages import Joined
from slambed.campaign.host_run import HostRun, ThisHost, begin, execute_there, prepare_there
from slambed.campaign.host_worker import harness_digest
from slambed.campaign.hosts import JoinedHosts
from slambed.campaign.ledger import Ledger
from slambed.campaign.runner import Runner
from slambed.errors import ExitCode, KilledError, PassingError, SlambedError
from slambed.metrics.summary import Summary
from slambed.native import repository_root
from slambed.report.cells import hosts_of
from slambed.report.hosts import mixes_hosts
from slambed.spec.device import Board, Device, Limits
from slambed.spec.hosts import Host, read_hosts
from slambed.spec.run_spec import RunSpec

GOOD = """\
hosts:
  - {name: lab1, address: me@lab1, engine: local, cores: 4, labels: [fast]}
  - {name: lab2, address: me@lab2, engine: local}
  - {name: board, address: pi@pi4, slambed: /opt/slambed, ssh: [-p, "2222"]}
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "hosts.yaml"
    path.write_text(text)
    return path


def test_hosts_are_chosen_by_name_and_label(tmp_path: Path) -> None:
    path = write(tmp_path, GOOD)
    assert [host.name for host in read_hosts(path, ["lab2", "fast"])] == ["lab1", "lab2"]
    (board,) = read_hosts(path, ["board"])
    assert (board.engine, board.cores, board.slambed) == ("docker", None, "/opt/slambed")
    with pytest.raises(SlambedError, match=r"--on lab3 is no host .* did you mean 'lab"):
        read_hosts(path, ["lab3"])


def test_the_example_is_a_file_of_hosts() -> None:
    hosts = read_hosts(repository_root() / "examples" / "hosts" / "hosts.yaml")
    assert [host.name for host in hosts if host.is_here] == ["mine"] and len(hosts) == 3


def test_an_engine_is_part_of_what_a_run_means(tmp_path: Path) -> None:
    path = write(tmp_path, GOOD)
    with pytest.raises(SlambedError, match=r"different engines.*lab2 has local, board has docker"):
        read_hosts(path)
    with pytest.raises(SlambedError, match=r"--engine docker, but host lab1 .* has engine local"):
        read_hosts(path, ["lab1"], "docker")
    assert len(read_hosts(path, ["lab1", "lab2"], "local")) == 2


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("hosts: []\n", "expected at least one entry"),
        ("host: []\n", "unknown key 'host', .*hosts.yaml line 1; did you mean 'hosts'"),
        ("hosts:\n  - {name: a, adress: b}\n", "'adress', .* line 2; did you mean 'address'"),
        ("hosts:\n  - {name: a}\n", "'hosts.0.address' is missing, .* line 2"),
        ("hosts:\n  - {name: a, address: -oProxyCommand=x}\n", "'hosts.0.address': .* line 2"),
        ("hosts:\n  - {name: a, address: b, engine: podman}\n", "engine.*'docker' or 'local'"),
        ("hosts:\n  - {name: a, address: b, cores: 0}\n", "cores.*greater than or equal to 1"),
        ("hosts:\n  - {name: a, address: b, cores: two}\n", "expected an integer, not 'two'"),
        (
            "hosts:\n  - {name: a, address: b}\n  - {name: a, address: c}\n",
            "name 'a' is given twice, .* line 3",
        ),
        (
            "hosts:\n  - {name: a, address: b}\n  - {name: c, address: b}\n",
            "address 'b' is given twice, .* line 3",
        ),
        (
            "hosts:\n  - {name: a, address: b}\n  - {name: c, address: d, labels: [a]}\n",
            "label 'a' is the name of a host, .* line 3",
        ),
        ("hosts:\n  - {name: a, address: here, ssh: [-v]}\n", "'ssh' is for hosts that ssh"),
    ],
)
def test_a_wrong_file_is_reported_in_a_line(tmp_path: Path, text: str, line: str) -> None:
    with pytest.raises(SlambedError, match=line) as raised:
        read_hosts(write(tmp_path, text))
    assert raised.value.code == ExitCode.BAD_INPUT and "\n" not in str(raised.value)


def test_what_does_not_go_with_hosts_is_refused(tmp_path: Path) -> None:
    path = str(write(tmp_path, GOOD))
    run = ("run", "quickstart")
    line = refused(ExitCode.BAD_INPUT, *run, "--on", "lab1")
    assert "with --hosts" in line
    assert refused(ExitCode.BAD_INPUT, *run, "--check", "--on", "lab1") == line
    for more in (("--engine", "virtual"), ("--slurm",), ("--scheduler", "tcp://127.0.0.1:1")):
        line = refused(ExitCode.BAD_INPUT, *run, "--hosts", path, *more)
        assert "for live runs" in line
        assert refused(ExitCode.BAD_INPUT, *run, "--check", "--hosts", path, *more) == line
    assert "no such file" in refused(ExitCode.BAD_INPUT, *run, "--hosts", f"{tmp_path}/no.yaml")


@pytest.mark.parametrize("hosts", [1, 2, 3, 5])
def test_repetitions_are_spread_evenly_whatever_their_number(hosts: int) -> None:
    names = [f"host{n}" for n in range(hosts)]
    for count in range(1, 25):
        first = Counter(preference(r, names, seed=7)[0] for r in range(count))
        assert max(first.values()) - min(first[name] for name in names) <= 1
    for repetition in range(25):
        assert sorted(preference(repetition, names, seed=7)) == names
    again = [preference(r, names, seed=7)[0] for r in range(40)]
    assert again == [preference(r, names, seed=7)[0] for r in range(40)]
    if hosts > 1:
        assert again != [preference(r, names, seed=8)[0] for r in range(40)]
        # The first host varies, so that warm-up effects are spread.
        assert len(set(again[::hosts])) > 1


def test_a_board_on_any_host_is_one_key_and_another_than_on_a_measured_one() -> None:
    board = Device(name="pi", title="pi", limits=Limits(), board=Board(cores=4, core_speed=0.2))
    anywhere = run_spec(device_mobile=board, engine="local")
    here = anywhere.model_copy(update={"host_speed": 0.9})
    there = anywhere.model_copy(update={"host_speed": 1.4})
    assert len({spec.run_key for spec in (anywhere, here, there)}) == 3
    assert "host_speed" not in anywhere.meaning()


def test_a_backlog_gives_what_may_begin() -> None:
    specs = [run_spec(seed=n, repetition=n) for n in range(3)]
    backlog, stop = Backlog(specs), threading.Event()
    item = backlog.take(stop, lambda spec: spec.repetition == 1)
    assert item is not None and item.spec is specs[1]
    item = backlog.take(stop)
    assert item is not None and item.spec is specs[0]


class Line:
    """A connection that a test can cut."""

    def __init__(self) -> None:
        self.up = True

    def alive(self) -> bool:
        return self.up

    def last_words(self) -> str:
        return "Connection closed by remote host"

    def close(self) -> None:
        self.up = False


FACTS = Joined(
    worker="tls://127.0.0.1:1",
    software="s",
    netem=False,
    cpu_model="c",
    cpus=[0],
    speed=1.0,
    speed_measured_utc=None,
    tidied="",
    load="",
)


class Hosts(HostExecutor):
    """Real claims with local work; one connection is cut during a run."""

    def __init__(self, names: list[str], cut: int = -1) -> None:
        self.lines = {name: Line() for name in names}
        places = {
            name: Place(Host(name=name, address=name), line, FACTS)  # type: ignore[arg-type]
            for name, line in self.lines.items()
        }
        self.reported: list[str] = []
        super().__init__(places, None, {}, 7, self.back, self.reported.append)
        self.made: list[tuple[str, str, int]] = []
        self.cut = cut
        self.at_once: Counter[str] = Counter()

    def back(self, host: Host) -> Any:
        raise SlambedError("still off")

    def execute(self, spec: RunSpec, raw: Path, stop: threading.Event, attempt: int = 1) -> Summary:
        place = self._claims[spec.run_key]
        name = place.host.name
        with self._guard:
            self.at_once[name] += 1
            assert self.at_once[name] == 1, "two runs on one host"
        stop.wait(0.01)
        with self._guard:
            self.at_once[name] -= 1
            self.made.append((name, spec.run_key, spec.repetition))
            if name == "b" and self.cut == sum(made[0] == "b" for made in self.made):
                self.made.pop()
                self.lines[name].close()
                raise KilledError(self._lose(place))
        summary = Summary(run_key=spec.run_key, cell=spec.cell, valid=True, outcome="completed")
        (raw / "summary.json").write_text(json.dumps(summary))
        (raw / "manifest.json").write_text("{}")
        return summary


def campaign(tmp_path: Path, hosts: Hosts) -> tuple[ResultFolder, Runner]:
    folder = ResultFolder(tmp_path / "results" / "tiny")
    folder.create()
    runner = Runner(folder, Ledger(folder.path / "ledger.jsonl"), hosts, places=hosts)
    return folder, runner


def two_cells(repetitions: int) -> list[RunSpec]:
    return [
        run_spec(cell=cell, params={"n_orb": n}, seed=r, repetition=r)
        for r in range(repetitions)
        for n, cell in ((500, "few"), (1000, "many"))
    ]


def test_every_cell_has_as_many_runs_on_every_host(tmp_path: Path) -> None:
    hosts = Hosts(["a", "b"])
    folder, runner = campaign(tmp_path, hosts)
    todo = two_cells(7)
    assert runner.run(todo, Quiet()).done == 14
    where = {key: name for name, key, _ in hosts.made}
    by_cell = {
        cell: Counter(where[s.run_key] for s in todo if s.cell == cell) for cell in ("few", "many")
    }
    assert by_cell["few"] == by_cell["many"] and sorted(by_cell["few"].values()) == [3, 4]
    started = [e for e in runner.ledger.read() if e["event"] == "run_started"]
    assert {e["run_key"]: e["host"] for e in started} == where
    hosts._over.set()
    folder.close()


def test_a_host_that_dies_costs_its_run_an_attempt_and_the_others_take_its_runs(
    tmp_path: Path,
) -> None:
    hosts = Hosts(["a", "b"], cut=3)
    folder, runner = campaign(tmp_path, hosts)
    todo = two_cells(10)
    verdict = runner.run(todo, Quiet())
    assert verdict.done == 20 and not verdict.given_up
    assert folder.run_keys() == sorted(spec.run_key for spec in todo)
    assert Counter(name for name, *_ in hosts.made) == {"b": 2, "a": 18}
    assert len({key for _, key, _ in hosts.made}) == 20
    failed = [e for e in runner.ledger.read() if e["event"] == "run_failed"]
    assert len(failed) == 1 and failed[0]["host"] == "b"
    assert hosts.reported == [
        "host b is gone (Connection closed by remote host); the others take its runs, and it is "
        "asked again"
    ]
    hosts._over.set()
    folder.close()


def test_a_campaign_ends_when_no_host_comes_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("slambed.campaign.host_executor.NONE_LEFT_S", 0.2)
    hosts = Hosts(["a", "b"])
    for line in hosts.lines.values():
        line.close()
    folder, runner = campaign(tmp_path, hosts)
    line = "hosts a, b are all gone; .*when all are back, with --on NAME those that are"
    with pytest.raises(SlambedError, match=line) as raised:
        runner.run(two_cells(2), Quiet())
    assert raised.value.code == ExitCode.ENVIRONMENT
    hosts._over.set()
    folder.close()


def test_who_waits_takes_hosts_one_at_a_time_in_the_order_of_their_addresses(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two campaigns whose files name them in other orders would wait for each other."""
    joined: list[str] = []
    at_once = threading.Semaphore(1)

    def join(self: JoinedHosts, connection: Any, wait_s: float) -> Joined:
        assert at_once.acquire(blocking=False)
        joined.append(connection._host.name)
        at_once.release()
        if connection._host.name == broken:
            raise SlambedError("no such machine")
        return FACTS

    monkeypatch.setattr(hosts_module, "_own_scheduler", lambda keys: SimpleNamespace())
    monkeypatch.setattr(hosts_module, "leave", lambda client: None)
    monkeypatch.setattr(JoinedHosts, "_join", join)
    monkeypatch.setattr(JoinedHosts, "_one_software", lambda self: "s")
    hosts = [Host(name=name, address=f"me@{name[::-1]}") for name in ("az", "by", "cx")]
    broken = ""
    with JoinedHosts(hosts, lambda line: None, wait=True) as found:
        assert joined == ["cx", "by", "az"] and [*found.places] == ["az", "by", "cx"]
    joined.clear()
    broken = "cx"
    with pytest.raises(SlambedError, match="no such machine"):
        JoinedHosts(hosts, lambda line: None, wait=True)
    assert "az" not in joined


class Never:
    """A task of a worker that is gone."""

    def done(self) -> bool:
        return False

    def cancel(self) -> None: ...


def test_a_host_that_dies_before_the_plan_is_a_line() -> None:
    line = Line()
    line.close()
    joined = object.__new__(JoinedHosts)
    joined.places = {"a": Place(Host(name="a", address="a"), line, FACTS)}  # type: ignore[arg-type]
    joined.software = "s"
    joined._client = SimpleNamespace(submit=lambda *_, **__: Never())
    with pytest.raises(SlambedError, match=r"^host a is gone \(Connection closed by") as raised:
        joined.foreign(None)  # type: ignore[arg-type]
    assert raised.value.code == ExitCode.ENVIRONMENT


def test_what_nobody_can_remove_on_a_host_costs_no_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def execute(spec: RunSpec, raw: Path, *_: Any) -> Summary:
        (raw / "summary.json").write_text("{}")
        return Summary(valid=True, outcome="completed")

    def refuse(*_: Any, **__: Any) -> None:
        raise PermissionError("a container's user owns it")

    facts = SimpleNamespace(name="me", as_json=dict)
    begin(ThisHost(None, None, facts, tmp_path))  # type: ignore[arg-type]
    executor = SimpleNamespace(execute=execute)
    monkeypatch.setattr(host_run, "LiveExecutor", lambda *_, **__: executor)
    monkeypatch.setattr(host_run, "remote_sequence", lambda *_: tmp_path)
    monkeypatch.setattr(host_run, "add_facts", lambda *_: None)
    run = HostRun(run_spec(), tmp_path, 0.5, [], 1, tmp_path, None)
    with monkeypatch.context() as patch:
        patch.setattr("os.rmdir", refuse)
        summary, _ = execute_there(run)
    assert summary.valid


def test_an_unreadable_file_of_a_host_names_the_host(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", "/cache/prepared")

    facts = SimpleNamespace(name="lab1", as_json=dict)
    begin(ThisHost(None, None, facts, tmp_path))  # type: ignore[arg-type]
    monkeypatch.setattr(host_run, "remote_sequence", full)
    run = HostRun(run_spec(), tmp_path, 0.5, [], 1, tmp_path, None)
    for work in (lambda: execute_there(run), lambda: prepare_there(run.spec, tmp_path)):
        with pytest.raises(PassingError, match=r"^host lab1: no space left .*/cache/prepared"):
            work()


def test_tables_name_hosts_where_several_made_the_runs() -> None:
    runs = pd.DataFrame({"host": ["a", "b", "a", None]})
    assert mixes_hosts(runs) and hosts_of(runs) == "-:1, a:2, b:1"
    assert not mixes_hosts(pd.DataFrame({"host": ["a", "a"]}))
    assert not mixes_hosts(pd.DataFrame({"host": [None, None]}))


def test_a_worker_here_says_what_it_is_and_refuses_what_it_cannot_give(tmp_path: Path) -> None:
    host = Host(name="me", address="here", engine="local", cores=1000)
    connection = HostConnection(host, tmp_path)
    assert connection._look().harness == harness_digest()
    keys = Credentials.make()
    assert "BEGIN CERTIFICATE" in keys.certificate and "PRIVATE KEY" in keys.key
    with pytest.raises(SlambedError, match=r"host me: .*(shall give runs 1000|not root)"):
        connection.join("tls://127.0.0.1:1", keys, 0.0, 0.0, False)
    assert not connection.alive()
