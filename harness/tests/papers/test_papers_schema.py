# SPDX-License-Identifier: Apache-2.0
"""The models of papers/*/paper.yaml: what they accept and what they reject."""

from typing import Any

import pytest
from pydantic import ValidationError

from slambed.papers.published import (
    Claim,
    Comparability,
    Contrast,
    Erratum,
    Margin,
    Paper,
    cells_of,
    read_papers,
    table_cells,
)
from slambed.papers.published.published_tables import Drawn


@pytest.fixture(scope="module")
def papers() -> dict[str, Paper]:
    return {paper.id: paper for paper in read_papers()}


def test_every_cell_and_claim_has_one_id(papers: dict[str, Paper]) -> None:
    assert sum(len(table_cells(p)) for p in papers.values()) == 271
    for paper in papers.values():
        cells = cells_of(paper)
        assert set(table_cells(paper)) | {claim.id for claim in paper.claims} <= set(cells)


def test_a_cell_has_the_coordinates_of_table_row_and_column(papers: dict[str, Paper]) -> None:
    cell = cells_of(papers["dynnetslam"])["dynnet.T3.dyn_wh_wosz.desk_40"]
    assert (cell.value, cell.unit, cell.runs, cell.resolution) == (4, "%", 100, 1)
    assert cell.system == "dyn_wh_wosz"
    assert {"dataset": "desk", "L_OL_ms": 40, "latency_profile": "sine"}.items() <= (
        cell.conditions.items()
    )
    delay = cells_of(papers["dynnetslam"])["dynnet.T1.T_MU.enhanced"]
    assert (delay.value, delay.spread) == (210, 69.3)
    named = cells_of(papers["multithread_rl"])["ijnc.T6.fp360.multithread_rl.rpe_r"]
    assert (named.metric, named.unit, named.resolution) == ("rpe_rot_rmse", "deg", 0.01)


def claim(**more: Any) -> dict[str, Any]:
    return {
        "id": "x.C1",
        "kind": "result",
        "metric": "m",
        "system": "s",
        "conditions": {},
        "op": "eq",
        "value": 1,
        "unit": None,
        "where": "Sec. 1",
    } | more


def contrast(**more: Any) -> dict[str, Any]:
    return {
        "id": "x.O1",
        "kind": "pair",
        "cells": ["a", "b"],
        "direction": "rises",
        "where": "Sec. 1",
        "says": "b is above a",
    } | more


@pytest.mark.parametrize(
    ("model", "content"),
    [
        (Claim, claim(op="approx")),
        (Claim, claim(op="set", value=3)),
        (Claim, claim(op="range", value=[3, 1])),
        (Claim, claim(op="le", value=[1, 3])),
        (Claim, claim(quantity={"kind": "window_share", "of": "x", "from_s": 25, "to_s": 22})),
        (Claim, claim(quantity={"kind": "max_over", "over": []})),
        (Claim, claim(configured={"system": "edgeslam", "param": "n_kf", "profile": "sine"})),
        (Contrast, contrast(kind="trend")),
        (Contrast, contrast(kind="all_below")),
        (Contrast, contrast(cells=["a", "a"])),
        (Contrast, contrast(kind="blocks", cells=[["a", "b"], ["c"]])),
        (Contrast, contrast(kind="all_below", cells=[["a", "b"]], direction="falls")),
        (Contrast, contrast(kind="flat", basis="text")),
        (Contrast, contrast(kind="flat", direction=None)),
        (Contrast, contrast(kind="flat", basis="text", direction=None, cells=["a"])),
        (Contrast, contrast(direction=None)),
        (Drawn, {"kind": "distribution", "event": "x", "unit": "m", "cells": ["a"]}),
        (Drawn, {"kind": "times", "event": "x", "unit": "s", "cells": ["a"], "field": "y"}),
        (Margin, {}),
        (Margin, {"ratio": 0.2, "points": 3}),
        (Margin, {"ratio": 0.2, "points_at_ends": 3}),
        (Erratum, {"why": "two numbers"}),
        (Erratum, {"why": "two numbers", "judge_as": 3, "skip": True}),
    ],
)
def test_what_cannot_be_meant_is_refused(model: Any, content: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        model.model_validate(content)


def test_chains_are_read_from_either_shape() -> None:
    assert Contrast.model_validate(contrast()).chains == [["a", "b"]]
    whole = Contrast.model_validate(contrast(kind="all_below", cells=[["a", "c"], ["b", "c"]]))
    assert whole.chains == [["a", "c"], ["b", "c"]]
    assert whole.ids() == ["a", "c", "b"]


def test_braces_stand_for_several_cells() -> None:
    trend = Contrast.model_validate(contrast(kind="trend", cells=["t.a.rtt{0,20}", "t.b.rtt0"]))
    assert trend.chains == [["t.a.rtt0", "t.a.rtt20", "t.b.rtt0"]]
    pairs = [["t.a.rtt{0, 20}", "t.b.rtt{0, 20}"], ["t.{c,d}.x", "t.e.x"]]
    whole = Contrast.model_validate(contrast(kind="all_below", cells=pairs))
    assert whole.chains == [
        ["t.a.rtt0", "t.b.rtt0"], ["t.a.rtt20", "t.b.rtt20"],
        ["t.c.x", "t.e.x"], ["t.d.x", "t.e.x"],
    ]  # fmt: skip
    curves = Contrast.model_validate(
        contrast(kind="flat", basis="text", direction=None, cells=[["t.{a,b}.x"], ["t.c", "t.d"]])
    )
    assert curves.chains == [["t.a.x", "t.b.x"], ["t.c", "t.d"]]
    with pytest.raises(ValidationError, match="different numbers"):
        Contrast.model_validate(contrast(kind="all_below", cells=[["t.{a,b}", "t.{a,b,c}"]]))


def test_the_margin_is_narrower_at_the_ends() -> None:
    share = Margin(points=15, points_at_ends=10)
    assert [share.at(p) for p in (0, 5, 6, 94, 95, 100)] == [10, 10, 15, 15, 10, 10]
    assert Margin(ratio=0.2).at(17.0) == 0.2


def test_what_is_said_of_a_part_wins() -> None:
    table = Comparability(parameter="a setting", read_as="as printed")
    cell = Comparability(read_as="as percent")
    both = cell.over(table)
    assert (both.parameter, both.read_as) == ("a setting", "as percent")
    assert not both.judged
    assert Comparability(read_as="as printed").judged
    assert not Comparability(erratum=Erratum(why="printed twice", skip=True)).judged
    assert Comparability(erratum=Erratum(why="printed twice", judge_as=3)).judged
