# SPDX-License-Identifier: Apache-2.0
"""The page of a paper: the same verdicts as HTML, Markdown, LaTeX and twelve lines of text."""

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from test_compare import DOCUMENTED, PAPER_CONVENTIONAL, PAPER_ENHANCED, results_of, table_2

from slambed.errors import SlambedError
from slambed.report import paper_view
from slambed.report.load import Results
from slambed.report.paper_page import PaperPage, write_overview, write_paper_page
from slambed.report.paper_view import twelve_lines
from slambed.report.papers import Paper, read_papers


class Anchors(HTMLParser):
    """Ids and links of a page; complains about a tag that is not closed."""

    def __init__(self) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.links: list[str] = []
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        self.ids += [str(found["id"])] if "id" in found else []
        self.links += [str(found["href"])] if tag == "a" else []
        if tag not in ("meta", "link", "br", "img"):
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        pass

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def dynnetslam() -> Paper:
    return read_papers(["dynnetslam"])[0]


@pytest.fixture(scope="module")
def experiments() -> list[Results]:
    lost = {"conventional": PAPER_CONVENTIONAL, "static": PAPER_ENHANCED}
    virtual = table_2(lost, 100, engine="virtual")
    live = table_2(DOCUMENTED, 10, dataset="synthetic_fr3_path")
    for results, name in ((virtual, "virtual_t2"), (live, "live_t2")):
        results.folder = Path(name)
        results.runs["seed"] = results.runs["repetition"] + 7
    return [virtual, live]


@pytest.fixture(scope="module")
def page(
    dynnetslam: Paper, experiments: list[Results], tmp_path_factory: pytest.TempPathFactory
) -> PaperPage:
    return write_paper_page(dynnetslam, experiments, tmp_path_factory.mktemp("pages"))


def test_every_mark_leads_to_its_number(page: PaperPage) -> None:
    html = page.html.read_text()
    found = Anchors()
    found.feed(html)
    assert not found.open
    assert len(found.ids) == len(set(found.ids))
    inner = {link[1:] for link in found.links if link.startswith("#")}
    assert inner <= set(found.ids)
    assert page.verdicts is not None
    for name in page.verdicts.cells:
        assert f"v-{name}" in found.ids
    assert "v-dynnet.T2.enhanced.rtt60" in inner
    assert "../index.html" not in found.links  # nothing points to a page that was not written
    assert 'src="http' not in html and "<script" not in html


def test_a_number_tells_runs_rule_and_place(page: PaperPage) -> None:
    html = page.html.read_text()
    entry = html[html.index('id="v-dynnet.T2.enhanced.rtt60"') :].split("</tr>")[0]
    assert "48 %" in entry
    assert "48 (48/100)" in entry
    assert "Newcombe" in entry
    assert "Margin 15 points" in entry
    narrow = html[html.index('id="v-dynnet.T2.enhanced.rtt80"') :].split("</tr>")[0]
    assert "Margin 13.5 points" in narrow  # half of 73 against 100
    assert "and 95 more" in entry
    assert "virtual_t2/runs/" in entry
    assert "Sec. III-C" in entry
    assert "synthetic_fr3_path" in entry  # the live column, on a stand-in


def test_bars_are_out_of_all_numbers(page: PaperPage) -> None:
    assert page.verdicts is not None
    html = page.html.read_text()
    for column in page.verdicts.columns:
        for _, _, ids in page.verdicts.groups():
            assert sum(column.marks(ids).values()) == len(ids)
    widths = re.findall(r'<div class="bar".*?</div>', html, re.S)
    assert len(widths) == 2 * len(page.verdicts.groups())
    for bar in widths:
        assert sum(map(float, re.findall(r"width: ([\d.]+)%", bar))) == pytest.approx(100, abs=0.1)


def test_claims_come_before_numbers_and_engines_stay_apart(page: PaperPage) -> None:
    html = page.html.read_text()
    assert html.index("Main claims") < html.index("<h2>Numbers") < html.index("Why not more")
    assert "never summed" in html
    assert "HOLDS" in html
    assert "same ordering" not in html
    assert re.search(r"\d+ not judged \([^)]*\d+ settings or twice there", html)
    assert "seeds\n7 to 106" in html


def test_twelve_lines_say_the_same(page: PaperPage, experiments: list[Results]) -> None:
    assert page.verdicts is not None
    lines = twelve_lines(page.verdicts, experiments)
    assert lines == page.lines
    assert len(lines) <= 12 * len(page.verdicts.columns)
    assert any(line.startswith("[HOLDS]") for line in lines)
    assert any("never" not in line and "reproduced" in line for line in lines)
    markdown = page.markdown.read_text()
    assert all(line in markdown for line in lines)


def test_latex_and_csv_of_every_table(page: PaperPage) -> None:
    names = {path.name for path in (page.html.parent / "tables").iterdir()}
    for part in ("counts", "orderings", "numbers"):
        for engine in ("virtual", "live"):
            assert f"dynnetslam_{part}_{engine}.tex" in names
            assert f"dynnetslam_{part}_{engine}.csv" in names


def test_one_page_over_all_papers(
    dynnetslam: Paper, experiments: list[Results], tmp_path: Path
) -> None:
    papers = [p for p in read_papers() if p.kind == "paper"]
    pages = [write_paper_page(paper, experiments, tmp_path, overview=True) for paper in papers]
    html = write_overview(
        [p.verdicts for p in pages if p.verdicts is not None], experiments, tmp_path
    ).read_text()
    found = Anchors()
    found.feed(html)
    assert not found.open
    for link in found.links:
        assert (tmp_path / link.partition("#")[0]).exists()
    assert html.count("no runs yet") == len(papers) - 1
    assert html.count("Nothing was run yet") == len(papers) - 1
    assert html.count("printed numbers reproduced") == 2  # dynnetslam has two engines
    assert "not run yet; slambed paper cloudslam" in html


def test_a_paper_without_runs_has_a_page_too(tmp_path: Path) -> None:
    paper = read_papers(["cloudslam"])[0]
    page = write_paper_page(paper, [results_of([], reproduces=())][:0], tmp_path)
    assert "no runs yet" in page.html.read_text()
    assert "NOT RUN" in page.html.read_text()


def test_no_command_is_named_where_no_experiment_makes_the_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def none(papers: list[Paper]) -> list[str]:
        raise SlambedError("no experiment")

    monkeypatch.setattr(paper_view, "experiments_of", none)
    html = write_paper_page(read_papers(["cloudslam"])[0], [], tmp_path).html.read_text()
    assert "not run yet, and no experiment makes these runs" in html
    assert "slambed paper cloudslam" not in html


def test_one_assumption_of_many_numbers_stands_there_once() -> None:
    spread = "spread in the paper as ours"
    told = [f"{spread} (67%)", "n = 5 in the paper", f"{spread} (8%)", f"{spread} (90%)"]
    assert paper_view.in_short(told) == [f"{spread} (8 to 90 %)", "n = 5 in the paper"]
    assert paper_view.in_short(told[:2]) == [f"{spread} (67 %)", "n = 5 in the paper"]
