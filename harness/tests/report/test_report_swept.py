# SPDX-License-Identifier: Apache-2.0
"""Curves over swept values, and consistent names of a sweep's points."""

import json
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from results_factory import RawRun, spec_of, write_experiment
from test_sweep import experiment_file, runs_of

from slambed.regression.diff import diff
from slambed.regression.diff_sides import Sides
from slambed.report.cells import cells_of, metrics_to_show
from slambed.report.experiment import write_report
from slambed.report.figures.sweep import draw_sweep, sweeps
from slambed.report.figures.swept import MOST_LINES, Swept, _without, draw_swept, swept
from slambed.report.load import Results, load
from slambed.report.style import FigureWriter, lay_out
from slambed.report.tables import cell_tables

RUNS = 5
SLOW = {"static": 1.0, "conventional": 2.0}


def results(
    variants: tuple[str, ...] = ("static", "conventional"),
    n_orb: tuple[Any, ...] = (300, 500, 1000),
    links: tuple[str, ...] = ("none",),
    **more: Any,
) -> Results:
    """Returns a grid: tracking time grows with the features, update time with the latency; seeds
    spread both."""
    rows = []
    for variant in variants:
        for n in n_orb:
            for at, link in enumerate(links):
                label = f"edgeslam:{variant} n_orb {n}"
                rows += [
                    {
                        "system": "edgeslam",
                        "variant": variant,
                        "label": label,
                        "dataset": "room",
                        "profile": link,
                        "cell": f"{label}/room/{link}",
                        "engine": "virtual",
                        "pace": None,
                        "device_mobile": "pi",
                        "device_edge": "desktop",
                        "params.n_orb": n,
                        "params.codec": "binary",
                        "valid": True,
                        "run_key": f"{variant}{n}{link}{seed}",
                        "lost": seed == 0,
                        "seed": seed,
                        "track_ms_median": SLOW.get(variant, 1.0) * float(n) / 100 + seed,
                        "update_delay_ms_median": 100.0 + 40 * at + seed,
                    }
                    | more
                    for seed in range(RUNS)
                ]
    asked = {"report": {"metrics": ["lost", "track_ms_median", "update_delay_ms_median"]}}
    return Results(Path("x"), "x", pd.DataFrame(rows), spec=asked)


