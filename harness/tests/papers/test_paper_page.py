# SPDX-License-Identifier: Apache-2.0
"""The page of a paper: the same verdicts as HTML, Markdown, LaTeX and text."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from markupsafe import escape
from test_compare import DOCUMENTED, PAPER_CONVENTIONAL, PAPER_ENHANCED, results_of, table_2

from slambed.errors import SlambedError
from slambed.papers import compare, paper_view
from slambed.papers.codes import spelled
from slambed.papers.compare import compare_paper
from slambed.papers.fits import DeviceFit
from slambed.papers.judged import Judged
from slambed.papers.lookup import Found, pool_of
from slambed.papers.measured import Measured
from slambed.papers.orderings import outcome_of
from slambed.papers.paper_claims import claim_groups, claim_lines, in_short
from slambed.papers.paper_page import PaperPage, write_overview, write_paper_page
from slambed.papers.paper_view import terminal_lines
from slambed.papers.published import Paper, cells_of, read_papers
from slambed.papers.reasons import count_json, count_table, reason_of
from slambed.papers.strip import strip_svg
from slambed.papers.verdicts.means import Kind, judge_mean
from slambed.papers.verdicts.model import Mean
from slambed.report.load import Results


class Anchors(HTMLParser):
    """Collects ids and links of a page, and fails for a tag that is not closed."""

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


def test_of_an_engine_that_played_less_only_that_is_said(dynnetslam: Paper) -> None:
    """A few live runs are no statement about all orderings of the paper."""
    both = {"conventional": PAPER_CONVENTIONAL, "static": PAPER_ENHANCED}
    virtual = table_2(both, 100, engine="virtual")
    live = table_2({"conventional": PAPER_CONVENTIONAL}, 100)
    live.folder = Path("live_t2")
    verdicts = compare_paper(dynnetslam, pool_of([virtual, live]))
    said = {
        column.engine: [found.says for found in paper_view.headline(verdicts, column)]
        for column in verdicts.columns
    }
    assert " judged" in said["virtual"][-1] and "of 24 orderings" in " ".join(said["virtual"])
    assert "that was played" in said["live"][0] or "that were played" in said["live"][0]
    assert said["live"][-1] == "6 printed numbers have a number of ours next to them."


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
    assert "../index.html" not in found.links  # no link to a page that was not written
    assert 'src="http' not in html and "<script" not in html


def test_a_number_reports_runs_rule_and_place(page: PaperPage) -> None:
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
    why_not = html[html.index("Why not more") :]
    assert re.search(
        r"synthetic_fr3_path is played instead of [\w]+: numbers of the two cannot be compared; "
        "get it with .{1,6}slambed data download",
        why_not,
    )


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
    claims = html[html.index("Main claims") : html.index("<h2>Numbers")]
    outcomes = re.findall(r'<p class="one">.*?</span>\n<span>(<b>live</b>|.{11})', claims)
    assert set(outcomes) == {"<b>virtual<", "<b>live</b>"}
    assert "HOLDS" in html
    assert "same ordering" not in html
    assert re.search(r"Of 163 printed numbers \d+ are judged: \d+ reproduced, ", html)
    assert "(seeds 7 to 106)" in html


def test_what_holds_without_being_evidence_looks_like_none(page: PaperPage) -> None:
    """Covers the paper's own sequence, a stand-in, cells that a device was fitted to, and cells
    that were only partly run."""
    assert page.verdicts is not None
    badges = {
        c.engine: {line.anchor: (line.badge, line.style) for line in claim_lines(c)}
        for c in page.verdicts.columns
    }
    assert badges["virtual"]["dynnet.O03"] == ("HOLDS", "holds")
    assert badges["virtual"]["dynnet.O01"] == ("RUN, EVENTS NOT KEPT", "no_events")
    assert badges["virtual"]["dynnet.O20"] == ("NOT RUN", "not_run")
    lost = {"conventional": PAPER_CONVENTIONAL, "static": PAPER_ENHANCED}
    stand_in = table_2(lost, 100, dataset="synthetic_fr3_path")
    half = results_of(
        [row for row in stand_in.runs.to_dict("records") if row["variant"] != "static"]
    )
    fitted = table_2(lost, 100, device_mobile="pi")
    fit = DeviceFit("a_fit", ("dynnet.T2.*",), frozenset(["pi"]))
    found = {}
    for name, results, fits in (
        ("stand-in", stand_in, []), ("half", half, []), ("fitted", fitted, [fit])
    ):  # fmt: skip
        verdicts = compare_paper(page.verdicts.paper, pool_of([results]), fits)
        column = verdicts.columns[0]
        line = next(c for c in claim_lines(column) if c.anchor == "dynnet.O03")
        found[name] = (line.badge, line.style)
        reported = paper_view.headline(verdicts, column)[0]
        assert reported.says.startswith(
            "On the paper's own sequences" if name == "fitted" else "On generated sequences"
        )
        counted = [item.says for item in reported.rest]
        assert ("numbers set to match" in " ".join(counted)) == (name == "fitted")
        outcomes = [outcome_of(item) for item in column.orderings]
        counts = re.findall(r"\d+", " ".join([reported.says, *counted]))
        assert sum(map(int, counts)) == 2 * len(outcomes)
    assert found == {
        "stand-in": ("HOLDS ON A SUBSTITUTE SEQUENCE", "holds weak"),
        "half": ("NOT ALL RUN", "half_run"),
        "fitted": ("HOLDS (FITTED, NO EVIDENCE)", "holds weak fitted"),
    }


def test_where_nothing_could_be_compared_nothing_is_said_to_agree_or_differ(
    dynnetslam: Paper,
) -> None:
    lost = {"conventional": PAPER_CONVENTIONAL, "static": PAPER_ENHANCED}
    stand_in = table_2(lost, 100, dataset="synthetic_fr3_path")
    verdicts = compare_paper(dynnetslam, pool_of([stand_in]), [])
    column = verdicts.columns[0]
    reported = paper_view.headline(verdicts, column)[1]
    marks = column.marks(list(column.rows))
    assert not marks["R"] + marks["D"] + marks["I"]
    assert reported.says == "Of 163 printed numbers none is judged."
    assert [item.says for item in reported.rest[:2]] == [
        f"{marks['S']} are shown beside ours, not judged",
        f"{marks['P']} are settings or repeated",
    ]
    assert sum(int(item.says.split()[0]) for item in reported.rest) == 163
    lines = " ".join(terminal_lines(verdicts, [stand_in]))
    for word in ("reproduced", "differ", "inconclusive"):
        assert word not in " ".join(reported.lines) and f"0 {word}" not in lines
    some = compare_paper(dynnetslam, pool_of([table_2(lost, 100)]), [])
    reported = paper_view.headline(some, some.columns[0])[1]
    found = re.fullmatch(
        r"Of 163 printed numbers (1\d) are judged: (\d+) reproduced, (\d+) different, "
        r"(\d+) inconclusive\.",
        reported.says,
    )
    assert found is not None
    judged, *parts = map(int, found.groups())
    assert judged == sum(parts) == 163 - sum(int(item.says.split()[0]) for item in reported.rest)


def test_of_several_pairs_those_that_do_not_hold_are_named(
    dynnetslam: Paper, tmp_path: Path
) -> None:
    lost = {"conventional": [60, 60, 30, 30, 90], "static": [5, 5, 31, 30, 5]}
    results = table_2(lost, 100)
    page = write_paper_page(dynnetslam, [results], tmp_path)
    assert page.verdicts is not None
    lines = {c.anchor: c for c in claim_lines(page.verdicts.columns[0])}
    claim = lines["dynnet.O03"]
    assert (claim.badge, claim.pairs) == ("NOT SHOWN IN FULL", "3 of 5 pairs hold")
    assert "31/100 > conventional" in claim.ours and "weakest of 5 pairs" in claim.ours
    assert ["30/100 = " in pair.ours for pair in claim.failing] == [True]
    assert claim.failing[0].where == "office, rtt_added_ms 60"
    assert claim.other_pairs == "the other 4 pairs, 1 not holding"
    html = page.html.read_text()
    entry = html[html.index('<li id="dynnet.O03">') :].split("</details>")[0]
    assert entry.index("3 of 5 pairs hold") < entry.index("31/100") < entry.index("<details")
    assert entry.count("<li>") == 4 and entry.index("not shown") < entry.index("<li>holds")
    assert re.search("<b>NOT SHOWN BY OURS</b>: our runs do not show it .* at least 90 %", html)
    headline = paper_view.headline(page.verdicts, page.verdicts.columns[0])[0]
    assert any(" not shown by ours" in item.says for item in headline.rest)
    reported = next(
        line
        for line in page.lines
        if "dynnet" not in line and line.startswith("[NOT SHOWN IN FULL")
    )
    assert "; 3 of 5 pairs hold; would have shown with a chance of 100 %; nor do " in reported
    table = (page.html.parent / "tables" / "dynnetslam_pairs_live.csv").read_text()
    assert table.count("dynnet.O03,") == 5
    orderings = (page.html.parent / "tables" / "dynnetslam_orderings_live.csv").read_text()
    row = next(line for line in orderings.splitlines() if line.startswith("dynnet.O03,"))
    assert ",not shown in full," in row and row.endswith("3 of 5 pairs hold")


def test_what_the_paper_does_not_show_does_not_hide_what_ours_show(
    dynnetslam: Paper, tmp_path: Path
) -> None:
    """The paper's numbers show the opposite of this ordering, so they do not show it."""
    turned = next(c for c in dynnetslam.contrasts if c.id == "dynnet.O03")
    turned = turned.model_copy(
        update={"direction": "falls" if turned.direction == "rises" else "rises", "main": False}
    )
    main = next(c for c in dynnetslam.contrasts if c.id == "dynnet.O04")
    paper = dynnetslam.model_copy(update={"contrasts": [main, turned]})

    def shown(lost: dict[str, list[int]], name: str) -> tuple[list[str], list[str], str]:
        page = write_paper_page(paper, [table_2(lost, 100)], tmp_path / name)
        assert page.verdicts is not None
        column = page.verdicts.columns[0]
        groups = {
            g.outcome: [line.pairs for line in g.lines] for g in claim_groups(page.verdicts, column)
        }
        listed = sum(len(g.lines) + g.more for g in claim_groups(page.verdicts, column))
        assert listed == len(column.orderings), "every ordering is listed or counted"
        assert column.orderings[1].kind == "not_shown_by_paper"
        html = page.html.read_text()
        more = html[html.index("<summary>1 more ordering of the paper</summary>") :]
        assert '<li id="dynnet.O03">' in more.partition("</section>")[0]
        found = paper_view.headline(page.verdicts, column)[0]
        for item in found.rest:
            assert f"<li>{escape(item.says)}" in html and f"- {item.says}" in page.lines
            for line in item.single:
                assert f"<li>{escape(line)}</li>" in html and f"  - {line}" in page.lines
        lines = [line for item in found.rest for line in item.lines]
        return lines, groups.get("unshown", []), html

    mixed = {"conventional": [60, 60, 60, 5, 5], "static": [5, 5, 30, 60, 60]}
    headline, groups, html = shown(mixed, "mixed")
    both = "ours: holds in 2 and reversed in 3 of 5 pairs"
    assert groups == [both] and f"<b>{both}</b>" in html
    unshown = "- 1 is not shown by the paper's own numbers"
    assert headline == [unshown, f'  - "{turned.says}" (O03), {both}']

    headline, groups, _ = shown({"conventional": [5] * 5, "static": [60] * 5}, "holding")
    assert groups == ["ours: holds"] and headline[-1].endswith("(O03), ours: holds")
    headline, groups, html = shown({"conventional": [5] * 5, "static": [5] * 5}, "equal")
    assert groups == [] and headline[-1] == unshown
    assert "<b>ours: not shown either</b>" in html


