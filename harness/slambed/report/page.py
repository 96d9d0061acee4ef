# SPDX-License-Identifier: Apache-2.0
"""HTML pages from the templates beside this file: nothing loaded from anywhere, and whole without
their script."""

import re
from functools import cache
from importlib.resources import files

import jinja2
from markupsafe import Markup, escape

_TEMPLATES = files("slambed.report") / "templates"
_SCRIPTS = files("slambed.report") / "scripts"

STYLE = (_TEMPLATES / "style.css").read_text(encoding="utf-8")
"""One look for all pages; it is put into each, so that a page is one file."""


NO_BREAK, JOINED = "\u00a0", "\u2060"
_AROUND = re.compile(r"\([^()]*\)|\[[^\[\]]*\]|± \S+")
_UNIT = re.compile(r"(?<=\d) (?=[^\s\d]{1,3}$)")
_NAME = re.compile(r"\S{13,}")


def cell(text: str) -> Markup:
    """A cell of a table that is broken, where the page is narrow, only before what is around a
    value (an interval, a deviation) and behind the joints of a long name."""
    if text[:1].isdigit():
        text = _AROUND.sub(lambda found: found[0].replace(" ", NO_BREAK), text)
        text = _UNIT.sub(NO_BREAK, text)
    words = escape(text.replace("->", f"-{JOINED}>"))
    return Markup(_NAME.sub(lambda found: _joints(found[0]), words))


def _joints(name: str) -> str:
    """Behind the larger joints if there are any: system:variant, cell/dataset/link."""
    return re.sub(
        r"(?<=[:/])(?=\w)" if re.search("[:/]", name) else r"(?<=[_.])(?=\w)", "<wbr>", name
    )


def render(template: str, package: str = "slambed.report", **values: object) -> str:
    """A page of a package's `templates/`; a name that the template asks for and nobody gives is an
    error."""
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
    """A script that pages may have."""
    return (_SCRIPTS / name).read_text(encoding="utf-8")


def in_page(points: str) -> Markup:
    """JSON of a figure's points, for the page's script. Nothing in it may end the element that it
    stands in."""
    return Markup(points.strip().replace("<", "\\u003c"))


@cache
def page_script() -> str:
    """The one script of a report: what figures do under a pointer. A server that shows reports
    knows it by its digest."""
    return script_of("view_math.js") + script_of("figures.js")
