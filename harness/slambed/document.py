# SPDX-License-Identifier: Apache-2.0
"""Generates the tables of docs/ from commands, schemas, records and metrics, its pictures of
dependencies from CMake and imports, and the C++ parameter header of each system from its
system.yaml.

python -m slambed.document

In docs/ each table lies between two comments; a test fails when a table, picture or header is out
of date.
"""

import re
from pathlib import Path
from typing import Any

from slambed.commands.described import verbs
from slambed.files.yaml_source import load_yaml
from slambed.metrics.catalog import METRICS
from slambed.metrics.metric import Metric, Use
from slambed.native import repository_root
from slambed.schema.arc_diagram import arc_diagram
from slambed.schema.key_tables import curve_table, key_tables
from slambed.schema.markdown import markdown_table, prose
from slambed.schema.record_tables import RECORDS, record_table
from slambed.spec.library import Library
from slambed.spec.linked import libraries_of, programs_of
from slambed.spec.parameter_header import HEADER, parameter_header

COMMAND = "python -m slambed.document"
TABLES = {
    "reference/metrics.md": ("gate",),
    "reference/command-line.md": ("verbs",),
    "reference/dataset.md": ("keys dataset", "datasets"),
    "reference/device.md": ("keys device", "keys device-fit", "devices"),
    "reference/experiment.md": ("keys experiment",),
    "reference/hosts.md": ("keys hosts",),
    "reference/input.md": ("keys input", "inputs"),
    "reference/make.md": ("make",),
    "reference/manifest.md": ("manifest",),
    "reference/mask-network.md": ("keys network", "networks"),
    "reference/messages.md": ("lines",),
    "reference/paper.md": ("keys paper", "keys plan", "keys inference"),
    "reference/profile.md": ("keys profile", "curves", "profiles"),
    "reference/run-folder.md": ("run", "sim", "relay"),
    "reference/samples.md": ("samples",),
    "reference/summary.md": ("summary", "own"),
    "reference/system.md": ("keys system",),
}
"""Maps a page of docs/ to its tables."""
UNNAMED = ("apps", "core")
"""Top folders of systems/ that are left out of a label because they only group other folders."""
EVERY_SYSTEM = "registry"
"""The library that links all systems; CMake finds its dependencies itself."""
KEYS = "keys "
"""Prefix of the names of tables of a kind of YAML file."""
CATALOGS = {
    "datasets": ("catalog/datasets", "id", ("title",)),
    "devices": ("catalog/devices", "name", ("title", "hardware")),
    "inputs": ("catalog/inputs", "id", ("yields", "dataset", "title")),
    "networks": ("catalog/networks", "id", ("license", "title")),
    "profiles": ("netem_profiles", "name", ("description", "source")),
}
"""Maps a table to its folder, the key that names a file, and the keys that are shown."""
ORIGINS = {"first_of": "first of", "window_of": "part of", "reader": "", "synthetic": "generated"}
"""Maps a dataset's key for its origin to the words before its value."""
TARGET = re.compile(r"^([a-z-]+):.*?## (.*)$", re.MULTILINE)
"""A target of the Makefile, as `make help` finds it."""


def table(name: str) -> str:
    """Returns one table as Markdown."""
    if name == "lines" or name in RECORDS:
        return markdown_table(*record_table(name))
    if name in CATALOGS:
        return _catalog(*CATALOGS[name])
    if name.startswith(KEYS):
        return key_tables(name.removeprefix(KEYS))
    return {
        "verbs": verbs,
        "make": _make,
        "curves": curve_table,
        "summary": _summary,
        "own": _own,
        "gate": _gate,
    }[name]()


def _catalog(folder: str, name: str, shown: tuple[str, ...]) -> str:
    files = sorted((repository_root() / folder).glob("*.yaml"))
    rows = []
    for content in (load_yaml(path).data for path in files):
        cells = [prose(" ".join(str(content.get(key, "")).split())) for key in shown]
        rows.append([f"`{content[name]}`", *_origin(content), *cells])
    origin = ["sensor", "comes from"] if folder.endswith("datasets") else []
    return markdown_table([name, *origin, *shown], rows)


def _origin(content: dict[str, Any]) -> list[str]:
    """Describes the origin of a dataset; empty for other files."""
    for key, words in ORIGINS.items():
        if value := content.get(key):
            names = value if isinstance(value, list) else [value]
            found = ", ".join(f"`{item}`" for item in names)
            sensor = content.get("sensor", "" if words.endswith("of") else "rgbd")
            return [sensor, words if key == "synthetic" else f"{words} {found}".strip()]
    return []


