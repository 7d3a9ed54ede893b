"""A proposal of `check` is right when it is followed: the craft's position and heading in z up."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hovercontrol.app.commands.options import pairs
from hovercontrol.logs import Log, read_log
from hovercontrol.logs.frames import in_z_up
from hovercontrol.logs.overview import overview
from hovercontrol.logs.required_columns import RequiredColumns
from tests.logs.readers import test_more_formats as more
from tests.logs.readers import written, written_ros


def followed(file: Path) -> tuple[Log, str]:
    text = overview(file, RequiredColumns(motion=True)) or ""
    words = shlex.split(text.splitlines()[-1])
    log = read_log(file, pairs(words[words.index("--columns") + 1]))
    frame = words[words.index("--frame") + 1] if "--frame" in words else ""
    return (in_z_up(log, frame) if frame else log), text


def check(file: Path, x: np.ndarray, y: np.ndarray, psi: np.ndarray | None = None, near: float = 1e-6) -> str:
    log, text = followed(file)
    known = np.isfinite(log["x"])
    n = int(known.sum())
    first = 1 if n < x.size else 0
    assert log["x"][known] == pytest.approx(x[first : first + n], abs=near)
    assert log["y"][known] == pytest.approx(y[first : first + n], abs=near)
    if psi is not None:
        assert log["psi"][known] == pytest.approx(psi[first : first + n], abs=max(near, 2e-3))
    assert not any("tilts" in note for note in log.notes)
    return text


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_of_a_bag(tmp_path: Path, kind: str) -> None:
    pytest.importorskip("rosbags")
    file = written.ros(tmp_path / ("a.bag" if kind == "ros1" else "a"), kind)
    text = check(file, written.X, 0 * written.X, written.PSI)
    assert "/odom  101 rows, 50 Hz, time by header.stamp" in text
    assert re.search(r"pose\.pose\.position\.x +0 +1\n", text)
    assert "pose.covariance[0..35]" in text


def test_of_transforms_is_the_frame_that_moves(tmp_path: Path) -> None:
    assert "/tf[odom]  " in check(
        written_ros.transforms(tmp_path / "a"), 0.01 * np.arange(100), np.zeros(100)
    )


def test_of_flight_logs_in_north_east_down(tmp_path: Path) -> None:
    pytest.importorskip("pyulog"), pytest.importorskip("pymavlink")
    for file in (written.ulog(tmp_path / "a.ulg"), written.ardupilot(tmp_path / "a.bin")):
        check(file, 0 * written.X, written.X, np.pi / 2 - written.PSI, 1e-4)  # x is north


@pytest.mark.parametrize("euler", [False, True])
@pytest.mark.parametrize("up", [1, 2])
def test_of_motive_with_either_axis_up(tmp_path: Path, euler: bool, up: int) -> None:
    t = 0.01 * np.arange(200)
    x, y, psi = np.sin(t), 0.5 * np.sin(2 * t), 1.5 * t
    order, turn = "XYZ", Rotation.from_euler("zy"[up == 1], psi[:, None])
    kinds = ["X", "Y", "Z"] if euler else ["X", "Y", "Z", "W"]
    rotation = turn.as_euler(order, degrees=True) if euler else turn.as_quat()
    place = np.column_stack([x, 0.1 + 0 * x, -y] if up == 1 else [x, y, 0.1 + 0 * x])
    n = len(kinds)
    lines = [
        f"Format Version,1.23,Rotation Type,{order if euler else 'Quaternion'},Length Units,Meters", "",
        ",Type" + ",Rigid Body" * (n + 3), ",Name" + ",Craft" * (n + 3), ",ID" + ",1" * (n + 3),
        "," + ",Rotation" * n + ",Position" * 3, "Frame,Time (Seconds)," + ",".join([*kinds, "X", "Y", "Z"]),
    ]  # fmt: skip
    rows = np.column_stack([rotation, place])
    lines += [f"{k},{t[k]:.4f}," + ",".join(f"{v:.9f}" for v in row) for k, row in enumerate(rows)]
    (tmp_path / "a.csv").write_text("\n".join(lines))
    check(tmp_path / "a.csv", x, y, psi)


def test_of_columns_of_latitude_and_longitude(tmp_path: Path) -> None:
    rows = [f"{k},{54 + 1e-5 * k},{10 - 2e-5 * k},{k}" for k in range(50)]
    (tmp_path / "a.csv").write_text("\n".join(["time,latitude,longitude,speed", *rows]))
    k = np.arange(50)
    text = check(tmp_path / "a.csv", -2e-5 * 65_579 * k, 1e-5 * 111_298 * k, near=2e-2)
    assert "psi: no name suggests a column" in text


def test_of_telemetry_names_the_frame(tmp_path: Path) -> None:
    pytest.importorskip("pymavlink")
    more.test_mavlink(tmp_path, 2)
    log, _ = followed(tmp_path / "a.tlog")
    assert log["y"][50:100] == pytest.approx(0.5 * (log.time[50:100] - log.time[0]) + log["y"][0], abs=1e-3)
    assert log["r"] == pytest.approx(-0.4 + 0 * log.time)


def test_a_course_over_ground_is_proposed_as_no_heading(tmp_path: Path) -> None:
    rmc = "$GPRMC,1000{:02d}.00,A,54{:07.4f},N,01000.0000,E,2.0,045.0,010526,,"
    (tmp_path / "a.nmea").write_text("\n".join(rmc.format(k, 0.001 * k) for k in range(50)))
    log, text = followed(tmp_path / "a.nmea")
    assert "psi" not in log.columns and "psi: no name suggests a column" in text
    assert log["y"][-1] == pytest.approx(0.049 / 60 * 111_298, rel=1e-3)
