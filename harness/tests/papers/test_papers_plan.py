# SPDX-License-Identifier: Apache-2.0
"""Plans: what they freeze, what the lint reports, and that their powers are right."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

from slambed.commands.papers import app
from slambed.errors import SlambedError
from slambed.papers.lint.checkout import Checkout
from slambed.papers.lint.lint_plan import plan_problems
from slambed.papers.published import Paper, PaperPlan, PublishedCell, cells_of, read_papers
from slambed.papers.published.paper_plan import PlannedLater, frozen_digest, read_plan
from slambed.papers.published.reading import papers_folder
from slambed.papers.verdicts.contrasts import Published, Step, power_of
from slambed.papers.verdicts.model import Mean, Share
from slambed.spec.library import Library

POWER_ERROR = 0.03
"""The powers of a plan are rounded, and 2,000 draws have a standard error of 0.01."""


@pytest.fixture(scope="module")
def paper() -> Paper:
    return read_papers(["dynnetslam"])[0]


@pytest.fixture(scope="module")
def plan() -> PaperPlan:
    found = read_plan("dynnetslam")
    assert found is not None
    return found


def raw_paper() -> dict[str, Any]:
    content = yaml.safe_load((papers_folder() / "dynnetslam" / "paper.yaml").read_text())
    assert isinstance(content, dict)
    return content


def test_the_plan_fits_its_paper(paper: Paper, plan: PaperPlan) -> None:
    assert list(plan_problems(plan, paper, Checkout(Library()))) == []
    assert {name for item in plan.runs for name in item.decides} == {c.id for c in paper.contrasts}


@pytest.mark.parametrize(
    "change",
    [
        lambda p: p["margins"]["ate_rmse"].update(ratio=0.5),
        lambda p: p["contrasts"].pop(),
        lambda p: p["contrasts"][2].update(direction="rises", kind="all_below", cells=[["a", "b"]]),
        lambda p: p["metrics"]["ate_rmse"].update(only_without_loss=False),
        lambda p: p["datasets"]["desk"].update(match=["redkitchen"]),
        lambda p: p["tables"][1]["rows"]["enhanced"]["values"].update(rtt80=37),
        lambda p: p["claims"][11]["quantity"].update(base="dynnet.F2.total.2"),
    ],
)
def test_what_bends_a_verdict_changes_the_frozen_digest(
    paper: Paper, change: Callable[[dict[str, Any]], None]
) -> None:
    content = raw_paper()
    change(content)
    assert frozen_digest(Paper.model_validate(content)) != frozen_digest(paper)


def test_words_may_be_bettered_without_another_plan(paper: Paper) -> None:
    content = raw_paper()
    content["contrasts"][0]["says"] = "in better words"
    content["metrics"]["ate_rmse"]["read_as"] = "in better words"
    content["systems"]["orbslam2_mobile"]["label"] = "in better words"
    content["claims"][20]["note"] = "in better words"
    assert frozen_digest(Paper.model_validate(content)) == frozen_digest(paper)


def test_a_plan_has_a_name_of_its_own(plan: PaperPlan) -> None:
    first = plan.runs[0].model_copy(update={"runs": plan.runs[0].runs + 1})
    other = plan.model_copy(update={"runs": [first, *plan.runs[1:]]})
    assert other.digest != plan.digest == read_plan("dynnetslam").digest  # type: ignore[union-attr]


def test_runs_older_than_the_plan_are_reported(plan: PaperPlan) -> None:
    assert plan.made_before(plan.written_utc - timedelta(seconds=1))
    assert not plan.made_before(plan.written_utc)
    assert not plan.made_before(datetime(2030, 1, 1, tzinfo=UTC))


def changed(plan: PaperPlan, **more: Any) -> PaperPlan:
    return plan.model_copy(update=more)


def first_with(plan: PaperPlan, **more: Any) -> PaperPlan:
    return changed(plan, runs=[plan.runs[0].model_copy(update=more), *plan.runs[1:]])


def waiting(contrast: str) -> PlannedLater:
    return PlannedLater(decides=[contrast], runs=30, waits_for="a system")


@pytest.mark.parametrize(
    ("spoil", "expected"),
    [
        (lambda p: changed(p, frozen="0"), "write a new plan"),
        (lambda p: changed(p, fits=["pi"]), "no catalog/devices/fits/pi.yaml"),
        (lambda p: changed(p, data={"attic": p.data["desk"]}), "no sequence attic"),
        (lambda p: changed(p, runs=p.runs[1:]), "no experiment decides dynnet.O01"),
        (lambda p: changed(p, later=[waiting("dynnet.O01")]), "O01 is decided by an experiment"),
        (lambda p: changed(p, later=[waiting("dynnet.O98")]), "later: no contrast dynnet.O98"),
        (lambda p: first_with(p, seed=7), "d_t1_components: seed 1, not 7"),
        (lambda p: first_with(p, experiment="d_t1"), "unknown experiment 'd_t1'"),
        (lambda p: first_with(p, decides=["dynnet.O99"]), "no contrast dynnet.O99"),
        (lambda p: first_with(p, experiment="d_f2_cores"), "no planned experiment reproduces"),
    ],
)
def test_a_planted_mistake_in_a_plan_is_found(
    paper: Paper, plan: PaperPlan, spoil: Callable[[PaperPlan], PaperPlan], expected: str
) -> None:
    found = [str(item) for item in plan_problems(spoil(plan), paper, Checkout(Library()))]
    assert any(expected in line for line in found), found


def test_a_torn_plan_is_one_line(tmp_path: Path) -> None:
    assert read_plan("dynnetslam", tmp_path) is None
    path = tmp_path / "dynnetslam" / "plan.yaml"
    path.parent.mkdir()
    path.write_text("paper: dynnetslam\n")
    with pytest.raises(SlambedError, match=r"'written_utc' is missing, .*dynnetslam/plan\.yaml"):
        read_plan("dynnetslam", tmp_path)
    text = (papers_folder() / "dynnetslam" / "plan.yaml").read_text()
    path.write_text(text.replace("paper: dynnetslam", "paper: other", 1))
    with pytest.raises(SlambedError, match="plan of 'other'"):
        read_plan("dynnetslam", tmp_path)


def published(paper: Paper, cell: PublishedCell) -> Published:
    assert cell.value is not None
    if paper.metrics[cell.metric].statistic == "share":
        assert cell.runs is not None
        return Share(round(cell.value / 100 * cell.runs), cell.runs)
    return Mean(cell.value, cell.spread, cell.runs, cell.resolution or 0.0)


@pytest.mark.parametrize("name", [p.id for p in read_papers() if p.kind == "paper"])
def test_the_powers_are_those_of_the_rules(name: str) -> None:
    """Every contrast of every paper is planned with the power that the rules give."""
    paper, plan = read_papers([name])[0], read_plan(name)
    assert plan is not None
    planned = [*plan.runs, *plan.later]
    assert {name for item in planned for name in item.decides} == {c.id for c in paper.contrasts}
    cells, contrasts = cells_of(paper), {item.id: item for item in paper.contrasts}
    for item in planned:
        for name, power in item.power.items():
            contrast = contrasts[name]
            chains = [c if contrast.direction == "rises" else c[::-1] for c in contrast.chains]
            steps = [Step((), tuple(published(paper, cells[i]) for i in c)) for c in chains]
            counts = [[item.runs] * len(step.paper) for step in steps]
            assert power == pytest.approx(power_of(steps, counts), abs=POWER_ERROR), name


def test_the_command_shows_what_is_decided() -> None:
    result = CliRunner().invoke(app, ["plan", "dynnetslam"])
    assert result.exit_code == 0, result.output
    assert "d_t3_sine: 150 runs per combination, seed 3" in result.output
    assert "dynnet.O09 (power 0.83): Under the sine the safe zone does harm" in result.output
    later = CliRunner().invoke(app, ["plan", "cloudslam"])
    assert "later, 5 runs per combination: live runs of c_f14_resources" in later.output
    assert "cloudslam.O01 (power 1)" in later.output
    missing = CliRunner().invoke(app, ["plan", "peer_orbslam2"])
    assert isinstance(missing.exception, SlambedError)