def test_where_ours_cannot_differ_the_page_says_why(dynnetslam: Paper, tmp_path: Path) -> None:
    def shown(lost: dict[str, list[int]]) -> tuple[dict[str, str], PaperPage]:
        page = write_paper_page(dynnetslam, [table_2(lost, 100)], tmp_path)
        assert page.verdicts is not None
        lines = claim_lines(page.verdicts.columns[0], every=True)
        cannot = [line for line in lines if line.pairs.endswith("nothing to compare")]
        assert not any("would have shown" in line.note + line.chance for line in cannot)
        return {line.anchor.partition(".")[2]: line.pairs for line in lines}, page

    never = "no run of ours lost track: nothing to compare"
    floor, page = shown({"conventional": [0] * 5, "static": [0] * 5})
    assert floor["O03"] == f"0 of 5 pairs hold; {never}"
    assert floor["O04"] == floor["O05"] == never
    html = page.html.read_text()
    assert html.count(f"<b>{never}</b>") == 2 and any(never in line for line in page.lines)
    entry = html[html.index('id="v-dynnet.T2.enhanced.rtt60"') :].split("</tr>")[0]
    assert "0 (0/100)" in entry and "; no run of ours lost track" in entry
    assert page.verdicts is not None
    reported = paper_view.headline(page.verdicts, page.verdicts.columns[0])[0]
    assert [li for item in reported.rest for li in item.single] == [f"in each of them: {never}"]
    always, _ = shown({"conventional": [100] * 5, "static": [100] * 5})
    assert always["O04"] == "every run of ours lost track: nothing to compare"
    some, page = shown({"conventional": [60, 60, 60, 0, 0], "static": [5, 5, 5, 0, 0]})
    where = "in 2 of 5 pairs no run of ours lost track: nothing to compare there"
    assert some["O03"] == f"3 of 5 pairs hold; {where}"
    assert "; would have shown with a chance of " in "".join(page.lines)
    equal, _ = shown({"conventional": [5] * 5, "static": [5] * 5})
    assert "nothing to compare" not in " ".join(equal.values())


