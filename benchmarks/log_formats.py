"""Logs of 100 MB in several formats (made on the spot): ``read_log``, each in a process of its own."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from benchmarks import log_writers as writers
from benchmarks.log_writers import SIZE

SECONDS = 15.0
"""Longest time that is accepted."""

CODE = """
import resource, sys, time
from hovercontrol.app.commands.options import pairs
from hovercontrol.logs import read_log
def used():
    own, child = map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return own.ru_utime + own.ru_stime + child.ru_utime + child.ru_stime, own.ru_maxrss + child.ru_maxrss
begin, before = time.perf_counter(), used()[0]
log = read_log(sys.argv[1], pairs(sys.argv[2]), sys.argv[3].split())
spent, (processor, peak) = time.perf_counter() - begin, used()
print(len(log), spent, processor - before, peak / 2**20)
"""


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    for name, (write, suffix, columns, inputs) in FORMATS.items():
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"large{suffix}"
            child = os.fork()  # what making the file takes does not count
            if child == 0:
                try:
                    write(path)
                except ImportError:
                    os._exit(1)
                os._exit(0)
            if os.waitpid(child, 0)[1]:
                yield f"{name}, not measured: its library is missing", "", "", None
                continue
            files = path.iterdir() if path.is_dir() else [path]
            size = sum(file.stat().st_size for file in files) / 1e6
            command = [sys.executable, "-W", "ignore", "-c", CODE, str(path), columns, inputs]
            done = subprocess.run(command, capture_output=True, text=True, check=True)
        count, spent, processor, peak = done.stdout.split()
        what = f"{name}, {size:.0f} MB, {count} rows"
        limit = f"<= {SECONDS:g} s"
        yield (
            what,
            f"{float(spent):.1f} s (processor {float(processor):.1f} s), {float(peak):.2f} GiB",
            limit,
            float(spent) <= SECONDS,
        )


def table(separator: str, decimal: str, units: str = "", first: float = 0.0) -> Callable[[Path], None]:
    """Return what writes a text table of nine columns."""

    def write(path: Path) -> None:
        names = ["time", "x", "y", "psi", "thrust", "a", "b", "c", "d"]
        values = [[f"{np.sin(k + j):.6f}".replace(".", decimal) for j in range(8)] for k in range(1000)]
        tails = [separator.join(row) for row in values]
        with path.open("w") as file:
            file.write(separator.join(names) + "\n" + units)
            k = 0
            while file.tell() < SIZE:
                stamps = (f"{first + 0.02 * j:.9f}".replace(".", decimal) for j in range(k, k + 1000))
                file.write("".join(f"{t}{separator}{tail}\n" for t, tail in zip(stamps, tails, strict=True)))
                k += 1000

    return write


def ulog(path: Path) -> None:
    """Write poses of 60 bytes at 100 Hz and commands at 50 Hz."""
    form = "a:uint64_t timestamp;float x;float y;float heading;float[8] other;"
    forms = (form, "b:uint64_t timestamp;float[2] control;")
    body = b"".join(struct.pack("<HB", len(text), ord("F")) + text.encode() for text in forms)
    for k, text in enumerate(forms):
        body += struct.pack("<HBBH", 4, ord("A"), 0, k) + text[:1].encode()
    with path.open("wb") as file:
        file.write(b"ULog\x01\x12\x35\x01" + bytes(8) + struct.pack("<HB", 40, ord("B")) + bytes(40) + body)
        pose, command = struct.Struct("<HBHQ11f"), struct.Struct("<HBHQ2f")
        for k in range(SIZE // 70):
            other = [0.1] * 8
            file.write(
                pose.pack(pose.size - 3, ord("D"), 0, 10_000 * k, 0.01 * k % 7, 0.0, 0.001 * k, *other)
            )
            if k % 2:
                file.write(
                    command.pack(command.size - 3, ord("D"), 1, 10_000 * k + 5000, float(k // 50 % 3), 0.0)
                )


def ardupilot(path: Path) -> None:
    """Write POS and ATT at 100 Hz and RCOU at 50 Hz."""

    def fmt(kind: int, length: int, name: bytes, form: bytes, columns: bytes) -> bytes:
        return b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", kind, length, name, form, columns)

    head = fmt(128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    head += fmt(4, 43, b"POS", b"Qffffffff", b"TimeUS,PN,PE,a,b,c,d,e,f") + fmt(
        5, 19, b"ATT", b"Qff", b"TimeUS,Roll,Yaw"
    )
    head += fmt(6, 15, b"RCOU", b"QHH", b"TimeUS,C1,C2")
    with path.open("wb") as file:
        file.write(head)
        for k in range(SIZE // 70):
            now = 10_000 * k
            file.write(b"\xa3\x95\x04" + struct.pack("<Qffffffff", now, 0.01 * k % 7, *[0.0] * 7))
            file.write(b"\xa3\x95\x05" + struct.pack("<Qff", now, 0.0, 0.001 * k))
            if k % 2:
                file.write(b"\xa3\x95\x06" + struct.pack("<QHH", now + 5000, 1500 + k // 50 % 3, 0))


def mcap(path: Path) -> None:
    """Write nav_msgs/Odometry at 100 Hz and geometry_msgs/Twist at 50 Hz."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    t = store.types
    v3, zeros = t["geometry_msgs/msg/Vector3"], np.zeros(36)
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        odom = writer.add_connection("/odom", "nav_msgs/msg/Odometry", typestore=store)
        cmd = writer.add_connection("/cmd", "geometry_msgs/msg/Twist", typestore=store)
        for k in range(SIZE // 780):
            now = 1_732_647_600 * 10**9 + 10_000_000 * k
            stamp = t["builtin_interfaces/msg/Time"](now // 10**9, now % 10**9)
            psi = 0.001 * k
            pose = t["geometry_msgs/msg/Pose"](
                t["geometry_msgs/msg/Point"](0.01 * k % 7, 0.0, 0.0),
                t["geometry_msgs/msg/Quaternion"](0.0, 0.0, np.sin(psi / 2), np.cos(psi / 2)),
            )
            twist = t["geometry_msgs/msg/Twist"](v3(float(k // 50 % 3), 0.0, 0.0), v3(0.0, 0.0, 0.0))
            message = t["nav_msgs/msg/Odometry"](
                t["std_msgs/msg/Header"](stamp=stamp, frame_id="odom"),
                "base",
                t["geometry_msgs/msg/PoseWithCovariance"](pose, zeros),
                t["geometry_msgs/msg/TwistWithCovariance"](twist, zeros),
            )
            writer.write(odom, now, bytes(store.serialize_cdr(message, message.__msgtype__)))
            if k % 2:
                writer.write(cmd, now + 5_000_000, bytes(store.serialize_cdr(twist, twist.__msgtype__)))


ODOM = ",".join(f"/odom/pose.pose.orientation.{k}" for k in "xyzw")

#: Format: what writes it, its suffix, --columns, inputs.
FORMATS = {
    "plain CSV": (table(",", "."), ".csv", "thrust=thrust", "thrust"),
    "CSV, semicolons, decimal commas, units": (
        table(";", ",", "s;mm;mm;deg;A;-;-;-;-\n"), ".csv", "thrust=thrust", "thrust"),
    "blanks": (table(" ", "."), ".txt", "thrust=thrust", "thrust"),
    "CSV, stamps of an epoch": (table(",", ".", first=1_732_647_600.0), ".csv", "thrust=thrust", "thrust"),
    "PX4 ULog": (ulog, ".ulg", "x=a/x,y=a/y,psi=a/heading,thrust=b/control[0]", "thrust"),
    "ArduPilot BIN": (ardupilot, ".bin", "x=POS/PN,y=POS/PE,psi=ATT/Yaw,thrust=RCOU/C1", "thrust"),
    "MCAP": (mcap, "", f"x=/odom/pose.pose.position.x,y=/odom/pose.pose.position.y,psi={ODOM},thrust=/cmd/linear.x",  # noqa: E501
             "thrust"),
    "MAVLink": (writers.mavlink, ".tlog", "x=LOCAL_POSITION_NED/x,y=LOCAL_POSITION_NED/y,psi=ATTITUDE/yaw", ""),  # noqa: E501
    "MDF 4": (writers.mdf, ".mf4", "x=x,y=y,psi=psi", ""),
    "HDF5": (writers.hdf5, ".h5", "x=x,y=y,psi=psi", ""),
    "TDMS": (writers.tdms, ".tdms", "x=x,y=y,psi=psi", ""),
    "MATLAB": (writers.matlab, ".mat", "x=x,y=y,psi=psi", ""),
    "NMEA": (writers.nmea, ".nmea", "x=RMC/lat,RMC/lon:north,y=RMC/lat,RMC/lon:east", ""),
    "CAN frames, ASC": (writers.can_frames, ".asc", "u=M/u,r=M/r", ""),
}  # fmt: skip
