# SPDX-License-Identifier: Apache-2.0
"""What mutants of valid files found (test_mutants), each kind by itself: one line, no traceback."""

from __future__ import annotations

import io
import struct
import tarfile
import zlib
from pathlib import Path

import pytest
from command_line import refused
from data_samples import gray, one_line, tum_recipe, write_prepared, write_tum
from mutated_readers import SUBJECTS, Subject, png
from mutator import Files, write

from slambed.campaign.pack import unpack
from slambed.data.camera_files import read_cameras
from slambed.data.catalog import Catalog
from slambed.data.encoded_picture import check_picture
from slambed.data.prepared import SEQUENCE_FILE, PreparedSequence
from slambed.data.trajectory import read_tum
from slambed.errors import ExitCode, SlambedError, printable
from slambed.files.json_file import read_object
from slambed.files.yaml_source import load_yaml
from slambed.files.yaml_text import DEEPEST, read_yaml
from slambed.link.profile import load_profile
from slambed.link.traces import find_trace, read_rate_trace
from slambed.spec.inputs import find_input
from slambed.spec.library import Library


def subject(name: str) -> Subject:
    return next(one for one in SUBJECTS if one.name == name)


def line_of(name: str, changes: Files, place: Path) -> str:
    """What a reader says of its valid input with some files changed."""
    files = subject(name).files()
    assert changes.keys() <= files.keys() or name in ("bag", "packed")
    write(files | changes, place / "in")
    (place / "out").mkdir()
    with pytest.raises(SlambedError) as error:
        subject(name).read(place / "in", place / "out")
    return one_line(error)


BOMB = "a: &a [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{new}: &{new} [{', '.join([f'*{old}'] * 10)}]\n"
    for old, new in zip("abcdef", "bcdefg", strict=True)
)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        # The parser in C ended the process here, with a segmentation fault.
        ("[" * 200_000, f"more than {DEEPEST} levels"),
        ("- " * 200_000 + "1", f"more than {DEEPEST} levels"),
        ("a: &a {b: *a}\n", "an alias stands for what it is in"),
        (BOMB, "more than 1,000,000 values"),
        ("a: 1\nb: 2011-13-45\n", "'2011-13-45' is not of type timestamp"),
        ("a: 1\nb: !!int x\n", "'x' is not of type int"),
        ("a: 1\nb: !!bool 3\n", "'3' is not of type bool"),
        ("a: 1\nb: " + "9" * 5000, "is not of type int"),
        ("a: 1\nb: " + "9" * 400, "is larger than 9223372036854775807"),
    ],
)
def test_yaml_that_stands_for_no_value(tmp_path: Path, text: str, complaint: str) -> None:
    file = tmp_path / "a.yaml"
    file.write_text(text)
    with pytest.raises(SlambedError) as error:
        load_yaml(file)
    line = one_line(error)
    assert complaint in line and f"{file} line {2 if text.startswith('a: 1') else ''}" in line
    calibration = tmp_path / "sensor.yaml"
    calibration.write_text(text)
    with pytest.raises(SlambedError, match=r"sensor\.yaml:\d+: not YAML"):
        read_cameras(calibration)


def test_yaml_may_have_levels_and_aliases() -> None:
    assert read_yaml("[" * 90 + "1" + "]" * 90)
    assert read_yaml("a: &a [1, 2]\nb: [*a, *a]\n") == {"a": [1, 2], "b": [[1, 2], [1, 2]]}
    assert read_yaml("[" + "[1, 2], " * 5000 + "]")[-1] == [1, 2]


def with_header(data: bytes, width: int, height: int, bits: int = 8, kind: int = 0) -> bytes:
    """A PNG whose header, with its right checksum, says something else."""
    head = b"IHDR" + struct.pack(">IIBBBBB", width, height, bits, kind, 0, 0, 0)
    return data[:12] + head + struct.pack(">I", zlib.crc32(head)) + data[33:]


