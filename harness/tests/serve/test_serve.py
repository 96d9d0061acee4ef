# SPDX-License-Identifier: Apache-2.0
"""The pages of `slambed serve` over HTTP agree with the results."""

import http.client
import json
import re
import shutil
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pandas as pd
import pytest
from command_line import refused
from data_samples import write_prepared
from results_factory import quickstart_like
from waiting import in_background

from slambed.campaign.ledger import Ledger
from slambed.data.trajectory import read_tum
from slambed.errors import ExitCode
from slambed.metrics.accuracy import absolute_error
from slambed.report.experiment import write_report
from slambed.serve.experiments import ExperimentEntry
from slambed.serve.server import Server, open_server
from slambed.serve.site import Site

EXPERIMENT = "/experiments/invented/"
LOSSY = "0000000000000007"
"""The run of the second repetition that loses track from 6.0 to 7.5 s."""


class Client:
    """A client of one server."""

    def __init__(self, server: Server) -> None:
        self.port = server.server_port

    def ask(
        self, path: str, method: str = "GET", body: bytes | None = None, **headers: str
    ) -> tuple[int, dict[str, str], bytes]:
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        named = {"Host": f"localhost:{self.port}"}
        named |= {name.replace("_", "-"): value for name, value in headers.items()}
        connection.request(method, path, body, named)
        answer = connection.getresponse()
        content = answer.read()
        connection.close()
        return answer.status, {k.lower(): v for k, v in answer.getheaders()}, content

    def page(self, path: str) -> str:
        status, headers, body = self.ask(path)
        assert status == 200, (path, status, body)
        assert headers["content-type"].startswith("text/html")
        return body.decode()

    def json(self, path: str) -> Any:
        status, _, body = self.ask(path)
        assert status == 200, (path, body)
        return json.loads(body)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve runs of two systems over two links, with the report."""
    root = tmp_path_factory.mktemp("serve")
    experiment = quickstart_like(root)
    shutil.rmtree(root / "raw")
    summary = json.loads((experiment / "runs" / LOSSY / "summary.json").read_text())
    summary |= {"valid": False, "invalid_reason": "the host was <busy>"}
    (experiment / "runs" / LOSSY / "summary.json").write_text(json.dumps(summary))
    write_report(experiment, formats=("png", "svg"))
    return root


@pytest.fixture
def results(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "results"))


@pytest.fixture
def client(results: Path) -> Iterator[Client]:
    with open_server(Site(results), 0) as server, in_background(lambda: server.serve_forever(0.02)):
        yield Client(server)
        server.shutdown()


def text_of(page: str) -> str:
    return " ".join(re.sub(r"<[^>]*>", " ", page).split())


def test_it_listens_on_this_machine_alone(results: Path) -> None:
    with open_server(Site(results), 0) as server:
        assert server.server_address[0] == "127.0.0.1"


def test_every_experiment_is_listed(client: Client, results: Path) -> None:
    (results / "broken").mkdir()
    (results / "broken" / "experiment.json").write_text("{no json")
    (results / "papers").mkdir()
    (results / ".hidden").mkdir()
    page = client.page("/")
    assert re.findall(r'href="/experiments/([^/]+)/"', page).count("invented") == 1
    assert "An invented experiment" in page and "broken" in page and ".hidden" not in page
    assert "<td>12</td>" in page and ">11</td>" in page.replace(" ", "")


def test_a_page_with_no_results_says_so(client: Client, results: Path) -> None:
    shutil.rmtree(results / "invented")
    assert "There are no results yet" in client.page("/")
    assert client.ask(EXPERIMENT)[0] == 404


def test_cells_and_runs_are_what_the_experiment_has(client: Client, results: Path) -> None:
    page = client.page(EXPERIMENT)
    runs = re.findall(r'<td class="word"><a href="runs/([0-9a-f]{16})/"', page)
    assert sorted(runs) == sorted(p.name for p in (results / "invented" / "runs").iterdir())
    reported = text_of(page)
    assert "12 runs, 11 valid" in reported and "An invented experiment" in reported
    ate = pd.read_csv(results / "invented" / "report" / "tables" / "cells_1.csv")
    for value in ate.iloc[:, 3]:
        assert str(value).split(" ")[0] in reported
    assert "the host was &lt;busy&gt;" in page and "<busy>" not in page


@pytest.mark.parametrize(
    ("query", "expected"),
    [
        ("", 12), ("?system=orbslam2", 6), ("?link=ramp_85", 6), ("?dataset=room_walk", 12),
        ("?valid=no", 1), ("?valid=yes", 11), ("?system=edgeslam:static&link=ramp_85", 3),
        ("?system=edgeslam:static&link=ramp_85&valid=yes", 2), ("?system=orbslam2&valid=no", 0),
        ("?system=", 12), ("?system=unknown", 12), ("?valid=maybe", 12), ("?other=1", 12),
    ],
)  # fmt: skip
def test_filters_leave_the_runs_asked_for(client: Client, query: str, expected: int) -> None:
    page = client.page(EXPERIMENT + query)
    assert len(re.findall(r'<td class="word"><a href="runs/[0-9a-f]{16}/"', page)) == expected
    chosen = re.findall(r"<option[^>]* selected>([^<]*)<", page)
    for value in chosen:
        assert value in query.replace("%20", " ")


def test_a_filter_hides_cells_and_changes_no_number(client: Client) -> None:
    def rows(query: str) -> list[str]:
        table = client.page(EXPERIMENT + query).split("<tbody>")[1].split("</tbody>")[0]
        return [text_of(row) for row in table.split("</tr>") if "<td" in row]

    everything, some = rows(""), rows("?system=edgeslam:static&valid=yes")
    assert len(everything) == 4 and len(some) == 2
    assert set(some) < set(everything)


def test_figures_and_report_are_the_experiments(client: Client, results: Path) -> None:
    page = client.page(EXPERIMENT)
    figures = re.findall(r'src="report/([^"]+)"', page)
    listed = json.loads((results / "invented" / "report" / "figures.json").read_text())
    assert figures == [f"{item['name']}.svg" for item in listed] and figures
    for name in (figures[0], listed[0]["data"], f"{listed[0]['name']}.points.json"):
        status, headers, body = client.ask(f"{EXPERIMENT}report/{name}")
        assert status == 200 and body == (results / "invented" / "report" / name).read_bytes()
        assert "script-src 'none'" in headers["content-security-policy"]
    report = client.page(f"{EXPERIMENT}report/index.html")
    links = [
        f"{EXPERIMENT}report/{href}" for href in re.findall(r'href="(\.\./runs/[^"]+)"', report)
    ]
    assert links and client.ask(links[0].replace("report/../", ""))[0] == 200


def test_a_foreign_name_in_the_list_of_figures_is_left_out(client: Client, results: Path) -> None:
    path = results / "invented" / "report" / "figures.json"
    path.write_text(json.dumps([{"name": "../../x"}, {"name": 7}, 5, {"name": "none_such"}]))
    assert "Figures come with the report" in client.page(EXPERIMENT)


def run_data(client: Client, key: str) -> dict[str, Any]:
    found: dict[str, Any] = client.json(f"{EXPERIMENT}runs/{key}/data.json")
    return found


def test_a_runs_time_line_is_what_its_events_say(client: Client, results: Path) -> None:
    run = run_data(client, LOSSY)
    events = pd.read_parquet(results / "invented" / "runs" / LOSSY / "events.parquet")
    frames = events[events["type"].isin(["frame_tracked", "frame_dropped"])]
    assert len(run["frames"]["t_s"]) == len(frames)
    assert run["frames"]["t_s"] == sorted(run["frames"]["t_s"])
    # In a made-up run, a frame is offered at its sequence time.
    pairs = zip(run["frames"]["t_s"], run["frames"]["seq_s"], strict=True)
    assert all(abs(t - seq) < 2e-3 for t, seq in pairs)
    states = [stretch["state"] for stretch in run["stretches"]]
    assert states == ["ok", "lost", "ok"]
    lost = run["stretches"][1]
    assert lost["begin_s"] == pytest.approx(6.0, abs=0.25)
    assert lost["end_s"] == pytest.approx(7.5, abs=0.25)
    marks = [mark["kind"] for mark in run["marks"]]
    for kind, name in (("track_lost", "loss"), ("keyframe_created", "keyframe")):
        assert marks.count(name) == (events["type"] == kind).sum() > 0
    curves = {(c["lane"], c["name"]): c for c in run["series"]}
    link = pd.read_parquet(results / "invented" / "runs" / LOSSY / "link.parquet")
    probe = link[(link["series"] == "probe_rtt_ms") & (link["t_s"] >= 0)]
    shown = curves["RTT", "measured by the probe"]
    assert max(shown["value"]) == pytest.approx(probe["value"].max(), rel=1e-4)
    assert {lane for lane, _ in curves} == {"tracking", "RTT", "CPU", "throttled"}
    assert {name for lane, name in curves if lane == "CPU"} == {"mobile", "edge"}


def test_frames_beyond_the_most_are_counted(
    client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert run_data(client, "0000000000000001")["frames_left_out"] == 0
    monkeypatch.setattr("slambed.serve.run_view.MOST_FRAMES", 100)
    run = run_data(client, LOSSY)
    assert (len(run["frames"]["t_s"]), run["frames_left_out"]) == (100, 20)
    assert 'id="cut" hidden' in client.page(f"{EXPERIMENT}runs/{LOSSY}/")


def test_the_path_lies_on_the_true_one_as_its_number_says(client: Client, results: Path) -> None:
    path = run_data(client, LOSSY)["path"]
    folder = results / "invented"
    found = absolute_error(
        read_tum(folder / "runs" / LOSSY / "trajectory.txt"),
        read_tum(folder / "groundtruth" / "room_walk.txt"),
        with_scale=False,
    )
    truth = {
        round(t, 3): p
        for t, *p in zip(*(path["truth"][k] for k in ("t_s", "x", "y", "z")), strict=True)
    }
    apart = [
        np.linalg.norm(np.subtract(p, truth[round(t, 3)]))
        for t, *p in zip(*(path["estimate"][k] for k in ("t_s", "x", "y", "z")), strict=True)
        if round(t, 3) in truth
    ]
    assert len(apart) > 80
    assert np.sqrt(np.mean(np.square(apart))) == pytest.approx(found.rmse, rel=0.02)
    # The path has a gap where tracking was lost.
    (gap,) = path["estimate"]["breaks"]
    assert path["estimate"]["t_s"][gap] == pytest.approx(7.5, abs=0.25)


def test_the_page_of_a_run_has_its_story_and_a_still_time_line(client: Client) -> None:
    page = client.page(f"{EXPERIMENT}runs/{LOSSY}/")
    assert "edgeslam:static" in text_of(page) and "invalid: the host was" in text_of(page)
    assert "track lost at" in text_of(page) and '<svg class="timeline"' in page
    assert "No pictures: the sequence is not prepared on this machine" in page
    assert run_data(client, LOSSY)["has_pictures"] is False
    assert client.ask(f"{EXPERIMENT}runs/{LOSSY}/frames/0.jpg")[0] == 404


def test_pictures_are_those_of_the_prepared_sequence(
    client: Client, results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path / "cache"))
    sequence = write_prepared(tmp_path / "cache" / "prepared" / "sample-1")
    path = results / "invented" / "runs" / LOSSY / "manifest.json"
    manifest = json.loads(path.read_text()) | {"sequence_checksum": sequence.checksum}
    path.write_text(json.dumps(manifest))
    assert run_data(client, LOSSY)["has_pictures"] is True
    for frame in (0, len(sequence) - 1):
        status, headers, body = client.ask(f"{EXPERIMENT}runs/{LOSSY}/frames/{frame}.jpg")
        assert (status, headers["content-type"]) == (200, "image/jpeg")
        picture = cv2.imdecode(np.frombuffer(body, np.uint8), cv2.IMREAD_GRAYSCALE)
        # The frames are noise, which JPEG changes, but each differs far more from all others.
        apart = [np.abs(picture.astype(int) - sequence.gray(i)).mean() for i in (0, 1, 3)]
        assert picture.shape == sequence.gray(frame).shape
        assert apart.index(min(apart)) == (0, 1, 3).index(frame) and min(apart) < 6
    for name in (f"{len(sequence)}.jpg", "-1.jpg", "x.jpg", "0.png", "1e3.jpg", "9" * 30 + ".jpg"):
        assert client.ask(f"{EXPERIMENT}runs/{LOSSY}/frames/{name}")[0] == 404, name


def test_a_broken_run_has_a_page_that_says_so(client: Client, results: Path) -> None:
    folder = results / "invented" / "runs" / LOSSY
    (folder / "events.parquet").write_bytes(b"PAR1 not really")
    (folder / "summary.json").write_text("{torn")
    page = client.page(f"{EXPERIMENT}runs/{LOSSY}/")
    assert "This run cannot be shown" in page and "Traceback" not in page
    assert client.ask(f"{EXPERIMENT}runs/{LOSSY}/data.json")[0] == 404
    assert "summary.json is incomplete or not from slambed" in client.page(EXPERIMENT)
    assert "events.parquet: unreadable" in page
    (folder / "events.parquet").unlink()
    assert "its events were not kept" in client.page(f"{EXPERIMENT}runs/{LOSSY}/")
    # The other pages still work.
    assert "What happened" in client.page(f"{EXPERIMENT}runs/0000000000000001/")


def test_whatever_is_no_page_is_not_found(client: Client, results: Path) -> None:
    (results / "invented" / "runs" / "secret.txt").write_text("x")
    (results.parent / "secret.json").write_text("{}")
    (results / "invented" / "runs" / "beef").symlink_to(results.parent)
    for path in (
        "/nothing", "/experiments/none/", "/experiments/invented/none", "/static/none.js",
        "/static/../../pyproject.toml", "/experiments/../secret.json", "/%2e%2e/secret.json",
        "/experiments/invented/%2e%2e/%2e%2e/secret.json", "/experiments/invented/ledger.jsonl",
        "/experiments/invented/report/../experiment.json", "/experiments/invented/.lock",
        f"{EXPERIMENT}runs/beef/", f"{EXPERIMENT}runs/beef/files/secret.json",
        f"{EXPERIMENT}runs/{LOSSY}/files/nodes", f"{EXPERIMENT}runs/{LOSSY}/files/secret.txt",
        f"{EXPERIMENT}runs/ffff/", "/papers/index.html", "//etc/passwd", "/experiments/runs/",
    ):  # fmt: skip
        status, headers, body = client.ask(path)
        assert status == 404, path
        assert b"Traceback" not in body and "content-security-policy" in headers


def test_only_looking_is_answered_and_only_by_our_name(client: Client) -> None:
    for method in ("POST", "PUT", "DELETE", "PATCH", "OPTIONS", "TRACE", "BREW"):
        status, headers, _ = client.ask("/", method, b"x" if method != "TRACE" else None)
        assert (status, headers["allow"]) == (405, "GET, HEAD"), method
    for host in ("evil.example", f"evil.example:{client.port}", f"0.0.0.0:{client.port}"):
        status, _, body = client.ask(EXPERIMENT, Host=host)
        assert status == 421 and b"invented" not in body
    assert client.ask(EXPERIMENT, Host=f"127.0.0.1:{client.port}")[0] == 200


def test_head_is_get_without_content(client: Client) -> None:
    _, get, body = client.ask(EXPERIMENT)
    status, head, nothing = client.ask(EXPERIMENT, "HEAD")
    assert (status, nothing) == (200, b"")
    assert head["content-length"] == get["content-length"] == str(len(body))
    assert head["etag"] == get["etag"]


def test_what_a_browser_has_is_not_sent_again(client: Client) -> None:
    _, headers, _ = client.ask(EXPERIMENT)
    status, again, body = client.ask(EXPERIMENT, If_None_Match=headers["etag"])
    assert (status, body) == (304, b"") and again["cache-control"] == "no-cache"
    assert client.ask(EXPERIMENT, If_None_Match='"other"')[0] == 200


def test_every_answer_has_its_policy(client: Client) -> None:
    for path in ("/", EXPERIMENT, f"{EXPERIMENT}runs/{LOSSY}/", "/static/run.js", "/none"):
        _, headers, _ = client.ask(path)
        assert "default-src 'none'" in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
        assert "access-control-allow-origin" not in headers


def test_our_pages_ask_for_nothing_from_elsewhere(client: Client) -> None:
    for path in ("/", EXPERIMENT, f"{EXPERIMENT}runs/{LOSSY}/"):
        page = client.page(path)
        assert not re.search(r'(?:src|href|action)="(?:https?:)?//', page)
        assert not re.search(r"<script(?![^>]* src=)|<style|\sstyle=|\son\w+=", page)
        for address in re.findall(r'<(?:script|link)[^>]*(?:src|href)="(/[^"]+)"', page):
            assert client.ask(address)[0] == 200, address


def test_a_page_is_called_with_its_slash(client: Client) -> None:
    status, headers, _ = client.ask(EXPERIMENT.rstrip("/"))
    assert (status, headers["location"]) == (301, EXPERIMENT)


def test_pages_follow_a_campaign(client: Client, results: Path) -> None:
    list_before = client.json("/state.json")["version"]
    before = client.json(f"{EXPERIMENT}state.json")["version"]
    assert client.json(f"{EXPERIMENT}state.json")["version"] == before
    ledger = Ledger(results / "invented" / "ledger.jsonl")
    ledger.append("campaign_started", runs=12, todo=["a", "b"])
    ledger.append("run_started", run_key="a", cell="x", repetition=0)
    assert client.json("/state.json")["version"] != list_before
    assert client.json(f"{EXPERIMENT}state.json")["version"] != before
    assert "running: 0 of 2 runs" in client.page("/")
    assert "running: 0 of 2 runs" in client.page(EXPERIMENT)
    ledger.append("campaign_ended", interrupted=True)
    assert "interrupted" in text_of(client.page("/"))


def test_a_killed_campaign_changes_the_version_without_a_file(
    client: Client, results: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    Ledger(results / "invented" / "ledger.jsonl").append("campaign_started", runs=1, todo=["a"])
    before = client.json("/state.json")["version"]
    for module in ("slambed.serve.site", "slambed.campaign.campaign_state"):
        monkeypatch.setattr(f"{module}.is_alive", lambda pid, since_s: False)
    assert client.json("/state.json")["version"] != before


def version_of(page: str) -> str:
    (version,) = re.findall(r'data-version="(\w+)"', page)
    return str(version)


def test_a_page_that_is_behind_its_files_is_renewed_later(
    client: Client, results: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    client.page("/")
    client.page(EXPERIMENT)
    monkeypatch.setattr("slambed.serve.kept.REST", 1e9)  # as if reading had taken very long
    path = results / "invented" / "experiment.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"title": "A new title"}))
    behind, of_experiment = client.page("/"), client.page(EXPERIMENT)
    assert "A new title" not in behind + of_experiment
    monkeypatch.setattr("slambed.serve.kept.REST", 0.0)
    assert client.json("/state.json")["version"] != version_of(behind)
    assert client.json(f"{EXPERIMENT}state.json")["version"] != version_of(of_experiment)
    now = client.page("/")
    assert "A new title" in now
    assert client.json("/state.json")["version"] == version_of(now)


def test_a_page_whose_campaign_alone_is_behind_is_renewed_later(
    client: Client, results: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    client.page(EXPERIMENT)
    ledger = Ledger(results / "invented" / "ledger.jsonl")
    ledger.append("campaign_started", runs=1, todo=["a"])
    ledger.append("campaign_ended", interrupted=True)
    with monkeypatch.context() as slow_list:
        slow_list.setattr(
            "slambed.serve.kept.PageCache._is_rested",
            lambda cache, entry: not isinstance(entry.value, ExperimentEntry),
        )
        behind = client.page(EXPERIMENT)
    assert "interrupted" not in behind
    monkeypatch.setattr("slambed.serve.kept.REST", 0.0)
    assert client.json(f"{EXPERIMENT}state.json")["version"] != version_of(behind)
    assert "interrupted" in client.page(EXPERIMENT)


def test_a_busy_port_and_a_missing_folder_are_reported_in_a_line(
    results: Path, tmp_path: Path
) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        line = refused(ExitCode.ENVIRONMENT, "serve", "--port", port, "--results", str(results))
    assert f"port {port} is in use" in line and "--port" in line
    nowhere = str(tmp_path / "nowhere")
    assert "no such folder" in refused(ExitCode.BAD_INPUT, "serve", "--results", nowhere)
