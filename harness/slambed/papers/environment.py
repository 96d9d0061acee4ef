# SPDX-License-Identifier: Apache-2.0
"""The templates of pages about papers."""

from functools import lru_cache

import jinja2


@lru_cache
def environment(package: str = "slambed.papers") -> jinja2.Environment:
    """Returns the templates of a package, which may include those of papers; values not marked safe
    are escaped."""
    folders = [jinja2.PackageLoader(name) for name in dict.fromkeys((package, "slambed.papers"))]
    return jinja2.Environment(
        loader=jinja2.ChoiceLoader(folders),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
