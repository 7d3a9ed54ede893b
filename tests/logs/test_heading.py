"""A heading of a quaternion or a rotation vector, against SciPy's rotations."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hovercontrol.app.commands.options import pairs
from hovercontrol.base.errors import ArgumentError, InputError
from hovercontrol.logs import read_log

#: Three turns and a little roll and pitch.
YAW = np.linspace(0.3, 20.0, 200)
TILT = 0.05 * np.sin(3.0 * YAW)


def written(file: Path, rotation: Rotation, last: int = 4) -> Path:
    rows = rotation.as_quat() if last == 4 else rotation.as_rotvec()
    names = ["qx", "qy", "qz", "qw"][:last]
    lines = [f"{0.1 * k},0,0," + ",".join(map(repr, map(float, row))) for k, row in enumerate(rows)]
    file.write_text("\n".join([",".join(["time", "x", "y", *names]), *lines]))
    return file


@pytest.mark.parametrize(
    "said", ["qx,qy,qz,qw", "qx,qy,qz,qw:z-up", "quat(qx;qy;qz;qw)", "quat(qx;qy;qz;qw):z-up"]
)
def test_the_heading_is_the_yaw_of_yaw_pitch_roll(tmp_path: Path, said: str) -> None:
    rotation = Rotation.from_euler("ZYX", np.column_stack([YAW, TILT, -TILT]))
    log = read_log(written(tmp_path / "a.csv", rotation), pairs(f"psi={said},y=y"))
    assert log["psi"] == pytest.approx(YAW, abs=1e-9)  # continuous over three turns


@pytest.mark.parametrize("axis", "xyz")
def test_the_axis_that_is_up_is_chosen(tmp_path: Path, axis: str) -> None:
    file = written(tmp_path / "a.csv", Rotation.from_euler(axis, YAW[:, None]))
    assert read_log(file, {"psi": f"qx,qy,qz,qw:{axis}-up"})["psi"] == pytest.approx(YAW, abs=1e-9)
    assert read_log(file, {"psi": f"qx,qy,qz,qw:{axis}-down"})["psi"] == pytest.approx(-YAW, abs=1e-9)
    assert read_log(file, {"psi": f"qx,qy,qz,qw:-{axis}-up"})["psi"] == pytest.approx(-YAW, abs=1e-9)


def test_with_y_up_it_is_the_angle_of_the_bodys_x_axis_from_x_to_minus_z(tmp_path: Path) -> None:
    rotation = Rotation.from_euler("YZX", np.column_stack([YAW, TILT, TILT]))
    forward = rotation.apply([1.0, 0.0, 0.0])
    wanted = np.unwrap(np.arctan2(-forward[:, 2], forward[:, 0]))
    psi = read_log(written(tmp_path / "a.csv", rotation), {"psi": "qx,qy,qz,qw:y-up"})["psi"]
    assert psi == pytest.approx(wanted, abs=1e-9)


def test_three_columns_are_a_rotation_vector(tmp_path: Path) -> None:
    file = written(tmp_path / "a.csv", Rotation.from_euler("z", YAW[:, None]), last=3)
    assert read_log(file, {"psi": "qx,qy,qz"})["psi"] == pytest.approx(YAW, abs=1e-9)


def test_what_is_no_rotation_is_told(tmp_path: Path) -> None:
    file = written(tmp_path / "a.csv", Rotation.from_euler("z", YAW[:, None]))
    with pytest.raises(
        InputError, match="row 1, columns x, y, qz, qw: expected a quaternion of length 1, found"
    ):
        file.write_text(file.read_text().replace("0.0,0,0,", "0.0,3,0,", 1))
        read_log(file, {"psi": "x,y,qz,qw", "x": "qx", "y": "qy"})
    with pytest.raises(ArgumentError, match="no column 'qa' to read 'psi' from"):
        read_log(file, {"psi": "qx,qy,qz,qa"})
    with pytest.raises(ArgumentError, match="only psi can be computed from a rotation"):
        read_log(file, {"x": "qx,qy,qz,qw"})


def test_parts_without_an_equals_sign_continue_a_rotation() -> None:
    assert pairs("psi=a,b,c,d:y-up,x=px") == {"psi": "a,b,c,d:y-up", "x": "px"}
    for text in ("x=a,b,y=c", "a,x=b", "psi=a,b,c,d,e"):
        with pytest.raises(InputError, match="--columns: expected NAME=COLUMN"):
            pairs(text)
