# SPDX-License-Identifier: Apache-2.0
"""The served pages in Chromium: by pointer and keys, and without scripts."""

import json
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from browser import Page
from data_samples import write_prepared
from results_factory import quickstart_like
from test_reports_in_browser import ATE, near, unfold
from waiting import in_background, until

from slambed.campaign.ledger import Ledger
from slambed.data import places
from slambed.report.experiment import write_report
from slambed.serve.server import open_server
from slambed.serve.site import Site

pytestmark = pytest.mark.browser

LOSSY = "0000000000000007"
"""The run that loses track from 6.0 to 7.5 s."""
READY = "document.getElementById('player').dataset.ready === 'yes'"
WIDTHS = (1200, 400)


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eight runs with their report; one has its images on this machine."""
    root = tmp_path_factory.mktemp("pages")
    experiment = quickstart_like(root, repetitions=2)
    shutil.rmtree(root / "raw")
    write_report(experiment, formats=("png", "svg"))
    sequence = write_prepared(places.prepared_folder() / "pages-1", frames=120)
    path = experiment / "runs" / LOSSY / "manifest.json"
    manifest = json.loads(path.read_text()) | {"sequence_checksum": sequence.checksum}
    path.write_text(json.dumps(manifest))
    yield root
    shutil.rmtree(sequence.path)


@pytest.fixture(scope="module")
def address(results: Path) -> Iterator[str]:
    with open_server(Site(results), 0) as server, in_background(lambda: server.serve_forever(0.02)):
        yield f"http://localhost:{server.server_port}"
        server.shutdown()


@pytest.fixture
def run(page: Page, address: str) -> Page:
    page.open(f"{address}/experiments/invented/runs/{LOSSY}/", READY)
    return page


def frame_shown(page: Page) -> int:
    page.until("document.getElementById('picture').complete")
    return int(
        re.findall(r"frames/(\d+)\.jpg", page.value("document.getElementById('picture').src"))[0]
    )


def go_to(page: Page, number: int) -> None:
    page.value(
        f"(() => {{ const s = document.getElementById('cursor'); s.value = {number};"
        " s.dispatchEvent(new Event('input')); })()"
    )


def drawing(page: Page) -> str:
    return str(page.value("document.getElementById('space').toDataURL()"))


def cursor_px(page: Page) -> float:
    return float(page.value("document.querySelector('#lanes .cursor').getAttribute('x1')"))


def tick_times(page: Page) -> list[float]:
    found = page.value("[...document.querySelectorAll('#lanes .time')].map((t) => t.textContent)")
    return [float(text.removesuffix(" s")) for text in found]


def test_from_the_list_to_a_run_by_its_links(page: Page, address: str) -> None:
    page.open(f"{address}/")
    page.value("document.querySelector('main a').click()")
    page.until("location.pathname === '/experiments/invented/'")
    page.until("document.querySelector('#runs a')")
    page.value(f"document.querySelector('#runs a[href*=\"{LOSSY}\"]').click()")
    page.until(f"location.pathname.endsWith('{LOSSY}/') && document.getElementById('player')")
    page.until(READY)
    assert "edgeslam:static" in page.text("h1")


def test_the_slider_moves_picture_path_and_time_line_together(run: Page) -> None:
    data = run.value("fetch('data.json').then((answer) => answer.json())")
    before, at_px = drawing(run), cursor_px(run)
    number = 60
    go_to(run, number)
    expected = data["frames"]["index"][number]
    run.until(f"document.getElementById('picture').src.endsWith('/{expected}.jpg')")
    assert frame_shown(run) == expected
    assert run.value("document.getElementById('picture').naturalWidth") == 64
    t_s = data["frames"]["t_s"][number]
    assert run.text("#now") == f"{t_s:.2f} s, frame {number + 1} of {len(data['frames']['t_s'])}"
    assert run.text("#values").startswith(data["frames"]["state"][number])
    assert "RTT" in run.text("#values") and "CPU mobile" in run.text("#values")
    assert drawing(run) != before and cursor_px(run) > at_px


def test_a_lost_frame_is_reported_as_lost(run: Page) -> None:
    data = run.value("fetch('data.json').then((answer) => answer.json())")
    number = data["frames"]["state"].index("lost")
    go_to(run, number)
    assert run.text("#values").startswith("lost") and "track lost at" in run.text("#values")
    assert run.value("document.getElementById('cursor').getAttribute('aria-valuetext')").endswith(
        "lost"
    )


def test_the_slider_obeys_the_keyboard(run: Page) -> None:
    run.value("document.getElementById('cursor').focus()")
    for _ in range(3):
        run.key("ArrowRight")
    assert run.text("#now").split("frame ")[1].startswith("4 of")
    run.key("Home")
    assert run.text("#now").startswith("0.00 s, frame 1 of")


def test_everything_on_a_run_is_reached_by_tab(run: Page) -> None:
    run.value("document.activeElement.blur()")
    reached = []
    for _ in range(12):
        run.key("Tab")
        reached.append(run.value("document.activeElement.id"))
    # The box of the features is disabled, because nothing is in the cache.
    assert [name for name in reached if name] == ["space", "play", "cursor", "show-map", "lanes"]


def test_play_goes_on_by_itself_and_stops(run: Page) -> None:
    run.value("document.getElementById('play').click()")
    run.until("Number(document.getElementById('cursor').value) >= 3")
    assert run.text("#play") == "Pause"
    run.value("document.getElementById('play').click()")
    at = run.value("document.getElementById('cursor').value")
    time.sleep(0.4)
    assert run.value("document.getElementById('cursor').value") == at
    assert run.text("#play") == "Play"


def test_a_click_on_the_time_line_sets_the_frame(run: Page) -> None:
    box = run.box("#lanes svg")
    x, y = box["x"] + 0.5 * box["width"], box["y"] + 60
    run.mouse("mousePressed", x, y, button="left", buttons=1, clickCount=1)
    run.mouse("mouseReleased", x, y, button="left", clickCount=1)
    shown_s = float(run.text("#now").split(" s")[0])
    assert 5.0 < shown_s < 7.0
    assert cursor_px(run) == pytest.approx(0.5 * box["width"], abs=12)


def test_the_time_line_zooms_by_drag_wheel_and_keys(run: Page) -> None:
    box = run.box("#lanes svg")
    whole = tick_times(run)
    y = box["y"] + 60
    run.drag((box["x"] + 0.4 * box["width"], y), (box["x"] + 0.6 * box["width"], y))
    part = tick_times(run)
    assert 4.0 < part[0] < part[-1] < 8.0
    run.mouse("mouseWheel", box["x"] + 0.5 * box["width"], y, deltaX=0, deltaY=-120)
    until(lambda: tick_times(run) != part, "the zoom")
    nearer = tick_times(run)
    assert nearer[-1] - nearer[0] < part[-1] - part[0]
    run.value("document.getElementById('lanes').focus()")
    run.key("ArrowRight")
    assert tick_times(run)[-1] > nearer[-1]
    run.key("0")
    assert tick_times(run) == whole


def test_the_path_turns_by_keys_and_pointer(run: Page) -> None:
    views = [drawing(run)]
    run.value("document.getElementById('space').focus()")
    for key in ("ArrowLeft", "ArrowUp", "+"):
        run.key(key)
        views.append(drawing(run))
    box = run.box("#space")
    middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    run.drag(middle, (middle[0] + 60, middle[1] + 20))
    views.append(drawing(run))
    assert len(set(views)) == 5


def test_filters_work_without_a_button_and_go_back(page: Page, address: str) -> None:
    page.open(f"{address}/experiments/invented/", "document.documentElement.matches('.scripted')")
    rows = "document.querySelectorAll('#runs tbody tr').length"
    assert page.value(rows) == 8
    page.value("document.querySelector('#filter-system').focus()")
    page.value(
        "(() => { const s = document.querySelector('#filter-system'); s.value = 'orbslam2';"
        " s.dispatchEvent(new Event('change', {bubbles: true})); })()"
    )
    page.until(f"{rows} === 4")
    assert page.value("location.search") == "?system=orbslam2"
    assert page.value("document.querySelector('#filter-system').value") == "orbslam2"
    assert page.value("document.activeElement.id") == "filter-system"
    page.value("history.back()")
    page.until(f"{rows} === 8")


def test_a_page_follows_a_campaign(page: Page, address: str, results: Path) -> None:
    page.open(f"{address}/experiments/invented/")
    ledger = Ledger(results / "invented" / "ledger.jsonl")
    ledger.append("campaign_started", runs=8, todo=["a", "b"])
    page.until("document.querySelector('main').textContent.includes('running: 0 of 2 runs')")
    ledger.append("campaign_ended", interrupted=False)
    page.until("document.querySelector('main').textContent.includes('Campaign ended')")
    # The page still works after a refresh.
    page.value("document.querySelector('#figures figure').scrollIntoView()")
    page.until("document.querySelector('#figures .frame')")


def choose_system(page: Page, name: str) -> None:
    page.value(
        f"(() => {{ const s = document.querySelector('#filter-system'); s.value = '{name}';"
        " s.dispatchEvent(new Event('change', {bubbles: true})); })()"
    )


def test_a_slow_answer_does_not_replace_a_later_one(page: Page, address: str) -> None:
    # Else the page of an earlier test, at the same address, could be taken for the new one.
    page.open("about:blank")
    page.open(f"{address}/experiments/invented/", "document.documentElement.matches('.scripted')")
    page.value(
        "(() => { const real = fetch; window.late = 0; window.fetch = async (at, how) => {"
        " const answer = await real(at, how);"
        " if (!String(at).includes('orbslam2')) return answer;"
        " await new Promise((go) => { window.release = go; });"
        " setTimeout(() => { window.late += 1; }, 200); return answer; }; })()"
    )
    choose_system(page, "orbslam2")
    page.until("window.release")
    choose_system(page, "")
    page.until("location.search === ''")
    page.until("document.querySelectorAll('#runs tbody tr').length === 8")
    page.value("window.release()")
    page.until("window.late === 1")
    assert page.value("document.querySelectorAll('#runs tbody tr').length") == 8


def test_a_refusal_is_not_taken_for_the_end_of_the_server(page: Page, address: str) -> None:
    page.open(f"{address}/")
    page.value(
        "(() => { window.real = fetch; window.fetch = async () =>"
        " new Response('<p>no JSON', { status: 500 }); })()"
    )
    follows = "document.getElementById('follows').textContent"
    page.until(follows)
    assert page.value(follows) == (
        "slambed serve answers with status 500; this is what it last showed."
    )
    page.value("(() => { window.fetch = window.real; })()")
    page.until(f"{follows} === ''")


def test_ctrl_c_ends_the_server_and_its_pages_say_so(page: Page, results: Path) -> None:
    command = [sys.executable, "-c", "from slambed.commands.main import main; main()"]
    serve = [*command, "serve", "--port", "0", "--results", str(results)]
    with subprocess.Popen(
        serve,
        stdout=subprocess.PIPE,
        text=True,
        # Restores Ctrl-C, which is ignored if these tests run in the background.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as server:
        try:
            assert server.stdout is not None
            (address,) = re.findall(r"http://localhost:\d+/", server.stdout.readline())
            page.open(address)
            server.send_signal(signal.SIGINT)
            assert server.wait(30) == 0
        finally:
            server.kill()
    page.until("document.getElementById('follows').textContent.includes('has ended')")
    page.problems.clear()  # the refused connection


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize(
    "path", ["/", "/experiments/invented/", f"/experiments/invented/runs/{LOSSY}/"]
)
def test_no_page_is_wider_than_the_screen(page: Page, address: str, path: str, width: int) -> None:
    page.size(width)
    page.open(f"{address}{path}", READY if "runs" in path else "document.readyState === 'complete'")
    assert page.value("document.documentElement.scrollWidth") <= width


def test_dark_where_the_browser_wishes(page: Page, address: str) -> None:
    page.open(f"{address}/")
    light = page.value("getComputedStyle(document.body).backgroundColor")
    page.prefers("dark")
    dark = page.value("getComputedStyle(document.body).backgroundColor")
    assert (light, dark) == ("rgb(255, 255, 255)", "rgb(22, 24, 27)")


def test_without_scripts_a_run_has_story_and_time_line(page: Page, address: str) -> None:
    page.scripts(False)
    page.open(f"{address}/experiments/invented/runs/{LOSSY}/")
    assert page.box("#still svg")["height"] > 50
    assert page.box("#player")["height"] == 0
    assert "track lost at" in page.text("#story")


def test_a_served_report_runs_its_script(page: Page, address: str) -> None:
    page.open(f"{address}/experiments/invented/report/index.html")
    unfold(page)
    near(page, ATE)


def test_a_mark_of_a_served_report_leads_to_its_moment_in_the_run(page: Page, address: str) -> None:
    page.open(f"{address}/experiments/invented/report/index.html")
    mark = "document.querySelector('svg.overview a[data-t]:nth-of-type(3)')"
    key, at_s = page.value(
        f"[{mark}.getAttribute('href').match(/runs\\/(\\w+)\\//)[1], {mark}.dataset.t]"
    )
    page.open(f"{address}/experiments/invented/runs/{key}/#t={at_s}", READY)
    now_s = float(page.text("#now").split(" s")[0])
    assert float(at_s) > 0.5 and abs(now_s - float(at_s)) < 0.3


def test_another_moment_in_the_address_moves_a_page_that_is_open(run: Page) -> None:
    run.value("document.getElementById('play').click()")
    run.value("(() => { location.hash = '#t=6.5'; })()")
    run.until("document.getElementById('now').textContent.startsWith('6.')")
    assert abs(float(run.text("#now").split(" s")[0]) - 6.5) < 0.2
    assert run.text("#play") == "Play"
    run.value("(() => { location.hash = '#content'; })()")
    time.sleep(0.2)
    assert run.text("#now").startswith("6.")


def test_a_run_whose_frames_are_cut_says_so(page: Page, address: str, run: Page) -> None:
    assert run.value("document.getElementById('cut').hidden")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("slambed.serve.run_view.MOST_FRAMES", 20)
        key = "0000000000000003"  # not opened by another test
        page.open(f"{address}/experiments/invented/runs/{key}/", READY)
    assert page.text("#cut") == (
        "The slider ends with frame 20; the 100 frames after it are left out."
    )
    assert not page.value("document.getElementById('cut').hidden")


def test_the_picture_of_an_experiment_leads_to_a_moment_and_stays_alive_when_filtered(
    page: Page, address: str
) -> None:
    page.open(f"{address}/experiments/invented/")
    page.until("document.querySelector('.lanesframe svg.overview')")
    names = "document.querySelectorAll('svg.overview > a').length"
    assert page.value(names) == 4
    page.value("document.getElementById('filter-link').focus()")
    page.value(
        "(() => { const s = document.getElementById('filter-link'); s.value = 'ramp_85';"
        " s.dispatchEvent(new Event('change', { bubbles: true })); })()"
    )
    page.until(f"{names} === 2")
    page.until("document.querySelector('.lanesframe svg.overview')")
    mark = "document.querySelector('svg.overview a[data-t]:nth-of-type(3)')"
    href, at_s = page.value(f"[{mark}.getAttribute('href'), {mark}.dataset.t]")
    page.open(f"{address}/experiments/invented/{href}", READY)
    assert abs(float(page.text("#now").split(" s")[0]) - float(at_s)) < 0.3
