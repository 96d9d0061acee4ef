# SPDX-License-Identifier: Apache-2.0
"""The lint of papers/*/paper.yaml: it accepts our files and reports every mistake."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

from slambed.commands.papers import app
from slambed.errors import SlambedError
from slambed.papers.lint.checkout import Checkout
from slambed.papers.lint.lint import lint
from slambed.papers.published import Paper, read_paper, read_papers, table_cells
from slambed.papers.published.reading import papers_folder
from slambed.spec.library import Library

Mistake = Callable[[dict[str, Any]], None]


@pytest.fixture(scope="module")
def checkout() -> Checkout:
    return Checkout(Library())


def test_our_papers_are_mapped_whole(checkout: Checkout) -> None:
    papers = [paper for paper in read_papers() if paper.kind == "paper"]
    assert [str(problem) for problem in lint(papers, checkout)] == []
    assert sum(len(table_cells(paper)) for paper in papers) == 271
    assert sum(len(paper.claims) for paper in papers) == 182


def raw(name: str) -> dict[str, Any]:
    content = yaml.safe_load((papers_folder() / name / "paper.yaml").read_text())
    assert isinstance(content, dict)
    return content


def claim(paper: dict[str, Any], name: str) -> dict[str, Any]:
    found: dict[str, Any] = next(c for c in paper["claims"] if c["id"] == name)
    return found


def contrast(paper: dict[str, Any], name: str) -> dict[str, Any]:
    found: dict[str, Any] = next(c for c in paper["contrasts"] if c["id"] == name)
    return found


def table(paper: dict[str, Any], name: str) -> dict[str, Any]:
    found: dict[str, Any] = next(t for t in paper["tables"] if t["id"] == name)
    return found


MISTAKES: dict[str, tuple[str, Mistake, str]] = {
    "a key that no run has": (
        "dynnetslam",
        lambda p: p["metrics"]["ate_rmse"].update(key="ate_rms_m"),
        "ate_rms_m",
    ),
    "a part of a delay that there is not": (
        "dynnetslam",
        lambda p: p["metrics"]["delay_track"].update(key="delay.T_Trak"),
        "T_Trak",
    ),
    "a parameter that no system has": (
        "dynnetslam",
        lambda p: p["conditions"]["L_OL_ms"].update(column="params.l_ol"),
        "no system has a parameter l_ol",
    ),
    "a parameter that this system has not": (
        "dynnetslam",
        lambda p: p["systems"]["edgeslam_static"]["match"].update({"params.b_ms": "1"}),
        "edgeslam has no parameter b_ms",
    ),
    "a variant that there is not": (
        "dynnetslam",
        lambda p: p["systems"]["dyn_wh_wsz"]["match"].update(variant="wh_wzs"),
        "no variant wh_wzs",
    ),
    "a system that is not built and does not say so": (
        "multithread_rl",
        lambda p: p["systems"]["relocate"]["match"].update(system="multithread_lr"),
        "no system multithread_lr",
    ),
    "a system that is said not to be built": (
        "dynnetslam",
        lambda p: p["systems"]["dyn_wh_wsz"].update(not_built="to come"),
        "system dynnetslam is built",
    ),
    "a dataset that there is not": (
        "multithread_rl",
        lambda p: p["datasets"]["fr2_pioneer_360"].update(match=["fr2_pioneer360"]),
        "no dataset fr2_pioneer360",
    ),
    "a stand-in that there is not": (
        "cloudslam",
        lambda p: p["datasets"]["rectangle"].update(stand_in=["synthetic_triangle*"]),
        "no dataset synthetic_triangle*",
    ),
    "a link profile that there is not": (
        "dynnetslam",
        lambda p: p["conditions"]["rtt_added_ms"].update({20: {"profile": "rtt20"}}),
        "no profile rtt20",
    ),
    "a condition that selects nothing": (
        "dynnetslam",
        lambda p: table(p, "dynnet.T2")["conditions"].update(weather="rain"),
        "weather = rain cannot be expressed",
    ),
    "a value of a condition that selects nothing": (
        "dynnetslam",
        lambda p: table(p, "dynnet.T2")["columns"]["rtt20"]["dims"].update(rtt_added_ms=25),
        "rtt_added_ms = 25 cannot be expressed",
    ),
    "a cell without a dataset": (
        "dynnetslam",
        lambda p: table(p, "dynnet.T1")["conditions"].pop("dataset"),
        "no dataset is named",
    ),
    "a claim without a dataset": (
        "dynnetslam",
        lambda p: claim(p, "dynnet.C26")["conditions"].pop("dataset"),
        "dynnet.C26: no dataset is named",
    ),
    "a metric without a margin": (
        "dynnetslam",
        lambda p: p["margins"].pop("ate_rmse_mean"),
        "none for 'ate_rmse_mean'",
    ),
    "a margin of nothing": (
        "dynnetslam",
        lambda p: p["margins"].update(ate_rms={"ratio": 0.2}),
        "margins, ate_rms",
    ),
    "a set-up that nobody compares": (
        "dynnetslam",
        lambda p: claim(p, "dynnet.C05").pop("parameter"),
        "dynnet.C05: setup",
    ),
    "a setting of ours that is another one": (
        "dynnetslam",
        lambda p: claim(p, "dynnet.C09").update(value=2),
        "the paper has 2.0, we have 1",
    ),
    "a setting of a profile that is another one": (
        "dynnetslam",
        lambda p: claim(p, "dynnet.C46").update(value=80),
        "we have 85",
    ),
    "words that nothing judges": (
        "dynnetslam",
        lambda p: contrast(p, "dynnet.O23").pop("claims"),
        "dynnet.C55: stated in words",
    ),
    "a duplicate of another number": (
        "dynnetslam",
        lambda p: claim(p, "dynnet.C33").update(duplicate_of="dynnet.T2.enhanced.rtt0"),
        "rtt0 is 0.0, not 3.0",
    ),
    "a duplicate of nothing": (
        "dynnetslam",
        lambda p: claim(p, "dynnet.C33").update(duplicate_of="dynnet.T9.x.y"),
        "no cell or claim dynnet.T9.x.y",
    ),
    "an ordering of a cell that there is not": (
        "dynnetslam",
        lambda p: contrast(p, "dynnet.O12").update(cells=["dynnet.C27", "dynnet.C99"]),
        "dynnet.O12: cells: no cell, claim or point dynnet.C99",
    ),
    "a reduction of a cell that there is not": (
        "multithread_rl",
        lambda p: claim(p, "ijnc.C16")["quantity"].update(base="ijnc.T5.pioneer4.edgeslam.x"),
        "no cell, claim or point ijnc.T5.pioneer4",
    ),
    "a reduction that the cells do not give": (
        "multithread_rl",
        lambda p: claim(p, "ijnc.C19").pop("erratum"),
        "ijnc.C19: quantity: the paper's cells give 16.85, not 35.33",
    ),
    "the largest of several that is another one": (
        "multithread_rl",
        lambda p: claim(p, "ijnc.C18")["quantity"]["over"].pop(1),
        "ijnc.C18: quantity: the paper's cells give 32.77, not 36.79",
    ),
    "runs of two codecs in one number": (
        "dynnetslam",
        lambda p: p["systems"]["edgeslam_static"]["match"].pop("params.codec"),
        "T_MU.enhanced: its runs differ in params.codec (binary, compatibility), which it leaves",
    ),
    "runs of three thresholds in one number": (
        "dynnetslam",
        lambda p: table(p, "dynnet.T3")["columns"]["desk_40"]["dims"].pop("L_OL_ms"),
        "desk_40: its runs differ in params.l_ol_ms (30.0, 40.0, 50.0), which it leaves open",
    ),
    "a number that its experiment makes no runs for": (
        "dynnetslam",
        lambda p: p["conditions"]["rtt_added_ms"].update({20: {"profile": "sine_p2p"}}),
        "dynnet.T2.enhanced.rtt20: an experiment reproduces it and makes no such runs",
    ),
    "an erratum that points nowhere": (
        "multithread_rl",
        lambda p: claim(p, "ijnc.C19").update(erratum={"why": "?", "judge_as": "ijnc.C99"}),
        "erratum: no cell or claim ijnc.C99",
    ),
    "a reference that is not named": (
        "cloudslam",
        lambda p: p["metrics"]["rmse_vs_orbslam"].update(key="rmse_vs_reference_live_m"),
        "a reference is named",
    ),
    "a figure of which nothing is compared": (
        "cloudslam",
        lambda p: p["figures"][0].pop("unmappable"),
        "cloudslam.F2: nothing of it",
    ),
    "a flat curve of two metrics": (
        "cloudslam",
        lambda p: contrast(p, "cloudslam.O17").update(
            cells=["cloudslam.F15.rmse_circular.12", "cloudslam.F15.response_circular.12"]
        ),
        "cloudslam.O17: flat, of several metrics: response_time, rmse_vs_orbslam",
    ),
    "a flat curve of shares": (
        "dynnetslam",
        lambda p: contrast(p, "dynnet.O23").update(
            kind="flat", direction=None, basis="text", cells=["dynnet.T2.enhanced.rtt{0,20}"]
        ),
        "dynnet.O23: flat needs a margin as a ratio, track_loss_ratio has none",
    ),
    "a drawing of a cell that there is not": (
        "cloudslam",
        lambda p: next(f for f in p["figures"] if f["id"] == "cloudslam.F12")["drawn"].update(
            cells=["cloudslam.F11.periodic_rectangle_rate.4"]
        ),
        "cloudslam.F12: drawn: no cell, claim or point cloudslam.F11.periodic_rectangle_rate.4",
    ),
    "an id given twice": (
        "dynnetslam",
        lambda p: claim(p, "dynnet.C33").update(id="dynnet.C34"),
        "given twice",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_planted_mistake_is_found(checkout: Checkout, mistake: str) -> None:
    name, plant, expected = MISTAKES[mistake]
    content = raw(name)
    assert lint([Paper.model_validate(content)], checkout) == []
    plant(content)
    found = [str(problem) for problem in lint([Paper.model_validate(content)], checkout)]
    assert any(expected in line for line in found), found


def test_a_fit_to_a_cell_that_there_is_not_is_found(checkout: Checkout) -> None:
    papers = read_papers(["dynnetslam"])
    other = Checkout(Library())
    own = {"made_up": ["dynnet.T1.T_*", "dynnet.T1.T_XY.enhanced", "else.T1.x"]}
    other.__dict__["fits"] = checkout.fits | own
    assert [str(problem) for problem in lint(papers, other)] == [
        "catalog/devices/fits/made_up.yaml: fits: no cell dynnet.T1.T_XY.enhanced"
    ]


def test_the_fit_names_the_cells_of_its_components(checkout: Checkout) -> None:
    assert "dynnet.T1.T_*" in checkout.fits["dynnetslam_table1"]


def test_an_operator_out_of_the_set_is_refused_with_its_place(tmp_path: Path) -> None:
    content = raw("multithread_rl")
    claim(content, "ijnc.C13").update(op="approx")
    path = tmp_path / "multithread_rl.yaml"
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(SlambedError, match=r"'claims\.12\.op': .*multithread_rl\.yaml line \d+"):
        read_paper(path)


def test_the_command_says_what_is_mapped() -> None:
    result = CliRunner().invoke(app, ["lint"])
    assert result.exit_code == 0, result.output
    assert "dynnetslam: 110 cells and 56 claims" in result.output


def test_the_command_lists_mistakes_and_ends_with_1(monkeypatch: pytest.MonkeyPatch) -> None:
    content = raw("dynnetslam")
    content["metrics"]["ate_rmse"]["key"] = "ate_rms_m"
    wrong = Paper.model_validate(content)
    monkeypatch.setattr("slambed.papers.published.reading.read_papers", lambda names: [wrong])
    result = CliRunner().invoke(app, ["lint", "dynnetslam"])
    assert "dynnetslam, metrics, ate_rmse: no number of a run is called ate_rms_m" in result.output
    assert isinstance(result.exception, SlambedError)
    assert result.exception.code == 1
