# SPDX-License-Identifier: Apache-2.0
"""Single-file pages: a report and a diff, opened from disk in Chromium."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from browser import Page
from results_factory import losing, quickstart_like
from test_diff import NAMES
from test_diff import results as differing

from slambed.regression.diff import diff
from slambed.regression.diff_page import write_diff_page
from slambed.regression.diff_sides import Sides
from slambed.report.experiment import write_report

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of eight runs."""
    root = tmp_path_factory.mktemp("reports")
    write_report(quickstart_like(root, repetitions=2), formats=("png", "svg"))
    return root / "invented" / "report"


@pytest.fixture
def report(page: Page, folder: Path) -> Page:
    page.open((folder / "index.html").as_uri())
    unfold(page)
    return page


def unfold(page: Page) -> None:
    """Opens all folded parts of a report."""
    page.value("document.querySelectorAll('details').forEach((d) => { d.open = true; })")


ATE = "#box_ate_rmse_m"


def near(page: Page, figure: str) -> dict[str, float]:
    """Returns the frame of a figure after the pointer came near."""
    page.value(f"document.querySelector('{figure}').scrollIntoView({{block: 'center'}})")
    page.until(f"document.querySelector('{figure} .frame')")
    page.until(f"document.querySelector('{figure} img').complete")
    return page.box(f"{figure} .frame")


def test_a_value_appears_under_the_pointer(report: Page, folder: Path) -> None:
    box = near(report, ATE)
    points = json.loads((folder / f"{ATE[1:]}.points.json").read_text())
    (axes,) = points["axes"]
    data = pd.read_csv(folder / f"{ATE[1:]}.csv")
    # The run with the largest value has no neighbor.
    value = 100 * data["ate_rmse_m"].max()
    curve = next(c for c in axes["curves"] if any(abs(x - value) < 1e-3 for x in c["x"]))
    at = min(range(len(curve["x"])), key=lambda i: abs(curve["x"][i] - value))
    x0, y0, x1, y1 = axes["box"]
    share_x = (curve["x"][at] - axes["x"]["limits"][0]) / (
        axes["x"]["limits"][1] - axes["x"]["limits"][0]
    )
    share_y = (curve["y"][at] - axes["y"]["limits"][0]) / (
        axes["y"]["limits"][1] - axes["y"]["limits"][0]
    )
    report.mouse(
        "mouseMoved",
        box["x"] + box["width"] * (x0 + (x1 - x0) * share_x),
        box["y"] + box["height"] * (y1 - (y1 - y0) * share_y),
    )
    report.until(f"!document.querySelector('{ATE} .tip').hidden")
    tip = report.text(f"{ATE} .tip")
    assert f"ATE RMSE [cm]: {float(f'{value:.4g}'):g}" in tip
    label = data.loc[data["ate_rmse_m"].idxmax(), "cell"].split("/")[0]
    assert label in tip
    report.mouse("mouseMoved", 1, 1)
    report.until(f"document.querySelector('{ATE} .tip').hidden")


def test_a_figure_is_looked_at_closer_and_as_a_whole_again(report: Page) -> None:
    figure = next(
        name
        for name in ("#rtt_room_walk_ramp_85", "#cpu_room_walk_ramp_85")
        if report.value(f"Boolean(document.querySelector('{name}'))")
    )
    box = near(report, figure)
    height = report.value(f"document.querySelector('{figure}').offsetHeight")
    report.drag(
        (box["x"] + 0.3 * box["width"], box["y"] + 0.2 * box["height"]),
        (box["x"] + 0.6 * box["width"], box["y"] + 0.5 * box["height"]),
    )
    close = f"document.querySelector('{figure} .frame.close')"
    report.until(close)
    wide = report.value(f"document.querySelector('{figure} img').getBoundingClientRect().width")
    assert wide == pytest.approx(box["width"] / 0.3, rel=0.05)
    assert report.value(f"document.querySelector('{figure}').offsetHeight") == height
    assert report.value(f"document.querySelectorAll('{figure} .scale').length") > 2
    report.key("0")
    report.until(f"!{close}")
    assert report.value(f"document.querySelectorAll('{figure} .scale').length") == 0


