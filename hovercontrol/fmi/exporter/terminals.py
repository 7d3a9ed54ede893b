"""``terminalsAndIcons.xml`` of FMI 3: groups of signals that tools can connect at once."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

from hovercontrol.fmi.exporter.description import xml_bytes
from hovercontrol.fmi.exporter.variables import Interface, Variable

#: Terminals by the names of their members; what is not here goes by its ending or is a command.
_GROUPS = {
    "pose": ("x", "y", "psi"),
    "velocity": ("u", "v", "r"),
    "tracking_error": ("error_x", "error_y"),
}
_ENDINGS = {"_ref": "reference", "_hat": "estimate"}
_TEXTS = {
    "pose": "position and heading in the earth frame",
    "velocity": "surge, sway and yaw rate in the body frame",
    "tracking_error": "position minus its reference",
    "reference": "reference of the craft",
    "estimate": "estimated coefficients",
    "command": "commands to the actuators",
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
        for name, members in groups.items():
            text = _TEXTS.get(name.removesuffix("_out"), "")
            terminal = SubElement(parent, "Terminal", name=name, matchingRule="bus", description=text)
            for v in members:
                about = {"variableName": v.name, "memberName": v.name, "variableKind": "signal"}
                SubElement(terminal, "TerminalMemberVariable", about)
    return xml_bytes(root)


def _group(name: str) -> str:
    for group, members in _GROUPS.items():
        if name in members:
            return group
    endings = (group for ending, group in _ENDINGS.items() if name.endswith(ending))
    return next(endings, "command")
