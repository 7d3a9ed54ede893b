"""A proposal for ``--columns``, as far as the names of a file's columns and its format suggest them."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.logs.log import POSE, VELOCITY
from hovercontrol.logs.topic import Topic

#: Topics with setpoints instead of measurements, and with a simulator's ground truth.
_WANTED = re.compile(r"set_?point|desired|target|reference|groundtruth|_sp\b", re.IGNORECASE)
_COMMAND = re.compile(
    r"cmd|command|(^|/)drive\b|steer|actuator|motor|servo|rc_?ou|throttle|thrust|rudder|pwm|fan|esc",
    re.IGNORECASE,
)
_NO_POSITION = re.compile(
    r"vel|acc|gyr|angular|linear|orient|quat|twist|mag|rot|del|\bv[xy]$|var|ref_", re.IGNORECASE
)

#: Suffixes of the names of x and y of a position, of a heading, of a yaw rate, and of body velocities.
_POSITIONS = ((r"x", "y"), (r"\bPN", "PE"), (r"pos\[0\]", "pos[1]"), (r"position\[0\]", "position[1]"))
_HEADING = re.compile(r"(^|[./_])(heading|yaw|psi)$", re.IGNORECASE)
_PLANAR_HEADING = re.compile(r"(^|[./_])theta$", re.IGNORECASE)  # of geometry_msgs/Pose2D
_RATE = re.compile(
    r"(angular(_velocity)?\.z|angular_velocity/xyz\[2\]|GyrZ|yaw_?rate|yawspeed|(^|[./])r)$", re.IGNORECASE
)
_QUATERNIONS = (
    ("orientation.x", "orientation.y", "orientation.z", "orientation.w"),
    ("rotation.x", "rotation.y", "rotation.z", "rotation.w"),
    ("qx", "qy", "qz", "qw"),
    ("/q[1]", "/q[2]", "/q[3]", "/q[0]"),  # PX4: the scalar first
    (".rx", ".ry", ".rz"),
)

#: Maximum number of proposed commands if no model gives the number of its inputs.
MOST_COMMANDS = 4

#: Formats whose frame is north-east-down.
_NED = ("PX4 ULog", "ArduPilot log", "ArduPilot log as text", "MAVLink telemetry", "NMEA 0183", "GPX", "FIT")

#: Formats whose vertical axis is the exporter's choice: the axis along which a body moves least.
_ANY_UP = ("Motive (OptiTrack) CSV", "Vicon CSV", "C3D", "TRC (motion capture)", "HDF5", "MATLAB")

#: Suffixes of the names of latitude and longitude.
_LATITUDE = re.compile(r"(^|[./_])lat(itude)?(_deg)?$", re.IGNORECASE)
_LONGITUDE = re.compile(r"(^|[./_])(lon|lng|long|longitude)(_deg)?$", re.IGNORECASE)


def proposal(topics: Sequence[Topic], kind: str, inputs: Sequence[str] = ()) -> tuple[dict[str, str], str]:
    """Return columns by signal name, as far as the file suggests them, and the frame of the log.

    Parameters
    ----------
    kind : str
        Name of the format.
    inputs : sequence of str, optional
        The model's inputs; without them up to four changing commands are proposed.
    """
    measured = [topic for topic in topics if not _WANTED.search(topic.name)]
    found: dict[str, str] = {}
    ned = kind in _NED
    poses = [pose for topic in measured if (pose := _pose(topic))]
    if poses:
        # prefer a pose that moves, then one with the heading in the same topic, then that with most rows
        found, topic = max(poses, key=lambda pair: (_moves(*pair), "psi" in pair[0], pair[1].rows))
        found = _upright(found, topic) if kind in _ANY_UP else found
    elif places := [place for topic in measured if (place := _fix(topic, ned=ned))]:
        found = max(places, key=lambda pair: pair[1].rows)[0]
    if found and "psi" not in found:
        headings = [psi for topic in measured if (psi := _heading(topic))]
        found |= {"psi": headings[0]} if headings else {}
    rates = [
        name
        for topic in measured
        for name in topic.header
        if _RATE.search(name) and not _COMMAND.search(name)
    ]
    found |= {"r": rates[0]} if rates else {}
    return found | _commands(topics, inputs, set(found.values())), "ned" if ned else ""


def _moves(pose: dict[str, str], topic: Topic) -> bool:
    """Return whether a position changes: a frame at rest is no craft."""
    return any(name in _changing(topic) for name in (pose["x"], pose["y"]))


def has_fix(header: Sequence[str]) -> bool:
    """Return whether there are columns of latitude and longitude.

    Examples
    --------
    >>> has_fix(["time", "GPS/Lat", "GPS/Lng"]), has_fix(["time", "x", "latency"])
    (True, False)
    """
    return all(any(map(end.search, header)) for end in (_LATITUDE, _LONGITUDE))


def _fix(topic: Topic, *, ned: bool) -> tuple[dict[str, str], Topic] | None:
    """Return a position from latitude and longitude: x north and y east in NED, else x east and y north."""
    if not has_fix(topic.header):
        return None
    lat, lon = (next(filter(end.search, topic.header)) for end in (_LATITUDE, _LONGITUDE))
    axes = ("north", "east") if ned else ("east", "north")
    return {ours: f"{lat},{lon}:{axis}" for ours, axis in zip("xy", axes, strict=True)}, topic


def _upright(pose: dict[str, str], topic: Topic) -> dict[str, str]:
    """Return the pose about the axis along which the body moves least, if that is x or y."""
    stem = pose["x"].removesuffix("x")
    axes = [f"{stem}{axis}" for axis in "xyz"]
    if not pose["x"].endswith("x") or not set(axes) <= set(topic.header):
        return pose
    values = topic.values(axes)
    ranges = [np.ptp(v[np.isfinite(v)]) if np.isfinite(v).any() else 0.0 for v in values.values()]
    up = int(np.argmin(ranges))
    turned = pose | {"psi": f"{pose['psi']}:{'xyz'[up]}-up"} if "," in pose.get("psi", "") else pose
    _, y, z = axes
    return turned | ({"x": y, "y": z} if up == 0 else {"y": f"{z}:-"}) if up != 2 else pose


def _pose(topic: Topic) -> tuple[dict[str, str], Topic] | None:
    header = set(topic.header)
    for first, second in _POSITIONS:
        for name in topic.header:
            end = re.search(f"(^|[./_]|){first}$", name)
            if not end or _COMMAND.search(name):
                continue
            plain = first.replace("\\b", "").replace("\\", "")
            stem = name[: len(name) - len(plain)]
            alone = not stem or stem[-1] in "./_" or len(plain) > 1
            if (
                alone
                and f"{stem}{second}" in header
                and not _NO_POSITION.search(stem.removeprefix(topic.name))
            ):
                pose = {"x": name, "y": f"{stem}{second}"}
                psi = _heading(topic)
                return ({**pose, "psi": psi} if psi else pose), topic
    return None


def _heading(topic: Topic) -> str:
    """Return the column of the heading, or the columns of a rotation; empty if none has a value."""
    header = topic.header
    there = set(header)
    planar = not any(re.search(r"(^|[./_])phi$", name) for name in header)  # else theta is the pitch
    for pattern in (_HEADING, _PLANAR_HEADING) if planar else (_HEADING,):
        for name in filter(pattern.search, header):
            if np.isfinite(topic.values([name])[name]).any():
                return name
    for ends in _QUATERNIONS:
        for name in header:
            if name.endswith(ends[0]):
                stem = name[: len(name) - len(ends[0])]
                if all(f"{stem}{end}" in there for end in ends):
                    return ",".join(f"{stem}{end}" for end in ends)
    return ""


def _commands(topics: Sequence[Topic], inputs: Sequence[str], taken: set[str]) -> dict[str, str]:
    """Return the commands: first by the names of the model's inputs, then changing columns in order."""
    found: dict[str, str] = {}
    names = [name for topic in topics for name in topic.header if name not in taken]
    for ours in inputs:
        plain = ours.lower()
        alike = [n for n in names if re.split(r"[./]", n)[-1].lower() == plain]
        alike = alike or [n for n in names if plain in re.split(r"[./]", n)[-1].lower()]
        if alike:
            found[ours] = alike[0]
    open_inputs = [name for name in inputs if name not in found]
    if inputs and not open_inputs:
        return found
    changing = [
        n for topic in topics if _COMMAND.search(topic.name) for n in _changing(topic) if n not in taken
    ]
    changing = [name for name in changing if name not in found.values()]
    if inputs:
        return found | dict(zip(open_inputs, changing, strict=False))
    own = [re.sub(r"\W+", "_", re.split("/", name)[-1]).strip("_") for name in changing[:MOST_COMMANDS]]
    return {
        ours: theirs for ours, theirs in zip(own, changing, strict=False) if ours not in (*POSE, *VELOCITY)
    }


def _changing(topic: Topic) -> list[str]:
    """Return the columns of a topic that are not its clocks and that change."""
    clocks = re.compile(r"(time|stamp|timestamp\w*|TimeUS|TimeMS|sec|nanosec|seq)$")
    names = [name for name in topic.header if name != topic.clock and not clocks.search(name)]
    try:
        values = topic.values(names)
    except InputError:
        return []
    return [n for n in names if np.isfinite(values[n]).any() and np.nanmax(values[n]) > np.nanmin(values[n])]
