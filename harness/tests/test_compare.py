# SPDX-License-Identifier: Apache-2.0
"""Published numbers: every file is whole, and verdicts say what the numbers say."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from slambed.errors import SlambedError
from slambed.report.compare import Comparison, compare_paper, tally
from slambed.report.load import Results
from slambed.report.lookup import pool_of
from slambed.report.paper_page import write_paper_page
from slambed.report.paper_runs import experiments_of
from slambed.report.papers import Paper, read_paper, read_papers
from slambed.report.peer import peer_tables
from slambed.report.published import comparisons_for

OFFICE = "fr3_long_office_household"


def runs_of(
    system: str, variant: str, profile: str | None, lost: int, runs: int, **more: Any
) -> Any:
    """Rows of summary.csv: `lost` of `runs` runs lose track."""
    return [
        {
            "run_key": f"{system}{variant}{profile}{more.get('dataset')}{i}{more.get('engine')}",
            "cell": f"{system}:{variant}/{profile}", "label": f"{system}:{variant}",
            "system": system, "variant": variant, "profile": profile, "dataset": OFFICE,
            "engine": "local", "link_backend": "relay" if system != "orbslam2" else None,
            "valid": True, "lost": i < lost, "wall_s": 87.0, "ate_rmse_m": 0.015 + 0.0001 * i,
            "coverage": 1.0, "repetition": i, "params.codec": "binary",
        } | more
        for i in range(runs)
    ]  # fmt: skip


def results_of(
    rows: list[dict[str, Any]], name: str = "made_up", reproduces: tuple[str, ...] = ("dynnetslam",)
) -> Results:
    return Results(Path(name), name, pd.DataFrame(rows), spec={"reproduces": list(reproduces)})


def verdicts(rows: list[Comparison], source: str) -> dict[tuple[str, str], Comparison]:
    return {(r.row, r.column): r for r in rows if r.source == source}


@pytest.fixture(scope="module")
def dynnetslam() -> Paper:
    return read_papers(["dynnetslam"])[0]


def test_all_papers_are_readable_and_complete() -> None:
    papers = {paper.id: paper for paper in read_papers()}
    assert set(papers) == {
        "cloudslam", "dynnetslam", "edgeslam_semantic", "multithread_rl", "peer_orbslam2",
    }  # fmt: skip
    cells = {
        name: sum(len(r.values) for t in p.tables for r in t.rows.values())
        for name, p in papers.items()
    }
    assert cells == {"cloudslam": 20, "dynnetslam": 110, "edgeslam_semantic": 45,
                     "multithread_rl": 96, "peer_orbslam2": 0}  # fmt: skip
    assert {n: len(p.claims) for n, p in papers.items()} == {
        "cloudslam": 38, "dynnetslam": 56, "edgeslam_semantic": 60, "multithread_rl": 28,
        "peer_orbslam2": 0,
    }  # fmt: skip
    for paper in papers.values():
        ids = [item.id for item in [*paper.tables, *paper.figures, *paper.claims]]
        assert len(ids) == len(set(ids))
        stated = {s for figure in paper.figures for s in figure.stated}
        assert stated <= {claim.id for claim in paper.claims}


def test_unknown_keys_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "p.yaml"
    path.write_text("id: p\nkind: paper\nauthor: me\n")
    with pytest.raises(SlambedError, match=r"p\.yaml"):
        read_paper(path)


def test_nothing_run_is_said_so(dynnetslam: Paper) -> None:
    rows = compare_paper(dynnetslam, pool_of([]))
    assert {row.verdict for row in rows} == {"not run"}
    assert all(row.reason for row in rows)
    assert len([r for r in rows if r.source.startswith("dynnet.T")]) == 110


def test_equal_shares_are_reproduced(dynnetslam: Paper) -> None:
    rows = [
        *runs_of("edgeslam", "static", "none", 0, 30),
        *runs_of("edgeslam", "static", "rtt_60", 15, 30),
        *runs_of("edgeslam", "conventional", "none", 23, 30),
        *runs_of("edgeslam", "conventional", "rtt_80", 30, 30),
    ]
    found = verdicts(compare_paper(dynnetslam, pool_of([results_of(rows)])), "dynnet.T2")
    assert found["Enh.", "0 ms"].verdict == "reproduced"
    assert found["Enh.", "60 ms"].verdict == "reproduced"
    assert found["Conv.", "0 ms"].verdict == "reproduced"
    cell = found["Conv.", "80 ms"]
    assert cell.verdict == "reproduced"
    assert cell.ours is not None
    assert cell.ours.value == 100.0
    assert found["Enh.", "20 ms"].verdict == "not run"
    assert "rtt_added_ms = 20" in found["Enh.", "20 ms"].reason


def test_other_values_in_the_same_order(dynnetslam: Paper) -> None:
    rows = [
        *runs_of("edgeslam", "static", "none", 10, 30),
        *runs_of("edgeslam", "static", "rtt_80", 15, 30),
        *runs_of("edgeslam", "conventional", "none", 28, 30, ate_rmse_m=0.03),
    ]
    found = verdicts(compare_paper(dynnetslam, pool_of([results_of(rows)])), "dynnet.T2")
    assert found["Enh.", "0 ms"].verdict == "same ordering"
    assert found["Enh.", "80 ms"].verdict == "same ordering"


def test_reversed_order_differs_and_says_against_what(dynnetslam: Paper) -> None:
    rows = [
        *runs_of("edgeslam", "static", "none", 29, 30),
        *runs_of("edgeslam", "conventional", "none", 1, 30),
    ]
    found = verdicts(compare_paper(dynnetslam, pool_of([results_of(rows)])), "dynnet.T2")
    assert found["Enh.", "0 ms"].verdict == "differs"
    assert found["Enh.", "0 ms"].reason == "ordering reversed against Conv., 0 ms"


def test_three_runs_reproduce_nothing(dynnetslam: Paper) -> None:
    rows = runs_of("edgeslam", "static", "none", 0, 3)
    cell = verdicts(compare_paper(dynnetslam, pool_of([results_of(rows)])), "dynnet.T2")
    assert cell["Enh.", "0 ms"].verdict == "not run"
    assert "3 runs are too few" in cell["Enh.", "0 ms"].reason


def test_a_stand_in_sequence_never_reproduces(dynnetslam: Paper) -> None:
    rows = [
        *runs_of("edgeslam", "static", "none", 0, 30, dataset="synthetic_office_10fps"),
        *runs_of("edgeslam", "conventional", "none", 23, 30, dataset="synthetic_office_10fps"),
    ]
    found = verdicts(compare_paper(dynnetslam, pool_of([results_of(rows)])), "dynnet.T2")
    assert found["Enh.", "0 ms"].verdict == "same ordering"
    assert "stand-in" in found["Enh.", "0 ms"].reason


def test_only_experiments_that_reproduce_a_table_count(dynnetslam: Paper) -> None:
    """A sensitivity study changes what the table does not name; text archives are a third thing."""
    own = runs_of("edgeslam", "static", "none", 0, 30)
    study = runs_of("edgeslam", "static", "none", 30, 30, engine="docker")
    text = runs_of("edgeslam", "static", "none", 30, 30, dataset=OFFICE) + own
    for row in text[:30]:
        row["params.codec"] = "compatibility"
        row["run_key"] += "text"
    pool = pool_of([
        results_of(text, reproduces=("dynnet.T2",)),
        results_of(study, "study", reproduces=("dynnet.T1",)),
        results_of(study, "other", reproduces=()),
    ])  # fmt: skip
    cell = verdicts(compare_paper(dynnetslam, pool), "dynnet.T2")["Enh.", "0 ms"]
    assert cell.ours is not None
    assert (cell.ours.value, cell.ours.count) == (0.0, 30)


def stand_in_of(dynnetslam: Paper, ate_rmse_m: float) -> Comparison:
    """Table 4 at one threshold (1.7 cm printed), on a generated sequence."""
    rows = runs_of(
        "dynnetslam", "wh_wosz", "sine", 0, 20, ate_rmse_m=ate_rmse_m,
        dataset="synthetic_office_10fps", **{"params.l_ol_ms": 30, "params.b_ms": 10},
    )  # fmt: skip
    found = compare_paper(dynnetslam, pool_of([results_of(rows)]))
    return verdicts(found, "dynnet.T4")["W-H/WO-SZ", "office 30"]


def test_the_same_number_on_a_stand_in_is_close(dynnetslam: Paper) -> None:
    published = stand_in_of(dynnetslam, 0.0).published
    cell = stand_in_of(dynnetslam, 1.09 * published / 100)
    assert (cell.verdict, cell.reason) == ("close", "within 10%; on a stand-in sequence")
    assert stand_in_of(dynnetslam, 1.12 * published / 100).verdict == "differs"
    assert tally([cell]) == "0 reproduced, 0 same ordering, 1 close, 0 differs, 0 not run"


def test_live_and_virtual_runs_are_never_mixed(dynnetslam: Paper) -> None:
    rows = [
        *runs_of("edgeslam", "static", "none", 0, 20),
        *runs_of("edgeslam", "static", "none", 20, 20, engine="virtual"),
    ]
    table = compare_paper(dynnetslam, pool_of([results_of(rows)]))
    own = [r for r in table if r.source == "dynnet.T2"]
    cells = {r.engine: r for r in own if (r.row, r.column) == ("Enh.", "0 ms")}
    assert cells["live"].ours is not None
    assert cells["virtual"].ours is not None
    assert (cells["live"].ours.value, cells["virtual"].ours.value) == (0.0, 100.0)


def test_parameters_and_survivors(dynnetslam: Paper) -> None:
    """Table 4 averages runs without a loss, at one threshold each."""
    rows = []
    for limit, ate in ((30, 0.017), (40, 0.0161)):
        params = {"params.l_ol_ms": limit, "params.b_ms": 10}
        rows += runs_of("dynnetslam", "wh_wosz", "sine", 2, 20, ate_rmse_m=ate, **params)
    for number, row in enumerate(rows):
        row["run_key"] = f"k{number}"
        if row["lost"]:
            row["ate_rmse_m"] = 9.0
    found = verdicts(compare_paper(dynnetslam, pool_of([results_of(rows)])), "dynnet.T4")
    thirty, forty = found["W-H/WO-SZ", "office 30"], found["W-H/WO-SZ", "office 40"]
    assert thirty.ours is not None
    assert thirty.ours.value == pytest.approx(1.7)
    assert thirty.ours.count == 18
    assert {thirty.verdict, forty.verdict} == {"reproduced"}
    assert found["W-H/WO-SZ", "office 50"].verdict == "not run"


def test_the_profile_does_not_matter_without_a_link(dynnetslam: Paper) -> None:
    rows = runs_of("orbslam2", "default", None, 12, 30)
    found = verdicts(compare_paper(dynnetslam, pool_of([results_of(rows)])), "dynnet.T3")
    assert found["WO Offloading", "office (no threshold)"].verdict == "reproduced"


def test_peer_ratios() -> None:
    peer = read_papers(["peer_orbslam2"])[0]
    rng = np.random.default_rng(1)
    rows = runs_of("orbslam2", "default", None, 0, 5, experiment="peer_redkitchen")
    for row in rows:
        row |= {"ate_rmse_m": 0.06 + 0.001 * rng.random(), "track_ms_median": 12 + rng.random()}
    tables = peer_tables(peer, pool_of([results_of(rows)]))
    assert len(tables) == 1
    cells = {row[0]: row for row in tables[0].rows}
    assert cells["ATE RMSE [cm]"][-1] == "met"
    assert cells["tracking, median [ms]"][-1] == "better"
    assert cells["mapping per keyframe, CPU [ms]"][-1] == "not run"


def test_an_experiment_shows_the_tables_it_reproduces(dynnetslam: Paper) -> None:
    rows = runs_of("edgeslam", "static", "none", 0, 30)
    results = results_of(rows, reproduces=("dynnet.T2", "dynnet.F9"))
    tables = comparisons_for(results)
    assert [table.name for table in tables] == ["compare_dynnetslam"]
    assert {row[0] for row in tables[0].rows} == {
        "dynnet.T2", "dynnet.C21", "dynnet.C22", "dynnet.C23", "dynnet.C24",
    }  # fmt: skip


def test_a_page_per_paper(dynnetslam: Paper, tmp_path: Path) -> None:
    rows = [
        *runs_of("edgeslam", "static", "none", 0, 30),
        *runs_of("edgeslam", "static", "rtt_60", 15, 30),
    ]
    page = write_paper_page(dynnetslam, [results_of(rows)], tmp_path)
    html = page.html.read_text()
    assert "Table 2 (Sec. III-C)" in html
    assert html.count("<figure ") == 2  # tables 1 and 2 have cells of ours
    assert 'src="http' not in html
    assert page.summary == tally(page.rows)
    assert (tmp_path / "dynnetslam" / "dynnet.T2.csv").exists()
    assert (tmp_path / "dynnetslam" / "tables" / "dynnet.T2.tex").exists()


def test_experiments_of_a_paper_are_those_that_reproduce_it(
    dynnetslam: Paper, tmp_path: Path
) -> None:
    (tmp_path / "d_t2_rtt.yaml").write_text("id: d_t2_rtt\nreproduces: [dynnet.T2]\n")
    (tmp_path / "other.yaml").write_text("id: other\n")
    assert experiments_of([dynnetslam], tmp_path) == ["d_t2_rtt"]
    with pytest.raises(SlambedError, match="no experiment"):
        experiments_of(read_papers(["cloudslam"]), tmp_path)
