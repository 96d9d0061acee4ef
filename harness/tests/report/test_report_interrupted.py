# SPDX-License-Identifier: Apache-2.0
"""Reports after a campaign that was killed before its report, and on a full disk."""

import json
import shutil
from io import StringIO
from pathlib import Path

import pytest
from command_line import refused, slambed
from results_factory import quickstart_like
from rich.console import Console

from slambed.campaign.options import Options
from slambed.campaign.runner import CampaignOutcome
from slambed.commands import run_and_report
from slambed.commands.run_and_report import show_report
from slambed.errors import ExitCode
from slambed.report import current, plots


@pytest.fixture
def experiment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two runs per cell; one figure is enough here."""
    all_jobs = plots.jobs_of
    monkeypatch.setattr(plots, "jobs_of", lambda *asked: all_jobs(*asked)[:1])
    return quickstart_like(tmp_path, 2, 4.0)


def reported_runs(folder: Path) -> int:
    return len((folder / "summary.csv").read_text().splitlines()) - 1


def show(folder: Path) -> None:
    """Shows the report like a campaign that found nothing to execute."""
    show_report(folder, Console(file=StringIO()), anew=False, figures=False)


def test_an_interrupt_during_the_report_says_how_to_write_it(
    experiment: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    outcome = CampaignOutcome(folder=experiment, done=2, valid=2)
    monkeypatch.setattr(run_and_report, "run_experiment", lambda *_: outcome)
    monkeypatch.setattr(run_and_report, "show_report", interrupted)
    said = StringIO()
    with pytest.raises(KeyboardInterrupt):
        run_and_report.run_and_report("quickstart", Options(), Console(file=said))
    line = " ".join(said.getvalue().split())
    assert line == f"all runs are kept, write the report with: slambed report {experiment}"


def test_a_report_of_fewer_runs_is_written_again(experiment: Path) -> None:
    """The campaign that executed the last run was killed before it could report it."""
    late = sorted((experiment / "runs").iterdir())[-1]
    runs = len(list((experiment / "runs").iterdir()))
    aside = shutil.move(late, experiment / "late")
    show(experiment)
    assert reported_runs(experiment) == runs - 1 and current.is_current(experiment)
    shutil.move(aside, late)
    assert not current.is_current(experiment)
    show(experiment)
    assert reported_runs(experiment) == runs
    assert late.name in (experiment / "summary.csv").read_text()


def test_a_report_of_these_runs_is_left_alone(experiment: Path) -> None:
    show(experiment)
    page = experiment / "report" / "index.html"
    page.write_text("read by somebody")
    show(experiment)
    assert page.read_text() == "read by somebody"
    # A changed number of the same run makes the report outdated.
    summary = next((experiment / "runs").glob("*/summary.json"))
    summary.write_text(json.dumps(json.loads(summary.read_text()) | {"frames_lost": 3}))
    show(experiment)
    assert page.read_text() != "read by somebody"


def test_a_report_that_was_not_finished_is_written_again(experiment: Path) -> None:
    show(experiment)
    page = experiment / "report" / "index.html"
    current.begin(experiment, experiment)
    page.write_text("half")
    show(experiment)
    assert page.read_text() != "half"


@pytest.mark.parametrize("kind", ["png", "svg", "pdf"])
def test_a_disk_that_fills_under_a_figure_is_one_line(experiment: Path, kind: str) -> None:
    """The kernel refuses the write, because the figure goes to /dev/full."""
    code, _, err = slambed("report", str(experiment))
    assert code == ExitCode.OK, err
    figure = next((experiment / "report").rglob(f"*.{kind}"))
    figure.unlink()
    figure.symlink_to("/dev/full")
    line = refused(ExitCode.ENVIRONMENT, "report", str(experiment))
    assert "no space left" in line and "finished" in line
    assert not current.is_current(experiment)
    figure.unlink()
    assert slambed("report", str(experiment))[0] == ExitCode.OK
    assert figure.stat().st_size > 0 and current.is_current(experiment)


def test_a_report_of_somebody_elses_results_goes_to_a_folder_of_ones_own(
    experiment: Path, tmp_path: Path
) -> None:
    def state() -> dict[str, int]:
        return {str(p): p.lstat().st_mtime_ns for p in [experiment, *experiment.rglob("*")]}

    before, mine = state(), tmp_path / "mine"
    code, out, err = slambed("report", str(experiment), "--output", str(mine))
    assert code == ExitCode.OK, err
    assert f"report: {mine}/report/index.html" in out and state() == before
    names = {path.name for path in mine.iterdir()}
    assert names == {"report", "report.md", "summary.csv"} and reported_runs(mine) > 0
    assert current.is_current(experiment) is False
    code, out, err = slambed(
        "report", "--results", str(experiment.parent), "--output", str(tmp_path / "all")
    )
    assert code == ExitCode.OK, err
    assert next((tmp_path / "all").rglob("index.html")).is_file() and state() == before
