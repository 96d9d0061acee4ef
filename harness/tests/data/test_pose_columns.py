# SPDX-License-Identifier: Apache-2.0
"""Tables of poses whose header says which column is which: OpenVINS, EuRoC, TUM, mixtures."""

from pathlib import Path

import numpy as np
import pytest
from command_line import refused, slambed

from slambed.data.pose_columns import named_columns
from slambed.data.trajectory import read_tum
from slambed.errors import SlambedError

TUM_ORDER = tuple(range(8))
W_FIRST = (0, 1, 2, 3, 5, 6, 7, 4)
HEADERS = {
    "# timestamp tx ty tz qx qy qz qw": (TUM_ORDER, None),
    "# timestamp(s) tx ty tz qx qy qz qw Pr11 Pr12 Pt33": (TUM_ORDER, "s"),
    "time(ns),tx,ty,tz,qx,qy,qz,qw": (TUM_ORDER, "ns"),
    "#time(ns),px,py,pz,qw,qx,qy,qz,vx,vy,vz,bwx,bwy,bwz,bax,bay,baz": (W_FIRST, "ns"),
    "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],"
    "q_RS_z [],v_RS_R_x [m s^-1]": (W_FIRST, "ns"),
    "#timestamp, p_x, p_y, p_z, q_w, q_x, q_y, q_z": (W_FIRST, None),
    "qw qx qy qz x y z t": ((7, 4, 5, 6, 1, 2, 3, 0), None),
}


@pytest.mark.parametrize("header", HEADERS)
def test_a_header_says_where_each_value_is(header: str) -> None:
    found = named_columns(["", "# a file", header, "1 2 3"], "a.txt")
    assert found is not None and (found.order, found.unit) == HEADERS[header]


@pytest.mark.parametrize(
    "line", ["# x", "# ground truth trajectory", "1 2 3 4 5 6 7 8", "#1403636579 1 2 3 4 5 6 7"]
)
def test_what_names_no_pose_is_no_header(line: str) -> None:
    assert named_columns([line, "1 0 0 0 0 0 0 1"], "a.txt") is None


def test_a_header_below_the_first_row_changes_nothing() -> None:
    below = "# time x y z qw qx qy qz"
    assert named_columns(["1 0 0 0 0 0 0 1", below], "a.txt") is None


def test_a_trajectory_is_read_in_the_order_of_its_header(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("#time(s),px,py,pz,qw,qx,qy,qz,vx\n5,1,2,3,0.8,0.6,0,0,9\n")
    rows = read_tum(path).rows()
    assert np.array_equal(rows, [[5, 1, 2, 3, 0.6, 0, 0, 0.8]])
    path.write_text("# timestamp(s) tx ty tz qx qy qz qw Pr11 Pr12\n5 1 2 3 0.6 0 0 0.8 7 7\n")
    assert np.array_equal(read_tum(path).rows(), rows)


@pytest.mark.parametrize("order", ["tx,ty,tz,qx,qy,qz,qw", "p_RS_R_x [m],y,z,qw,qx,qy,qz,vx"])
@pytest.mark.parametrize(("unit", "time"), [("s", 5), ("ms", 5e3), ("us", 5e6), ("ns", 5e9)])
def test_times_are_in_the_unit_of_the_header(
    tmp_path: Path, order: str, unit: str, time: float
) -> None:
    path = tmp_path / "a.csv"
    rest = ",1" * order.count(",")
    path.write_text(f"#timestamp [{unit}],{order}\n{time:.18e},1{rest}\n")
    assert read_tum(path).stamps_s == pytest.approx([5.0], abs=1e-12)


@pytest.mark.parametrize("factor", [1e3, 1e6, 1e9])
def test_evaluate_recognizes_the_unit_of_dates(tmp_path: Path, factor: float) -> None:
    """Both files may have any unit; where it is not seconds, a note says so."""
    files = {}
    for name, scale in (("own", factor), ("true", 1.0)):
        files[name] = tmp_path / f"{name}.txt"
        rows = [(scale * (1.4e9 + 0.1 * n), n, n * n % 7, 0) for n in range(30)]
        files[name].write_text("".join(f"{t:.3f} {x} {y} {z} 0 0 0 1\n" for t, x, y, z in rows))
    for pair in (("own", "true"), ("true", "own"), ("own", "own")):
        code, out, err = slambed("evaluate", *(str(files[name]) for name in pair))
        assert code == 0 and "ATE RMSE 0.000000 m (SE3, 30 pairs" in out, err
        assert err.count("own.txt: times are read as ") == pair.count("own")
    files["own"].write_text(files["true"].read_text().replace("14000000", "15000000"))
    assert "do not overlap" in refused(2, "evaluate", str(files["own"]), str(files["true"]))


def test_more_columns_without_a_header_are_refused(tmp_path: Path) -> None:
    """Nobody can know what they are."""
    path = tmp_path / "a.txt"
    path.write_text("5 1 2 3 0.6 0 0 0.8 7\n")
    with pytest.raises(SlambedError, match=r"a\.txt:1: not a pose: 9 values"):
        read_tum(path)


def test_states_of_openvins_are_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "state_estimate.txt"
    path.write_text("# timestamp(s) q p v bg ba cam_imu_dt num_cam\n1 0 0 0 1 2 3 4 0 0 0\n")
    with pytest.raises(SlambedError, match=r"state_estimate\.txt: states of OpenVINS"):
        read_tum(path)