@pytest.fixture
def drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Draws figures and yields (figure, name, title, caption, data) of each."""

    def draw(made_of: Results) -> list[tuple[Figure, str, str, str, pd.DataFrame]]:
        writer = FigureWriter(tmp_path, "", [])
        saved: list[Any] = []
        monkeypatch.setattr(writer, "save", lambda *parts: saved.append(parts))
        for found in swept(made_of):
            draw_swept(made_of, found, writer)
        return saved

    yield draw


def names(found: Swept) -> list[tuple[str, str]]:
    return [(line.system, line.point) for line in found.lines]


def test_few_lines_are_one_figure_with_all_metrics(drawn: Any) -> None:
    ((made, name, title, caption, data),) = drawn(results())
    assert (name, title) == ("swept_room_n_orb", "Metrics against n_orb: room")
    assert [axis.get_title() for axis in made.axes] == [
        "Runs with a track loss",
        "Tracking, median",
        "Map update delay with\npacing, median",
    ]
    assert [axis.get_ylabel() for axis in made.axes] == ["[%]", "[ms]", "[ms]"]
    assert {a.get_xlabel() for a in made.axes[1:]} == {"n_orb [features]"}  # the system's own unit
    assert [t.get_text() for t in made.axes[0].get_xticklabels()] == ["300", "500", "1000"]
    (legend,) = made.legends
    assert [t.get_text() for t in legend.get_texts()] == [
        "edgeslam:static",
        "edgeslam:conventional",
    ]
    tracked = data[data["metric"].eq("track_ms_median") & data["line"].eq("edgeslam:conventional")]
    # The seeds add 0 to 4 to 6, 10 and 20 ms, so quartiles are 1 and 3 above.
    assert list(tracked["n_orb"]) == [300, 500, 1000]
    assert list(tracked["middle"]) == [8, 12, 22]
    assert list(tracked["low"]) == [7, 11, 21] and list(tracked["high"]) == [9, 13, 23]
    assert set(data[data["metric"].eq("lost")]["middle"]) == {20.0}
    assert "quartiles" in caption and "left out" not in caption
    light = [line for line in made.axes[1].lines if line.get_label() == "a run"]
    assert [len(line.get_xdata()) for line in light] == [3 * RUNS] * 2
    assert all((line.get_alpha() or 1) < 0.5 for line in light)


def test_values_too_near_each_other_have_ticks_and_no_names(drawn: Any) -> None:
    """In d_f7_norb, the labels 875 and 1000 once overlapped."""
    ((made, *_),) = drawn(results(n_orb=(500, 625, 750, 875, 1000, 1250)))
    for axis in made.axes:
        assert len(axis.get_xticks()) == 6
        names = [t.get_text() for t in axis.get_xticklabels()]
        assert names[0] == "500" and names[-1] == "1250" and "" in names


def test_many_lines_are_small_multiples_of_few_lines_each(drawn: Any) -> None:
    links = ("none", "rtt_40", "rtt_80")
    made_of = results(links=links)
    assert [found.axis.key for found in swept(made_of)] == ["params.n_orb", "link.rtt_ms"]
    saved = drawn(made_of)
    assert [name for _, name, *_ in saved] == [
        f"swept_room_{axis}_{key}"
        for axis in ("n_orb", "RTT")
        for key in ("lost", "track_ms_median", "update_delay_ms_median")
    ]
    for made, name, *_ in saved:
        over_rtt = "_RTT_" in name
        titles = [f"n_orb {n}" for n in (300, 500, 1000)] if over_rtt else list(links)
        assert [axis.get_title() for axis in made.axes] == titles
        assert len({axis.get_ylim() for axis in made.axes}) == 1
        assert [t.get_text() for t in made.legends[0].get_texts()] == [
            "edgeslam:static",
            "edgeslam:conventional",
        ]
        # The link `none` adds 0 ms.
        ticks = [float(t.get_text()) for t in made.axes[0].get_xticklabels()]
        assert ticks == ([0, 40, 80] if over_rtt else [300, 500, 1000])


@pytest.mark.parametrize("variants", [("static", "conventional"), tuple("abcdefgh")])
@pytest.mark.parametrize("links", [("none",), ("none", "rtt_40", "rtt_80")])
def test_nothing_overlaps_or_leaves_the_figure(
    drawn: Any, variants: tuple[str, ...], links: tuple[str, ...]
) -> None:
    figures = drawn(results(variants, (50, 500, 625, 750, 875, 1000, 1250, 2000), links))
    assert figures
    for made, *_ in figures:
        lay_out(made)
        (legend,) = made.legends
        beneath = legend.get_window_extent()
        boxes = [axis.get_tightbbox() for axis in made.axes]
        assert all(not beneath.overlaps(box) for box in boxes)
        assert all(box.x0 >= -1 and box.x1 <= made.bbox.x1 + 1 for box in [*boxes, beneath])
        assert all(not a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])
        for axis in made.axes:
            ticks = [t.get_window_extent() for t in axis.get_xticklabels() if t.get_text()]
            assert all(a.x1 < b.x0 for a, b in pairwise(sorted(ticks, key=lambda t: t.x0)))
            curves = {line.get_label() for line in axis.lines} - {"a run"}
            assert len([x for x in curves if not x.startswith("_")]) <= MOST_LINES


def test_only_numbers_of_three_values_and_more_with_all_else_equal() -> None:
    assert not list(swept(results(n_orb=(300, 500))))
    for words in (["few", "some", "many"], [True, False, True]):
        found = results()
        values = dict(zip((300, 500, 1000), words, strict=True))
        found.runs["params.n_orb"] = found.runs["params.n_orb"].map(values)
        assert not list(swept(found))
    assert not list(swept(results(links=("ramp_85", "rtt_40", "rtt_80"), n_orb=(300,))))
    found = results()
    found.runs["device_mobile"] = found.runs["params.n_orb"].map(lambda n: f"pi_{n}")
    assert not list(swept(found))  # either of the two may be the cause
    found = results()
    found.runs["valid"] = False
    assert not list(swept(found))


def test_a_strategy_that_has_its_own_figure_gets_no_second_one() -> None:
    own = {"reference_rmse_m": 0.1, "link_mbit_s": 1.0}
    assert not list(swept(results(**own)))
    over_links = results(("static",), links=("rtt_0", "rtt_40", "rtt_80"), **own)
    assert [found.axis.key for found in swept(over_links)] == ["link.rtt_ms"]


def test_a_strategy_has_a_figure_for_each_link_and_each_system(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    writer = FigureWriter(tmp_path, "", [])
    saved: list[Any] = []
    monkeypatch.setattr(writer, "save", lambda _, *parts: saved.append(parts))
    own = {"reference_rmse_m": 0.1, "link_mbit_s": 1.0}
    one, two = results(("static",), **own), results(("static",), links=("none", "slow"), **own)
    other = results(("static",), **own, system="other", run_key="x")
    both = replace(one, runs=pd.concat([one.runs, other.runs], ignore_index=True))
    drawn = []
    for made_of in (one, two, both):
        assert all(draw_sweep(sweep, writer) for sweep in sweeps(made_of))
        drawn.append([(name, title.rpartition("n_orb: ")[2]) for name, title, *_ in saved])
        saved.clear()
    name, where = "sweep_room_static_n_orb", "static, room"
    assert drawn == [
        [(name, where)],
        [(f"{name}_{own}", f"{where}, {own}") for own in ("none", "slow")],
        [(f"{name}_{own}", f"{where}, {own}") for own in ("edgeslam", "other")],
    ]


def test_a_strategy_has_a_figure_for_each_engine_and_device(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = {"reference_rmse_m": 0.1, "link_mbit_s": 1.0}
    one = results(("static",), **own)
    live = one.runs.assign(engine="local", pace="realtime", reference_rmse_m=9.0)
    slow = one.runs.assign(device_mobile="half_core")
    found = sweeps(replace(one, runs=pd.concat([one.runs, live, slow], ignore_index=True)))
    assert [sweep.apart for sweep in found] == [
        ("virtual", "pi"), ("local", "realtime", "pi"), ("virtual", "half_core"),
    ]  # fmt: skip
    assert [set(sweep.runs["reference_rmse_m"]) for sweep in found] == [{0.1}, {9.0}, {0.1}]
    writer = FigureWriter(tmp_path, "", [])
    saved: list[Any] = []
    monkeypatch.setattr(writer, "save", lambda _, *parts: saved.append(parts))
    assert all(draw_sweep(sweep, writer) for sweep in found)
    assert len({name for name, *_ in saved}) == 3


def test_only_the_links_of_a_strategys_own_figure_get_no_second_one() -> None:
    own = {"reference_rmse_m": 0.1, "link_mbit_s": 1.0}
    found = results(("static",), links=("none", "slow"), **own)
    other = found.runs[found.runs["profile"].eq("slow")].assign(**{"params.codec": "json"})
    whole = replace(found, runs=pd.concat([found.runs, other], ignore_index=True))
    assert [sweep.profile for sweep in sweeps(whole)] == ["none"]
    (curves,) = swept(whole)
    assert {rows for line in curves.lines for rows in line.runs["profile"]} == {"slow"}
    assert len(curves.lines) == 2


def test_the_caption_of_a_strategys_figure_names_ranges(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    captions: list[str] = []
    writer = FigureWriter(tmp_path, "", [])
    monkeypatch.setattr(writer, "save", lambda *parts: captions.append(parts[3]))
    few = results(("static",), reference_rmse_m=0.1, link_mbit_s=1.0)
    twice = replace(few, runs=pd.concat([few.runs, few.runs], ignore_index=True))
    mixed = pd.concat([few.runs, few.runs[few.runs["params.n_orb"].eq(300)]], ignore_index=True)
    for made_of in (few, twice, replace(few, runs=mixed)):
        (sweep,) = sweeps(made_of)
        assert draw_sweep(sweep, writer)
    assert captions == [
        "Medians of the runs with the range of fewer than 6 runs.",
        "Medians of the runs with 95 % intervals.",
        "Medians of the runs with 95 % intervals, or the range of fewer than 6 runs.",
    ]


def links_of(contents: dict[str, dict[str, Any]]) -> Results:
    made = results(("static",), links=tuple(contents), n_orb=(300,))
    return replace(made, links=contents)


def test_links_are_swept_by_what_they_do_and_not_by_their_names() -> None:
    found = links_of(
        {
            f"r{rtt}_l{percent}": {"name": "x", "rtt_ms": rtt, **loss}
            for rtt in (20, 60, 120)
            for percent, loss in ((0, {}), (1, {"loss": {"random": 0.01}}))
        }
    )
    (over_rtt,) = swept(found)
    assert over_rtt.axis.key == "link.rtt_ms"
    assert [line.point for line in over_rtt.lines] == ["RTT alone", "loss 1 %"]
    assert [sorted(set(line.values)) for line in over_rtt.lines] == [[20, 60, 120]] * 2


def test_packet_loss_is_an_axis() -> None:
    shares = (0.0, 0.01, 0.05)
    losses = [{"loss": {"random": share}} if share else {} for share in shares]
    content = {f"a{n}": {"rtt_ms": 40, **loss} for n, loss in enumerate(losses)}
    (over_loss,) = swept(links_of(content))
    assert over_loss.axis.heading == "share of packets lost in each direction"
    assert [sorted(set(line.values)) for line in over_loss.lines] == [list(shares)]
    assert [line.point for line in over_loss.lines] == [""]
    # Bursts, or a trace, are no number; an outage makes another link.
    bursts = {"loss": {"gilbert_elliott": {"to_bad": 0.1, "to_good": 0.5}}}
    assert not list(swept(links_of({**content, "a2": {"rtt_ms": 40, **bursts}})))
    cut = {"gaps": [{"start_s": 1, "length_s": 1}]}
    assert not list(swept(links_of({**content, "a2": {**content["a2"], **cut}})))


def test_where_half_of_the_runs_failed_the_line_has_a_gap(drawn: Any) -> None:
    found = results(("static",))
    failed = found.runs["params.n_orb"].eq(500) & (found.runs["seed"] < 3)
    found.runs.loc[failed, "track_ms_median"] = np.inf
    ((_, _, _, _, data),) = drawn(found)
    tracked = data[data["metric"].eq("track_ms_median")].set_index("n_orb")
    assert np.isnan(tracked["middle"][500]) and tracked["middle"][300] == 5


@pytest.mark.parametrize(
    ("label", "leaf", "value", "left"),
    [
        ("edgeslam:static n_orb 500", "n_orb", 500.0, "edgeslam:static"),
        ("static n_orb 500, l_ol_ms 30", "n_orb", 500.0, "static, l_ol_ms 30"),
        ("static n_orb 500, l_ol_ms 30", "l_ol_ms", 30, "static n_orb 500"),
        ("W-H W-SZ 30", "l_ol_ms", 30.0, "W-H W-SZ"),
        ("static, 500 features", "n_orb", 500.0, "static features"),
        ("conventional, 2.0 s", "sync_period_s", 2.0, "conventional"),
        ("600: static", "n_orb", 600.0, "static"),
        ("pi4 n_orb 4", "n_orb", 4.0, "pi4"),
        ("few", "n_orb", 500.0, ""),
    ],
)
def test_a_line_is_called_what_its_labels_have_in_common(
    label: str, leaf: str, value: float, left: str
) -> None:
    assert _without(label, leaf, value) == left


def test_points_of_a_grid_have_one_name_in_tables_figures_and_differences(tmp_path: Path) -> None:
    """With default labels of a grid, tables, figures and diff use the same names."""
    systems = [{"system": "edgeslam", "variant": v} for v in SLOW]
    file = experiment_file(
        tmp_path, systems=systems, grid={"params.n_orb": [300, 500, 1000], "link.rtt_ms": [0]}
    )
    planned = runs_of(file)
    runs = [
        (
            spec_of(
                "edgeslam",
                spec.variant,
                spec.profile,
                spec.repetition,
                label=spec.label,
                cell=spec.cell,
                dataset=spec.dataset,
                engine="virtual",
                params={"n_orb": spec.params["n_orb"]},
            ),
            RawRun(duration_s=3.0, track_ms=SLOW[spec.variant] * 20, seed=spec.seed),
        )
        for spec in planned
    ]
    folder = write_experiment(tmp_path / "results", runs)
    found = load(folder)
    labels = {f"edgeslam:{v} n_orb {n}" for v in SLOW for n in (300, 500, 1000)}
    metrics = metrics_to_show(found)
    (table, *_) = cell_tables(cells_of(found, metrics), metrics)
    assert {row[0] for row in table.rows} == labels == {spec.label for spec in planned}
    cells = {change.cell for change in diff(Sides.of(found, found), ["track_ms_median"])}
    assert cells == set(found.cells()) == {spec.cell for spec in planned}
    (curves,) = swept(found)
    assert names(curves) == [(f"edgeslam:{v}", "") for v in sorted(SLOW)]
    assert {f"{line.system} n_orb {v:g}" for line in curves.lines for v in line.values} == labels
    paths = write_report(folder)
    page = paths.html.read_text()
    assert 'id="swept_room_n_orb"' in page and "swept_room_n_orb.csv" in page
    assert "swept_room_n_orb.png" in paths.markdown.read_text()
    points = json.loads((paths.folder / "swept_room_n_orb.points.json").read_text())
    reported = {curve["name"] for axis in points["axes"] for curve in axis["curves"]}
    assert {"edgeslam:static", "edgeslam:conventional", "a run"} <= reported
    bars = json.loads((paths.folder / "box_track_ms_median.points.json").read_text())
    assert {name for _, name in bars["axes"][0]["y"]["names"]} == labels
