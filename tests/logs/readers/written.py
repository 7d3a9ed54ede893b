"""Log files of each format, written by the format's own library or by its specification."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

#: Seconds of each pose, and of each command; the same in every file.
POSE_TIME = 0.02 * np.arange(101)
COMMAND_TIME = 0.1 * np.arange(21) + 0.005
START = 1_732_647_600_123_456_789

X = 0.5 * POSE_TIME
PSI = 1.5 * POSE_TIME - 1.0
THRUST = np.floor(COMMAND_TIME * 2.0)


def ros(path: Path, kind: str) -> Path:
    """Write /odom (nav_msgs/Odometry) and /cmd (geometry_msgs/Twist) into a bag: ros1, sqlite3 or mcap."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_HUMBLE)
    types = store.types
    v3, cov = types["geometry_msgs/msg/Vector3"], np.zeros(36)

    def odometry(k: int) -> object:
        now = START + round(1e9 * POSE_TIME[k])
        stamp = types["builtin_interfaces/msg/Time"](now // 10**9, now % 10**9)
        header = {"seq": k} if kind == "ros1" else {}
        pose = types["geometry_msgs/msg/Pose"](
            types["geometry_msgs/msg/Point"](X[k], 0.0, 0.0),
            types["geometry_msgs/msg/Quaternion"](0.0, 0.0, np.sin(PSI[k] / 2), np.cos(PSI[k] / 2)),
        )
        return types["nav_msgs/msg/Odometry"](
            types["std_msgs/msg/Header"](stamp=stamp, frame_id="odom", **header), "base",
            types["geometry_msgs/msg/PoseWithCovariance"](pose, cov),
            types["geometry_msgs/msg/TwistWithCovariance"](
                types["geometry_msgs/msg/Twist"](v3(0.5, 0.0, 0.0), v3(0.0, 0.0, 1.5)), cov
            ),
        )  # fmt: skip

    def twist(k: int) -> object:
        return types["geometry_msgs/msg/Twist"](v3(THRUST[k], 0.0, 0.0), v3(0.0, 0.0, 0.0))

    plugin = {"sqlite3": StoragePlugin.SQLITE3, "mcap": StoragePlugin.MCAP}
    writer = Writer1(path) if kind == "ros1" else Writer2(path, version=9, storage_plugin=plugin[kind])
    serialize = store.serialize_ros1 if kind == "ros1" else store.serialize_cdr
    with writer:
        odom = writer.add_connection("/odom", "nav_msgs/msg/Odometry", typestore=store)
        cmd = writer.add_connection("/cmd", "geometry_msgs/msg/Twist", typestore=store)
        late = 3_000_000  # a message is recorded 3 ms after its stamp
        for k, t in enumerate(POSE_TIME):
            raw = serialize(odometry(k), "nav_msgs/msg/Odometry")
            writer.write(odom, START + round(1e9 * t) + late, raw)
        for k, t in enumerate(COMMAND_TIME):
            writer.write(cmd, START + round(1e9 * t), serialize(twist(k), "geometry_msgs/msg/Twist"))
    return path


def ulog(path: Path) -> Path:
    """Write vehicle_local_position, vehicle_attitude and actuator_motors by PX4's specification of ULog."""

    def message(kind: bytes, body: bytes) -> bytes:
        return struct.pack("<HB", len(body), kind[0]) + body

    formats = (
        b"vehicle_local_position:uint64_t timestamp;float x;float y;float heading;uint8_t[4] _padding0;",
        b"vehicle_attitude:uint64_t timestamp;float[4] q;",
        b"actuator_motors:uint64_t timestamp;float[2] control;",
    )
    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 7_000_000)
    out += message(b"B", bytes(40))
    out += b"".join(message(b"F", text) for text in formats)
    for k, text in enumerate(formats):
        out += message(b"A", struct.pack("<BH", 0, k) + text.partition(b":")[0])
    rows = []
    for t, x, psi in zip(POSE_TIME, X, PSI, strict=True):
        now = 7_000_000 + round(1e6 * t)
        rows.append((now, message(b"D", struct.pack("<HQfff", 0, now, x, 0.0, psi))))
        now += 1000
        half = (psi + 0.0015) / 2  # of this time
        rows.append(
            (now, message(b"D", struct.pack("<HQffff", 1, now, np.cos(half), 0.0, 0.0, np.sin(half))))
        )
    for t, thrust in zip(COMMAND_TIME, THRUST, strict=True):
        now = 7_000_000 + round(1e6 * t)
        rows.append((now, message(b"D", struct.pack("<HQff", 2, now, thrust, 0.0))))
    path.write_bytes(out + b"".join(row for _, row in sorted(rows)))
    return path


