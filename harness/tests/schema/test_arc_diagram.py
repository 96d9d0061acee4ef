# SPDX-License-Identifier: Apache-2.0
"""A picture of what uses what leads down only, and leaves out what a longer path implies."""

from xml.etree import ElementTree

import pytest

from slambed.schema.arc_diagram import arc_diagram, downwards, reduced

USED = {"app": {"tool", "base"}, "tool": {"base"}, "other": {"base"}, "base": set[str]()}
SVG = "{http://www.w3.org/2000/svg}"


def test_an_arrow_that_a_longer_path_implies_is_left_out() -> None:
    assert reduced(USED)["app"] == {"tool"}
    assert reduced(USED)["other"] == {"base"}


def test_each_name_is_above_those_that_it_uses_and_close_to_them() -> None:
    assert downwards(sorted(USED), USED) == ["app", "tool", "other", "base"]
    with pytest.raises(ValueError, match="a circle among a, b"):
        downwards(["a", "b", "c"], {"c": {"a"}, "a": {"b"}, "b": {"a"}})


def test_a_picture_has_each_name_once_and_an_arc_for_each_use() -> None:
    groups = {"programs": ["app"], "parts": ["base", "other", "tool"]}
    text = arc_diagram("a < b", groups, USED | {"app": {"tool", "parts"}}, {"app": "the app"})
    svg = ElementTree.fromstring(text)
    words = ["".join(item.itertext()) for item in svg.iter(f"{SVG}text")]
    assert words == ["programs", "the app", "parts", "other", "tool", "base"]
    assert svg.get("aria-label") == "a < b"
    arcs = [item.get("d", "") for item in svg.iter(f"{SVG}path") if item.get("fill") == "none"]
    assert len(arcs) == 4  # app to tool and to the heading, tool and other to base
    for path in arcs:
        begin, *_, end = path.replace("C", " ").split()[1:]
        assert float(end) > float(begin)
