# SPDX-License-Identifier: Apache-2.0
"""`slambed diff`: it finds a planted change, and rarely reports chance."""

import io
import json
import re
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from command_line import slambed
from matplotlib.figure import Figure
from numpy.typing import NDArray
from results_factory import RawRun, spec_of, write_experiment
from rich.console import Console

from slambed.errors import SlambedError
from slambed.metrics.changes import paired_shift
from slambed.regression import diff_page
from slambed.regression.diff import Change, diff_json, diff_table, not_compared
from slambed.regression.diff import diff as diff_of
from slambed.regression.diff_page import relative, write_diff_page
from slambed.regression.diff_sides import Sides
from slambed.report.load import Results, load
from slambed.spec.device import VIRTUAL

Floats = NDArray[np.float64]

PAIRS = 100
NAMES = ["track_ms_median", "ate_rmse_m", "coverage", "lost"]


def results(rng: np.random.Generator, slower: float = 1.0, engine: str = VIRTUAL) -> Results:
    """Returns two cells of 100 runs; the effect of a seed is the same in every folder."""
    rows = []
    for cell, base in (("ramp", 20.0), ("none", 12.0)):
        for seed in range(PAIRS):
            own = np.random.default_rng(seed)
            rows.append(
                {
                    "system": "edgeslam",
                    "label": "edgeslam",
                    "dataset": "room",
                    "profile": cell,
                    "engine": engine,
                    "seed": seed,
                    "valid": True,
                    "coverage": 1.0,
                    "track_ms_median": slower
                    * base
                    * own.lognormal(0, 0.2)
                    * rng.lognormal(0, 0.05),
                    "ate_rmse_m": 0.02 * own.lognormal(0, 0.3) * rng.lognormal(0, 0.05),
                    "lost": bool(rng.random() < 0.1),
                }
            )
    return Results(Path("x"), "x", pd.DataFrame(rows))


def diff(a: Results, b: Results, metrics: list[str] | None = None) -> list[Change]:
    return diff_of(Sides.of(a, b), metrics)


def shown(found: list[Change]) -> set[tuple[str, str]]:
    return {(change.metric.key, change.verdict) for change in found if change.shown}


def test_a_slow_down_of_five_percent_is_found_in_pairs() -> None:
    rng = np.random.default_rng(1)
    found = diff(results(rng), results(rng, 1.05), NAMES)
    assert shown(found) == {("track_ms_median", "worse")}
    change = next(c for c in found if c.metric.key == "track_ms_median" and "ramp" in c.cell)
    assert change.paired and change.change.count == PAIRS
    assert 0 < change.change.low < change.change.value < change.change.high
    assert change.change.value == pytest.approx(0.05 * 20, rel=0.5)


def test_equal_folders_differ_by_chance_as_rarely_as_documented() -> None:
    """5 % of 60 comparisons of two folders may show something; 9 are its 99.9 % quantile."""
    rng = np.random.default_rng(2)
    wrong = sum(bool(shown(diff(results(rng), results(rng), NAMES))) for _ in range(60))
    assert wrong <= 9


def test_metrics_in_words_are_left_out() -> None:
    """Experiments with faults name `faults`, such as `kill 8.0-`."""
    rng = np.random.default_rng(7)
    a, b = results(rng), results(rng)
    for side in (a, b):
        side.runs["faults"] = "kill 8.0-"
        side.spec["report"] = {"metrics": ["faults", "coverage"]}
    assert {change.metric.key for change in diff(a, b)} == {"coverage"}


def test_few_runs_against_many_can_show_a_change() -> None:
    """3 of 23 runs can be placed in 1,771 ways, so p can be 0.0011."""
    rng = np.random.default_rng(8)
    many, few = (results(rng, slower, engine="local") for slower in (1.0, 9.0))
    few.runs = few.runs[few.runs["seed"] < 3].reset_index(drop=True)
    for change in diff(many, few, ["track_ms_median"]):
        assert change.possible and change.verdict == "worse"
    few.runs = few.runs[few.runs["seed"] < 2].reset_index(drop=True)
    many.runs = many.runs[many.runs["seed"] < 3].reset_index(drop=True)
    assert {c.verdict for c in diff(many, few, ["track_ms_median"])} == {"too few runs to show any"}


def test_live_runs_are_not_paired_and_need_a_larger_change() -> None:
    rng = np.random.default_rng(3)
    found = diff(results(rng, engine="local"), results(rng, 1.5, engine="local"), NAMES)
    assert not any(change.paired for change in found)
    assert ("track_ms_median", "worse") in shown(found)


