# SPDX-License-Identifier: Apache-2.0
"""Renders HTML pages from the templates of a package. Pages load nothing and are complete without
scripts."""

import re
from functools import cache
from importlib.resources import files

import jinja2
from markupsafe import Markup, escape

_TEMPLATES = files("slambed.report") / "templates"
_SCRIPTS = files("slambed.report") / "scripts"

STYLE = (_TEMPLATES / "style.css").read_text(encoding="utf-8")
"""Style of all pages, inlined so that a page is one file."""


NO_BREAK, JOINED = "\u00a0", "\u2060"
_AROUND = re.compile(r"\([^()]*\)|\[[^\[\]]*\]|± \S+")
_UNIT = re.compile(r"(?<=\d) (?=[^\s\d]{1,3}$)")
_NAME = re.compile(r"\S{13,}")


def cell(text: str) -> Markup:
    """Returns a table cell that wraps only before the interval or deviation of a value and after
    the separators of a long name."""
    if text[:1].isdigit():
        text = _AROUND.sub(lambda found: found[0].replace(" ", NO_BREAK), text)
        text = _UNIT.sub(NO_BREAK, text)
    words = escape(text.replace("->", f"-{JOINED}>"))
    return Markup(_NAME.sub(lambda found: _joints(found[0]), words))


def _joints(name: str) -> str:
    """Allows breaks after : and / if there are any (system:variant, cell/dataset/link), else after
    _ and a dot."""
    return re.sub(
        r"(?<=[:/])(?=\w)" if re.search("[:/]", name) else r"(?<=[_.])(?=\w)", "<wbr>", name
    )


def render(template: str, package: str = "slambed.report", **values: object) -> str:
    """Renders a page from a package's `templates/`; a missing value is an error."""
    return _environment(package).get_template(template).render(style=Markup(STYLE), **values)


@cache
def _environment(package: str) -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader(package),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters["cell"] = cell
    return environment


@cache
def script_of(name: str) -> str:
    return (_SCRIPTS / name).read_text(encoding="utf-8")


def in_page(points: str) -> Markup:
    """Returns the JSON of a figure's points for a page, escaped so that it cannot close its
    element."""
    return Markup(points.strip().replace("<", "\\u003c"))


@cache
def page_script() -> str:
    """Returns the only script of a report, which shows values under the pointer. The server allows
    it by its digest."""
    return "".join(map(script_of, ("view_math.js", "figures.js", "lanes_zoom.js")))
