# SPDX-License-Identifier: Apache-2.0
"""The page over commits: changes are marked once at the right commit, and it is complete."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from command_line import refused, slambed
from test_gate import TYPICAL, some_runs

from slambed.regression.gate import append_history
from slambed.regression.trend_page import publish
from slambed.regression.trends import read_history, trends_of

NIGHTS, SLOW_FROM, SLOW_UNTIL = 16, 8, 12
CELL = "alone/room/none"
LINK = "https://example.org/commit/"


def commit(night: int) -> str:
    return f"{night:02x}" * 20


@pytest.fixture(scope="module")
def history(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Tracking takes a quarter more time from one commit on, until another one fixes it."""
    path = tmp_path_factory.mktemp("history") / "runs.parquet"
    rng = np.random.default_rng(11)
    for night in range(NIGHTS):
        factor = 1.25 if SLOW_FROM <= night < SLOW_UNTIL else 1.0
        slow = {
            "track_ms_median": lambda _, f=factor: (
                f * TYPICAL["track_ms_median"] * rng.lognormal(0, 0.06)
            )
        }
        runs = some_runs(rng, 6, **slow)
        append_history(path, runs, f"2026-03-{night + 1:02}", factor == 1, commit(night))
    return path


def test_a_step_is_marked_once_and_its_end_too(history: Path) -> None:
    (found,) = trends_of(read_history(history))
    marks = [(s.cell, s.metric.key, s.commit, s.worse) for s in reversed(found.steps)]
    assert marks == [
        (CELL, "track_ms_median", commit(SLOW_FROM), True),
        (CELL, "track_ms_median", commit(SLOW_UNTIL), False),
    ]
    step = found.steps[-1]
    assert step.after / step.before == pytest.approx(1.25, abs=0.08)
    assert all(len(trend.points) == NIGHTS for cell in found.cells.values() for trend in cell)


def test_the_same_virtual_runs_of_many_nights_are_no_more_evidence_than_one() -> None:
    """Six runs against those of 29 nights would show any difference; six pairs do not."""
    faster = [0.88, 0.89, 0.3, 0.4, 0.85, 0.2]
    nights = []
    for night in range(30):
        runs = some_runs(
            np.random.default_rng(1),
            6,
            track_ms_median=lambda i, last=night == 29: (10 + i / 10) * (faster[i] if last else 1),
        )
        runs = runs.assign(engine="virtual", seed=runs["repetition"], metrics_version="9")
        runs["run_key"] += f" {night}"
        nights.append(
            runs.assign(night_utc=f"2026-04-{night + 1:02}", passed=True, commit=commit(night))
        )
    (found,) = trends_of(pd.concat(nights, ignore_index=True))
    assert found.steps == []


def test_quiet_nights_have_no_mark() -> None:
    rng = np.random.default_rng(12)
    nights = [
        some_runs(rng, 6).assign(night_utc=f"2026-04-{n + 1:02}", passed=True, commit=commit(n))
        for n in range(20)
    ]
    (found,) = trends_of(pd.concat(nights))
    assert found.steps == []


def test_the_page_has_every_point_and_leads_to_commits(history: Path, tmp_path: Path) -> None:
    page = publish(read_history(history), tmp_path / "site", LINK)
    html = page.read_text()
    (found,) = trends_of(read_history(history))
    trends = sum(map(len, found.cells.values()))
    assert html.count('<svg class="trend"') == trends
    assert html.count('class="worse"') == html.count('class="better"') == 1
    assert html.count(f'href="{LINK}{commit(SLOW_FROM)}"') == trends + 1
    assert "changes for the worse" in html and "<script" not in html
    assert not re.findall(r'(?:src|href)="(?!#|data:|https://example.org|points.csv)', html)
    assert "the regression gate was closed" in html and "built-in" not in html and " → " in html
    points = pd.read_csv(tmp_path / "site/points.csv")
    assert len(points) == trends * NIGHTS
    assert set(points["change"].dropna()) == {"worse", "better"}
    assert (points["low"] <= points["value"]).all() and (points["value"] <= points["high"]).all()


def test_without_an_address_commits_are_named(history: Path, tmp_path: Path) -> None:
    html = publish(read_history(history), tmp_path / "site").read_text()
    assert f"<code>{commit(SLOW_FROM)[:7]}</code>" in html and "https://" not in html


def test_nights_of_older_versions_have_no_commit(tmp_path: Path) -> None:
    rng = np.random.default_rng(13)
    path = tmp_path / "runs.parquet"
    append_history(path, some_runs(rng, 6), "2026-01-01", True)
    pd.read_parquet(path).drop(columns="commit").to_parquet(path)
    append_history(path, some_runs(rng, 6), "2026-01-02", True, commit(1))
    html = publish(read_history(path), tmp_path / "site", LINK).read_text()
    assert "commit unknown" in html and commit(1)[:7] in html


def test_the_command_publishes_what_the_history_has(history: Path, tmp_path: Path) -> None:
    site = ("--publish", str(tmp_path / "site"))
    code, out, err = slambed("gate", *site, "--history", str(history), "--link-to", LINK)
    assert code == 0 and "site/index.html" in out, err
    assert (tmp_path / "site/index.html").is_file()
    assert "give both" in refused(2, "gate", *site)
    assert "name tonight's experiments" in refused(2, "gate")
    assert "begins one" in refused(2, "gate", *site, "--history", str(tmp_path / "none.parquet"))
    other = tmp_path / "other.parquet"
    other.write_text("x")
    assert "is no history" in refused(2, "gate", *site, "--history", str(other))