def test_a_picture_cannot_be_larger_than_its_bytes(capfd: pytest.CaptureFixture[str]) -> None:
    """The decoder took 860 MiB for it."""
    data = png(gray(1))
    with pytest.raises(SlambedError, match=r"a\.png: PNG of 30000x30000 pixels, as its"):
        check_picture(with_header(data, 30_000, 30_000), "a.png")
    jpeg = bytearray(b"\xff\xd8\xff\xc0\0\x0b\x08\xff\xff\xff\xff\x01\x01\x11\0\xff\xd9")
    with pytest.raises(SlambedError, match=r"a\.jpg: JPEG of 65535x65535 pixels"):
        check_picture(bytes(jpeg), "a.jpg")
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    ("damage", "complaint"),
    [
        (lambda d: d[:60] + b"\0\1\2" + d[63:], "the checksum of its part at byte 33 is wrong"),
        (lambda d: with_header(d, 64, 48, bits=7), "a kind of pixels that there is not"),
        (lambda d: with_header(d, 64, 48, kind=3), "it has no palette"),
        (lambda d: with_header(d, 0, 48), "PNG of 0x48 pixels"),
        (lambda d: d[:8] + d[33:], "it begins with no header"),
        (lambda d: d[:33] + d[-12:], "it has no pixels"),
        (lambda d: d[:37] + b"\0" + d[38:], "its part at byte 33 has no kind"),
        (lambda d: d[:-12], "PNG is truncated"),
    ],
)
def test_a_damaged_png_is_found_before_its_decoder_prints(damage: object, complaint: str) -> None:
    assert callable(damage)
    with pytest.raises(SlambedError, match=f"^a.png: .*{complaint}"):
        check_picture(damage(png(gray(1))), "a.png")


def test_a_path_that_left_the_world_has_no_error(tmp_path: Path) -> None:
    """LAPACK never ended on it."""
    rows = [f"{i} {i % 3} {i % 5} 1 0 0 0 1" for i in range(20)]
    true, own = tmp_path / "truth.txt", tmp_path / "own.txt"
    true.write_text("\n".join(rows))
    own.write_text("\n".join([*rows[:-1], "19 1e300 0 0 0 0 0 1"]))
    line = refused(ExitCode.BAD_INPUT, "evaluate", str(own), str(true))
    assert f"{own} against {true}: a pose is 1e+300 m away" in line


@pytest.mark.parametrize(
    ("row", "complaint"),
    [
        ("3 0 0 0 0 0 0 1e308", r"a.txt: .* the quaternion at 3.000000 s has length inf"),
        ("3 0 0 0 0 0 0 0", r"a.txt: .* the quaternion at 3.000000 s has length 0"),
        ("1e300 0 0 0 0 0 0 1", r"a.txt:2: 1e\+300 is not a time"),
    ],
)
def test_a_pose_that_is_none(tmp_path: Path, row: str, complaint: str) -> None:
    (tmp_path / "a.txt").write_text(f"1 0 0 0 0 0 0 1\n{row}\n")
    with pytest.raises(SlambedError, match=complaint) as error:
        read_tum(tmp_path / "a.txt")
    one_line(error)


