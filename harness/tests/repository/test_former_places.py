# SPDX-License-Identifier: Apache-2.0
"""Users' files in the folders of older checkouts, before catalog/ and papers/<id>/."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from slambed.data.catalog import Catalog
from slambed.errors import SlambedError
from slambed.infer.inference_plan import find_plan
from slambed.papers.published import read_papers
from slambed.segment.network import load_network
from slambed.spec.library import Library


@pytest.mark.parametrize(
    ("former", "asks", "where"),
    [
        ("devices", lambda root: Library(root).device("mine"), "catalog/devices"),
        ("inputs", lambda root: Library(root).input("mine"), "catalog/inputs"),
        (
            "datasets",
            lambda root: Catalog.load(root / "catalog" / "datasets", []).get("mine"),
            "catalog/datasets",
        ),
        ("networks", lambda root: load_network("mine"), "catalog/networks"),
        ("papers", lambda root: read_papers(["mine"]), "papers/mine/paper.yaml"),
        ("inference", lambda root: find_plan("mine"), "papers/<paper>/inference"),
    ],
)
def test_who_asks_for_a_file_in_a_former_place_is_reported_where_to_move_it(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    former: str,
    asks: Callable[[Path], Any],
    where: str,
) -> None:
    for module in ("slambed.segment.network", "slambed.papers.published.reading"):
        monkeypatch.setattr(f"{module}.repository_root", lambda: tmp_path)
    with pytest.raises(SlambedError) as unknown:
        asks(tmp_path)
    assert "no longer read" not in str(unknown.value)
    file = tmp_path / former / "mine.yaml"
    file.parent.mkdir()
    file.write_text("")
    with pytest.raises(SlambedError) as refused:
        asks(tmp_path)
    message = f"{file} is no longer read, move it to {tmp_path / where}"
    assert message in str(refused.value) and "\n" not in str(refused.value)
