# SPDX-License-Identifier: Apache-2.0
"""`slambed explain EXPERIMENT --only ...` takes the run that the report shows."""

from pathlib import Path

import pytest
from command_line import refused, slambed
from results_factory import RawRun, spec_of, write_experiment

from slambed.errors import ExitCode
from slambed.report.load import load
from slambed.report.overview import overviews


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three runs each of two systems; those of the second lose track for different times."""
    folder = tmp_path_factory.mktemp("explained")
    ours = [(spec_of("orbslam2", "default", None, i), RawRun(4.0, edge=False)) for i in range(3)]
    lost = [((2.0, 3.5),), (), ((2.0, 2.4),)]
    theirs = [
        (spec_of("edgeslam", "static", "ramp_85", i), RawRun(4.0, lost_at_s=at))
        for i, at in enumerate(lost)
    ]
    write_experiment(folder, [*ours, *theirs])
    return folder


def explained(results: Path, *arguments: str) -> str:
    code, out, err = slambed("explain", *arguments, "--slowest", "1", "--results", str(results))
    assert code == ExitCode.OK, out + err
    return out


def test_a_selection_gives_the_median_run_that_the_report_shows(results: Path) -> None:
    out = explained(results, "invented", "--only", "system=edgeslam")
    run = "0000000000000005"
    first, *story = out.splitlines()
    assert first == f"run {run}: the median of 3 of edgeslam:static/room_walk/ramp_85"
    assert story == explained(results, run).splitlines()
    (overview,) = overviews(load(results / "invented"))
    assert run in overview.shown
    folder = str(results / "invented")
    assert explained(results, folder, "--only", "edgeslam:static/*") == out


def test_a_single_combination_needs_no_selection(tmp_path: Path) -> None:
    write_experiment(tmp_path, [(spec_of("orbslam2", "default", None, 0), RawRun(4.0, edge=False))])
    first = explained(tmp_path, "invented").splitlines()[0]
    assert first == "run 0000000000000000: the median of 1 of orbslam2/room_walk"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (
            ("invented",),
            "has 2 combinations, pick one with --only: "
            "orbslam2/room_walk, edgeslam:static/room_walk/ramp_85",
        ),
        (("invented", "--only", "dataset=room_walk"), "has 2 combinations of that, pick one"),
        (
            ("invented", "--only", "system=nobody"),
            "--only system=nobody is no combination; system: ",
        ),
        (("0000000000000001", "--only", "system=orbslam2"), "--only picks a run of an experiment"),
    ],
)
def test_what_leaves_no_single_combination_is_one_line(
    results: Path, arguments: tuple[str, ...], says: str
) -> None:
    assert says in refused(ExitCode.BAD_INPUT, "explain", *arguments, "--results", str(results))


@pytest.mark.parametrize("other", [("--out", "pictures"), ("--path",)])
def test_a_timeline_file_beside_a_folder_of_pictures_is_refused_at_once(
    results: Path, other: tuple[str, ...]
) -> None:
    line = refused(
        ExitCode.BAD_INPUT, "explain", "invented", "--only", "system=edgeslam", "--output", "a.png",
        *other, "--results", str(results),
    )  # fmt: skip
    assert "--output names the timeline alone" in line


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--path", "--from", "1"), "--path shows the whole run; leave out --from"),
        (("--rerun", "--to", "2"), "--rerun shows the whole run"),
        (("--path", "--around", "loss"), "--path shows the whole run"),
        (("--around", "2", "--from", "1"), "--around is a time window itself"),
        (("--around", "loss", "--to", "0"), "--around is a time window itself"),
        (("--slowest", "1", "--out", "x"), "--slowest draws nothing; give it alone"),
        (("--slowest", "1", "--sequence", "x"), "--slowest draws nothing"),
        (("--messages", "x.csv", "--out", "x"), "--messages draws nothing; give it alone"),
        (("--messages", "x.csv", "--sequence", "x"), "--messages draws nothing"),
        (("--sequence", "x"), "give it with --rerun"),
        (("--path", "--sequence", "x"), "give it with --rerun"),
    ],
)
def test_an_option_that_would_do_nothing_is_refused(
    results: Path, tmp_path: Path, arguments: tuple[str, ...], says: str
) -> None:
    asked = ("explain", "0000000000000003", *arguments, "--results", str(results))
    assert says in refused(ExitCode.BAD_INPUT, *asked, cwd=tmp_path)
    assert not list(tmp_path.iterdir())


def test_without_events_there_is_nothing_to_explain(tmp_path: Path) -> None:
    runs = [(spec_of("orbslam2", "default", None, 0), RawRun(4.0, edge=False))]
    folder = write_experiment(tmp_path, runs)
    for file in folder.glob("runs/*/events.parquet"):
        file.unlink()
    line = refused(ExitCode.BAD_INPUT, "explain", "invented", "--results", str(tmp_path))
    assert "no valid run of orbslam2/room_walk has events" in line