def ardupilot(path: Path) -> Path:
    """Write POS, ATT and RCOU with units by ArduPilot's format of dataflash logs."""

    def fmt(kind: int, name: str, form: str, columns: str) -> bytes:
        sizes = {"Q": 8, "f": 4, "c": 2, "C": 2, "H": 2, "B": 1, "b": 1, "N": 16, "Z": 64, "d": 8}
        length = 3 + sum(sizes[c] for c in form)
        return b"\xa3\x95\x80" + struct.pack(
            "<BB4s16s64s", kind, length, name.encode(), form.encode(), columns.encode()
        )

    out = b"\xa3\x95\x80" + struct.pack(
        "<BB4s16s64s", 128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns"
    )
    out += fmt(1, "UNIT", "QbZ", "TimeUS,Id,Label") + fmt(2, "FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds")
    out += fmt(3, "MULT", "Qbd", "TimeUS,Id,Mult")
    out += fmt(4, "POS", "Qff", "TimeUS,PN,PE") + fmt(5, "ATT", "Qcc", "TimeUS,Roll,Yaw")
    out += fmt(6, "RCOU", "QHH", "TimeUS,C1,C2") + fmt(7, "IMU", "QBf", "TimeUS,I,GyrZ")
    for code, label in (("s", "s"), ("m", "m"), ("d", "deg"), ("Y", "us"), ("#", "instance"), ("E", "rad/s")):
        out += b"\xa3\x95\x01" + struct.pack("<Qb64s", 0, ord(code), label.encode())
    for code, value in (("-", 0.0), ("F", 1e-6), ("0", 1.0), ("B", 1e-2)):
        out += b"\xa3\x95\x03" + struct.pack("<Qbd", 0, ord(code), value)
    for kind, units, mults in ((4, "smm", "F00"), (5, "sdd", "FBB"), (6, "sYY", "F--"), (7, "s#E", "F-0")):
        out += b"\xa3\x95\x02" + struct.pack("<QB16s16s", 0, kind, units.encode(), mults.encode())
    rows = []
    for t, x, psi in zip(POSE_TIME, X, PSI, strict=True):
        now = 5_000_000 + round(1e6 * t)
        rows.append((now, b"\xa3\x95\x04" + struct.pack("<Qff", now, x, 0.0)))
        rows.append((now, b"\xa3\x95\x05" + struct.pack("<Qhh", now, 0, round(100 * np.degrees(psi)))))
        rows += [(now, b"\xa3\x95\x07" + struct.pack("<QBf", now, k, 1.5 + k)) for k in (0, 1)]
    for t, thrust in zip(COMMAND_TIME, THRUST, strict=True):
        now = 5_000_000 + round(1e6 * t)
        rows.append((now, b"\xa3\x95\x06" + struct.pack("<QHH", now, 1000 + round(100 * thrust), 0)))
    path.write_bytes(out + b"".join(row for _, row in sorted(rows)))
    return path


def mdf(path: Path, version: str = "4.10") -> Path:
    """Write a group of poses in mm and degrees, and one of commands."""
    from asammdf import MDF, Signal

    with MDF(version=version) as file:
        file.append([
            Signal(1000.0 * X, POSE_TIME, name="pos_x", unit="mm"),
            Signal(0.0 * X, POSE_TIME, name="pos_y", unit="mm"),
            Signal(np.degrees(PSI), POSE_TIME, name="yaw", unit="deg"),
        ], acq_name="pose")  # fmt: skip
        file.append([Signal(THRUST.astype(np.uint8), COMMAND_TIME, name="thrust")], acq_name="commands")
        file.save(path, overwrite=True)
    return path


def matlab(path: Path) -> Path:
    """Write a struct of poses and one of commands, each with its time."""
    from scipy.io import savemat

    pose = {"time": POSE_TIME, "pos": np.column_stack([X, 0.0 * X, 0.0 * X]), "yaw": PSI}
    savemat(path, {"pose": pose, "cmd": {"t": COMMAND_TIME[:, None], "thrust": THRUST}, "note": "a run"})
    return path


def motive(path: Path, *, euler: bool = False, lengths: str = "Millimeters") -> Path:
    """Write what Motive 3 exports of one rigid body with y up, turning about it; row 5 is lost."""
    scale = {"Millimeters": 1000.0, "Meters": 1.0}[lengths]
    axes = ["X", "Y", "Z"] if euler else ["X", "Y", "Z", "W"]
    columns = [*["Rotation"] * len(axes), *["Position"] * 3, "Mean Marker Error"]
    n = len(columns)
    take = f"Format Version,1.23,Take Name,Take 7,Capture Frame Rate,50.000000,Rotation Type,{'XYZ' if euler else 'Quaternion'},"  # noqa: E501
    lines = [
        take + f"Length Units,{lengths},Coordinate Space,Global", "",
        ",Type," + ",".join(["Rigid Body"] * n), ",Name," + ",".join(["Craft"] * n), ",ID," + ",".join(["1"] * n),  # noqa: E501
        ",," + ",".join(columns), "Frame,Time (Seconds)," + ",".join([*axes, "X", "Y", "Z", ""]),
    ]  # fmt: skip
    for k, (t, x, psi) in enumerate(zip(POSE_TIME, X, PSI, strict=True)):
        turn = [0.0, np.degrees(psi), 0.0] if euler else [0.0, np.sin(psi / 2), 0.0, np.cos(psi / 2)]
        cells = [f"{v:.9f}" for v in (*turn, scale * x, scale * 0.1, 0.0, 0.1)]
        lines.append(f"{k},{t:.6f}," + ",".join(cells if k != 5 else [""] * n))
    path.write_text("\n".join(lines))
    return path


def vicon(path: Path, *, trajectories: bool = True) -> Path:
    """Write what Nexus exports of one segment [mm, rotation vector in rad], and of a marker."""
    lines = [
        "Segments",
        "50",
        ",,Craft:Craft,,,,,",
        "Frame,Sub Frame,RX,RY,RZ,TX,TY,TZ",
        ",,rad,rad,rad,mm,mm,mm",
    ]
    lines += [
        f"{k + 1},0,0,0,{psi:.9f},{1000 * x:.6f},0,50" for k, (x, psi) in enumerate(zip(X, PSI, strict=True))
    ]
    if trajectories:
        lines += ["", "Trajectories", "50", ",,Craft:nose,,", "Frame,Sub Frame,X,Y,Z", ",,mm,mm,mm"]
        lines += [f"{k + 1},0,{1000 * x:.6f},1,2" if k != 5 else f"{k + 1},0,,," for k, x in enumerate(X)]
    path.write_text("\r\n".join(lines) + "\r\n")
    return path