def test_what_a_reader_must_know_of_an_ordering_stands_beside_it(
    dynnetslam: Paper, tmp_path: Path
) -> None:
    results = table_2({"conventional": [5] * 5, "static": [5] * 5}, 10)
    page = write_paper_page(dynnetslam, [results], tmp_path)
    assert page.verdicts is not None
    lines = {c.anchor: c for c in claim_lines(page.verdicts.columns[0], every=True)}
    told = [contrast for contrast in dynnetslam.contrasts if contrast.note]
    assert "dynnet.O20" in {contrast.id for contrast in told}
    for contrast in told:
        assert contrast.note.removesuffix(".") in lines[contrast.id].note


def test_too_few_runs_say_how_many_would_decide(dynnetslam: Paper, tmp_path: Path) -> None:
    results = table_2({"conventional": [2, 2, 3, 3, 3], "static": [1, 2, 2, 3, 2]}, 10)
    page = write_paper_page(dynnetslam, [results], tmp_path)
    assert page.verdicts is not None
    lines = {c.anchor: c for c in claim_lines(page.verdicts.columns[0])}
    claim = lines["dynnet.O03"]
    assert (claim.badge, claim.chance) == (
        "INCONCLUSIVE, TOO FEW RUNS",
        "30 runs of each combination would decide",
    )
    assert claim.chance in claim.line and claim.chance in claim.note
    defined = "<b>INCONCLUSIVE, TOO FEW RUNS</b>: our runs do not show it, and may well have missed"
    assert defined in page.html.read_text()


