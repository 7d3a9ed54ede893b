"""The same run is read from a file of each format: pose of one topic, commands of another, in SI."""

import warnings
from pathlib import Path

import numpy as np
import pytest

from hovercontrol.app.commands.options import pairs
from hovercontrol.base.errors import InputError
from hovercontrol.logs import Log, read_log
from tests.logs.readers import written

QUATERNION = ",".join(f"/odom/pose.pose.orientation.{k}" for k in "xyzw")
ODOM = f"x=/odom/pose.pose.position.x,y=/odom/pose.pose.position.y,psi={QUATERNION},thrust=/cmd/linear.x"

#: Format: library, what writes it, its file, --columns, tolerances of x [m] and psi [rad].
FORMATS = {
    "rosbag1": ("rosbags", lambda p: written.ros(p, "ros1"), "a.bag", ODOM, 1e-9),
    "rosbag2": ("rosbags", lambda p: written.ros(p, "sqlite3"), "folder", ODOM.replace("=/", "="), 1e-9),
    "mcap": ("rosbags", lambda p: written.ros(p, "mcap"), "folder", ODOM, 1e-9),
    "ulog": ("pyulog", written.ulog, "a.ulg",
             "x=vehicle_local_position/x,y=vehicle_local_position/y,psi=vehicle_local_position/heading,"
             "thrust=actuator_motors/control[0]", 1e-6),
    "ulog, attitude": ("pyulog", written.ulog, "a.ulg",
                       "x=vehicle_local_position.x,y=vehicle_local_position.y,psi=vehicle_attitude.q[1],"
                       "vehicle_attitude.q[2],vehicle_attitude.q[3],vehicle_attitude.q[0],"
                       "thrust=actuator_motors.control[0]", 1e-6),
    "ardupilot": ("pymavlink", written.ardupilot, "a.bin", "x=POS/PN,y=POS/PE,psi=ATT/Yaw,thrust=RCOU.C1", 1e-4),  # noqa: E501
    "mdf4": ("asammdf", written.mdf, "a.mf4", "x=pos_x,y=pos_y,psi=yaw", 1e-9),
    "mdf3": ("asammdf", lambda p: written.mdf(p, "3.30"), "a.mdf", "x=pos_x,y=pos_y,psi=yaw", 1e-9),
    "matlab": ("scipy", written.matlab, "a.mat", "x=pose.pos[0],y=pose.pos[1],psi=pose.yaw,thrust=cmd.thrust", 1e-12),  # noqa: E501
}  # fmt: skip


def made(name: str, folder: Path) -> tuple[Path, str]:
    library, write, file, columns, _ = FORMATS[name]
    pytest.importorskip(library)
    if name == "mcap" and file != "folder":
        return folder / file, columns
    write(folder / file)
    return folder / file, columns


def check(log: Log, tolerance: float) -> None:
    measured = np.isfinite(log["x"])
    time = log.time[measured]
    assert np.array_equal(np.round(np.diff(time), 9), np.full(time.size - 1, 0.02))
    assert 1 <= written.POSE_TIME.size - time.size <= 3  # cut where no command is known
    assert log["x"][measured] == pytest.approx(written.X[1 : 1 + time.size], abs=tolerance)
    assert log["psi"][measured] == pytest.approx(written.PSI[1 : 1 + time.size], abs=tolerance)
    thrust = np.floor(2.0 * (0.1 * np.floor((written.POSE_TIME[1:] - 0.005 + 1e-9) / 0.1) + 0.005))
    own = log["thrust"] if log["thrust"].max() < 10 else (log["thrust"] - 1000.0) / 100.0
    assert own[measured].tolist() == thrust[: time.size].tolist()


