# SPDX-License-Identifier: Apache-2.0
"""Figures are drawn only if something that they show has changed."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
from results_factory import quickstart_like

from slambed.report import figure_cache as drawn
from slambed.report.experiment import write_report
from slambed.report.style import ON_PAGES, FigureWriter

ONE = "mobile_cpu_percent_mean"


@pytest.fixture(scope="module")
def reported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = quickstart_like(tmp_path_factory.mktemp("drawn"), 2, 4.0)
    write_report(folder, formats=ON_PAGES)
    return folder


@pytest.fixture
def experiment(reported: Path, tmp_path: Path) -> Path:
    """An unchanged report; the times of its files are preserved."""
    return Path(shutil.copytree(reported, tmp_path / reported.name))


@pytest.fixture
def saved(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Returns the names of the figures that are actually drawn."""
    names: list[str] = []
    save = FigureWriter.save

    def note(writer: FigureWriter, made: object, name: str, *rest: object) -> None:
        names.append(name)
        save(writer, made, name, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(FigureWriter, "save", note)
    return names


def some_run(folder: Path, profile: str) -> Path:
    summaries = sorted((folder / "runs").glob("*/summary.json"))
    return next(p for p in summaries if json.loads(p.read_text())["profile"] == profile).parent


def change(run: Path, **values: object) -> None:
    summary = run / "summary.json"
    summary.write_text(json.dumps(json.loads(summary.read_text()) | values))


def figures(folder: Path) -> dict[str, bytes]:
    listed = json.loads((folder / "report" / "figures.json").read_text())
    names = [name for figure in listed for name in (*figure["files"], figure["data"])]
    return {name: (folder / "report" / name).read_bytes() for name in names}


def test_nothing_is_drawn_again_of_the_same_runs(experiment: Path, saved: list[str]) -> None:
    before = figures(experiment)
    page = (experiment / "report.md").read_text()
    write_report(experiment, formats=ON_PAGES)
    assert saved == [] and len(before) > 30
    assert figures(experiment) == before
    assert (experiment / "report.md").read_text() == page


def test_one_changed_number_is_drawn_where_it_is_shown(experiment: Path, saved: list[str]) -> None:
    change(some_run(experiment, "ramp_85"), **{ONE: 99.0})
    write_report(experiment, formats=ON_PAGES)
    assert f"box_{ONE}" in saved and "box_ate_rmse_m" not in saved
    assert not any(name.endswith("room_walk_none") for name in saved)
    assert 99.0 in pd.read_csv(experiment / "report" / f"box_{ONE}.csv")[ONE].tolist()


def remove_a_run(folder: Path) -> None:
    shutil.rmtree(some_run(folder, "none"))


def add_a_run(folder: Path) -> None:
    one = some_run(folder, "ramp_85")
    shutil.copytree(one, one.with_name("f" * 16))
    change(one.with_name("f" * 16), run_key="f" * 16, ate_rmse_m=0.5, repetition=7)


def another_path(folder: Path) -> None:
    path = some_run(folder, "none") / "trajectory.txt"
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[: len(lines) // 2]))


def fewer_events(folder: Path) -> None:
    run = some_run(folder, "ramp_85") / "events.parquet"
    events = pd.read_parquet(run)
    events[events["type"] != "stage"].to_parquet(run)


def other_names(folder: Path) -> None:
    for summary in (folder / "runs").glob("*/summary.json"):
        system = json.loads(summary.read_text())["system"]
        manifest = json.loads((summary.parent / "manifest.json").read_text())
        manifest["spec"]["label"] = f"my {system}"
        (summary.parent / "manifest.json").write_text(json.dumps(manifest))
        change(summary.parent, cell=f"my {system}/{summary.parent.name[-1]}")


@pytest.mark.parametrize(
    "alter", [remove_a_run, add_a_run, another_path, fewer_events, other_names]
)
def test_a_report_on_top_of_another_has_the_figures_of_one_from_scratch(
    experiment: Path, tmp_path: Path, saved: list[str], alter: Callable[[Path], None]
) -> None:
    alter(experiment)
    scratch = Path(shutil.copytree(experiment, tmp_path / "other" / experiment.name))
    shutil.rmtree(scratch / "report")
    write_report(experiment, formats=ON_PAGES)
    on_top = len(saved)
    write_report(scratch, formats=ON_PAGES)
    assert 0 < on_top <= len(saved) - on_top
    assert figures(experiment) == figures(scratch)


def test_a_missing_file_and_a_missing_format_are_drawn(experiment: Path, saved: list[str]) -> None:
    (experiment / "report" / "share_lost.svg").unlink()
    write_report(experiment, formats=ON_PAGES)
    assert saved == ["share_lost"]
    saved.clear()
    write_report(experiment)
    names = [name.removesuffix(".png") for name in figures(experiment) if name.endswith(".png")]
    assert sorted(saved) == sorted(names)
    assert all((experiment / "report" / f"{name}.pdf").is_file() for name in names)
    saved.clear()
    # A report with fewer formats can reuse figures with more.
    write_report(experiment, formats=ON_PAGES)
    assert saved == []


def test_no_pdf_of_an_older_figure_stays(experiment: Path) -> None:
    write_report(experiment)
    change(some_run(experiment, "none"), **{ONE: 99.0})
    write_report(experiment, formats=ON_PAGES)
    assert not (experiment / "report" / f"box_{ONE}.pdf").exists()
    assert (experiment / "report" / "box_ate_rmse_m.pdf").is_file()


def test_other_drawing_code_draws_all(
    experiment: Path, saved: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(drawn, "drawing_code", lambda: "of another day")
    write_report(experiment, formats=ON_PAGES)
    drawn_names = {name.partition(".")[0] for name in figures(experiment)}
    assert set(saved) == drawn_names


def test_a_report_killed_while_it_draws_leaves_nothing_to_be_taken_for_whole(
    experiment: Path, saved: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    change(some_run(experiment, "none"), **{ONE: 99.0})
    with monkeypatch.context() as patch:
        patch.setattr("slambed.report.style._wrap_wide_texts", lambda made: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            write_report(experiment, formats=ON_PAGES)
    saved.clear()
    write_report(experiment, formats=ON_PAGES)
    assert {name.partition(".")[0] for name in figures(experiment)} == set(saved)


def test_what_was_wrong_while_a_figure_was_drawn_is_reported_again(experiment: Path) -> None:
    for path in (experiment / "runs").glob("*/trajectory.txt"):
        path.write_text("no pose\n")
    problems = write_report(experiment, formats=ON_PAGES).problems
    assert any("trajectory.txt" in line for line in problems)
    assert write_report(experiment, formats=ON_PAGES).problems == problems
