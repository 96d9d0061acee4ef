# SPDX-License-Identifier: Apache-2.0
"""HTML pages from the templates beside this file: no script, nothing loaded from anywhere."""

import re
from importlib.resources import files

import jinja2
from markupsafe import Markup, escape

_TEMPLATES = files("slambed.report") / "templates"

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


def render(template: str, **values: object) -> str:
    """A page; a name that the template asks for and nobody gives is an error."""
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    environment.filters["cell"] = cell
    text = (_TEMPLATES / template).read_text(encoding="utf-8")
    return environment.from_string(text).render(style=Markup(STYLE), **values)