@pytest.mark.filterwarnings("error")
def test_a_path_of_blank_lines_is_empty_without_a_warning(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("  \n \n")
    assert len(read_tum(tmp_path / "a.txt")) == 0


@pytest.mark.parametrize("kind", ["folder", "loop", "brackets", "digits"])
def test_a_header_of_a_sequence_that_cannot_be_read(tmp_path: Path, kind: str) -> None:
    write_prepared(tmp_path / "s")
    header = tmp_path / "s" / SEQUENCE_FILE
    header.unlink()
    match kind:
        case "folder":
            header.mkdir()
        case "loop":
            header.symlink_to(header.name)
        case "brackets":
            header.write_text("[" * 200_000)
        case "digits":
            header.write_text("9" * 5000)
    with pytest.raises(SlambedError, match=r"sequence\.json: ") as error:
        PreparedSequence.open(tmp_path / "s")
    one_line(error)
    assert read_object(header) is None


@pytest.mark.parametrize("name", ["", ".", "runs", "tiny"])
def test_packed_files_without_a_place(tmp_path: Path, name: str) -> None:
    file = tmp_path / "a.tar.xz"
    with tarfile.open(file, "w:xz") as out:
        out.addfile(tarfile.TarInfo(name), io.BytesIO(b""))
    with pytest.raises(SlambedError, match=r"a\.tar\.xz is (torn|no file of)"):
        unpack(file, tmp_path / "results")


@pytest.mark.parametrize("plan", [b"{", b"[]", b'{"runs": 3}', b'{"runs": [3]}', b"[" * 100_000])
def test_a_torn_plan_is_not_put_among_results(tmp_path: Path, plan: bytes) -> None:
    """It would be in the way of every command that asks for the results beside it."""
    file = tmp_path / "a.tar.xz"
    with tarfile.open(file, "w:xz") as out:
        member = tarfile.TarInfo("tiny/experiment.json")
        member.size = len(plan)
        out.addfile(member, io.BytesIO(plan))
    with pytest.raises(SlambedError, match=r"a\.tar\.xz: tiny/experiment\.json is not whole"):
        unpack(file, tmp_path / "results")
    assert not (tmp_path / "results/tiny").exists()


def test_a_link_to_itself_is_no_system(tmp_path: Path) -> None:
    (tmp_path / "system.yaml").symlink_to("system.yaml")
    with pytest.raises(SlambedError, match=r"unknown system .*system\.yaml"):
        Library(tmp_path).system(str(tmp_path / "system.yaml"))


@pytest.mark.parametrize("name", ["~nobody_of_this_name/a", "x" * 5000, "a\0b"])
def test_names_that_no_file_can_have(tmp_path: Path, name: str) -> None:
    for find in (find_trace, find_input):
        with pytest.raises(SlambedError, match="not found, looked in") as error:
            find(name, tmp_path)
        assert len(one_line(error)) < 1500


def test_a_list_with_a_name_of_a_whole_file(tmp_path: Path) -> None:
    walk = write_tum(tmp_path / "tiny_tum")
    lines = (walk / "rgb.txt").read_text().splitlines()
    lines[2] = " ".join([lines[2]] * 100)
    (walk / "rgb.txt").write_text("\n".join(lines))
    tum_recipe(tmp_path / "datasets")
    environment = {"SLAMBED_DATASETS": str(tmp_path / "datasets"), "SLAMBED_DATA": str(tmp_path)}
    cache = str(tmp_path / "cache")
    command = ("data", "prepare", "tiny_tum", "--cache", cache)
    (walk / lines[2].split()[1]).unlink()
    line = refused(ExitCode.BAD_INPUT, *command, **environment)
    assert "rgb.txt:3: there is neither" in line and len(line) < 1500


def test_what_a_message_shows_of_a_file_does_nothing_to_a_terminal() -> None:
    assert str(SlambedError("a.txt:1: '\x1b[2J\x07' is not a time")) == (
        "a.txt:1: '\\x1b[2J\\x07' is not a time"
    )
    assert printable("two\nlines\tof \u2028 größer") == "two lines of \\u2028 größer"
    long = printable(f"a.txt: '{'x' * 100_000}' is no number; correct the line")
    assert len(long) < 300 and long.startswith("a.txt: 'xxx") and long.endswith("correct the line")
    assert len(printable("a b " * 100_000)) < 1300


def test_an_mcap_whose_lengths_lie(tmp_path: Path) -> None:
    """They asked for more memory than there is, or for bytes that never come."""
    data = subject("mcap").files()["data/walk.mcap"]
    assert isinstance(data, bytes)
    for value in (2**62, 2**63 - 1, 2**64 - 1):
        place = tmp_path / str(value)
        changed = data[:9] + struct.pack("<Q", value) + data[17:]
        line = line_of("mcap", {"data/walk.mcap": changed}, place)
        assert "walk.mcap: cannot be read as a bag" in line


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"name: /gray\n", b"name: 1.5\n"),
        (b"type: sensor_msgs/msg/Image\n", b"type: [a]\n"),
        (b"storage_identifier: sqlite3", b"storage_identifier: {}"),
    ],
)
def test_metadata_of_a_bag_of_odd_kinds(tmp_path: Path, old: bytes, new: bytes) -> None:
    name = "data/walk/metadata.yaml"
    text = subject("bag_ros2").files()[name]
    assert isinstance(text, bytes) and old in text
    line = line_of("bag_ros2", {name: text.replace(old, new)}, tmp_path)
    assert "walk: " in line and "cannot be read as a bag" in line


def test_a_rig_that_rectifies_to_no_camera(tmp_path: Path) -> None:
    name = "data/walk/mav0/cam1/sensor.yaml"
    text = subject("euroc").files()[name]
    assert isinstance(text, bytes)
    changed = text.replace(b"1.0, 0.0, 0.0, 0.0, 0.0, 1.0]", b"1.0, 0.0, 0.0, 0.0, 0.0, -0.5]")
    line = line_of("euroc", {name: changed}, tmp_path)
    assert "mav0" in line


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        # Memory for 745 GiB was asked for.
        ("rtt_ms: {steps: [[0, 1], [1e9, 5]]}", "the profile lasts 1e+09 s, more than 100000 s"),
        ("rtt_ms: {ramp: {to_ms: 5, rise_s: 1, hold_s: 1.0e+12}}", "the profile lasts 1e+12 s"),
        ("rtt_ms: 5\nduration_s: .inf", "expected seconds up to 100000, not inf"),
        # These never ended.
        ("rtt_ms: 5\ngaps: [{start_s: 1, length_s: 1e-320, every_s: 1e-310}]", "gaps[0].every_s"),
        ("rtt_ms: {sine: {amplitude_ms: 5, period_s: 1e-320}}", "rtt_ms.sine.period_s"),
        # These made JSON that the relay cannot read, or times that it cannot hold.
        ("rtt_ms: 5\nrate: {mbps: 1, queue_bytes: 9000000000000000000}", "rate.queue_bytes"),
        ("rtt_ms: 5\njitter: {sd_ms: 1e300}", "jitter.sd_ms"),
        ("rtt_ms: 5\ngaps: [{start_s: 1, length_s: 1e300}]", "gaps[0].length_s"),
    ],
)
def test_a_profile_of_sizes_that_no_link_has(tmp_path: Path, text: str, complaint: str) -> None:
    file = tmp_path / "a.yaml"
    file.write_text(text)
    with pytest.raises(SlambedError) as error:
        load_profile(file)
    line = one_line(error)
    assert complaint in line and str(file) in line


