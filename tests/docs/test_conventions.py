"""Each row of the table of conventions is followed: a motion written as its source defines it is read.

The craft turns at `W` and slides: x + i y = (u + i v) e^(i psi)/(i W), where x is east.
"""

import io
import struct
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import hovercontrol as hc
from hovercontrol.app.commands.options import pairs
from hovercontrol.logs.frames import in_z_up
from tests.logs.readers.written_ros import START, Bag

sys.path.insert(0, str(Path(__file__).parents[2] / "docs"))
from generate.formats import CONVENTIONS

sys.path.pop(0)

W, U, V = 0.8, 0.5, 0.1
TIME = 1.0 * np.arange(9)  # NMEA and GPX have whole seconds
PSI = W * TIME - 0.5
PATH = (U + 1j * V) * np.exp(1j * PSI) / (1j * W)
EAST, NORTH = (PATH - PATH[0]).real, (PATH - PATH[0]).imag
COMPASS = np.pi / 2 - PSI  # clockwise from north
RATE = -W
TURN = np.column_stack([0 * PSI, 0 * PSI, np.sin(PSI / 2), np.cos(PSI / 2)])


def rows(*columns):
    return "\n".join("\t".join(f"{v:.9f}" for v in row) for row in np.column_stack(columns))


def ros(folder, transforms):
    bag = Bag(folder / "a")
    types = bag.store.types
    with bag.writer:
        for t, x, y, q in zip(TIME, EAST, NORTH, TURN, strict=True):
            ns = START + round(1e9 * t)
            turn = bag.Quaternion(*q)
            if transforms:
                move = types["geometry_msgs/msg/Transform"](bag.Vector3(x, y, 0.0), turn)
                bag.write("/tf", ns, bag.TFMessage([bag.TransformStamped(bag.header(ns), "base_link", move)]))
                continue
            pose = types["geometry_msgs/msg/Pose"](types["geometry_msgs/msg/Point"](x, y, 0.0), turn)
            speed = types["geometry_msgs/msg/Twist"](bag.Vector3(U, V, 0.0), bag.Vector3(0.0, 0.0, W))
            pose = types["geometry_msgs/msg/PoseWithCovariance"](pose, np.zeros(36))
            speed = types["geometry_msgs/msg/TwistWithCovariance"](speed, np.zeros(36))
            bag.write("/odom", ns, bag.Odometry(bag.header(ns), "base_link", pose, speed))
    return folder / "a"


def through_odom(folder):
    """Write the motion in map through a frame odom that slides and turns."""
    bag = Bag(folder / "a")

    def message(ns, parent, child, place, angle):
        turn = bag.Quaternion(0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2))
        move = bag.store.types["geometry_msgs/msg/Transform"](bag.Vector3(place.real, place.imag, 0.0), turn)
        return bag.TransformStamped(bag.header(ns, parent), child, move)

    with bag.writer:
        for k, t in enumerate(TIME):
            ns, shift, angle = START + round(1e9 * t), complex(0.5 * t, -3.0), 0.4 * t - 1.0
            local = (complex(EAST[k], NORTH[k]) - shift) * np.exp(-1j * angle)
            own = message(ns, "odom", "base_link", local, PSI[k] - angle)
            bag.write("/tf", ns, bag.TFMessage([own, message(ns, "map", "odom", shift, angle)]))
    return folder / "a"


def fit(folder):
    tool = pytest.importorskip("fit_tool")
    pytest.importorskip("fitdecode")
    from fit_tool.profile.messages.record_message import RecordMessage

    out = tool.FitFileBuilder(auto_define=True)
    for k, (lat, lon) in enumerate(zip(*fixes(), strict=True)):
        record = RecordMessage()
        record.timestamp, record.position_lat, record.position_long = 1000 * (START // 10**9 + k), lat, lon
        out.add(record)
    out.build().to_file(str(folder / "a.fit"))
    return folder / "a.fit"


def px4(folder):
    def message(kind, body):
        return struct.pack("<HB", len(body), kind[0]) + body

    position, attitude = b"vehicle_local_position", b"vehicle_attitude"
    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + message(b"B", bytes(40))
    out += message(b"F", position + b":uint64_t timestamp;float x;float y;")
    out += message(b"F", attitude + b":uint64_t timestamp;float[4] q;")
    out += b"".join(message(b"A", struct.pack("<BH", 0, k) + n) for k, n in enumerate((position, attitude)))
    for t, north, east, yaw in zip(TIME, NORTH, EAST, COMPASS, strict=True):
        now = round(1e6 * t)
        out += message(b"D", struct.pack("<HQff", 0, now, north, east))
        out += message(b"D", struct.pack("<HQffff", 1, now, np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)))
    (folder / "a.ulg").write_bytes(out)
    return folder / "a.ulg"


