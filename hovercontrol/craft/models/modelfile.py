"""The model file: a model as readable TOML.

.. code-block:: toml

    [plant]
    name = "hovercraft"
    limited = true          # optional: commands saturate at their bounds in every simulation and FMU
    mass = 3.2              # optional [kg]: forces may be in newton and are shown in newton, too
    inertia = 0.05          # optional [kg m^2]: the same for torques; fans then push by 1/mass and 1/inertia

    [inputs]                # optional: where a command's unit or bounds differ from the default
    thrust = {unit = "A", lower = 0.0, upper = 6.1}

    [effects]
    yaw_coulomb = 0.83
    yaw_linear_drag = {value = 27.5, unit = "deg/s^2/(rad/s)"}   # any compatible unit
    sway_linear_drag = {value = 1.2, unit = "N*s/m"}             # with a mass: a force
    surge_coulomb = {value = 1.35, width = 0.02}                 # an effect with shape parameters

    [fans]                  # optional: a fan craft, place in metres from the centre of mass, direction in rad
    rear_left = {x = -0.05, y = -0.04, direction = 0.0}            # its input is the force in newton, or a
    front = {x = 0.05, y = 0.0, direction = 3.1, curve = [0.027, 1.05, -0.43]}  # signal s: N per s, s^2...
    rear = {x = -0.05, y = 0.0, direction = 0.0, curve = {signal = [0.0, 0.5, 1.0], force = [0.0, 0.1, 0.4]}}
    left = {x = 0.0, y = 0.04, direction = 1.57, gain = 1.05}   # times a coefficient that a fit seeks
    right = {x = 0.0, y = -0.04, direction = 1.57, reverses = true}   # its force may be negative
    bow = {x = 0.1, y = 0.0, direction = 1.57, upper = 0.5}           # its largest command
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from hovercontrol.base.boundary import as_user, checked
from hovercontrol.base.errors import InputError, shown
from hovercontrol.base.files import write_atomically
from hovercontrol.base.tables import check_keys, number, positive, read_toml, table, text
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.units import UnitError
from hovercontrol.craft.effects import Effect, effect
from hovercontrol.craft.effects.base import resolved_unit
from hovercontrol.craft.models.fans import BenchCurve, Fan, Polynomial
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.motion import RUDDER, THRUST
from hovercontrol.craft.models.physical import BODY, coefficient_of


@checked
def load_model(path: str | Path) -> Model:
    r"""Read a model file.

    Parameters
    ----------
    path : path

    Returns
    -------
    Model

    Raises
    ------
    InputError
        If a section, an effect or a key is unknown, a unit is not compatible, or a number is missing or out
        of bounds. The message names file, key and the nearest match.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "craft.toml"
    ...     _ = file.write_text('[plant]\nname = "craft"\n[effects]\nyaw_coulomb = 0.83\n')
    ...     load_model(file).coefficients()
    {'yaw_coulomb': 0.83, 'yaw_coulomb_width': 0.01}
    """
    content = read_toml(path)
    try:
        return model_from_table(content)
    except InputError as error:
        raise type(error)(f"{path}: {error}") from None


def model_from_table(content: Mapping[str, Any]) -> Model:
    """Return the model of a parsed model file (see :func:`load_model`)."""
    check_keys("section", content, ("plant", "inputs", "effects", "fans"))
    plant = table("[plant]", content.get("plant", {}))
    check_keys("key in [plant]", plant, ("name", "limited", *BODY))
    limited = plant.get("limited", False)
    if not isinstance(limited, bool):
        raise InputError(f"plant.limited: expected true or false, found {shown(limited)}")
    inputs = table("[inputs]", content.get("inputs", {}))
    check_keys("input", inputs, ("thrust", "rudder"))
    fans = table("[fans]", content.get("fans", {}))
    effects = table("[effects]", content.get("effects", {}))
    signals = {s.name: _input(s, inputs.get(s.name, {})) for s in (THRUST, RUDDER)}
    units = {name: s.unit for name, s in signals.items()}
    craft = Model(
        text("plant.name", plant.get("name", "hovercraft")),
        thrust=signals["thrust"],
        rudder=signals["rudder"],
        fans=tuple(_fan(key, value) for key, value in fans.items()),
        limited=limited,
        mass=_body(plant, "mass"),
        inertia=_body(plant, "inertia"),
    )
    listed = tuple(_effect(craft, key, value, units) for key, value in effects.items())
    pushes = {"fan_force": craft.mass, "fan_torque": craft.inertia} if fans else {}
    driven = tuple(effect(e, 1 / size) for e, size in pushes.items() if size and e not in effects)
    return replace(craft, effects=listed + driven)


@checked
def save_model(model: Model, path: str | Path) -> Path:
    """Write a model file, atomically.

    Parameters
    ----------
    model : Model
    path : path

    Returns
    -------
    Path

    Examples
    --------
    >>> import tempfile, hovercontrol as hc
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = save_model(hc.vehicle("hoverdemon"), Path(folder) / "craft.toml")
    ...     load_model(file) == hc.vehicle("hoverdemon")
    True
    """
    text = model_text(model)
    return write_atomically(path, lambda temporary: temporary.write_text(text, encoding="utf-8"))


def model_text(model: Model) -> str:
    """Return a model as the text of a model file.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> print(model_text(Model("puck", [hc.effect("yaw_linear_drag", 0.5)])), end="")
    [plant]
    name = "puck"
    <BLANKLINE>
    [effects]
    yaw_linear_drag = 0.5
    """
    lines = ["[plant]", f"name = {_quoted(model.name)}", *["limited = true"] * model.limited]
    lines += [*(f"{part} = {size!r}" for part, size in model.body.items() if size is not None), ""]
    changed = [(s, d) for s, d in ((model.thrust, THRUST), (model.rudder, RUDDER)) if s != d]
    if changed:
        lines += ["[inputs]", *(f"{s.name} = {_input_text(s, d)}" for s, d in changed), ""]
    lines += ["[effects]", *(f"{e.name} = {effect_text(e)}" for e in model.effects)]
    if model.fans:
        lines += ["", "[fans]"]
        lines += [f"{f.name} = {_fan_text(f)}" for f in model.fans]
    return "\n".join(lines) + "\n"


def _fan_text(fan: Fan) -> str:
    parts = [f"x = {fan.x!r}", f"y = {fan.y!r}", f"direction = {fan.direction!r}"]
    if isinstance(fan.curve, Polynomial):
        parts.append(f"curve = {list(fan.curve.coefficients)!r}")
    elif isinstance(fan.curve, BenchCurve):
        signals, forces = list(fan.curve.signals), list(fan.curve.forces)
        parts.append(f"curve = {{signal = {signals!r}, force = {forces!r}}}")
    if fan.gain is not None:
        parts.append(f"gain = {fan.gain!r}")
    if fan.reverses:
        parts.append("reverses = true")
    if fan.upper is not None:
        parts.append(f"upper = {fan.upper!r}")
    return "{" + ", ".join(parts) + "}"


def effect_text(e: Effect) -> str:
    """Return an effect's numbers as TOML: one number, or a table of those unlike the defaults."""
    defaults = {key: number.default for key, number in e.numbers.items()}
    shown = {k: v for k, v in e.values.items() if k == "value" or v != defaults[k]}
    if list(shown) == ["value"]:
        return repr(shown["value"])
    return "{" + ", ".join(f"{k} = {v!r}" for k, v in shown.items()) + "}"