def _make() -> str:
    makefile = (repository_root() / "Makefile").read_text(encoding="utf-8")
    rows = [[f"`make {name}`", text] for name, text in TARGET.findall(makefile)]
    return markdown_table(["target", "what it does"], rows)


def _summary() -> str:
    rows = [[f"`{item.key}`", item.stored_type, item.unit, item.meaning] for item in METRICS]
    return markdown_table(["key", "type", "unit", "meaning"], rows)


def _own() -> str:
    library = Library()
    rows = [
        [f"`{key}`", name, "int" if item.take == "count" else "float", item.unit, item.doc]
        for name in library.systems()
        for key, item in library.system(name).metrics.items()
    ]
    return markdown_table(["key", "system", "type", "unit", "meaning"], rows)


def _libraries() -> str:
    """Draws the C++ folders in their groups, with arcs to those that they link."""
    root = repository_root() / "systems"
    libraries, programs = libraries_of(repository_root()), programs_of(repository_root())
    used: dict[str, set[str]] = {}
    labels: dict[str, str] = {}
    groups: dict[str, list[str]] = {
        f"systems/{name}": [] for name in ("apps", "*", "synth", "core")
    }
    for name, target in (*libraries.items(), *programs.items()):
        folder = target.folder.relative_to(root)
        key = folder.as_posix()
        found = {libraries[item].folder.relative_to(root).as_posix() for item in target.depends}
        if key not in used:
            group = f"systems/{folder.parts[0]}"
            groups[group if group in groups else "systems/*"].append(key)
        used[key] = used.get(key, set()) | (found - {key})
        path = "/".join(folder.parts[1:] if folder.parts[0] in UNNAMED else folder.parts)
        labels[key] = name if name in programs else path
    used[libraries[EVERY_SYSTEM].folder.relative_to(root).as_posix()].add("systems/*")
    return arc_diagram("Which folder of systems/ uses which", groups, used, labels)


def _packages() -> str:
    """Draws the packages of harness/slambed, with arcs to those that they import."""
    from grimp import build_graph  # Comes with import-linter (development only).

    graph = build_graph("slambed", cache_dir=None)
    names = {name for name in graph.find_children("slambed") if graph.find_children(name)}
    used = {
        a: {
            b
            for b in names - {a}
            if graph.direct_import_exists(importer=a, imported=b, as_packages=True)
        }
        for a in names
    }
    labels = {name: name.rpartition(".")[2] for name in names}
    title = "Which package of harness/slambed uses which"
    return arc_diagram(title, {"": sorted(names)}, used, labels)


def _gate() -> str:
    rows = [
        [f"`{item.key}`", item.name, f"{item.better} is better", _least(item)]
        for item in METRICS
        if Use.GATED in item.use
    ]
    return markdown_table(["metric", "shown as", "", "a smaller change is no alarm"], rows)


def _least(item: Metric) -> str:
    step = f"{item.relevant_step * item.scale:g} {item.shown_unit}".strip()
    if item.kind == "share" or not item.relevant_share:
        return f"{item.relevant_step * item.scale:g} points"
    share = f"{item.relevant_share:.0%}"
    return f"{share}, at least {step}" if item.relevant_step else share


def marks(name: str) -> tuple[str, str]:
    """Returns the comments before and after a table."""
    return f"<!-- table {name}: {COMMAND} -->\n", f"<!-- end of table {name} -->\n"


def renewed(text: str, names: tuple[str, ...]) -> str:
    """Returns the page with its tables regenerated. Raises ValueError where a comment is
    missing."""
    for name in names:
        begin, end = marks(name)
        head, _, rest = text.partition(begin)
        _, found, tail = rest.partition(end)
        if not found:
            raise ValueError(f"no place for the table '{name}': write {begin!r} and {end!r}")
        text = f"{head}{begin}\n{table(name)}\n{end}{tail}"
    return text


def headers() -> dict[Path, str]:
    """Maps the path of each parameter header to its content, for the systems built here."""
    library = Library()
    found = ((name, library.system(name)) for name in library.systems())
    return {
        library.system_file(name).parent / HEADER: parameter_header(system)
        for name, system in found
        if system.runtime is None
    }


def pictures() -> dict[str, str]:
    """Maps the name of each generated picture of docs/pictures to its SVG."""
    return {"libraries.svg": _libraries(), "packages.svg": _packages()}


def main() -> None:
    """Renews every page, picture and header."""
    for path, text in headers().items():
        path.write_text(text, encoding="utf-8")
    docs: Path = repository_root() / "docs"
    for name, text in pictures().items():
        (docs / "pictures" / name).write_text(text, encoding="utf-8")
    for page, names in TABLES.items():
        path = docs / page
        path.write_text(renewed(path.read_text(encoding="utf-8"), names), encoding="utf-8")


if __name__ == "__main__":
    main()
