# SPDX-License-Identifier: Apache-2.0
"""HTML pages from the templates beside this file: no script, nothing loaded from anywhere."""

from importlib.resources import files

import jinja2
from markupsafe import Markup

_TEMPLATES = files("slambed.report") / "templates"

STYLE = (_TEMPLATES / "style.css").read_text(encoding="utf-8")
"""One look for all pages; it is put into each, so that a page is one file."""


def render(template: str, **values: object) -> str:
    """A page; a name that the template asks for and nobody gives is an error."""
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    text = (_TEMPLATES / template).read_text(encoding="utf-8")
    return environment.from_string(text).render(style=Markup(STYLE), **values)
