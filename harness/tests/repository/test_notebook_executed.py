# SPDX-License-Identifier: Apache-2.0
"""Executes docs/results.ipynb cell by cell, like a notebook's kernel.

Its cells are plain Python, so no kernel (with its two dozen packages) is needed.
"""

import ast
import json
from pathlib import Path
from typing import Any

import matplotlib
import pytest
from results_factory import quickstart_like

from slambed.native import repository_root

matplotlib.use("Agg")
import matplotlib.pyplot as plt

NOTEBOOK = repository_root() / "docs" / "results.ipynb"


def cells(kind: str) -> list[dict[str, Any]]:
    content = json.loads(NOTEBOOK.read_text())
    assert (content["nbformat"], content["nbformat_minor"]) == (4, 5)
    return [cell for cell in content["cells"] if cell["cell_type"] == kind]


def execute(sources: list[str]) -> tuple[dict[str, Any], list[Any]]:
    """Returns the names that the cells define, and the value that each cell shows."""
    names: dict[str, Any] = {"__name__": "__main__"}
    shown: list[Any] = []
    for number, source in enumerate(sources):
        where = f"{NOTEBOOK.name}, cell {number}"
        body = ast.parse(source, where).body
        last = body.pop() if body and isinstance(body[-1], ast.Expr) else None
        exec(compile(ast.Module(body, []), where, "exec"), names)
        if isinstance(last, ast.Expr):
            shown.append(eval(compile(ast.Expression(last.value), where, "eval"), names))
    return names, shown


@pytest.fixture
def executed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[dict[str, Any], list[Any]]:
    monkeypatch.setenv("SLAMBED_RESULTS", str(quickstart_like(tmp_path, 2, 6.0)))
    plt.close("all")
    return execute(["".join(cell["source"]) for cell in cells("code")])


def test_every_cell_runs_and_shows_what_the_results_are(
    executed: tuple[dict[str, Any], list[Any]],
) -> None:
    names, shown = executed
    tables = [value._repr_html_() for value in shown if hasattr(value, "_repr_html_")]
    assert len(tables) >= 5 and all("<table" in table for table in tables)
    assert len(names["results"].runs) == 8 and len(names["frames"]) > 100
    assert len(plt.get_fignums()) == 2 and all(plt.figure(n).axes[0].lines for n in (1, 2))
    plt.close("all")
    # The alignment in the notebook is the one behind the table's number.
    run = names["run"]
    assert names["rmse_m"] == pytest.approx(float(run.ate_rmse_m), rel=0.1)


def test_no_output_is_kept() -> None:
    assert len(cells("code")) >= 8
    for cell in cells("code"):
        assert cell["outputs"] == [] and cell["execution_count"] is None, cell["id"]
        assert not any(line.startswith(("%", "!")) for line in cell["source"]), cell["id"]
