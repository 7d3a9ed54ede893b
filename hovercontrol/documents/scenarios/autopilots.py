"""The section ``[autopilot]`` of a scenario."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hovercontrol.base.boundary import as_user
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.base.tables import number
from hovercontrol.blocks.random_numbers import LARGEST_SEED
from hovercontrol.control.autopilot import SWITCHES, Imperfections
from hovercontrol.control.autopilot.navigation import NAVIGATION, check_beacons
from hovercontrol.craft.hardware.actuators import (
    FanTable,
    VariablePitch,
    read_fan_table,
    read_servo_table,
    table_pair,
)
from hovercontrol.craft.hardware.sensors import Beacons
from hovercontrol.documents.scenarios.definition import Autopilot

#: What may push the craft: K06's reversing fan, or the variable-pitch propeller that it wishes for.
PROPELLERS = ("reversing_fan", "variable_pitch")
#: Keys and what they hold.
KEYS: dict[str, type] = {
    "navigation": str,
    "fan_table": object,
    "servo_table": str,
    "propeller": str,
    "beacons": object,
    "rudder_loss": float,
    "seed": int,
    **dict.fromkeys(SWITCHES, bool),
}


def autopilot_section(folder: Path, section: Mapping[str, Any]) -> Autopilot:
    """Return the arguments of the section.

    Parameters
    ----------
    folder : Path
        Folder of the scenario's file, to which file names are relative.
    section : mapping
        Keys of the section, of the types in :data:`KEYS`.

    Raises
    ------
    InputError
        If a value is wrong; the message names its key, and the file and row of a table.
    """
    given = dict(section)
    own = {key: given.pop(key) for key in list(given) if key in SWITCHES}
    navigation = given.get("navigation", Autopilot.navigation)
    check_known(navigation, NAVIGATION, f"autopilot.navigation: unknown {navigation!r}")
    if not 0 <= given.get("seed", 0) <= LARGEST_SEED:
        raise InputError(f"autopilot.seed must be between 0 and {LARGEST_SEED}, found {given['seed']}")
    if not 0 <= given.get("rudder_loss", 0.0) < 1:
        raise InputError(
            f"autopilot.rudder_loss must be at least 0 and less than 1, found {given['rudder_loss']:g}"
        )
    if "fan_table" in given:
        given["tables"] = _fan_tables(folder, given.pop("fan_table"))
        if given.get("rudder_loss"):
            raise InputError(
                "autopilot.rudder_loss belongs to the stand-in tables; expected either it or fan_table"
            )
    if "propeller" in given:
        given["propeller"] = _propeller(given["propeller"])
        if given["propeller"] and "tables" in given:
            raise InputError("autopilot.fan_table belongs to a fan, not to a variable-pitch propeller")
    if "servo_table" in given:
        given["servo"] = read_servo_table(folder / given.pop("servo_table"))
    if "beacons" in given:
        given["beacons"] = _beacons(given["beacons"])
        check_beacons("autopilot", given["beacons"], navigation)
    return as_user(Autopilot, **given, imperfections=Imperfections(**own))


def _propeller(name: str) -> VariablePitch | None:
    check_known(name, PROPELLERS, f"autopilot.propeller: unknown {name!r}")
    return VariablePitch() if name == "variable_pitch" else None


def _fan_tables(folder: Path, names: Any) -> tuple[FanTable, FanTable]:
    listed = [names] if isinstance(names, str) else names
    if not isinstance(listed, list) or not all(isinstance(name, str) for name in listed):
        raise InputError(f"autopilot.fan_table must be the name of a file, or of two, found {names!r}")
    return table_pair([read_fan_table(folder / name) for name in listed], "autopilot.fan_table")


def _beacons(entries: Any) -> Beacons:
    if not isinstance(entries, list) or not all(isinstance(e, list) and len(e) == 3 for e in entries):
        raise InputError(f"autopilot.beacons must be a list of [x, y, height], found {entries!r}")
    rows = [[number(f"autopilot.beacons {k}", v) for v in row] for k, row in enumerate(entries, 1)]
    try:
        return Beacons([row[:2] for row in rows], [row[2] for row in rows])
    except InputError as error:
        raise InputError(f"autopilot.beacons: {error}") from None
