"""Bags with the habits of real recordings, written by rosbags."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

START = 1_764_300_000 * 10**9
STEP = 20_000_000


class Bag:
    """A bag that is being written, with constructors of messages."""

    def __init__(self, folder: Path, compression: str = "none") -> None:
        pytest.importorskip("rosbags")
        from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore

        self.store = get_typestore(Stores.ROS2_JAZZY)
        self.writer = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
        if compression == "zstd":
            self.writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        self.topics: dict[str, Any] = {}

    def __getattr__(self, name: str) -> Callable[..., Any]:
        package = next(key for key in self.store.types if key.endswith(f"/msg/{name}"))
        return self.store.types[package]

    def header(self, ns: int, frame: str = "odom") -> Any:
        return self.Header(self.store.types["builtin_interfaces/msg/Time"](ns // 10**9, ns % 10**9), frame)

    def pose(self, x: float) -> tuple[Any, Any]:
        return self.Vector3(x, 0.0, 0.0), self.Quaternion(0.0, 0.0, 0.0, 1.0)

    def odometry(self, ns: int, x: float) -> Any:
        types = self.store.types
        _, turn = self.pose(x)
        pose = types["geometry_msgs/msg/Pose"](types["geometry_msgs/msg/Point"](x, 0.0, 0.0), turn)
        return self.Odometry(
            self.header(ns), "base", types["geometry_msgs/msg/PoseWithCovariance"](pose, np.zeros(36)),
            types["geometry_msgs/msg/TwistWithCovariance"](self.twist(0.5), np.zeros(36)),
        )  # fmt: skip

    def twist(self, x: float) -> Any:
        zero = self.Vector3(0.0, 0.0, 0.0)
        return self.store.types["geometry_msgs/msg/Twist"](self.Vector3(x, 0.0, 0.0), zero)

    def write(self, topic: str, ns: int, message: Any) -> None:
        kind = message.__msgtype__
        if topic not in self.topics:
            self.topics[topic] = self.writer.add_connection(topic, kind, typestore=self.store)
        self.writer.write(self.topics[topic], ns, self.store.serialize_cdr(message, kind))


def joints(folder: Path) -> Path:
    """Write /joint_states of two publishers, with two joints at 0.1 and 1, and one at 50."""
    bag = Bag(folder)
    with bag.writer:
        for k in range(100):
            ns, none = START + k * STEP, np.zeros(0)
            two = bag.JointState(bag.header(ns), ["rudder", "sail"], np.array([0.1, 1.0]), none, none)
            bag.write("/joint_states", ns, two)
            one = bag.JointState(bag.header(ns + 5_000_000), ["prop"], np.array([50.0]), none, none)
            bag.write("/joint_states", ns + 5_000_000, one)
    return folder


def transforms(folder: Path) -> Path:
    """Write /tf with base_link at 0.5 m/s in odom, and odom at rest in map."""
    bag = Bag(folder)

    def message(ns: int, parent: str, child: str, x: float) -> Any:
        move = bag.store.types["geometry_msgs/msg/Transform"](*bag.pose(x))
        return bag.TransformStamped(bag.header(ns, parent), child, move)

    with bag.writer:
        for k in range(100):
            ns = START + k * STEP
            both = [message(ns, "odom", "base_link", 0.01 * k)]
            both += [message(ns, "map", "odom", 10.0)] if k % 5 == 0 else []
            bag.write("/tf", ns, bag.TFMessage(both))
    return folder


def drifting_path(t: Any) -> dict[str, Any]:
    """Return the path of a craft in map, in closed form."""
    return {"x": 2.0 * np.cos(t), "y": 2.0 * np.sin(t), "psi": t + 0.3}


def drifting(folder: Path) -> Path:
    """Write /tf with base_link in odom, and odom in map at a quarter of the rate, which slides and turns.

    The craft follows :func:`drifting_path` in map. /tf_static has map in world, 100 m along x.
    """
    bag = Bag(folder)

    def message(ns: int, parent: str, child: str, x: float, y: float, angle: float) -> Any:
        turn = bag.Quaternion(0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2))
        move = bag.store.types["geometry_msgs/msg/Transform"](bag.Vector3(x, y, 0.0), turn)
        return bag.TransformStamped(bag.header(ns, parent), child, move)

    with bag.writer:
        bag.write("/tf_static", START, bag.TFMessage([message(START, "world", "map", 100.0, 0.0, 0.0)]))
        for k in range(100):
            ns, t = START + k * STEP, 0.02 * k
            own = drifting_path(t)
            shift, angle = complex(0.5 * t, -0.2 * t), 0.4 * t - 0.5  # of odom in map
            local = (complex(own["x"], own["y"]) - shift) * np.exp(-1j * angle)
            both = [message(ns, "odom", "base_link", local.real, local.imag, own["psi"] - angle)]
            if k % 5 == 0 and k <= 90:
                both.append(message(ns, "map", "odom", shift.real, shift.imag, angle))
            bag.write("/tf", ns, bag.TFMessage(both))
    return folder


def simulated(folder: Path, speed: float) -> Path:
    """Write /odom with stamps from 100 s on, and /cmd_vel without, of a simulation at `speed`."""
    bag = Bag(folder)
    with bag.writer:
        for k in range(100):
            ns, stamp = START + round(k * STEP / speed), 100 * 10**9 + k * STEP
            bag.write("/odom", ns, bag.odometry(stamp, 0.5 * stamp / 1e9 - 50.0))
            bag.write("/cmd_vel", ns + 1, bag.twist(float(k // 25)))
    return folder


def odd(folder: Path) -> Path:
    """Write /odom with two stamps of zero, and /actuators whose first array is empty."""
    bag = Bag(folder)
    layout = bag.MultiArrayLayout([], 0)
    with bag.writer:
        for k in range(100):
            ns = START + k * STEP
            bag.write("/odom", ns, bag.odometry(0 if k in (0, 50) else ns, 0.5 * k * STEP / 1e9))
            values = np.array([] if k == 0 else [1.0, 0.2], dtype=np.float32)
            bag.write("/actuators", ns, bag.Float32MultiArray(layout, values))
    return folder


def cut(folder: Path, compression: str) -> Path:
    """Write /odom, and keep two thirds of the file's chunk and no metadata."""
    bag = Bag(folder / "whole", compression)
    rng = np.random.default_rng(0)
    with bag.writer:
        for k in range(1000):
            message = bag.odometry(START + k * STEP, 0.5 * k * STEP / 1e9)
            message.pose.covariance[:] = rng.normal(size=36)
            bag.write("/odom", START + k * STEP, message)
    raw, at = next((folder / "whole").glob("*.mcap")).read_bytes(), 8
    while raw[at] != 6:  # records before the chunk
        at += 9 + int.from_bytes(raw[at + 1 : at + 9], "little")
    (folder / "cut").mkdir()
    size = int.from_bytes(raw[at + 1 : at + 9], "little")
    (folder / "cut" / "a.mcap").write_bytes(raw[: at + 2 * size // 3])
    return folder / "cut" / "a.mcap"
