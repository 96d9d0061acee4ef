# SPDX-License-Identifier: Apache-2.0
"""The tables of the reference: every key and every option says what it means."""

import pytest

from slambed.commands.described import verbs
from slambed.commands.main import COMMANDS
from slambed.schema import key_tables as tables
from slambed.schema.kinds import KINDS, Kind
from slambed.schema.markdown import prose


@pytest.mark.parametrize("kind", KINDS)
def test_every_key_of_a_kind_has_a_meaning(kind: str) -> None:
    for line in tables.key_tables(kind).splitlines():
        if line.startswith("| `"):
            assert len(line.split(" | ")) >= 4 and not line.endswith("|  |"), line


def test_a_key_without_a_meaning_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    silent = {"properties": {"size": {"type": "integer"}}}
    monkeypatch.setitem(KINDS, "silent", Kind("Silent", (), lambda: silent))
    with pytest.raises(ValueError, match=r"silent\.size has no meaning"):
        tables.key_tables("silent")


def test_types_and_defaults_are_said_in_words() -> None:
    table = tables.key_tables("experiment")
    assert "| `engine` | `auto` or `docker` or `local` or `virtual` | `auto` |" in table
    assert "| `systems` | list of [SystemChoice](#systemchoice) | required |" in table
    assert "| `seed` | int ≥ 0, < 2147483648 | `1` |" in table


def test_every_command_and_option_is_described() -> None:
    text = verbs()
    for name in COMMANDS:
        assert f"### slambed {name}\n" in text
    for line in text.splitlines():
        if line.startswith("| `"):
            assert not line.endswith("|  |"), line


def test_a_page_that_a_sentence_names_becomes_a_link() -> None:
    text = 'as in <a>, `<b>` (docs/explanation/limits.md, "At a pace")'
    assert prose(text) == "as in &lt;a>, `<b>` ([At a pace](../explanation/limits.md#at-a-pace))"
