# SPDX-License-Identifier: Apache-2.0
"""A campaign and its report, as `slambed run` and `slambed papers run` execute them."""

import shlex
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from slambed.campaign.options import Options
from slambed.campaign.run_experiment import run_experiment
from slambed.campaign.runner import CampaignOutcome
from slambed.commands.report_request import check_figure_names
from slambed.commands.shared_options import status_command
from slambed.errors import ExitCode, SlambedError
from slambed.papers.experiment_tables import comparisons_for
from slambed.papers.published.paper_plan import plans_of_today
from slambed.report.current import is_current
from slambed.report.experiment import ReportSummary, terminal_summary, write_report
from slambed.report.load import load
from slambed.report.recompute import recompute_refused
from slambed.report.style import ON_PAGES
from slambed.terminal import RESULTS


def run_and_report(
    name: str, options: Options, console: Console, figures: bool = True
) -> CampaignOutcome:
    """Executes the missing runs of an experiment, then shows and writes its report."""
    options = replace(options, plans=plans_of_today())
    verdict = run_experiment(name, options, console, check_figure_names)
    if verdict.folder is not None and any((verdict.folder / "runs").iterdir()):
        try:
            show_report(verdict.folder, console, verdict.done > 0, figures)
        except KeyboardInterrupt:
            write = f"slambed report {shlex.quote(str(verdict.folder))}"
            _print(console, f"all runs are kept, write the report with: {write}")
            raise
    return verdict


def raise_unless_good(verdicts: list[CampaignOutcome], what: str, results: Path = RESULTS) -> None:
    """Raises SlambedError (exit code 1) if a run failed, is invalid or did not complete."""
    given_up = [line for verdict in verdicts for line in verdict.given_up.values()]
    done = sum(verdict.done for verdict in verdicts)
    invalid = done - sum(verdict.valid for verdict in verdicts)
    broken_off = sum(verdict.not_completed for verdict in verdicts)
    line = None
    if given_up:
        line = f"{len(given_up)} runs have no result: {given_up[0]}; the same command tries again"
    elif invalid:
        line = f"{invalid} of {done} runs are invalid; '{status_command(what, results)}' says why"
    elif broken_off:
        line = f"{broken_off} of {done} runs did not complete: a result, which the report shows"
    if line is not None:
        raise SlambedError(line, ExitCode.NOT_ALL_GOOD)


def show_report(folder: Path, console: Console, anew: bool = True, figures: bool = True) -> None:
    """Shows the tables of a results folder, and writes its report unless the current one is up to
    date."""
    results = load(folder)
    if results.refused and (again := recompute_refused(folder)) is not None:
        anew = True
        for line in again.lines():
            _print(console, line)
        results = load(folder)
    summary = ReportSummary.of(results, comparisons_for(results))
    if anew or not is_current(folder):
        write_report(folder, figures=figures, summary=summary, formats=ON_PAGES)
    terminal_summary(folder, console, summary, said=True)
    _print(console, f"every run: {folder / 'summary.csv'}")


def _print(console: Console, line: str) -> None:
    console.print(line, highlight=False, markup=False, soft_wrap=True)
