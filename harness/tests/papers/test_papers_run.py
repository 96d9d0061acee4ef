# SPDX-License-Identifier: Apache-2.0
"""`slambed papers run`: what is played first, what is set aside, and what is left at the end."""

from dataclasses import replace
from pathlib import Path

import pytest
from command_line import refused, slambed
from rich.console import Console
from test_compare import PAPER_CONVENTIONAL, PAPER_ENHANCED, table_2

from slambed.campaign.options import Options
from slambed.campaign.overall import Outlook, Overall
from slambed.campaign.runner import CampaignOutcome
from slambed.commands import papers_run
from slambed.commands.papers_run import Played, play, raise_unless_done
from slambed.errors import ExitCode, SlambedError
from slambed.failures import INTERRUPTED
from slambed.papers.decides import Decides, decided_words, decides, in_order
from slambed.papers.paper_runs import experiments_of
from slambed.papers.published import Paper, read_papers
from slambed.papers.published.paper_plan import read_plan


@pytest.fixture(scope="module")
def dynnetslam() -> Paper:
    return read_papers(["dynnetslam"])[0]


def test_main_claims_come_first_then_what_decides_most_per_hour() -> None:
    found = {
        "numbers": Decides(numbers=50),
        "dear": Decides(main=2, orderings=2),
        "cheap": Decides(main=1, orderings=1),
        "more": Decides(orderings=4),
        "less": Decides(orderings=1),
    }
    cost_s = {"numbers": 1.0, "dear": 7200.0, "cheap": 600.0, "more": 3600.0, "less": 3600.0}
    assert in_order(found, cost_s) == ["cheap", "dear", "more", "less", "numbers"]
    there = cost_s | {"dear": 0.0}
    assert in_order(found, there)[0] == "dear"


def test_the_plan_says_what_an_experiment_decides(dynnetslam: Paper) -> None:
    plan = read_plan("dynnetslam")
    assert plan is not None
    planned = next(item for item in plan.runs if item.experiment == "d_t2_rtt")
    found = decides(dynnetslam, "d_t2_rtt", {"dynnet.T2"})
    assert found.orderings == len(planned.decides)
    assert found.main > 0 and found.numbers > 0


def test_without_a_plan_it_is_what_its_tables_are_compared_for() -> None:
    paper = read_papers(["cloudslam"])[0]
    sources = {table.id for table in paper.tables} | {figure.id for figure in paper.figures}
    every = decides(paper, "c_any", sources | {claim.id for claim in paper.claims})
    assert 0 < every.main <= every.orderings <= len(paper.contrasts)
    assert decides(paper, "c_any", set()) == Decides()


def test_what_is_decided_so_far_is_counted(dynnetslam: Paper) -> None:
    lost = {"conventional": PAPER_CONVENTIONAL, "static": PAPER_ENHANCED}
    runs = table_2(lost, 100, engine="virtual")
    nothing, some = decided_words([dynnetslam], []), decided_words([dynnetslam], [runs])
    assert nothing.startswith(f"0 of {len(dynnetslam.contrasts)} orderings decided, ours beside 0")
    assert int(some.split()[0]) > 0
    assert int(some.split("ours beside ")[1].split()[0]) > 0


@pytest.fixture
def played(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, Options]]:
    """Replaces runs by a note of what would be played; d_t2_rtt is refused."""
    calls: list[tuple[str, Options]] = []

    def outlook(name: str, options: Options) -> Outlook:
        if name == "d_t2_rtt":
            raise SlambedError("no such profile")
        return Outlook(4, 2, 10.0)

    def run(name: str, options: Options, screen: object) -> CampaignOutcome:
        calls.append((name, options))
        assert options.overall is not None
        for _ in range(2):
            if not options.overall.is_used_up:
                options.overall.ended(name, 10.0)
        return CampaignOutcome(done=2, valid=2)

    monkeypatch.setattr(papers_run, "outlook", outlook)
    monkeypatch.setattr(papers_run, "run_and_report", run)
    return calls


def test_everything_is_played_and_what_cannot_be_is_set_aside(
    dynnetslam: Paper, played: list[tuple[str, Options]], tmp_path: Path
) -> None:
    found = play([dynnetslam], Options(results=tmp_path), None)
    names = [name for name, _ in played]
    assert "d_t1_components" in names and "d_t2_rtt" not in names
    assert found.refused == {"d_t2_rtt": "no such profile"}
    assert found.overall.left == 0
    assert found.overall.done == 4 * len(names)
    with pytest.raises(SlambedError, match="1 experiment could not be played: d_t2_rtt") as error:
        raise_unless_done(found)
    assert error.value.code == ExitCode.NOT_ALL_GOOD


