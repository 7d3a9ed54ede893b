"""File formats: logs, model files, scenario files, results, with their JSON Schemas."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from generate.pages import code, table, toctree, write
from hovercontrol.app.schema import KINDS, schema
from hovercontrol.craft.models.motion import MOTION
from hovercontrol.identification.check.facts import UNITS
from hovercontrol.logs.source import FORMATS

ABOUT = {
    "model": ("Model files (TOML)", "A craft as a list of effects. `hc.load_model`, `--model FILE`."),
    "scenario": (
        "Scenario files (TOML)",
        "What happens, to which craft, in which phases. `hovercontrol simulate FILE`.",
    ),
    "result": ("result.json of a diagnosis", "What `hovercontrol diagnose` found, for other programs."),
    "fmu": (
        "result.json of a diagnosis of an FMU",
        "What `hovercontrol diagnose --model FILE.fmu` found, for other programs.",
    ),
    "simulation": ("A simulation as JSON", "What `hovercontrol simulate --json` prints; also of an FMU."),
    "sweep": ("A sweep as JSON", "What `hovercontrol sweep --json` prints; also of an FMU."),
    "monitor": (
        "result.json of a monitor",
        "What `hovercontrol monitor` found.",
    ),
    "monitor_event": (
        "A line of monitor --follow",
        "What `hovercontrol monitor --follow` prints while a log grows: alarms, and faults of its rows.",
    ),
}


#: Frames, axes and units by source: position, heading, velocities, columns and frame, definition. A test follows each row.
CONVENTIONS = [
    ("ROS `nav_msgs/Odometry`", "x, y of `header.frame_id`, z up", "quaternion x, y, z, w", "`twist` along the body: forward, left",
     "x=/odom/pose.pose.position.x,y=/odom/pose.pose.position.y,psi=/odom/pose.pose.orientation.x,/odom/pose.pose.orientation.y,/odom/pose.pose.orientation.z,/odom/pose.pose.orientation.w,u=/odom/twist.twist.linear.x,v=/odom/twist.twist.linear.y,r=/odom/twist.twist.angular.z", "", "REP 103, REP 105"),
    ("ROS `tf2_msgs/TFMessage`", "of the child in its parent", "quaternion x, y, z, w", "none",
     "x=/tf[base_link]/transform.translation.x,y=/tf[base_link]/transform.translation.y,psi=/tf[base_link]/transform.rotation.x,/tf[base_link]/transform.rotation.y,/tf[base_link]/transform.rotation.z,/tf[base_link]/transform.rotation.w", "", "tf2"),
    ("ROS `tf2_msgs/TFMessage`, through `odom`", "of the child in `map`, transforms composed", "quaternion x, y, z, w", "none",
     "x=/tf[base_link in map]/transform.translation.x,y=/tf[base_link in map]/transform.translation.y,psi=/tf[base_link in map]/transform.rotation.x,/tf[base_link in map]/transform.rotation.y,/tf[base_link in map]/transform.rotation.z,/tf[base_link in map]/transform.rotation.w", "", "tf2; REP 105"),
    ("PX4 `vehicle_local_position`, `vehicle_attitude`", "x north, y east", "clockwise from north; quaternion w first", "vx, vy along north and east: no u, v",
     "x=vehicle_local_position/x,y=vehicle_local_position/y,psi=vehicle_attitude/q[1],vehicle_attitude/q[2],vehicle_attitude/q[3],vehicle_attitude/q[0]", "ned", "PX4 1.15, message definitions"),
    ("ArduPilot `POS`, `ATT`, `IMU`", "PN north, PE east", "Yaw, clockwise from north, deg", "VN, VE along north and east; GyrZ clockwise",
     "x=POS/PN,y=POS/PE,psi=ATT/Yaw,r=IMU/GyrZ", "ned", "ArduPilot 4.5, log messages"),
    ("MAVLink `LOCAL_POSITION_NED`, `ATTITUDE`", "x north, y east", "yaw, clockwise from north, rad", "vx, vy along north and east; yawspeed clockwise",
     "x=LOCAL_POSITION_NED/x,y=LOCAL_POSITION_NED/y,psi=ATTITUDE/yaw,r=ATTITUDE/yawspeed", "ned", "MAVLink 2, common.xml"),
    ("NMEA 0183", "latitude and longitude", "HDT, THS: clockwise from true north, deg", "speed and course over ground; a course is no heading",
     "x=RMC/lat,RMC/lon:north,y=RMC/lat,RMC/lon:east,psi=HDT/heading", "ned", "IEC 61162-1"),
    ("GPX", "latitude and longitude", "none", "none", "x=lat,lon:east,y=lat,lon:north", "enu", "GPX 1.1"),
    ("FIT", "latitude and longitude", "none: the heading of `gps_metadata` is a course", "speed over ground", "x=record/position_lat,record/position_long:north,y=record/position_lat,record/position_long:east", "ned", "FIT SDK 21, profile"),
    ("Motive (OptiTrack) CSV", "y up unless exported otherwise", "quaternion x, y, z, w", "none",
     "x=Craft.x,y=Craft.z:-,psi=Craft.qx,Craft.qy,Craft.qz,Craft.qw:y-up", "", "Motive 3, Data Export: CSV; NatNet SDK"),
    ("Motive (OptiTrack) CSV, Euler angles", "y up unless exported otherwise", "about the body's axes in the order of `Rotation Type`", "none",
     "x=Craft.x,y=Craft.z:-,psi=Craft.rx,Craft.ry,Craft.rz:y-up", "", "Motive 3, Data Export: CSV; NatNet SDK"),
    ("Vicon CSV", "z up", "rotation vector RX, RY, RZ", "none", "x=Craft.x,y=Craft.y,psi=Craft.rx,Craft.ry,Craft.rz", "", "Nexus 2, ASCII files"),
    ("Qualisys TSV", "z up, mm", "yaw, deg, by the project's definition of Euler angles", "none", "x=boat.x,y=boat.y,psi=boat.yaw", "", "QTM 2024, TSV export"),
    ("OpenSim `.mot`, `.sto`", "m", "deg where `inDegrees=yes`", "angles per second likewise", "x=x,y=y,psi=psi,r=r", "", "OpenSim 4, motion files"),
    ("C3D, TRC", "axes of the laboratory: `check` takes the one that moves least as vertical", "none", "none", "x=bow.x,y=bow.z:-", "", "c3d.org"),
]  # fmt: skip

#: What the page on logs says of other formats.
_OTHER_LOGS = (
    "## Formats",
    'A file\'s format is known by its content, else by its suffix. Libraries come with `pip install ".[logs]"` (ROS, PX4, ArduPilot, MDF) '
    'and `".[logs-all]"` (all).',
    table(
        ("format", "suffix", "library", "names of columns"),
        [(f.name, ", ".join(f"`{s}`" for s in f.suffixes), f.library, f.columns) for f in FORMATS],
    ),
    "ROS 2's bags are also read as the folder into which they were recorded. Files of other suffixes are read as CSV. Frames of CAN are decoded by "
    "a database (DBC) beside the file: the one of its name, or the only one in the folder. Messages of J1939 are known by their parameter group, whatever their source address and priority. "
    "MDF, HDF5, MATLAB 7.3 and C3D are read in a process of their own, since some damaged files crash or stall their libraries. An MCAP file that lost its end is read up to the break.",
    "In CSV these are recognised, and said in one line: commas, semicolons, tabs, bars or blanks between values; decimal commas; UTF-16; "
    "comment lines (`#`, `%`, `//`); lines above the header; units in its names (`x [mm]`, `T [degC]`) or in a line below it, which are converted to SI. Copies of the row before, and a last "
    "line without its end, are left out. Dates are those of ISO 8601, or day first with dots (31.12.2026). `True` and `False` are 1 and 0; durations are seconds (`0.5 sec`, `1 days 00:00:01`).",
    'Parquet states units in the metadata of its columns, or pandas in `attrs`: `frame.attrs = {"units": {"x": "mm"}}`. HDF5 is read by the conventions of netCDF (CF): '
    "`units`, `scale_factor`, `add_offset`, `_FillValue`, times since a date. Waveforms of TDMS begin at their `wf_start_time` if all state one.",
    "## Missing values",
    "Missing are blank and NaN cells, samples whose invalidation bit is set (MDF), points that were not seen (motion capture), the largest number of a measured field of "
    "MAVLink, and CAN values whose label says so (`SNA`, `Error`). Other labels are numbers: of `0 = Off` with a scale of 0.1 N the value is 0 N. A note of the log names each label that occurs.",
    "## Topics",
    "`hovercontrol check flight.ulg` lists the topics of a log with their rates, and unit, range and missing share of their columns, and proposes `--columns`. Each topic has its own "
    "clock. The rows of the log are those of the topic with most of the measured columns; measured columns of other topics are interpolated "
    "linearly between their rows, commands hold until the next row. A topic's clock is the stamp in the header of its ROS messages where that agrees with the "
    "time of recording to 10 s, else that time; `--columns time=/odom/time` names another. If no topic's stamps agree with it, as in a simulation at another speed, stamps are the clock of all topics. "
    "Dots may be written for slashes: `ATT.Yaw`.",
    "Elements that messages name are columns by their names, `/joint_states/position[rudder]`. Transforms are a table for each child frame, `/tf[base_link]/transform.translation.x`. "
    "A body below a moving frame is also a table in each fixed frame, `/tf[base_link in map]/...`: the transforms between them are composed at its stamps as tf2 does, `/tf_static` at all times. "
    "That pose jumps where a localisation corrects `odom` (REP 105): velocities are better in `odom`.",
    "## Conventions of the formats",
    "What a source means by its columns, and how it is read. The package's own frame is z up: psi turns from x to y, v is positive to the left.",
    table(
        ("source", "position", "heading", "velocities", "`--columns`", "`--frame`", "where it is defined"),
        [(*row[:4], f"`{row[4]}`", f"`{row[5]}`" if row[5] else "", row[6]) for row in CONVENTIONS],
    ),
    "`check` compares heading with course, yaw rate with the rate of the heading, velocities with the rate of the position, and the tilt of a body with its heading, and tells a contradiction with its likely cause.",
    "## Time and heading",
    table(
        ("`--columns`", "what it does"),
        [
            (
                "`time=stamp`",
                "a number in s; a date as ISO 8601 writes it; or a stamp since 1970 in s, ms, us or ns, told by its size",
            ),
            ("`time=stamp:ms`", "a number in another unit"),
            (
                "`time=sec+nanosec`",
                "a sum of integers; units by names (`sec`, `nsec`, `usec`, `week`), or `time=a:s+b:ns`; `time=gps_week+sow`",
            ),
            ("`psi=qx,qy,qz,qw`", "the heading of a quaternion, scalar last; also `quat(qx;qy;qz;qw)`"),
            (
                "`x=lat,lon:east`, `y=lat,lon:north`",
                "metres east and north of the first fix, in the plane tangent to the ellipsoid (WGS 84)",
            ),
            ("`psi=rx,ry,rz`", "the heading of a rotation vector; also `rotvec(rx;ry;rz)`"),
            (
                "`psi=qx,qy,qz,qw:y-up`",
                "about another axis: `x-up`, `y-up`, `z-up` (default), `z-down` ...; `:-z-up` turns the sign",
            ),
        ],
    ),
    "Dates and stamps since 1970 count from the first row; differences are exact to 1 ns. The heading is the angle about the axis that is up by the right-hand rule, "
    "in rad and without jumps, from the frame's x axis (y, where x is up) to the body's, projected on the floor. For `z-up` that is yaw, from x to y; for "
    "`y-up` it is from x to -z, so the plane's coordinates are `x=pos.x,y=pos.z:-`.",
)


def pages(into: Path) -> tuple[str, str]:
    """Write a page for each format."""
    for kind in KINDS:
        found = schema(kind)
        head, text = ABOUT[kind]
        plain = json.dumps(found, indent=1)
        (into / "formats").mkdir(parents=True, exist_ok=True)
        (into / "formats" / f"{kind}.schema.json").write_text(plain + "\n", encoding="utf-8")
        write(
            into / "formats" / f"{kind}.md",
            f"# {head}",
            text,
            code(f"$ hovercontrol schema {kind} > {kind}.schema.json", "console"),
            f"The whole JSON Schema (draft 2020-12): {{download}}`{kind}.schema.json`. Editors check and complete by it.",
            "## Keys",
            table(("key", "type", "what it is"), _rows(found)),
            "An effect is a number, or an object with `value`, `unit` and the numbers on [its page](../effects.md)."
            if kind == "model"
            else "",
        )
    write(
        into / "formats" / "log.md",
        "# Logs",
        "CSV or Parquet has a header and a row for each time: `time` and any of pose and body velocities, then the inputs by the plant's names. "
        "A log of a Block of your own has its inputs and any of its outputs or states by their names. Missing values are empty cells. Other names and units are mapped: `--columns time=stamp_ms:ms,psi=yaw:deg`. The frame is x, y on "
        "the floor with z up; psi turns from x to y. `--frame ned` converts north-east-down logs.",
        table(
            ("column", "unit", "what it is"),
            [
                ("`time`", "s", "time"),
                *((f"`{s.name}`", UNITS.get(s.name, s.unit), s.description) for s in MOTION),
                ("`thrust`, `rudder`, ...", "the plant's", "inputs, held from row to row"),
            ],
        ),
        code(
            "time,x,y,psi,thrust,rudder\n0.00,0.000,0.000,0.000,1.5,0.10\n0.02,0.000,0.000,0.001,1.5,0.10",
            "text",
        ),
        *_OTHER_LOGS,
    )
    write(
        into / "formats" / "parameters.md",
        "# Parameter files (TOML)",
        "Values for a model that is written in Python: `identify` and `diagnose` write `parameters.toml`, `--params` of every command that "
        "takes `FILE.py:NAME` reads it, and `hc.load_parameters(model, file)`.",
        code(
            '[model]\nname = "motor"\n\n[coefficients]\ngain = 13.9  # rad/s^2/V\n\n'
            "[effects]\nspeed_coulomb = 0.4\ninput_delay = {seconds = 0.04}",
            "toml",
        ),
    )
    kinds = ["log", "parameters", *KINDS]
    rows = [
        (
            "[Logs](formats/log.md)",
            "CSV, Parquet, and logs of ROS, PX4, ArduPilot, MAVLink, MATLAB, MDF, LabVIEW, CAN, GNSS, motion capture",
        )
    ]
    rows += [("[Parameter files](formats/parameters.md)", "TOML: what a fit found of a Block of your own")]
    rows += [(f"[{ABOUT[k][0]}](formats/{k}.md)", ABOUT[k][1]) for k in KINDS]
    write(into / "formats.md", "# File formats", table(("file", "what it is"), rows),
          toctree(f"formats/{k}" for k in kinds))  # fmt: skip
    return "formats", f"{len(kinds)} formats"


def _rows(found: dict[str, Any], prefix: str = "", depth: int = 0) -> list[tuple[str, str, str]]:
    """Return keys, types and texts, nested keys by dots; the deepest are in the schema's file."""
    rows = []
    for part in found.get("anyOf", [found]) if "properties" not in found else [found]:
        for key, inside in part.get("properties", {}).items():
            rows.append((f"`{prefix}{key}`", _type(inside), inside.get("description", "")))
            if depth < 2 and not prefix.startswith("effects."):  # each effect has its page
                more = inside.get("items", inside)
                rows += _rows(more, f"{prefix}{key}{'[]' if more is not inside else ''}.", depth + 1)
    return list(dict.fromkeys(rows))


def _type(inside: dict[str, Any]) -> str:
    if "enum" in inside:
        return " or ".join(f"`{v}`" for v in inside["enum"])
    if "anyOf" in inside:
        return " or ".join(dict.fromkeys(_type(part) for part in inside["anyOf"]))
    kind = inside.get("type", "")
    text = " or ".join(kind) if isinstance(kind, list) else kind
    low, high = inside.get("minimum"), inside.get("maximum")
    limits = [f"at least {low:g}"] if low is not None else []
    limits += [f"at most {high:g}"] if high is not None else []
    return f"{text}, {' and '.join(limits)}" if limits else text
