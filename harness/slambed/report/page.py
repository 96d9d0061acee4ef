# SPDX-License-Identifier: Apache-2.0
"""The look of the HTML report: one template, no script, nothing loaded from anywhere."""

STYLE = """
:root { --ink: #1a1a1a; --soft: #5a5a5a; --line: #d8d8d8; --good: #00694b; --bad: #a83e00;
  --back: #ffffff; --card: #f5f6f8; }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1rem; max-width: 72rem; color: var(--ink); background: var(--back);
  font: 16px/1.45 system-ui, -apple-system, "Segoe UI", "DejaVu Sans", sans-serif; }
h1 { font-size: 1.6rem; line-height: 1.2; margin: .4rem 0; }
h2 { font-size: 1.2rem; margin: 2rem 0 .5rem; border-bottom: 1px solid var(--line); }
h3 { font-size: 1rem; margin: 1.2rem 0 .3rem; }
p.lead, .soft { color: var(--soft); }
nav { font-size: .9rem; } nav a { margin-right: .9rem; white-space: nowrap; }
a { color: #00548a; }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(9rem, 1fr)); gap: .6rem; }
.tile { background: var(--card); border-radius: .5rem; padding: .6rem .8rem; }
.tile b { display: block; font-size: 1.35rem; }
.tile span { color: var(--soft); font-size: .85rem; }
.good { color: var(--good); } .bad { color: var(--bad); }
.warn { border-left: 4px solid var(--bad); background: #fff6ef; padding: .5rem .8rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: .86rem; margin: .4rem 0; }
caption { text-align: left; color: var(--soft); padding: .2rem 0; }
th, td { padding: .25rem .55rem; text-align: right; vertical-align: top; white-space: nowrap; }
th { border-bottom: 2px solid var(--ink); vertical-align: bottom; white-space: normal; }
td { border-bottom: 1px solid var(--line); }
th.word, td.word { text-align: left; white-space: normal; }
td.word { min-width: 4rem; }
td.long { white-space: normal; min-width: 14rem; overflow-wrap: anywhere; }
figure { margin: 0 0 1.2rem; break-inside: avoid; }
figure img { width: 100%; height: auto; display: block; }
figcaption { font-size: .86rem; color: var(--soft); }
.figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(28rem, 100%), 1fr));
  gap: 1rem 1.6rem; }
code { font-size: .85em; overflow-wrap: anywhere; }
details { margin: .3rem 0; } summary { cursor: pointer; }
svg.timeline { width: 100%; max-width: 60rem; height: auto; display: block; }
svg .name { font: 9px sans-serif; fill: #5a5a5a; } svg .tick { font: 8px sans-serif;
  text-anchor: end; fill: #5a5a5a; } svg .time { font: 8px sans-serif; fill: #5a5a5a; }
@media (max-width: 40rem) { body { padding: .7rem; font-size: 15px; } table { font-size: .8rem; } }
@media print { body { max-width: none; font-size: 9.5pt; padding: 0; } nav { display: none; }
  h2 { break-after: avoid; } table { font-size: 7.5pt; } th, td { white-space: normal;
  padding: .12rem .3rem; } .scroll { overflow: visible; } .tile { border: 1px solid var(--line); }
  .figures { grid-template-columns: 1fr 1fr; } a { color: inherit; text-decoration: none; } }
"""