def ardupilot(folder):
    lines = [
        "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns", "FMT, 1, 20, ATT, Qcc, TimeUS,Roll,Yaw",
        "FMT, 2, 20, IMU, Qf, TimeUS,GyrZ", "FMT, 5, 20, POS, Qff, TimeUS,PN,PE",
        "FMT, 3, 20, UNIT, QbZ, TimeUS,Id,Label", "FMT, 4, 20, FMTU, QBNN, TimeUS,FmtType,UnitIds,MultIds",
        *(f"UNIT, 0, {ord(k)}, {unit}" for k, unit in (("d", "deg"), ("h", "degheading"), ("E", "rad/s"))),
        "FMTU, 0, 1, sdh, F00", "FMTU, 0, 2, sE, F0",
    ]  # fmt: skip
    for t, north, east, yaw in zip(TIME, NORTH, EAST, COMPASS, strict=True):
        now = round(1e6 * t)
        lines += [f"ATT, {now}, 0, {np.degrees(yaw) % 360:.6f}", f"IMU, {now}, {RATE}"]
        lines.append(f"POS, {now}, {north:.9f}, {east:.9f}")
    (folder / "a.log").write_text("\n".join(lines))
    return folder / "a.log"


def mavlink(folder):
    pytest.importorskip("pymavlink")
    from pymavlink.dialects.v20 import ardupilotmega as m

    sender, out = m.MAVLink(io.BytesIO(), srcSystem=1), bytearray()
    speed = (U + 1j * V) * np.exp(1j * PSI)
    for k, t in enumerate(TIME):
        now, yaw = round(1000 * t), (COMPASS[k] + np.pi) % (2 * np.pi) - np.pi
        for message in (
            m.MAVLink_attitude_message(now, 0.0, 0.0, yaw, 0.0, 0.0, RATE),
            m.MAVLink_local_position_ned_message(
                now, NORTH[k], EAST[k], 0.0, speed[k].imag, speed[k].real, 0.0
            ),
        ):
            out += struct.pack(">Q", START // 1000 + 1000 * now) + message.pack(sender)
    (folder / "a.tlog").write_bytes(out)
    return folder / "a.tlog"


def fixes():
    pymap3d = pytest.importorskip("pymap3d")
    return pymap3d.enu2geodetic(EAST, NORTH, 0.0 * EAST, 54.0, 10.0, 0.0)[:2]


def nmea(folder):
    pynmea2 = pytest.importorskip("pynmea2")
    lines = []
    for k, (lat, lon) in enumerate(zip(*fixes(), strict=True)):
        place = f"{int(lat):02d}{lat % 1 * 60:010.7f}", "N", f"{int(lon):03d}{lon % 1 * 60:010.7f}", "E"
        course = np.degrees(COMPASS[k] - np.arctan2(V, U)) % 360
        given = f"1000{k:02d}.00", "A", *place, "1.0", f"{course:.1f}", "010526", "", ""
        lines.append(str(pynmea2.RMC("GP", "RMC", given)))
        lines.append(str(pynmea2.HDT("HE", "HDT", (f"{np.degrees(COMPASS[k]) % 360:.4f}", "T"))))
    (folder / "a.nmea").write_text("\r\n".join(lines))
    return folder / "a.nmea"


def gpx(folder):
    gpxpy = pytest.importorskip("gpxpy")
    track, begin = gpxpy.gpx.GPX(), datetime(2026, 5, 1, 10, tzinfo=UTC)
    segment = gpxpy.gpx.GPXTrackSegment()
    track.tracks.append(gpxpy.gpx.GPXTrack())
    track.tracks[0].segments.append(segment)
    for t, lat, lon in zip(TIME, *fixes(), strict=True):
        segment.points.append(gpxpy.gpx.GPXTrackPoint(lat, lon, time=begin + timedelta(seconds=float(t))))
    (folder / "a.gpx").write_text(track.to_xml())
    return folder / "a.gpx"


def motive(folder, kind):
    """Write a body that turns about y, which is up; z is south."""
    turned = Rotation.from_rotvec(np.outer(PSI, [0.0, 1.0, 0.0]))
    euler = kind != "Quaternion"
    numbers = (
        turned.as_euler(kind, degrees=True)[:, [kind.index(a) for a in "XYZ"]] if euler else turned.as_quat()
    )
    names = list("XYZ" if euler else "XYZW")
    n = len(names) + 3
    lines = [
        f"Format Version,1.24,Rotation Type,{kind},Length Units,Meters", "", ",Type" + ",Rigid Body" * n,
        ",Name" + ",Craft" * n, ",ID" + ",1" * n, "," + ",Rotation" * len(names) + ",Position" * 3,
        f"Frame,Time (Seconds),{','.join(names)},X,Y,Z",
    ]  # fmt: skip
    body = rows(np.arange(9), TIME, numbers, EAST, 0.1 + 0 * TIME, -NORTH).replace("\t", ",")
    (folder / "a.csv").write_text("\n".join([*lines, body]))
    return folder / "a.csv"


def vicon(folder):
    head = "Segments\n1\n,,Craft:Craft,,,,,\nFrame,Sub Frame,RX,RY,RZ,TX,TY,TZ\n,,rad,rad,rad,mm,mm,mm\n"
    numbers = np.column_stack([0 * PSI, 0 * PSI, PSI, 1000 * EAST, 1000 * NORTH, 50 + 0 * PSI])
    lines = [f"{k + 1},0,{','.join(f'{v:.9f}' for v in row)}" for k, row in enumerate(numbers)]
    (folder / "a.csv").write_text(head + "\n".join(lines) + "\n")
    return folder / "a.csv"


def qualisys(folder):
    head = "NO_OF_FRAMES\t9\nFREQUENCY\t1\nDATA_INCLUDED\t6D\nBODY_NAMES\tboat\n"
    head += "Frame\tTime\tboat X\tY\tZ\tRoll\tPitch\tYaw\tResidual" + "".join(f"\tRot[{k}]" for k in range(9))
    turns = Rotation.from_rotvec(np.outer(PSI, [0.0, 0.0, 1.0])).as_matrix().transpose(0, 2, 1).reshape(9, 9)
    flat, yaw = 0.0 * TIME, np.degrees(PSI)
    own = (1000 * EAST, 1000 * NORTH, flat + 50.0, flat, flat, yaw, flat + 0.2)
    (folder / "a.tsv").write_text(head + "\n" + rows(np.arange(1, 10), TIME, *own, turns) + "\n")
    return folder / "a.tsv"


def opensim(folder):
    head = "run\nversion=1\ninDegrees=yes\nendheader\ntime\tx\ty\tpsi\tr\n"
    (folder / "a.mot").write_text(head + rows(TIME, EAST, NORTH, np.degrees(PSI), np.degrees(W) + 0 * PSI))
    return folder / "a.mot"


def trc(folder):
    """Write a marker with y up."""
    head = (
        "PathFileType\t4\t(X/Y/Z)\ta.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\t"
        "OrigDataStartFrame\tOrigNumFrames\n1\t1\t9\t1\tmm\t1\t1\t9\nFrame#\tTime\tbow\t\t\n\t\tX1\tY1\tZ1\n\n"
    )
    body = rows(np.arange(1, 10), TIME, 1000 * EAST, 20.0 + 0 * EAST, -1000 * NORTH)
    (folder / "a.trc").write_text(head + body + "\n")
    return folder / "a.trc"


WRITE = {
    "ROS `nav_msgs/Odometry`": lambda p: ros(p, transforms=False),
    "ROS `tf2_msgs/TFMessage`": lambda p: ros(p, transforms=True),
    "ROS `tf2_msgs/TFMessage`, through `odom`": through_odom,
    "PX4 `vehicle_local_position`, `vehicle_attitude`": px4,
    "ArduPilot `POS`, `ATT`, `IMU`": ardupilot,
    "MAVLink `LOCAL_POSITION_NED`, `ATTITUDE`": mavlink,
    "NMEA 0183": nmea,
    "GPX": gpx,
    "FIT": fit,
    "Motive (OptiTrack) CSV": lambda p: motive(p, "Quaternion"),
    "Motive (OptiTrack) CSV, Euler angles": lambda p: motive(p, "YXZ"),
    "Vicon CSV": vicon,
    "Qualisys TSV": qualisys,
    "OpenSim `.mot`, `.sto`": opensim,
    "C3D, TRC": trc,
}


@pytest.mark.parametrize("row", CONVENTIONS, ids=lambda row: row[0])
def test_a_row_read_as_it_says_is_the_motion(tmp_path, row):
    columns, frame = pairs(row[4]), row[5] or "z-up"
    log = in_z_up(hc.read_log(WRITE[row[0]](tmp_path), columns), frame)
    expected = {"x": EAST, "y": NORTH, "psi": PSI, "u": U, "v": V, "r": W}
    assert log.time - log.time[0] == pytest.approx(TIME, abs=1e-6)
    resolution = 1e-2 if row[0] == "FIT" else 2e-3  # a unit of FIT's positions is 9 mm
    for name in columns:
        origin = log[name][0] if name in "xy" else 0.0
        turns = 2 * np.pi * np.round((log[name] - expected[name]) / (2 * np.pi)) if name == "psi" else 0.0
        assert log[name] - origin - turns == pytest.approx(expected[name] + 0 * TIME, abs=resolution), name