def test_values_are_reached_by_keys(report: Page) -> None:
    near(report, ATE)
    report.value(f"document.querySelector('{ATE} .frame').focus()")
    tips = []
    for key in ("ArrowRight", "ArrowRight", "ArrowDown"):
        report.key(key)
        tips.append(report.text(f"{ATE} .tip"))
    assert len(set(tips)) >= 2 and all("ATE RMSE [cm]" in tip for tip in tips)
    report.key("+")
    report.until(f"document.querySelector('{ATE} .frame.close')")
    report.key("Escape")
    report.until(f"document.querySelector('{ATE} .tip').hidden")


def test_a_page_scrolls_past_a_figure_that_nobody_clicked(report: Page) -> None:
    box = near(report, ATE)
    report.value("document.activeElement.blur()")
    before = report.value("scrollY")
    report.mouse("mouseWheel", box["x"] + 50, box["y"] + 50, deltaX=0, deltaY=200)
    report.until(f"scrollY > {before}")
    assert not report.value(f"Boolean(document.querySelector('{ATE} .frame.close'))")


def test_a_report_prints_and_reads_without_its_script_as_with_it(
    report: Page, folder: Path
) -> None:
    near(report, ATE)
    report.drag(
        *[
            (p["x"] + s * p["width"], p["y"] + s * p["height"])
            for p in [report.box(f"{ATE} .frame")]
            for s in (0.3, 0.6)
        ]
    )
    with_script = report.pdf()
    report.scripts(False)
    report.open((folder / "index.html").as_uri())
    assert report.value("document.querySelectorAll('.frame, .lanesframe').length") == 0
    assert report.value("[...document.images].every((i) => i.naturalWidth > 0)")
    assert report.box("p.scripted")["height"] == 0
    without = report.pdf()
    pages = [len(re.findall(rb"/Type\s*/Page\b", pdf)) for pdf in (with_script, without)]
    assert pages[0] == pages[1] > 1
    assert abs(len(with_script) - len(without)) < 0.02 * len(without)


PRINTED_PX = 720
"""Width of a sheet's text at the resolution of CSS."""
FILLED = """(() => {
  const place = document.querySelector('.figures').getBoundingClientRect();
  const heights = [...document.querySelectorAll('.figures > figure')].map((figure) => {
    const top = figure.getBoundingClientRect().top;
    return figure.querySelector('figcaption').getBoundingClientRect().bottom - top;
  });
  return heights.reduce((sum, height) => sum + height, 0) / (2 * place.height);
})()"""


def test_figures_of_a_printed_report_leave_no_large_gaps(report: Page) -> None:
    report.size(PRINTED_PX)
    report.ask("Emulation.setEmulatedMedia", media="print")
    filled = report.value(FILLED)
    report.ask("Emulation.setEmulatedMedia", media="")
    assert filled > 0.85


@pytest.fixture
def folded(page: Page, lossy: Path) -> Page:
    """A report as it opens, of runs that lose track."""
    page.open(lossy.as_uri())
    return page


