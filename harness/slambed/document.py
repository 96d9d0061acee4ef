# SPDX-License-Identifier: Apache-2.0
"""Writes what docs/ say that follows from the list of metrics, from records and from CMake, and
what the C++ of each system takes from its system.yaml.

    python -m slambed.document

In docs/ each stands between two comments; a test fails when something is not what its source says.
"""

from pathlib import Path

from slambed.metrics.catalog import METRICS
from slambed.metrics.metric import Metric, Use
from slambed.native import repository_root
from slambed.schema.record_tables import RECORDS, record_table
from slambed.spec.library import Library
from slambed.spec.linked import below, floors_of
from slambed.spec.parameter_header import HEADER, parameter_header

COMMAND = "python -m slambed.document"
TABLES = {
    "architecture.md": ("floors",),
    "formats.md": ("run", "sim", "relay", "lines", "samples", "summary", "own", "manifest"),
    "metrics.md": ("gate",),
}
"""Page of docs/ and the tables in it."""


def table(name: str) -> str:
    """One table as Markdown."""
    if name == "lines" or name in RECORDS:
        return _lines(*record_table(name))
    return {"summary": _summary, "own": _own, "gate": _gate, "floors": _floors}[name]()


def _lines(headings: list[str], rows: list[list[str]]) -> str:
    rule = ["---"] * len(headings)
    return "".join(f"| {' | '.join(row)} |\n" for row in (headings, rule, *rows))


def _summary() -> str:
    rows = [[f"`{item.key}`", item.stored_type, item.unit, item.doc] for item in METRICS]
    return _lines(["key", "type", "unit", "meaning"], rows)


def _own() -> str:
    library = Library()
    rows = [
        [f"`{key}`", name, "int" if item.take == "count" else "float", item.unit, item.doc]
        for name in library.systems()
        for key, item in library.system(name).metrics.items()
    ]
    return _lines(["key", "system", "type", "unit", "meaning"], rows)


def _floors() -> str:
    """Floors and systems, an arrow to each that is used and not reached over another one."""
    floors = floors_of(repository_root())
    lines = ["```mermaid", "flowchart TD"]
    for name in floors:
        used = floors[name][1]
        over = below([deeper for item in used for deeper in floors[item][1]], floors)
        lines += [f"  {name} --> {item}" for item in used if item not in over]
    return "\n".join([*lines, "```", ""])


def _gate() -> str:
    rows = [
        [f"`{item.key}`", item.name, f"{item.better} is better", _least(item)]
        for item in METRICS
        if Use.GATED in item.use
    ]
    return _lines(["metric", "shown as", "", "a smaller change is no alarm"], rows)


def _least(item: Metric) -> str:
    step = f"{item.relevant_step * item.scale:g} {item.shown_unit}".strip()
    if item.kind == "share" or not item.relevant_share:
        return f"{item.relevant_step * item.scale:g} points"
    share = f"{item.relevant_share:.0%}"
    return f"{share}, at least {step}" if item.relevant_step else share


def marks(name: str) -> tuple[str, str]:
    """What stands before and after a table."""
    return f"<!-- table {name}: {COMMAND} -->\n", f"<!-- end of table {name} -->\n"


def renewed(text: str, names: tuple[str, ...]) -> str:
    """A page with its tables as the list says. Raises ValueError where the comments are gone."""
    for name in names:
        begin, end = marks(name)
        head, _, rest = text.partition(begin)
        _, found, tail = rest.partition(end)
        if not found:
            raise ValueError(f"no place for the table '{name}': write {begin!r} and {end!r}")
        text = f"{head}{begin}\n{table(name)}\n{end}{tail}"
    return text


def headers() -> dict[Path, str]:
    """The C++ of each of our systems' parameters, and where it stands."""
    library = Library()
    found = ((name, library.system(name)) for name in library.systems())
    return {
        library.system_file(name).parent / HEADER: parameter_header(system)
        for name, system in found
        if system.runtime is None
    }


def main() -> None:
    """Renews every page and header."""
    for path, text in headers().items():
        path.write_text(text, encoding="utf-8")
    docs: Path = repository_root() / "docs"
    for page, names in TABLES.items():
        path = docs / page
        path.write_text(renewed(path.read_text(encoding="utf-8"), names), encoding="utf-8")


if __name__ == "__main__":
    main()