@pytest.mark.parametrize("name", FORMATS)
def test_a_run_is_read(tmp_path: Path, name: str) -> None:
    file, columns = made(name, tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check(read_log(file, pairs(columns), ["thrust"]), FORMATS[name][-1])


def test_a_single_mcap_file_and_a_single_database_are_bags(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    for kind, suffix in (("mcap", "*.mcap"), ("sqlite3", "*.db3")):
        folder = written.ros(tmp_path / kind, kind)
        (single,) = folder.glob(suffix)
        moved = single.rename(tmp_path / f"run{single.suffix}")
        check(read_log(moved, pairs(ODOM), ["thrust"]), 1e-9)


def test_stamps_of_messages_are_the_clock_unless_another_is_named(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    file = written.ros(tmp_path / "a.bag", "ros1")
    assert read_log(file, pairs(ODOM), ["thrust"]).origin == written.START + 20_000_000 - 20_000_000
    recorded = read_log(file, {**pairs(ODOM), "time": "/odom/time"}, ["thrust"])
    assert recorded.origin == written.START + 3_000_000
    parts = "/odom/header.stamp.sec+/odom/header.stamp.nanosec"
    assert read_log(file, {**pairs(ODOM), "time": parts}, ["thrust"]).origin == written.START


def test_units_that_a_log_states_are_converted_and_instances_are_topics(tmp_path: Path) -> None:
    pytest.importorskip("pymavlink")
    file = written.ardupilot(tmp_path / "a.bin")
    log = read_log(file, {"r": "IMU[1]/GyrZ", "psi": "ATT/Yaw", "x": "POS/PN", "y": "POS/PE"})
    assert log["r"] == pytest.approx(np.full(101, 2.5))
    with pytest.raises(InputError, match=r"column 'x', read as 'deg': expected a unit like 'm', found 'deg'"):
        read_log(file, {"x": "ATT/Yaw", "y": "POS/PE", "psi": "ATT/Roll"})


@pytest.mark.parametrize("euler", [False, True])
@pytest.mark.parametrize("lengths", ["Millimeters", "Meters"])
def test_a_motive_export(tmp_path: Path, euler: bool, lengths: str) -> None:
    file = written.motive(tmp_path / "take.csv", euler=euler, lengths=lengths)
    psi = "Craft.ry" if euler else "Craft.qx,Craft.qy,Craft.qz,Craft.qw:y-up"
    columns = pairs(f"x=Craft.x,y=Craft.z:-,psi={psi}")
    log = read_log(file, columns)
    assert "Motive export (Craft; lengths in" in log.notes[0]
    there = np.arange(101) != 5  # of one frame the markers were lost
    assert log.time == pytest.approx(written.POSE_TIME)
    assert np.isnan(log["x"][5]) and np.isnan(log["psi"][5])
    assert log["x"][there] == pytest.approx(written.X[there], abs=1e-6)
    assert log["psi"][there] == pytest.approx(written.PSI[there], abs=1e-6)
    assert log["Craft.y"][there] == pytest.approx(0.1)


@pytest.mark.parametrize("trajectories", [False, True])
def test_a_vicon_export(tmp_path: Path, trajectories: bool) -> None:
    file = written.vicon(tmp_path / "trial.csv", trajectories=trajectories)
    log = read_log(file, pairs("x=Craft.x,y=Craft.y,psi=Craft.rx,Craft.ry,Craft.rz"))
    assert log.time == pytest.approx(written.POSE_TIME + 0.02)
    assert log["x"] == pytest.approx(written.X, abs=1e-6)
    assert log["psi"] == pytest.approx(written.PSI, abs=1e-6)
    if trajectories:
        nose = read_log(file, {"x": "Craft:nose.x", "y": "Craft:nose.y", "psi": "Craft.rz"})
        assert np.isnan(nose["x"]).any() and np.isfinite(nose["x"]).sum() > 50


def test_a_library_that_is_missing_is_said_how_to_install(tmp_path: Path, monkeypatch) -> None:
    (tmp_path / "a.ulg").write_bytes(b"ULog\x01\x12\x35\x01" + bytes(8))

    def missing(name: str, *_: object) -> None:
        raise ImportError(f"No module named {name!r}")

    monkeypatch.setattr("hovercontrol.logs.readers.tables.import_module", missing)
    with pytest.raises(InputError, match=r'a.ulg: reading PX4 logs needs pyulog: pip install "\.\[logs\]"'):
        read_log(tmp_path / "a.ulg")


@pytest.mark.parametrize("suffix", ["bag", "mcap", "db3", "ulg", "bin", "mat", "mf4", "mdf", "pq", "csv"])
@pytest.mark.parametrize("content", [b"", bytes(range(256)) * 20])
def test_a_file_with_a_wrong_suffix_ends_in_one_line(tmp_path: Path, suffix: str, content: bytes) -> None:
    for library in ("rosbags", "pyulog", "pymavlink", "asammdf"):
        pytest.importorskip(library)
    file = tmp_path / f"a.{suffix}"
    file.write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_log(file)
    assert "\n" not in str(caught.value) and str(file) in str(caught.value)


def test_messages_without_a_length_are_refused(tmp_path: Path) -> None:
    pytest.importorskip("pymavlink")
    file = written.ardupilot(tmp_path / "a.bin")
    raw = bytearray(file.read_bytes())
    at = raw.find(b"\xa3\x95\x80\x05")  # the format of ATT
    raw[at + 4] = 0
    file.write_bytes(raw)
    with pytest.raises(InputError, match=f"byte {at}: expected messages of over 3 bytes, found 0"):
        read_log(file, {"psi": "ATT/Yaw"}, motion=False)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"PK\x03\x04" + bytes(60), "it seems to be an archive .*: unpack it, or save the sheet as CSV"),
        (b"H Product:Blackbox flight data recorder\n", "a log of Betaflight or INAV: blackbox_decode"),
        (b"IFHD\x00\x05", "an ADTF recording: adtf_dattool --export"),
        (b"ARROW1\x00\x00", "Feather.*: pyarrow.feather reads it"),
        (b"\x1f\x8b\x08\x00", "compressed by gzip: unpack it with gunzip"),
    ],
)
def test_a_file_that_no_reader_knows_is_named(tmp_path: Path, content: bytes, said: str) -> None:
    (tmp_path / "a.csv").write_bytes(content)
    with pytest.raises(InputError, match=rf"a\.csv: .*{said}"):
        read_log(tmp_path / "a.csv")
