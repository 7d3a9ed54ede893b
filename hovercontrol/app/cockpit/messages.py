"""Messages from the page, validated as a whole before they act."""

from __future__ import annotations

from typing import Any

from hovercontrol.base.errors import InputError, check_known, shown

#: What a message may hold.
_ORDERS = {
    "stick": list, "command": dict, "loop": str, "pause": bool, "record": bool, "reset": bool,
    "monitor": bool, "take": bool,
}  # fmt: skip


def check_message(message: dict[str, Any]) -> None:
    """Validate a message before any part of it acts.

    Raises
    ------
    InputError
        If it has unknown keys or values of a wrong type.
    """
    for key, value in message.items():
        check_known(key, _ORDERS, f"unknown order {shown(key)}")
        if key == "stick" and not (isinstance(value, list) and len(value) == 2):
            raise InputError(f"stick: expected two numbers, found {shown(value)}")
        if not isinstance(value, _ORDERS[key]):
            raise InputError(f"{key}: expected {_ORDERS[key].__name__}, found {shown(value)}")
    _check_command(message.get("command", {}))


def _check_command(order: dict[str, Any]) -> None:
    known = ("law", "references", "disturbances", "switches")
    for key in order:
        check_known(key, known, f"command: unknown {shown(key)}")
    for key in known[1:]:
        if not isinstance(order.get(key, {}), dict):
            raise InputError(f"{key}: expected an object, found {shown(order[key])}")
    for key, values in order.get("disturbances", {}).items():
        if not isinstance(values, dict | None):
            raise InputError(f"disturbance {shown(key)}: expected an object or null, found {shown(values)}")