def _quoted(value: str) -> str:
    """Return a TOML string; its escapes are JSON's."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _input_text(signal: Signal, default: Signal) -> str:
    parts = []
    for key in ("unit", "description", "lower", "upper"):
        value = getattr(signal, key)
        if value != getattr(default, key):
            parts.append(f"{key} = {_quoted(value) if isinstance(value, str) else repr(value)}")
    return "{" + ", ".join(parts) + "}"


def _input(default: Signal, value: Any) -> Signal:
    given = table(f"inputs.{default.name}", value)
    check_keys(f"key in inputs.{default.name}", given, ("unit", "description", "lower", "upper"))
    for key in ("lower", "upper"):
        if key in given:
            number(f"inputs.{default.name}.{key}", given[key])
    for key in ("unit", "description"):
        text(f"inputs.{default.name}.{key}", given.get(key, ""))
    lower, upper = given.get("lower", default.lower), given.get("upper", default.upper)
    if lower > upper:
        raise InputError(f"inputs.{default.name}: lower = {lower:g} is above upper = {upper:g}")
    try:
        return default.replace(start=min(max(default.start, lower), upper), **given)
    except InputError as error:
        raise InputError(f"inputs.{default.name}: {error}") from None


def _body(plant: Mapping[str, Any], part: str) -> float | None:
    return positive(f"plant.{part}", plant[part]) if part in plant else None


def _fan(name: str, value: Any) -> Fan:
    given = table(f"fans.{name}", value)
    check_keys(f"key in fans.{name}", given, ("x", "y", "direction", "curve", "gain", "reverses", "upper"))
    for key in ("x", "y", "direction"):
        if key not in given:
            raise InputError(f"fans.{name}: {key!r} is missing")
    x, y, direction = (number(f"fans.{name}.{key}", given[key]) for key in ("x", "y", "direction"))
    curve = _curve(name, given["curve"]) if "curve" in given else None
    gain = number(f"fans.{name}.gain", given["gain"]) if "gain" in given else None
    reverses = given.get("reverses", False)
    if not isinstance(reverses, bool):
        raise InputError(f"fans.{name}.reverses: expected true or false, found {shown(reverses)}")
    upper = number(f"fans.{name}.upper", given["upper"]) if "upper" in given else None
    return Fan(name, x, y, direction, curve, gain, reverses, upper)


def _curve(fan: str, value: Any) -> Polynomial | BenchCurve:
    if isinstance(value, dict):
        check_keys(f"key in fans.{fan}.curve", value, ("signal", "force"))
        for key in ("signal", "force"):
            if key not in value:
                raise InputError(f"fans.{fan}.curve: {key!r} is missing")
    try:
        if isinstance(value, dict):
            return as_user(BenchCurve, value["signal"], value["force"])
        return as_user(Polynomial, value)
    except InputError as error:
        raise InputError(f"fans.{fan}: {error}") from None


def _effect(craft: Model, name: str, value: Any, units: Mapping[str, str]) -> Effect:
    if name in BODY:
        raise InputError(f"effects.{name}: {name} is a key of [plant], {name} = ... [{BODY[name][0]}]")
    try:
        cls = craft.effect_class(name)
    except InputError as error:
        raise InputError(
            f"{error} (an own effect: load this file in the Python file that defines the effect)"
        ) from None
    if not isinstance(value, dict):
        return cls(number(f"effects.{name}", value))
    given = dict(value)
    check_keys(f"key in effects.{name}", given, (*cls.numbers, "unit"))
    unit = given.pop("unit", None)
    numbers = {key: number(f"effects.{name}.{key}", v) for key, v in given.items()}
    if unit is not None:
        if "value" not in cls.numbers or "value" not in numbers:
            raise InputError(f"effects.{name}: a unit needs a value")
        wanted = resolved_unit(cls.numbers["value"].unit, units)
        given_in = text(f"effects.{name}.unit", unit)
        try:
            numbers["value"] = coefficient_of(cls, numbers["value"], given_in, wanted, craft.body)
        except UnitError as error:
            raise UnitError(f"effects.{name}: {error}") from None
    return cls(**numbers)