def test_folders_of_one_system_each_are_compared_whatever_their_labels() -> None:
    rng = np.random.default_rng(4)
    other = results(rng)
    other.runs["label"] = "mine"
    assert {c.cell for c in diff(results(rng), other, NAMES)} == {"room/ramp", "room/none"}


def test_failed_runs_are_infinitely_bad_and_no_crash() -> None:
    rng = np.random.default_rng(5)
    failing = results(rng)
    failing.runs.loc[failing.runs["seed"] < 60, "track_ms_median"] = np.inf
    found = {c.metric.key: c for c in diff(results(rng), failing, ["track_ms_median"])}
    assert found["track_ms_median"].verdict == "worse"
    (reported,) = {
        c["b"] for c in diff_json(list(found.values()), Sides.of(failing, failing))["changes"]
    }
    assert reported is None  # JSON has no infinity


def test_nothing_in_common_is_reported() -> None:
    rng = np.random.default_rng(6)
    other = results(rng)
    other.runs["dataset"] = "office"
    with pytest.raises(SlambedError, match="share no combination"):
        diff(results(rng), other)


def test_the_command_compares_two_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # In 80 columns the headings have two lines.
    monkeypatch.setenv("COLUMNS", "160")
    folders = []
    for name, track_ms in (("before", 40.0), ("after", 80.0)):
        runs = [
            (
                spec_of("edgeslam", "static", "ramp_85", n, engine=VIRTUAL),
                RawRun(duration_s=4.0, track_ms=track_ms, seed=n),
            )
            for n in range(8)
        ]
        folders.append(str(write_experiment(tmp_path / name, runs)))
    table = tmp_path / "diff.csv"
    metric = ("--metric", "track_ms_median")
    code, out, err = slambed("diff", *folders, *metric, "-o", str(table))
    assert (code, err) == (1, "") and "1 of 1 comparisons show a change" in out
    rows = pd.read_csv(table)
    assert list(rows["verdict"]) == ["worse"] and list(rows["runs"]) == ["8 pairs"]
    # A and B are described by their folders, which differ, then by what both share.
    assert "A: before" in out and "B: after" in out
    assert "Both: system edgeslam:static; device half_core" in " ".join(out.split())
    for side, folder in zip("AB", folders, strict=True):
        assert rows[f"{side} is"][0].startswith(f"folder {folder}; system edgeslam:static; device")
        assert "engine virtual; commit 0123456" in rows[f"{side} is"][0]
    table = table.with_suffix(".md")
    assert slambed("diff", *folders, *metric, "-o", str(table))[0] == 1
    lines = table.read_text().splitlines()
    assert lines[0] == f"A: folder {folders[0]}" and lines[2] == f"B: folder {folders[1]}"
    assert lines[6].startswith("| cell | metric | A: before | B: after |")
    code, out, err = slambed("diff", *folders, *metric, "--json", "-o", str(table))
    assert code == 1 and err == f"table: {table}\n"
    (change,) = (found := json.loads(out))["changes"]
    assert (found["a"], found["b"], found["shown"]) == (*folders, 1)
    assert [found["sides"][side]["name"] for side in "ab"] == ["before", "after"]
    assert found["sides"]["b"]["system"] == ["edgeslam:static"] and found["differing"] == ["folder"]
    assert (change["metric"], change["unit"], change["verdict"]) == (*metric[1:], "ms", "worse")
    assert change["a"] < change["b"] and change["low"] <= change["change"] <= change["high"]
    assert change["runs"] == 8 and change["paired"] and change["p_value"] < 0.05
    code, out, _ = slambed("diff", folders[0], folders[0], *metric)
    assert code == 0 and "0 of 1 comparisons" in out
    assert "8 of 8 runs of A are the same in B, in every value" in out
    page = tmp_path / "diff.html"
    assert slambed("diff", *folders, *metric, "--html", str(page))[0] == 1
    assert_self_contained(text := page.read_text())
    assert '<td class="word bad">worse</td>' in text and text.count("data:image/svg+xml") == 1
    assert "An invented experiment: before against after: what differs" in text
    assert "<th>A: before</th><th>B: after</th>" in text
    code, _, err = slambed("diff", *folders, "--html", str(tmp_path / "no" / "where.html"))
    assert code == 2 and "choose another --html" in err and err.count("\n") == 1


def assert_self_contained(page: str) -> None:
    loaded = re.findall(r'(?:src|href)="([^"#]*)', page)
    assert all(address.startswith("data:") for address in loaded), loaded
    # The page has only its own script, and the points for it.
    opened = re.findall(r"<script[^>]*>", page)
    assert opened in ([], ['<script type="application/json" class="points">', "<script>"]), opened