TEMPLATE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,">
<title>{{ title }} - slambed</title>
<style>{{ style }}</style>
</head>
<body>
{% macro grid(table) %}
<div class="scroll"><table>
<caption>{{ table.caption }}</caption>
<thead><tr>{% for h in table.headings -%}
<th{% if loop.index0 < table.words %} class="word"{% endif %}>{{ h }}</th>
{%- endfor %}</tr></thead>
<tbody>{% for row in table.rows %}<tr>{% for c in row -%}
<td{% if loop.index0 < table.words %} class="word"{% endif %}>{{ c }}</td>
{%- endfor %}</tr>
{% endfor %}</tbody></table></div>
{% endmacro %}
<header>
<h1>{{ title }}</h1>
<p class="lead">Experiment <code>{{ name }}</code>. {{ notes }}</p>
<nav>{% for anchor, text in sections %}<a href="#{{ anchor }}">{{ text }}</a> {% endfor %}</nav>
</header>
<section id="summary">
<h2>Summary</h2>
<div class="tiles">{% for value, text, mood in tiles %}
<div class="tile"><b class="{{ mood }}">{{ value }}</b><span>{{ text }}</span></div>{% endfor %}
</div>
{% for line in setup %}<p>{{ line }}</p>{% endfor %}
<p>{{ hint }}</p>
{% if problems %}<div class="warn" id="warnings"><b>Warnings</b>
<ul>{% for line in problems %}<li>{{ line }}</li>{% endfor %}</ul></div>{% endif %}
</section>
<section id="tables"><h2>Tables</h2>
{% for table in tables %}{{ grid(table) }}{% endfor %}
{% if cell_notes %}<h3>To be read with the tables</h3>
<ul>{% for cell, note in cell_notes %}<li><b>{{ cell }}</b>: {{ note }}</li>{% endfor %}</ul>
{% endif %}
</section>
{% if comparisons %}<section id="papers"><h2>Beside published figures</h2>
{% for table in comparisons %}{{ grid(table) }}{% endfor %}</section>{% endif %}
{% if differences.rows %}<section id="differences"><h2>Differences</h2>
{{ grid(differences) }}</section>{% endif %}
<section id="figures"><h2>Figures</h2>
<div class="figures">{% for figure in figures %}
<figure id="{{ figure.name }}"><img alt="{{ figure.title }}" src="{{ figure.uri }}">
<figcaption>{{ figure.caption }} Data: <a href="{{ figure.data }}">{{ figure.data }}</a>; made by
<code>{{ figure.command }}</code></figcaption></figure>{% endfor %}
</div>
{% if left_out %}<p class="soft">{{ left_out }} more figures were left out to keep this quick:
<code>slambed plots {{ name }} --all</code> draws them.</p>{% endif %}
</section>
<section id="validity"><h2>Validity of link and limits</h2>
{% if link.rows %}{{ grid(link) }}{% else %}<p class="soft">No run had a link.</p>{% endif %}
{% if limits.rows %}{{ grid(limits) }}{% else %}
<p class="soft">{{ no_limits }}</p>{% endif %}
</section>
<section id="runs"><h2>Runs</h2>
{% if runs_left_out %}<p class="soft">{{ runs_left_out }} more runs are in
<a href="../summary.csv">summary.csv</a>; shown are those that are not valid or lost track, then one
of each cell.</p>{% endif %}
<div class="scroll"><table><thead><tr><th class="word">run</th><th class="word">cell</th>
<th class="word">outcome</th><th>coverage</th><th>losses</th><th>ATE [cm]</th>
<th class="word">time line</th></tr></thead><tbody>
{% for run in runs %}<tr><td class="word"><a href="../runs/{{ run.key }}/">{{ run.key }}</a></td>
<td class="word">{{ run.name }}</td>
<td class="word {{ run.mood }}">{{ run.outcome }}</td><td>{{ run.coverage }}</td>
<td>{{ run.losses }}</td><td>{{ run.ate }}</td>
<td class="word">{% if run.timeline %}<a href="#t-{{ run.key }}">here</a>{% else -%}
<code>slambed view {{ run.key }}</code>{% endif %}</td></tr>
{% endfor %}</tbody></table></div>
{% for run in runs if run.timeline %}<div id="t-{{ run.key }}"><h3>{{ run.key }}:
{{ run.name }}</h3>{{ run.timeline | safe }}</div>{% endfor %}
<p class="soft">Time lines: green tracked, orange lost, grey not initialised; ticks under the state
are applied map updates; shaded: a fault (its name appears under the pointer).</p>
</section>
<section id="manifest"><h2>Manifest</h2>
<div class="scroll"><table><thead><tr><th class="word">fact</th><th class="word">value</th>
<th>runs</th></tr></thead><tbody>
{% for fact, value, count in facts %}<tr><td class="word">{{ fact }}</td>
<td class="word long">{{ value }}</td><td>{{ count }}</td></tr>{% endfor %}</tbody></table></div>
<p class="soft">Each run's full manifest is in its folder. All numbers: <a href="../summary.csv">
summary.csv</a>.</p>
</section>
</body>
</html>
"""
