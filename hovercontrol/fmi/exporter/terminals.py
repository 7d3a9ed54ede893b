"""``terminalsAndIcons.xml`` of FMI 3: groups of signals that tools can connect at once."""

from __future__ import annotations

import re
from xml.etree.ElementTree import Element, SubElement

from hovercontrol.fmi.exporter.description import xml_bytes
from hovercontrol.fmi.exporter.variables import Interface, Variable

#: Terminals by patterns of their members' names, the first that fits.
_PATTERNS = {
    "pose": r"x|y|psi",
    "velocity": r"u|v|r",
    "tracking_error": r"error_[xy]",
    "reference": r".*_ref",
    "link": r".*_received|(uplink|downlink|link)_.*",
    "estimate": r".*_(hat|ins|seen)|xhat\[.*|(P|P\d)\[.*|.*_innovation(_variance)?|solved.*|previous_.*",
    "measurement": (
        r"(specific_force|acceleration|magnetic|fix|range|heading_(fix|aid|magnetic)|yaw_rate|gyro)(_.*)?"
        r"|.*_(measured|heard|valid|fix)"
    ),
    "command": (
        r"(thrust|rudder|force_[xy]|force_angle|fan_speed|servo|rudder_angle|blade_pitch|drive_mode)(_.*)?"
        r"|.*_(command|wanted|set|clipped|outside)|(rear|front)_(left|right)"
    ),
}
_TEXTS = {
    "pose": "position and heading in the earth frame",
    "velocity": "surge, sway and yaw rate in the body frame",
    "tracking_error": "position minus its reference",
    "reference": "reference of the craft",
    "link": "what a radio link delivers, and how it does",
    "estimate": "estimated states and coefficients",
    "measurement": "what sensors measure",
    "command": "commands to the actuators, and what the actuators do",
    "signals": "other signals",
}


def terminals(interface: Interface) -> bytes:
    """Return ``terminalsAndIcons.xml``; terminals of the same name connect, whichever the direction."""
    root = Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    graphics = SubElement(root, "GraphicalRepresentation")
    corners = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}
    SubElement(graphics, "CoordinateSystem", corners, suggestedScalingFactorTo_mm="0.1")
    SubElement(graphics, "Icon", corners)
    groups: dict[str, list[Variable]] = {}
    for v in interface.of("input"):
        groups.setdefault(_group(v.name), []).append(v)
    read = set(groups)
    for v in interface.outputs:
        name = _group(v.name)
        groups.setdefault(f"{name}_out" if name in read else name, []).append(v)
    if groups:
        parent = SubElement(root, "Terminals")
        arrays = {v.reference: a for a in interface.arrays for v in a.elements}
        for name, members in groups.items():
            listed = [arrays[v.reference].name if v.reference in arrays else v.name for v in members]
            text = _TEXTS.get(name.removesuffix("_out"), "")
            terminal = SubElement(parent, "Terminal", name=name, matchingRule="bus", description=text)
            for member in dict.fromkeys(listed):
                about = {"variableName": member, "memberName": member, "variableKind": "signal"}
                SubElement(terminal, "TerminalMemberVariable", about)
    return xml_bytes(root)


def _group(name: str) -> str:
    fitting = (group for group, pattern in _PATTERNS.items() if re.fullmatch(pattern, name))
    return next(fitting, "signals")