def test_a_rate_trace_ends_some_day(tmp_path: Path) -> None:
    (tmp_path / "a.trace").write_text("1\n" + "9" * 400)
    with pytest.raises(SlambedError, match=r"is more than 1000000000 ms, .*a\.trace line 2"):
        read_rate_trace("a.trace", tmp_path)


def test_a_parameter_that_is_called_by_a_number(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text("rtt_ms: $peak\nparams: {1: 2, mean: 3}\n")
    with pytest.raises(SlambedError, match=r"unknown parameter '\$peak', .*a\.yaml at rtt_ms"):
        load_profile(tmp_path / "a.yaml")


@pytest.mark.parametrize("width", [0, 65_536, 2**31])
def test_a_calibration_of_no_picture(tmp_path: Path, width: int) -> None:
    text = f"K: [1, 0, 1, 0, 1, 1, 0, 0, 1]\nD: []\nwidth: {width}\nheight: 9\n"
    (tmp_path / "a.yaml").write_text(text)
    with pytest.raises(SlambedError, match=rf"a\.yaml: not .* a picture of {width}x9 pixels"):
        read_cameras(tmp_path / "a.yaml")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        (b"[12.0,", b"[1e308,", "intrinsics 1e+308 12 8 6, expected focal lengths above 0"),
        (b"0.1, 0.0, 1.0", b"1e308, 0.0, 1.0", "a number of the pose is 1e+308, expected meters"),
    ],
)
def test_a_camera_as_large_as_the_world(
    tmp_path: Path, old: bytes, new: bytes, complaint: str
) -> None:
    name = "data/walk/mav0/cam1/sensor.yaml"
    text = subject("euroc").files()[name]
    assert isinstance(text, bytes) and old in text
    assert complaint in line_of("euroc", {name: text.replace(old, new)}, tmp_path)


def test_a_grid_of_a_number(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text("id: a\nsystems: [{system: x, grid: {1: [1]}}]\n")
    with pytest.raises(SlambedError, match=r"a grid cannot vary '1', .*a\.yaml line 2"):
        Library(tmp_path).experiment(str(tmp_path / "a.yaml"))


@pytest.mark.parametrize(
    ("key", "value", "complaint"),
    [
        (
            "reader_options",
            "{gray_range: [0, 1.0e-320]}",
            "tiny_tum: reader_options: gray_range must",
        ),
        ("reader_options", "{time_unit: [s]}", "rgb.txt: reader_options: time_unit must be"),
        ("reader_options", "{max_gap: 1}", "tiny_tum: reader_options: unknown key 'max_gap'"),
        ("reader", "tun", "dataset 'tiny_tum': reader 'tun' does not exist; did you mean 'tum'"),
        ("fps", ".inf", "'fps': input should be a finite number"),
        ("camera", "{width: 9, height: 9, fx: 1, fy: 1, cx: .nan, cy: 1, bf: 1}", "'camera.cx'"),
        ("camera", "{width: 2147483647, height: 9, fx: 1, fy: 1, cx: 1, cy: 1, bf: 1}", "65535"),
    ],
)
def test_dataset_files_name_themselves(
    tmp_path: Path, key: str, value: str, complaint: str
) -> None:
    write_tum(tmp_path / "tiny_tum")
    tum_recipe(tmp_path / "datasets", **{key: value})
    catalog = Catalog.load(tmp_path / "datasets", [tmp_path])
    with pytest.raises(SlambedError) as error:
        catalog.prepare("tiny_tum", tmp_path / "cache")
    assert complaint in one_line(error) and "tiny_tum" in one_line(error)


def test_messages_that_a_bag_defines_otherwise(tmp_path: Path) -> None:
    files = subject("bag").files()
    data = files["data/walk.bag"]
    assert isinstance(data, bytes)
    changed = data.replace(b"string encoding", b"string encodinx")
    line = line_of("bag", {"data/walk.bag": changed}, tmp_path)
    assert "walk.bag" in line and ("otherwise than ROS" in line or "cannot be read" in line)
