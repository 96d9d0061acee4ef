# SPDX-License-Identifier: Apache-2.0
"""`slambed papers run`: plays the experiments of papers as one campaign."""

from dataclasses import dataclass, field, replace
from pathlib import Path

from slambed.campaign.options import Options
from slambed.campaign.outlook import outlook
from slambed.campaign.overall import Outlook, Overall
from slambed.campaign.progress import duration
from slambed.campaign.run_plan import print_to
from slambed.campaign.runner import CampaignOutcome
from slambed.commands.results_folders import result_folders
from slambed.commands.run_and_report import raise_unless_good, run_and_report
from slambed.errors import ExitCode, SlambedError
from slambed.papers.decides import Decides, decided_words, decides, in_order
from slambed.papers.paper_runs import experiments_of
from slambed.papers.published import Paper
from slambed.papers.published.paper_plan import read_plan
from slambed.process.cpus import own_cpus
from slambed.report.load import load
from slambed.spec.library import Library
from slambed.terminal import RESULTS, console

PLANNED = "plan"
"""`--runs plan`: runs per cell as registered in the papers' plans."""


@dataclass(frozen=True)
class Ahead:
    """One experiment of the campaign before it is played."""

    options: Options
    outlook: Outlook
    decides: Decides


@dataclass
class Played:
    """What became of the campaign."""

    outcomes: list[CampaignOutcome]
    refused: dict[str, str]
    """Experiment -> why it could not be played."""
    overall: Overall
    interrupted: bool = False

    @property
    def left_words(self) -> str:
        """Returns how much is left, for the last line."""
        return f"{self.overall.left} runs are left, about {duration(self.overall.left_s())}"


@dataclass
class SetAside:
    """The experiments that could not be played."""

    refused: dict[str, str] = field(default_factory=dict)
    """Experiment -> why."""
    environments: list[SlambedError] = field(default_factory=list)
    """Failures of the environment since the last experiment that was played."""

    def add(self, name: str, error: SlambedError) -> None:
        """Sets an experiment aside. Its environment may lack what only it needs, such as an engine.
        Raises the error if nothing could be played since another such one: it is this machine."""
        if error.code == ExitCode.ENVIRONMENT:
            if self.environments:
                raise error
            self.environments.append(error)
        self.refused[name] = str(error)

    def raise_if_all(self, asked: int) -> None:
        """Raises the failure of the environment if it was the only experiment."""
        if self.environments and asked == len(self.refused) == 1:
            raise self.environments[0]


def play(papers: list[Paper], options: Options, budget_s: float | None) -> Played:
    """Plays what is missing of the papers' experiments, in the order of what it decides.

    An experiment that cannot be played is set aside, and the others go on. Raises SlambedError for
    failures of the environment that are not of one experiment, such as a full disk.
    """
    screen = console()
    set_aside = SetAside()
    ahead: dict[str, Ahead] = {}
    names = experiments_of(papers)
    for name in names:
        own = replace(options, runs=_runs(papers, name, options.runs))
        try:
            experiment, _ = Library().experiment(name)
            found = outlook(name, own)
        except SlambedError as error:
            set_aside.add(name, error)
            print_to(screen, f"{name} is left out: {error}")
            continue
        set_aside.environments.clear()
        worth = sum(
            (decides(paper, name, set(experiment.reproduces)) for paper in papers), Decides()
        )
        ahead[name] = Ahead(own, found, worth)
    jobs = options.jobs or len(own_cpus())
    overall = Overall({name: item.outlook for name, item in ahead.items()}, jobs, budget_s)
    played = Played([], set_aside.refused, overall)
    cost_s = {name: item.outlook.missing * item.outlook.run_s for name, item in ahead.items()}
    print_to(
        screen,
        f"{len(ahead)} experiments, {overall.total} runs, {overall.done} there already, "
        f"{overall.left} left, about {duration(overall.left_s())}" + _uncounted(overall),
    )
    overall.decided = _decided(papers, options.results)
    for name in in_order({name: item.decides for name, item in ahead.items()}, cost_s):
        if overall.is_used_up and overall.left:
            break
        try:
            own = replace(ahead[name].options, overall=overall)
            outcome = run_and_report(name, own, screen)
        except SlambedError as error:
            set_aside.add(name, error)
            print_to(screen, f"{name} is left out: {error}")
            continue
        played.outcomes.append(outcome)
        if outcome.interrupted:
            played.interrupted = True
            break
        if outcome.done:
            set_aside.environments.clear()
            overall.decided = _decided(papers, options.results)
        print_to(
            screen,
            f"papers: {overall.done} of {overall.total} runs, "
            f"{duration(overall.left_s())} left; {overall.decided}",
        )
    set_aside.raise_if_all(len(names))
    return played


def _uncounted(overall: Overall) -> str:
    """Returns how many experiments may have runs that this number misses."""
    number = sum(not found.is_counted for found in overall.outlooks.values())
    if not number:
        return ""
    return f" (runs of {_experiments(number)} are looked for once sequences are made)"


def _experiments(number: int) -> str:
    return f"{number} experiment{'s' if number > 1 else ''}"


def raise_unless_done(played: Played) -> None:
    """Raises SlambedError (exit code 1) with what is left when the budget was used up, and if
    anything else is not good."""
    if played.overall.is_used_up and played.overall.left:
        budget = duration(played.overall.budget_s or 0.0)
        raise SlambedError(
            f"the budget of {budget} is used: {played.left_words}; the same command goes on",
            ExitCode.NOT_ALL_GOOD,
        )
    invalid = [found.folder for found in played.outcomes if found.valid < found.done]
    first = next((folder for folder in invalid if folder is not None), RESULTS / "NAME")
    raise_unless_good(played.outcomes, first.name, first.parent)
    if played.refused:
        name, why = next(iter(played.refused.items()))
        raise SlambedError(
            f"{_experiments(len(played.refused))} could not be played: {name}: {why}",
            ExitCode.NOT_ALL_GOOD,
        )


def _runs(papers: list[Paper], experiment: str, asked: int | str | None) -> int | str | None:
    """Returns the runs per cell; for `plan` the most that a paper's plan asks for, or the
    experiment's default."""
    if asked != PLANNED:
        return asked
    plans = [read_plan(paper.id) for paper in papers if paper.kind == "paper"]
    found = [
        item.runs for plan in plans if plan for item in plan.runs if item.experiment == experiment
    ]
    return max(found, default=None)


def _decided(papers: list[Paper], results: Path) -> str:
    if not results.is_dir():
        return decided_words(papers, [])
    return decided_words(papers, [load(folder) for folder in result_folders(results)])