def test_the_page_says_what_the_table_does(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    a, b = results(rng), results(rng, 1.05)
    for side in (a, b):
        side.runs["started_utc"], side.runs["run_key"] = None, side.runs.index.astype(str)
    a.facts["commit"], b.facts["commit"] = Counter({"1" * 40: 9}), Counter({"2" * 40: 9})
    a.runs["ate_rmse_m"] = 0.0  # no scale: in the table, not in the figure
    found = diff(a, b, NAMES)
    path = tmp_path / "page.html"
    write_diff_page(found, Sides.of(a, b), path)
    page = path.read_text()
    assert_self_contained(page)
    table = diff_table(found, Sides.of(a, b))
    assert page.count("<tr>") >= len(table.rows) + 5
    assert f'<b class="bad">{sum(c.verdict == "worse" for c in found)}</b>' in page
    assert "<b>commit</b>" in page and "1" * 40 in page and "<b>engine</b>" not in page
    drawn = [change for change in found if relative(change) is not None]
    assert len(found) - len(drawn) == 2 and "2 more are in the table alone" in page
    for change in found:
        if change.metric.key == "track_ms_median":
            ends = relative(change)
            assert ends is not None and ends[1] < ends[0] < ends[2]
            x, y = (times_by_seed(side, change.cell.split("/")[-1]) for side in (a, b))
            assert ends[0] == pytest.approx(100 * paired_shift(x, y).value / np.median(x))


def times_by_seed(side: Results, link: str) -> Floats:
    runs = side.runs[side.runs["profile"] == link].sort_values("seed")
    return runs["track_ms_median"].to_numpy(np.float64)


def test_the_figure_names_its_sides_and_keeps_inside(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(1)
    a, b = results(rng), results(rng, 1.05)
    b = replace(b, folder=Path("a_long_name_of_results_of_another_commit/x"))
    figures: list[Figure] = []
    monkeypatch.setattr(diff_page, "_uri", lambda made: str(figures.append(made)))
    sides = Sides.of(a, b)
    diff_page._forest(diff(a, b, NAMES), "\n".join(sides.headings()))
    (made,) = figures
    assert made.get_suptitle() == "A: x\nB: a_long_nam...r_commit/x"
    texts = [made._suptitle, made.axes[0].xaxis.label]  # type: ignore[attr-defined]
    for box in (text.get_window_extent() for text in texts):
        assert box.x0 >= 0 and box.x1 <= made.bbox.x1 and box.y1 <= made.bbox.y1


def test_a_page_of_equal_folders_claims_no_equality(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    a = results(rng)
    a.runs["started_utc"] = None
    write_diff_page(diff(a, a, NAMES), Sides.of(a, a), tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text()
    assert "no proof that there is none" in page and "What differs is in bold" not in page


@pytest.fixture(scope="module")
def one_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Returns two systems with two values of n_orb each, over two links; the labels are those that
    a grid makes by default."""
    runs = []
    for variant, slow in (("static", 40.0), ("conventional", 60.0)):
        for n_orb, slower in ((500, 1.0), (1000, 2.0)):
            for profile in ("rtt_0", "rtt_40"):
                label = f"edgeslam:{variant} n_orb {n_orb}"
                where = {"label": label, "cell": f"{label}/room_walk/{profile}",
                         "params": {"n_orb": n_orb}, "engine": VIRTUAL}  # fmt: skip
                runs += [
                    (
                        spec_of("edgeslam", variant, profile, n, **where),
                        RawRun(duration_s=3.0, track_ms=slow * slower, seed=n),
                    )
                    for n in range(3)
                ]
    return write_experiment(tmp_path_factory.mktemp("one"), runs)


METRIC = ("--metric", "track_ms_median")


@pytest.mark.parametrize(
    ("a", "b", "heads", "cells", "ratio"),
    [
        ("variant=static", "variant=conventional", ("static", "conventional"),
         {f"edgeslam:* n_orb {n}/room_walk/{p}" for n in (500, 1000) for p in ("rtt_0", "rtt_40")},
         1.5),
        ("system=edgeslam:static,link=rtt_0", "system=edgeslam:conventional,link=rtt_0",
         ("edgeslam:static", "edgeslam:conventional"),
         {f"edgeslam:* n_orb {n}/room_walk/rtt_0" for n in (500, 1000)}, 1.5),
        ("params.n_orb=500", "params.n_orb=1000", ("n_orb=500", "n_orb=1000"),
         {f"edgeslam:{v} n_orb */room_walk/{p}" for v in ("static", "conventional")
          for p in ("rtt_0", "rtt_40")}, 2.0),
        ("link=rtt_0", "link=rtt_40", ("rtt_0", "rtt_40"),
         {f"edgeslam:{v} n_orb {n}/room_walk" for v in ("static", "conventional")
          for n in (500, 1000)}, 1.0),
        ("edgeslam:static n_orb 500/*/rtt_0", "*conventional n_orb 1000/*/rtt_40",
         ("edgeslam:s... n_orb 500", "edgeslam:c...n_orb 1000"), {"room_walk"}, 3.0),
    ],
)  # fmt: skip
def test_two_parts_of_one_folder_are_compared(
    one_folder: Path, a: str, b: str, heads: tuple[str, str], cells: set[str], ratio: float
) -> None:
    """Cells are matched by everything that is not selected on, their runs by seed."""
    sides = Sides.of(results := load(one_folder), None, [a], [b])
    found = diff_of(sides, ["track_ms_median"])
    assert {change.cell for change in found} == cells
    for change in found:
        assert change.paired and change.change.count == 3
        assert change.b / change.a == pytest.approx(ratio, rel=0.1)
    assert sides.headings() == tuple(f"{x}: {name}" for x, name in zip("AB", heads, strict=True))
    assert len(results.runs) == 24  # the loaded results are unchanged
    code, out, _ = slambed("diff", str(one_folder), "--a", a, "--b", b, *METRIC, "--json")
    content = json.loads(out)
    assert code == 0 and content["sides"]["a"]["selected"] == [a]
    assert content["sides"]["a"]["commit"] == ["0123456789abcdef"]
    assert {change["cell"] for change in content["changes"]} == cells


def test_what_is_left_out_is_told(one_folder: Path) -> None:
    sides = ("--a", "variant=static", "--b", "variant=conventional,link=rtt_40")
    _, out, _ = slambed("diff", str(one_folder), *sides, *METRIC)
    lines = [line for line in out.splitlines() if line.startswith("not compared: ")]
    assert lines == [
        "not compared: edgeslam:static n_orb 500/room_walk/rtt_0: B has no valid run of it",
        "not compared: edgeslam:static n_orb 1000/room_walk/rtt_0: B has no valid run of it",
    ]
    _, out, _ = slambed("diff", str(one_folder), *sides, *METRIC, "--json")
    assert len(json.loads(out)["not_compared"]) == 2
    a = results(np.random.default_rng(7))
    asked = ["track_ms_median", "keyframes"]
    left_out = not_compared(diff(a, a, asked), Sides.of(a, a), asked)
    assert [one.metric for one in left_out] == ["keyframes"] * 2
    assert not_compared(diff(a, a), Sides.of(a, a)) == []


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ([], "as in --a 'variant=conventional' --b 'variant=static'"),
        (["--a", "variant=static"], "say with --a and --b what of it to compare"),
        (["--a", "variant=static", "--b", "variant=dynamic"],
         "--b variant=dynamic is no combination; variant: conventional, static"),
        (["--a", "variant=static", "--b", "link=rtt_0"],
         "both mean edgeslam:static n_orb 500/room_walk/rtt_0, edgeslam:static n_orb 1000/"),
        (["--a", "variant=static", "--b", "systm=edgeslam"],
         "or KEY=VALUE of system, variant, label, dataset, link"),
        (["--truth", "--a", "link=rtt_0", "--b", "link=rtt_40"], "--truth takes whole folders"),
    ],
)  # fmt: skip
def test_what_cannot_be_compared_is_one_line(
    one_folder: Path, words: list[str], expected: str
) -> None:
    code, out, err = slambed("diff", str(one_folder), *words)
    assert (code, out, err.count("\n")) == (2, "", 1) and expected in err


def test_a_narrow_terminal_cuts_no_name(one_folder: Path) -> None:
    sides = Sides.of(load(one_folder), None, ["variant=static"], ["variant=conventional"])
    terminal = Console(width=70, record=True, file=io.StringIO())
    table = diff_table(diff_of(sides, ["track_ms_median"]), sides)
    terminal.print(table.rich())
    out = terminal.export_text()
    assert "\N{HORIZONTAL ELLIPSIS}" not in out and "A:" in out


def test_cells_are_never_pooled() -> None:
    rng = np.random.default_rng(7)
    a, b = results(rng), results(rng)
    a.runs["label"] = np.where(a.runs["seed"] % 2, "x: 5", "x 5")
    b.runs["label"] = "y 5"
    with pytest.raises(
        SlambedError, match="A has two combinations where the other side may have one: x"
    ):
        diff(a, b, NAMES)


def test_several_selections_of_a_side_are_all_meant(one_folder: Path) -> None:
    links = ["variant=static,link=rtt_0", "variant=static,link=rtt_40"]
    sides = Sides.of(load(one_folder), None, links, ["variant=conventional"])
    assert len(diff_of(sides, ["track_ms_median"])) == 4
