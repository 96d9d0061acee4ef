# SPDX-License-Identifier: Apache-2.0
"""Results of several engines: the order of their rows, and tables wider than the terminal."""

import io
from dataclasses import replace
from pathlib import Path

import pytest
from results_factory import RawRun, spec_of, write_experiment
from rich.console import Console

from slambed.report.load import Results, load
from slambed.report.rounds import update_round_tables
from slambed.report.tables import Table, asked_links


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """Two links and two engines, whose runs come in another order for each link."""
    order = {"none": ("virtual", "docker"), "ramp_85": ("docker", "virtual")}
    runs = [
        (spec_of("edgeslam", "static", profile, 0, engine=engine), RawRun(duration_s=4.0))
        for profile, engines in order.items()
        for engine in engines
    ]
    return load(write_experiment(tmp_path_factory.mktemp("both"), runs))


def printed(table: Table, width: int) -> list[str]:
    """Returns the lines of a terminal of this width."""
    console = Console(width=width, file=io.StringIO())
    console.print(table.rich())
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue().splitlines()


def shown(table: Table, width: int) -> list[str]:
    """Returns the same without the caption."""
    lines = printed(table, width)
    return lines[next(n for n, line in enumerate(lines) if line.startswith("sys")) :]


def test_rows_of_several_engines_are_in_the_same_order_for_every_link(both: Results) -> None:
    (table,) = update_round_tables(both)
    docker, virtual = "edgeslam:static (docker)", "edgeslam:static (virtual)"
    assert [row[:2] for row in table.rows] == [
        [docker, "none"], [virtual, "none"], [docker, "ramp_85"], [virtual, "ramp_85"],
    ]  # fmt: skip


@pytest.mark.parametrize(("width", "tables"), [(200, 1), (160, 2), (120, 2), (80, 3), (60, 5)])
def test_every_column_of_a_wide_table_is_whole_in_a_narrow_terminal(
    both: Results, width: int, tables: int
) -> None:
    (table,) = update_round_tables(both)
    lines = shown(table, width)
    assert max(map(len, lines)) <= width
    headings = [line.split() for line in lines if line.startswith("system ")]
    assert len(headings) == tables
    assert all(own[:2] == ["system", "link"] for own in headings)
    numbers = [heading for own in headings for heading in own[2:]]
    assert numbers == table.headings[2:] and numbers[-1] == "gap"
    # Each cell's first line is a whole number, and the sign stays with it.
    assert not any(line.split()[0] == "±" for line in lines if line.split())


def test_long_names_are_folded_and_never_cut() -> None:
    name = "a_system_with_a_name:and_a_variant (virtual)"
    table = Table("t", "", ["system", "value"], [[name, "1.0"]])
    lines = shown(table, 30)
    folded = "".join(line[:-3].replace(" ", "") for line in lines[1:])
    assert folded == name.replace(" ", "")
    assert lines[1].endswith(" 1.0")


def test_a_caption_has_the_width_of_the_terminal_and_is_no_markup() -> None:
    caption = "A narrow table with a caption that is longer than its two columns [0, 56] [bold]."
    table = Table("t", caption, ["system", "value"], [["name", "1.0"]])
    assert printed(table, 100)[0] == caption


def test_a_terminal_too_narrow_for_a_number_still_shows_it() -> None:
    table = Table("t", "", ["system", "value"], [["name", "123456.789"]])
    digits = [line.split()[-1] for line in shown(table, 10) if line[-1:].isdigit()]
    assert "".join(digits) == "123456.789"


def test_a_report_says_what_each_link_was(both: Results) -> None:
    content = {
        "rtt_ms": {"points": [[0, 0], [10, 85]]},
        "loss": {"random": 0.01},
        "up": {"rate": {"mbps": 4, "queue_bytes": 65536}},
        "gaps": [{"start_s": 5, "length_s": 2}],
        "gap_mode": "drop",
    }
    missing = {"rtt_ms": {"trace": "nowhere.csv"}}
    found = asked_links(replace(both, links={"ramp_85": content, "none": missing}))
    assert found.rows == [
        ["none", "-", "-", "-", "-"],
        [
            "ramp_85", "0 to 85", "rate 4 Mbit/s, queue 65,536 bytes; loss 1.000%",
            "rate unlimited; loss 1.000%", "silence of 2 s at 5 s; traffic is dropped",
        ],
    ]  # fmt: skip


def test_links_of_a_grid_are_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    profiles = ("rtt_160", "rtt_40", "rtt_0", "rtt_7.5")
    runs = [(spec_of("edgeslam", "static", name, 0), RawRun(duration_s=4.0)) for name in profiles]
    found = load(write_experiment(tmp_path, runs)).runs["profile"]
    assert list(found) == ["rtt_0", "rtt_7.5", "rtt_40", "rtt_160"]
