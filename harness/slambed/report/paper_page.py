# SPDX-License-Identifier: Apache-2.0
"""One page per paper: every published number beside ours, and where our runs are."""

import base64
import os
from dataclasses import dataclass
from pathlib import Path

import jinja2
import pandas as pd

from slambed.report.compare import Comparison, compare_paper, comparison_table, tally
from slambed.report.experiment import write_tables
from slambed.report.load import Results
from slambed.report.lookup import pool_of
from slambed.report.page import STYLE
from slambed.report.papers import Paper
from slambed.report.peer import peer_tables
from slambed.report.style import COLOURS, FigureWriter, SavedFigure, figure, file_name
from slambed.report.tables import Table

PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,"><title>{{ paper.paper.title }} - slambed</title>
<style>{{ style }}
.reproduced, .met, .better { color: var(--good); } .differs, .missed { color: var(--bad); }
</style></head><body>
<header><h1>{{ paper.paper.title }}</h1>
<p class="lead">{{ paper.paper.authors | join(", ") }}. {{ paper.paper.venue }}, {{ paper.paper.year
}}.</p></header>
<section><h2>Summary</h2><p><b>{{ summary }}</b></p>
<p class="soft">A number is <i>reproduced</i> when it and ours cannot be told apart (shares:
Fisher's test; means: overlapping intervals, or within 10 %) and ours is narrow enough to tell;
<i>same ordering</i> when that fails but the differences inside the table point the same way;
<i>close</i> when a stand-in sequence gives the same number and no difference decides;
<i>differs</i> when they do not; else <i>not run</i>, with the reason. Live and virtual runs are
never mixed.</p>
{% if experiments %}<p>Runs: {% for name, link in experiments %}<a href="{{ link }}">{{ name }}</a>
{% endfor %}</p>{% else %}<p>There are no runs of ours yet.</p>{% endif %}</section>
{% for table, notes in tables %}<section><h2>{{ table.caption }}</h2>
{% for figure in figures if figure.name == table.name %}<figure style="max-width: 44rem">
<img alt="{{ figure.title }}" src="{{ figure.uri }}">
<figcaption>{{ figure.caption }} Data: <a href="{{ figure.data }}">{{ figure.data }}</a>; made by
<code>{{ figure.command }}</code></figcaption></figure>{% endfor %}
<div class="scroll"><table><thead><tr>{% for h in table.headings -%}
<th{% if loop.index0 < table.words %} class="word"{% endif %}>{{ h }}</th>{% endfor %}</tr></thead>
<tbody>{% for row in table.rows %}<tr>{% for c in row -%}
<td class="{% if loop.index0 < table.words %}word{% elif loop.last %}long{% endif %}
 {{ c.split(' ')[0] }}">{{ c }}</td>{% endfor %}</tr>
{% endfor %}</tbody></table></div>
{% for note in notes %}<p class="soft">{{ note }}</p>{% endfor %}</section>{% endfor %}
</body></html>
"""


@dataclass(frozen=True)
class PaperPage:
    """What was written for one paper."""

    html: Path
    markdown: Path
    summary: str
    rows: list[Comparison]


def write_paper_page(
    paper: Paper, experiments: list[Results], folder: Path, command: str | None = None
) -> PaperPage:
    """Writes `<folder>/<paper id>/index.html`, page.md, tables and figures."""
    target = folder / paper.id
    target.mkdir(parents=True, exist_ok=True)
    pool = pool_of(experiments)
    made_by = command or f"slambed compare {paper.id}"
    writer = FigureWriter(target, made_by, [])
    tables: list[tuple[Table, list[str]]] = []
    rows: list[Comparison] = []
    if paper.kind == "peer":
        tables = [(table, []) for table in peer_tables(paper, pool)]
        summary = f"{len(tables)} of {len(paper.setups)} set-ups were run"
    else:
        rows = compare_paper(paper, pool)
        summary = tally(rows)
        for published in paper.tables:
            own = [row for row in rows if row.source == published.id]
            caption = f"{published.label} ({published.where}): {published.caption}"
            tables.append((comparison_table(f"{published.id}", caption, own), published.notes))
            _draw(own, f"{published.label}: {published.caption}", published.id, writer)
        claims = [row for row in rows if row.source in {claim.id for claim in paper.claims}]
        caption = "Stated results"
        tables.append((comparison_table(f"{paper.id}_claims", caption, claims), []))
    tables = [(table, notes) for table, notes in tables if table.rows]
    used = sorted(set(pool.runs["experiment_folder"])) if len(pool.runs) else []
    links = [(r.name, _link(r, target)) for r in experiments if r.name in used]
    writer.write_list()
    html = target / "index.html"
    html.write_text(_render(paper, summary, links, writer.saved, tables, target), encoding="utf-8")
    write_tables([table for table, _ in tables], target / "tables")
    markdown = target / "page.md"
    lines = [f"# {paper.paper.title}", "", summary, ""]
    for table, notes in tables:
        lines += [f"## {table.caption}", "", table.markdown(), *notes, ""]
    markdown.write_text("\n".join(lines), encoding="utf-8")
    return PaperPage(html, markdown, summary, rows)


def _link(results: Results, target: Path) -> str:
    page = results.folder / "report" / "index.html"
    return Path(os.path.relpath(page, target)).as_posix()


def _render(
    paper: Paper,
    summary: str,
    links: list[tuple[str, str]],
    figures: list[SavedFigure],
    tables: list[tuple[Table, list[str]]],
    target: Path,
) -> str:
    shown = []
    for item in figures:
        data = base64.b64encode((target / f"{item.name}.svg").read_bytes()).decode()
        shown.append({**vars(item), "uri": f"data:image/svg+xml;base64,{data}"})
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    return environment.from_string(PAGE).render(
        paper=paper, summary=summary, style=STYLE, experiments=links, figures=shown, tables=tables
    )


def _draw(rows: list[Comparison], title: str, name: str, writer: FigureWriter) -> None:
    """Published values as diamonds, ours as dots with intervals; one panel per metric."""
    rows = [row for row in rows if row.ours is not None]
    metrics = list(dict.fromkeys((row.metric, row.unit) for row in rows))
    if not rows:
        return
    counts = [sum((r.metric, r.unit) == m for r in rows) for m in metrics]
    height = sum(0.75 + 0.24 * n for n in counts) + 0.3
    with figure(len(metrics), height_in=height, gridspec_kw={"height_ratios": counts}) as (
        made,
        axes,
    ):
        for axis, (metric, unit) in zip(axes, metrics, strict=True):
            own = [row for row in rows if (row.metric, row.unit) == (metric, unit)]
            for place, row in enumerate(own):
                assert row.ours is not None
                axis.plot([row.ours.low, row.ours.high], [place, place], color=COLOURS[0])
                axis.plot(row.ours.value, place, "o", color=COLOURS[0],
                          label="ours, 95 %" if place == 0 else None)  # fmt: skip
                axis.plot(row.published, place, "D", color=COLOURS[1], markerfacecolor="none",
                          label="paper" if place == 0 else None)  # fmt: skip
            axis.set_yticks(range(len(own)), [f"{row.row}, {row.column}" for row in own])
            axis.set_ylim(len(own) - 0.5, -0.5)
            low, high = axis.get_xlim()
            axis.set_xlim(min(low, -0.03 * high), high)  # lengths shall be comparable: from zero
            axis.set_xlabel(f"{metric.replace('_', ' ')} [{unit}]")
            axis.tick_params(axis="y", labelsize=7)
        axes[0].legend(loc="best")
        made.suptitle(title if len(title) < 70 else title.split(":")[0], fontsize=10)
        data = pd.DataFrame(
            [
                {"row": r.row, "column": r.column, "metric": r.metric, "unit": r.unit,
                 "paper": r.published, "ours": r.ours.value, "low": r.ours.low,
                 "high": r.ours.high, "runs": r.ours.count, "verdict": r.verdict}
                for r in rows if r.ours is not None
            ]
        )  # fmt: skip
        caption = "Published values (diamonds) and ours with 95 % intervals (dots)."
        writer.save(made, file_name(name), title, caption, data)