def test_runs_on_a_sequence_that_is_not_made_yet_are_told(
    dynnetslam: Paper,
    played: list[tuple[str, Options]],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    """Their keys contain the sequence's checksum, so they cannot be looked for before."""

    def first_line() -> str:
        play([dynnetslam], Options(results=tmp_path), None)
        return " ".join(capsys.readouterr().out.split())

    assert "are looked for" not in first_line()
    monkeypatch.setattr(papers_run, "outlook", lambda *_: Outlook(4, 4, 10.0, is_counted=False))
    number = len(experiments_of([dynnetslam]))
    assert f"(runs of {number} experiments are looked for once sequences" in first_line()


@pytest.mark.parametrize(
    "given",
    [
        ("--runs", "plan"), ("--engine", "virtual"), ("--jobs", "2"), ("--budget", "2h"),
        ("--part", "1/3"), ("--scheduler", "tcp://127.0.0.1:1"), ("--slurm",),
    ],
)  # fmt: skip
def test_what_is_for_runs_is_refused_where_nothing_is_executed(
    tmp_path: Path, given: tuple[str, ...]
) -> None:
    asked = ("papers", "run", "cloudslam", "--reuse-only", "--results", str(tmp_path))
    line = refused(ExitCode.BAD_INPUT, *asked, *given)
    assert line == f"error: --reuse-only executes nothing; leave out {given[0]}"


def test_a_used_budget_ends_the_campaign_with_what_is_left(
    dynnetslam: Paper, played: list[tuple[str, Options]], tmp_path: Path
) -> None:
    found = play([dynnetslam], Options(results=tmp_path), 1e-9)
    assert played == []
    with pytest.raises(SlambedError, match=r"budget of 0 s is used: \d+ runs are left") as error:
        raise_unless_done(found)
    assert error.value.code == ExitCode.NOT_ALL_GOOD


def test_runs_of_the_plan_are_asked_for(
    dynnetslam: Paper, played: list[tuple[str, Options]], tmp_path: Path
) -> None:
    play([dynnetslam], Options(runs="plan", results=tmp_path), None)
    asked = {name: options.runs for name, options in played}
    assert asked["d_t3_sine"] == 150 and asked["d_f2_cores"] == 20


def test_an_interruption_ends_it_and_a_broken_environment_fails(
    dynnetslam: Paper,
    played: list[tuple[str, Options]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stopped = CampaignOutcome(done=1, valid=1, interrupted=True)
    monkeypatch.setattr(papers_run, "run_and_report", lambda *given: stopped)
    found: Played = play([dynnetslam], Options(results=tmp_path), None)
    assert found.interrupted and found.outcomes == [stopped]

    def full(*given: object) -> CampaignOutcome:
        raise SlambedError("the disk is full", ExitCode.ENVIRONMENT)

    monkeypatch.setattr(papers_run, "run_and_report", full)
    with pytest.raises(SlambedError, match="the disk is full"):
        play([dynnetslam], replace(Options(), results=tmp_path), None)


def test_one_experiment_that_this_machine_cannot_play_is_set_aside(
    dynnetslam: Paper,
    played: list[tuple[str, Options]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    good = papers_run.run_and_report

    def without_root(name: str, options: Options, screen: Console) -> CampaignOutcome:
        if name in ("d_f2_cores", "d_t3_sine"):
            raise SlambedError("engine local needs root", ExitCode.ENVIRONMENT)
        return good(name, options, screen)

    monkeypatch.setattr(papers_run, "run_and_report", without_root)
    monkeypatch.setattr(papers_run, "in_order", lambda found, _: sorted(found))
    found = play([dynnetslam], Options(results=tmp_path), None)
    assert set(found.refused) == {"d_f2_cores", "d_t2_rtt", "d_t3_sine"} and found.outcomes
    with pytest.raises(SlambedError, match="3 experiments could not be played"):
        raise_unless_done(found)
    # Where it was the only one, the machine is the reason.
    monkeypatch.setattr(papers_run, "experiments_of", lambda papers: ["d_t3_sine"])
    with pytest.raises(SlambedError, match="needs root") as error:
        play([dynnetslam], Options(results=tmp_path), None)
    assert error.value.code == ExitCode.ENVIRONMENT


def test_mistakes_in_options_are_found_first(tmp_path: Path) -> None:
    own = ["papers", "run", "dynnetslam", "--results", str(tmp_path)]
    assert "write 2h, 90min" in refused(ExitCode.BAD_INPUT, *own, "--budget", "soon")
    assert "--part 4/3 is no part" in refused(ExitCode.BAD_INPUT, *own, "--part", "4/3")
    moby = refused(ExitCode.BAD_INPUT, *own, "--engine", "moby")
    assert "unknown engine 'moby'; known: auto, docker, local, virtual" in moby
    both = ("--scheduler", "tcp://lab:8786", "--slurm")
    assert "one of --scheduler ADDRESS, --slurm" in refused(ExitCode.BAD_INPUT, *own, *both)


def test_an_interrupted_campaign_says_what_is_left_and_how_to_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    overall = Overall({"one": Outlook(3, 2, 60.0)}, 1, None)
    monkeypatch.setattr(
        papers_run, "play", lambda *given: Played([], {}, overall, interrupted=True)
    )
    own = ["papers", "run", "dynnetslam", "--results", str(tmp_path / "results")]
    code, _, said = slambed(*own)
    assert code == INTERRUPTED
    assert said == (
        f"interrupted; finished runs are kept, 2 runs are left, about 2 min 00 s; "
        f"go on with: slambed {' '.join(own)}\n"
    )