def test_reasons_beyond_the_largest_are_counted_and_listed(
    dynnetslam: Paper, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(paper_view, "REASONS", 2)
    page = write_paper_page(dynnetslam, [table_2({"static": PAPER_ENHANCED}, 100)], tmp_path)
    assert page.verdicts is not None
    column = page.verdicts.columns[0]
    gaps = paper_view.why_not(page.verdicts, column)
    counts = [int(line.split()[0]) for line in (*gaps.reasons, *gaps.rest)]
    marks = column.marks(list(column.rows))
    assert sum(counts) == sum(marks[m] for m in "NEFSI")
    assert gaps.numbers == sum(counts[2:]) > 0 and counts == sorted(counts, reverse=True)
    assert gaps.more == "and 1 more reason (1 number)"
    assert replace(gaps, rest=["", ""], numbers=3).more == "and 2 more reasons (3 numbers)"
    assert replace(gaps, rest=[], numbers=0).more == ""
    assert f"{gaps.more} on the page" in page.lines
    html = page.html.read_text()
    hidden = html[html.index(f"<summary>{gaps.more}</summary>") :].split("</details>")[0]
    assert hidden.count("<li>") == len(gaps.rest)


def test_a_fitted_number_that_is_far_off_shows_it_in_its_table(
    dynnetslam: Paper, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fit = DeviceFit("a_fit", ("dynnet.T2.*",), frozenset(["pi"]))
    monkeypatch.setattr(compare, "read_fits", lambda: [fit])
    lost = {"static": [*PAPER_ENHANCED[:4], 0]}
    html = write_paper_page(
        dynnetslam, [table_2(lost, 100, device_mobile="pi")], tmp_path
    ).html.read_text()
    far = "fitted, yet 73 points below the printed value"
    assert html.count(f"<small>{far}</small>") == 1
    assert "fitted: set to match, no evidence" in html  # the legend
    assert "set to match a published value; no evidence" in html


def test_runs_per_number_are_those_played(dynnetslam: Paper) -> None:
    """The count is not limited to runs with a number: the ATE of runs without a loss is out of all
    runs."""
    lost = {"conventional": PAPER_CONVENTIONAL, "static": PAPER_ENHANCED}
    results = table_2(lost, 100, ate_rmse_m=0.01)
    verdicts = compare_paper(dynnetslam, pool_of([results]), [])
    line = paper_view.circumstance(verdicts, verdicts.columns[0], [results]).line
    assert ", 100 runs per number" in line


def test_the_terminal_says_the_same(page: PaperPage, experiments: list[Results]) -> None:
    assert page.verdicts is not None
    lines = terminal_lines(page.verdicts, experiments)
    assert lines == page.lines
    assert len(lines) <= 24 * len(page.verdicts.columns)
    assert any(line.startswith("[HOLDS]") for line in lines)
    assert any("never" not in line and "reproduced" in line for line in lines)
    assert any(re.search(r"\d/\d+ runs", line) for line in lines)
    assert not any(re.search(r"\d/\d+ %", line) for line in lines)  # a count is no percentage
    assert not any("download None" in line for line in lines)
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
    assert html.count("Nothing is played yet") == len(papers) - 1
    assert html.count("are judged: ") == 1  # the virtual column is on the paper's own sequence
    held = html[html.index('class="outcome hold"') :].split("</ul>")[0]
    assert "Enhanced Edge-SLAM loses track less often than conventional at every RTT" in held
    assert html.count('<svg class="strip"') == 2
    for paper in papers:
        for contrast in (c for c in paper.contrasts if c.main):
            assert str(escape(contrast.says)) in html
    head, *rows = re.findall("<tr>(.*?)</tr>", html.partition("</table>")[0], re.DOTALL)
    assert "orderings played" in re.sub(r"\s+", " ", head)
    cells = [re.findall("<td[^>]*>(?:<a[^>]*>)?([^<]*)", row) for row in rows]
    of_paper = {row[1]: list(map(int, row[2:])) for row in cells if row[0] == "DynNetSLAM"}
    assert set(of_paper) == {"virtual", "live"}
    for played, hold, reverse, neither, printed, judged, reproduced in of_paper.values():
        assert played == hold + reverse + neither and printed == 163 and reproduced <= judged
    assert of_paper["virtual"][5] > 9 > of_paper["live"][5] == 0
    words = re.sub(r"<[^>]*>", " ", html.partition("</style>")[2])
    assert not re.search(r"\b[OC]\d\d\b", words)  # no code without its sentence


def test_a_code_stands_beside_its_sentence(dynnetslam: Paper) -> None:
    text = spelled(
        "as O03, dynnet.C24 and dynnet.T2.enhanced.rtt60; i7, T2 and X99 stay", dynnetslam
    )
    says = next(c.says for c in dynnetslam.contrasts if c.id == "dynnet.O03")
    assert text.startswith(f'as "{says}" (O03), "track loss ratio, ')
    assert '" (C24) and Table 2 (' in text
    assert text.endswith("; i7, T2 and X99 stay")


def test_a_number_on_a_stand_in_has_a_place_and_is_drawn_lighter(
    dynnetslam: Paper, tmp_path: Path
) -> None:
    lost = {"conventional": PAPER_CONVENTIONAL, "static": PAPER_ENHANCED}
    stand_in = table_2(lost, 100, dataset="synthetic_fr3_path")
    html = write_paper_page(dynnetslam, [stand_in], tmp_path).html.read_text()
    table = html[html.index('id="dynnet.T2"') :].split("</table>")[0]
    assert "<small>as printed</small>" in table
    assert html.count('class="light"') > 9 and '<rect class="band"' not in html
    own = write_paper_page(dynnetslam, [table_2(lost, 100)], tmp_path).html.read_text()
    assert '<rect class="band"' in own


def judged_mean(values: list[float], kind: Kind, margin: float) -> Judged:
    """Returns an execution time of ours compared with the printed 55 ms."""
    cell = cells_of(read_papers(["multithread_rl"])[0])["ijnc.T3.execution_time.dT_LR"]
    ours = Measured(Found(None, None, ""), np.array(values))
    return Judged(cell, "measured", judge_mean(ours.mean, Mean(55.0), margin, kind), ours, "")


def test_a_margin_is_drawn_only_on_the_axis_of_its_verdict() -> None:
    whole = judged_mean([54.0, 55.0, 56.0, 57.0, 58.0], "ratio", 0.2)
    few = judged_mean([54.0, 55.0], "ratio", 0.2)
    in_ms = judged_mean([54.0, 55.0, 56.0, 57.0, 58.0], "difference", 0.01)
    band = r'<rect class="band" x="[\d.]+" y="[\d.-]+" width="([\d.]+)"'
    alone = re.findall(band, strip_svg([whole], ""))
    assert len(alone) == 1 and float(alone[0]) > 0
    for rows in ([few, whole], [whole, few], [in_ms, whole]):
        assert re.findall(band, strip_svg(rows, "")) == alone
    assert '<rect class="band"' not in strip_svg([in_ms], "")


def test_numbers_without_one_of_ours_are_counted_by_reason(experiments: list[Results]) -> None:
    papers = [p for p in read_papers() if p.kind == "paper"]
    pages = [compare_paper(paper, pool_of(experiments)) for paper in papers]
    counts = count_json(pages)
    for verdicts in pages:
        own = counts[verdicts.paper.id]
        assert sum(own["groups"].values()) == own["printed"] == len(verdicts.cells)
        assert sum(own["without"].values()) == own["groups"]["none"] == len(own["numbers"])
        assert all(number["why"] for number in own["numbers"])
    fields = [c for c in papers[2].claims if c.reason == "field_study" and c.kind == "result"]
    assert papers[2].id == "edgeslam_semantic"
    assert counts["edgeslam_semantic"]["without"]["field_study"] == len(fields) > 10
    assert counts["cloudslam"]["without"]["recording"] > 0  # KITTI, which nothing stands in for
    table = count_table(pages)
    printed, judged = table.rows[:2]
    assert sum(map(int, printed[1:-1])) == int(printed[-1]) == 433
    assert int(judged[table.headings.index("dynnetslam")]) > 9


def test_a_number_that_only_the_other_kind_of_runs_has_is_not_called_not_played(
    dynnetslam: Paper, tmp_path: Path
) -> None:
    both = {"conventional": PAPER_CONVENTIONAL, "static": PAPER_ENHANCED}
    live = table_2({"static": PAPER_ENHANCED}, 100)
    live.folder = Path("live_t2")
    page = write_paper_page(dynnetslam, [live, table_2(both, 100, engine="virtual")], tmp_path)
    assert page.verdicts is not None
    reasons = {}
    for column in page.verdicts.columns:
        gaps = paper_view.why_not(page.verdicts, column)
        reasons[column.engine] = [line.split(": ", 1)[1] for line in (*gaps.reasons, *gaps.rest)]
    assert "played in virtual time only" in reasons["live"]
    assert "played live only" not in reasons["virtual"] + reasons["live"]
    assert any(line.startswith("not played yet; slambed") for line in reasons["virtual"])
    own = count_json([page.verdicts])["dynnetslam"]["without"]
    assert "live" not in own and own["not_played"] > 0


def test_runs_that_all_lost_track_were_played(dynnetslam: Paper) -> None:
    """The other kind of runs has the number; that is not why this one has none."""
    both = {"conventional": PAPER_CONVENTIONAL, "static": PAPER_ENHANCED}
    live, virtual = table_2(both, 100), table_2(both, 100, engine="virtual")
    live.folder = Path("live_t2")
    for results in (live, virtual):
        results.runs["ate_rmse_m"] = 0.01
    virtual.runs["lost"] = True
    verdicts = compare_paper(dynnetslam, pool_of([live, virtual]))
    column = verdicts.columns[0]
    assert column.engine == "virtual"
    reasons = {
        (reason_of(verdicts, column, row), row.why)
        for row in column.rows.values()
        if row.why == "every run lost track"
    }
    assert reasons == {("not_measured", "every run lost track")}


def test_an_ordering_that_only_the_other_kind_of_runs_shows_is_counted_as_played_there(
    dynnetslam: Paper,
) -> None:
    live = table_2({"static": PAPER_ENHANCED}, 100)
    live.folder = Path("live_t2")
    virtual = table_2({"conventional": PAPER_CONVENTIONAL}, 100, engine="virtual")
    verdicts = compare_paper(dynnetslam, pool_of([live, virtual]))
    column = verdicts.columns[1]
    assert column.engine == "live"
    said = [item.says for item in paper_view.headline(verdicts, column)[0].rest]
    assert "1 was played in virtual time only" in said  # O05
    assert "2 are not all run" in said  # O03 and another one need both variants
    assert "14 have no number of ours" in said
    groups = {g.heading: g for g in claim_groups(verdicts, column)}
    only = groups["Played in virtual time only"]
    assert len(only.lines) + only.more == 1
    listed = groups["Not all run"]
    assert len(listed.lines) + listed.more == 2
    (row,) = [row for row in paper_view.summary_rows(verdicts) if row.runs == "live"]
    assert (row.orderings, row.hold, row.neither) == (3, 1, 2)


def test_the_headline_says_where_orderings_hold_on_few_frames(dynnetslam: Paper) -> None:
    both = {"conventional": PAPER_CONVENTIONAL, "static": PAPER_ENHANCED}
    results = table_2(both, 100)
    for coverage, expected in ((0.148, True), (0.9, False)):
        results.runs["coverage"] = coverage
        verdicts = compare_paper(dynnetslam, pool_of([results]))
        found = paper_view.headline(verdicts, verdicts.columns[0])[0]
        said = [item.says for item in found.rest if "our runs tracked" in item.says]
        words = "in each of those that hold our runs tracked at most 15 % of their frames"
        assert said == ([words] if expected else [])


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
    assert "not played yet, and no experiment makes these runs" in html
    assert "slambed papers run cloudslam" not in html


def test_one_assumption_of_many_numbers_stands_there_once() -> None:
    spread = "spread in the paper as ours"
    reported = [f"{spread} (67%)", "n = 5 in the paper", f"{spread} (8%)", f"{spread} (90%)"]
    assert in_short(reported) == [f"{spread} (8 to 90 %)", "n = 5 in the paper"]
    assert in_short(reported[:2]) == [f"{spread} (67 %)", "n = 5 in the paper"]


@pytest.mark.parametrize(
    "paper", [p for p in read_papers() if p.kind == "paper"], ids=lambda paper: paper.id
)
def test_a_page_reports_the_year_once(paper: Paper, tmp_path: Path) -> None:
    page = write_paper_page(paper, [], tmp_path)
    (lead,) = re.findall(r'<p class="lead">(.*?)\n', page.html.read_text())
    assert lead.count(str(paper.paper.year)) == 1 and lead.endswith(f"{paper.paper.year}.")
