# SPDX-License-Identifier: Apache-2.0
"""`slambed diff`: a planted change is found, chance is not taken for one."""

import re
from collections import Counter
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from command_line import slambed
from results_factory import RawRun, spec_of, write_experiment

from slambed.errors import SlambedError
from slambed.report.diff import Change, diff, diff_table
from slambed.report.diff_page import relative, write_diff_page
from slambed.report.load import Results
from slambed.spec.device import VIRTUAL

PAIRS = 100
NAMES = ["track_ms_median", "ate_rmse_m", "coverage", "lost"]


def results(rng: np.random.Generator, slower: float = 1.0, engine: str = VIRTUAL) -> Results:
    """Two cells of 100 runs; what a run's seed does to it is the same in every folder."""
    rows = []
    for cell, base in (("ramp", 20.0), ("none", 12.0)):
        for seed in range(PAIRS):
            own = np.random.default_rng(seed)
            rows.append(
                {
                    "system": "edgeslam", "label": "edgeslam", "dataset": "room",
                    "profile": cell, "engine": engine,
                    "seed": seed, "trusted": True, "coverage": 1.0,
                    "track_ms_median": slower * base * own.lognormal(0, 0.2)
                    * rng.lognormal(0, 0.05),
                    "ate_rmse_m": 0.02 * own.lognormal(0, 0.3) * rng.lognormal(0, 0.05),
                    "lost": bool(rng.random() < 0.1),
                }
            )  # fmt: skip
    return Results(Path("x"), "x", pd.DataFrame(rows))


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


def test_equal_folders_differ_by_chance_as_rarely_as_told() -> None:
    """5 % of 60 comparisons of two folders may show something; 9 are its 99.9 % quantile."""
    rng = np.random.default_rng(2)
    wrong = sum(bool(shown(diff(results(rng), results(rng), NAMES))) for _ in range(60))
    assert wrong <= 9


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


def test_nothing_in_common_is_told() -> None:
    rng = np.random.default_rng(6)
    other = results(rng)
    other.runs["dataset"] = "office"
    with pytest.raises(SlambedError, match="share no cell"):
        diff(results(rng), other)


def test_the_command_compares_two_folders(tmp_path: Path) -> None:
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
    code, out, _ = slambed("diff", folders[0], folders[0], *metric)
    assert code == 0 and "0 of 1 comparisons" in out
    page = tmp_path / "diff.html"
    assert slambed("diff", *folders, *metric, "--html", str(page))[0] == 1
    assert_self_contained(text := page.read_text())
    assert '<td class="word bad">worse</td>' in text and text.count("data:image/svg+xml") == 1
    code, _, err = slambed("diff", *folders, "--html", str(tmp_path / "no" / "where.html"))
    assert code == 2 and "choose another --html" in err and err.count("\n") == 1


def assert_self_contained(page: str) -> None:
    loaded = re.findall(r'(?:src|href)="([^"#]*)', page)
    assert all(address.startswith("data:") for address in loaded), loaded
    assert "<script" not in page


def test_the_page_says_what_the_table_does(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    a, b = results(rng), results(rng, 1.05)
    for side in (a, b):
        side.runs["started_utc"], side.runs["run_key"] = None, side.runs.index.astype(str)
    a.facts["commit"], b.facts["commit"] = Counter({"1" * 40: 9}), Counter({"2" * 40: 9})
    a.runs["ate_rmse_m"] = 0.0  # no scale: in the table, not in the figure
    found = diff(a, b, NAMES)
    path = tmp_path / "page.html"
    write_diff_page(found, a, b, path)
    page = path.read_text()
    assert_self_contained(page)
    table = diff_table(found, "x", "x")
    assert page.count("<tr>") >= len(table.rows) + 5
    assert f'<b class="bad">{sum(c.verdict == "worse" for c in found)}</b>' in page
    assert "<b>commit</b>" in page and "1" * 40 in page and "<b>engine</b>" not in page
    drawn = [change for change in found if relative(change) is not None]
    assert len(found) - len(drawn) == 2 and "2 more are in the table alone" in page
    for change in found:
        if change.metric.key == "track_ms_median":
            ends = relative(change)
            assert ends is not None and ends[1] < ends[0] < ends[2]
            assert ends[0] == pytest.approx(5.0, abs=2.0)


def test_a_page_of_equal_folders_claims_no_equality(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    a = results(rng)
    a.runs["started_utc"] = None
    write_diff_page(diff(a, a, NAMES), a, a, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text()
    assert "no proof that there is none" in page and "What differs is in bold" not in page