@pytest.fixture(scope="module")
def lossy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of three runs, two of which lose track at 6 s."""
    runs = losing(tmp_path_factory.mktemp("lossy"))
    return write_report(runs, figures=False).html


CROSS = "svg.overview a:has(svg.at)"


@pytest.mark.parametrize("width", [1280, 400])
def test_the_first_screen_is_the_picture(folded: Page, lossy: Path, width: int) -> None:
    folded.size(width, 900)
    folded.open(lossy.as_uri())
    top, bottom = folded.value(
        "(({top, bottom}) => [top, bottom])"
        "(document.querySelector('svg.overview').getBoundingClientRect())"
    )
    assert 0 < top < bottom < 900
    assert folded.value("document.documentElement.scrollWidth") <= width
    unfold(folded)
    long_name = "edgeslam:conventional/synthetic_fr3_path/rtt_20_loss_1_percent_of_all"
    folded.value(f"document.body.insertAdjacentHTML('beforeend', '<p><b>{long_name}</b></p>')")
    assert folded.value("document.documentElement.scrollWidth") <= width
    # Nothing of the picture is cut off at its right end.
    assert folded.value(
        "[...document.querySelectorAll('svg.overview > text, svg.overview > a text')].every("
        "(t) => t.getBoundingClientRect().right <= innerWidth)"
    )


@pytest.mark.parametrize("scripts", [True, False])
def test_a_click_on_a_loss_leads_to_the_time_line_of_its_run(
    page: Page, lossy: Path, scripts: bool
) -> None:
    page.scripts(scripts)
    page.open(lossy.as_uri())
    target = page.value(f"document.querySelector('{CROSS}').getAttribute('href')")
    assert page.value(f"document.querySelector('{target} svg').checkVisibility()") is False
    box = page.box(f"{CROSS} rect")
    at = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse("mousePressed", *at, button="left", clickCount=1)
    page.mouse("mouseReleased", *at, button="left", clickCount=1)
    page.until(f"location.hash === '{target}'")
    page.until(f"document.querySelector('{target} svg').checkVisibility()")
    page.until(
        f"(({{top}}) => top >= 0 && top < innerHeight)"
        f"(document.querySelector('{target}').getBoundingClientRect())"
    )


def test_the_picture_tells_its_values_and_is_looked_at_closer(folded: Page) -> None:
    frame = "document.querySelector('.lanesframe')"
    box = folded.box(".lanesframe")
    folded.mouse("mouseMoved", box["x"] + box["width"] / 2, box["y"] + 20)
    folded.until(f"!{frame}.querySelector('.tip').hidden")
    tip = folded.text(".lanesframe .tip")
    # The round-trip time that was asked of the link is largest in the middle of 12 s.
    assert "6." in tip.split(" s")[0] or "5.9" in tip
    asked = re.search(r"RTT of ramp_85, asked: ([\d.]+) ms", tip)
    assert asked is not None and float(asked[1]) > 70
    assert "tracking: " in tip
    folded.value(f"{frame}.focus()")
    window = f"Number({frame}.querySelector('.window').getAttribute('width').slice(0, -1))"
    assert folded.value(window) == pytest.approx(100)
    folded.key("+")
    assert folded.value(window) == pytest.approx(150)
    folded.key("0")
    assert folded.value(window) == pytest.approx(100)
    folded.drag(
        (box["x"] + 0.25 * box["width"], box["y"] + 20),
        (box["x"] + 0.5 * box["width"], box["y"] + 20),
    )
    assert folded.value(window) == pytest.approx(400, rel=0.05)
    assert folded.value("location.hash") == ""


def test_a_difference_reports_its_values_as_a_report_does(page: Page, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    a, b = differing(rng), differing(rng, 1.05)
    for side in (a, b):
        side.runs["started_utc"], side.runs["run_key"] = None, side.runs.index.astype(str)
    write_diff_page(diff(sides := Sides.of(a, b), NAMES), sides, tmp_path / "diff.html")
    page.open((tmp_path / "diff.html").as_uri())
    near(page, "#forest")
    page.value("document.querySelector('#forest .frame').focus()")
    tips = []
    for key in ("ArrowRight", "ArrowDown"):
        page.key(key)
        tips.append(page.text("#forest .tip"))
    assert "95 % interval" in tips[0] and "worse" in tips[1]
    assert all("room/" in tip and "B - A in % of A" in tip for tip in tips)
    width = "document.querySelector('#forest img').getBoundingClientRect().width"
    whole = page.value(width)
    page.key("+")
    page.until(f"{width} > 1.4 * {whole}")
    page.scripts(False)
    page.open((tmp_path / "diff.html").as_uri())
    assert page.value("document.querySelectorAll('.frame').length") == 0
    assert page.value("document.images[0].naturalWidth > 0")
