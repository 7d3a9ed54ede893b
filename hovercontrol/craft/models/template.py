"""Templates of model files: commented, ready to run, with every effect that could be added."""

from __future__ import annotations

import math

from hovercontrol.base.errors import InputError, check_known
from hovercontrol.craft.effects import Effect, Shape, effect
from hovercontrol.craft.effects.base import resolved_unit
from hovercontrol.craft.models.fans import Fan
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.vehicles import c17_experiment, four_fan

#: What a model file can be of.
KINDS = ("rudder", "fan", "block")

#: Column at which comments stand, where what is before them is shorter.
COMMENT = 38

_HEAD = """\
# A model of a craft with {what}: planar rigid-body motion plus the effects below.
# Body frame: surge u forward, sway v to the left, yaw rate r counter-clockwise. All numbers are in SI units,
# or say their unit: yaw_linear_drag = {{value = 27.5, unit = "deg/s^2/(rad/s)"}}. Coefficients are per mass
# and inertia: of a craft of 2 kg, drag of 0.6 N per m/s is 0.6 / 2 = 0.3 1/s. With the mass under [plant] it
# may be given as a force: surge_linear_drag = {{value = 0.6, unit = "N*s/m"}}.
# The numbers here are those of {of}; put yours, or let a log tell them:
#
#     hovercontrol simulate {file}                     # drive it: a log and pictures
#     hovercontrol check run.csv --model {file}        # is the log good, and what can it show?
#     hovercontrol identify run.csv --model {file}     # coefficients with standard errors
#     hovercontrol diagnose run.csv --holdout other.csv --model {file}    # what the model lacks
#     hovercontrol cockpit --model {file}              # drive it by hand, in the browser
#
# A log is a CSV file with time [s], x, y [m], psi [rad] and/or u, v [m/s], r [rad/s], and the inputs
# {inputs}.

[plant]
name = "{name}"
{mass}# inertia = 0.01                      # [kg m^2], about the vertical axis: torques may be in N m
"""

_INPUTS = """
[inputs]                              # the commands: unit and bounds
thrust = {unit = "A", lower = 0.0, upper = 6.1, description = "thrust command, motor current"}
rudder = {lower = -0.45, upper = 0.45}  # rad
"""

_FANS = """
[fans]                                # place [m] from the centre of mass (x forward, y left), direction
# of push [rad] from forward, counter-clockwise. The input of a fan has its name. It is the force [N] or, with
# a static curve, its signal s: curve = [0.03, 1.05, -0.43] (N per s, s^2, s^3), or points of a bench
# curve = {signal = [0.0, 0.5, 1.0], force = [0.0, 0.1, 0.4]}. gain = 1.0 adds a coefficient to fit.
"""

_BLOCK = '''\
"""An own machine: its equations as a Block, and effects that could be added.

    hovercontrol simulate {file}                     # drive it: a log and a picture
    hovercontrol check run.csv --model {file}        # is the log good, and what can it show?
    hovercontrol identify run.csv --model {file}     # its coefficients, with standard errors
    hovercontrol diagnose run.csv --holdout other.csv --model {file}
    hovercontrol export {file} -o {stem}.fmu

A log is a CSV file with time [s], the inputs (force) and the measured outputs (position). In Python:
BLOCK.start() steps it, hovercontrol.simulate(BLOCK, ...) simulates it, BLOCK.to_control() is the same for
python-control.
"""

import hovercontrol as hc

# ---- signals: name, SI unit, description; start is the initial or default value, lower and upper are bounds

position = hc.Signal("position", "m", "of the trolley on its rail")
velocity = hc.Signal("velocity", "m/s", "of the trolley")
force = hc.Signal("force", "N", "commanded to the motor", lower=-150.0, upper=150.0)
mass = hc.Signal("mass", "kg", "of the trolley", start={mass!r})
drag = hc.Signal("drag", "1/s", "drag in proportion to the velocity", start=0.4, lower=0.0)

# ---- equations: the time derivative of each state, as SymPy expressions of the signals' symbols

BLOCK = hc.Block(
    "{name}",
    states=[position, velocity],
    inputs=[force],
    outputs=[position],  # what is measured; a computed output has its line in output_expressions={{...}}
    parameters=[mass, drag],
    derivatives={{
        "position": velocity.symbol,
        "velocity": force.symbol / mass.symbol - drag.symbol * velocity.symbol,
    }},
)

# ---- what it may lack: without a catalogue what any machine may (friction, play, lag, delay, bias ...)

MODEL = hc.BlockModel(BLOCK)
'''


def template(kind: str, name: str, file: str, mass: float | None = None) -> str:
    """Return the text of a template of a model file.

    Parameters
    ----------
    kind : {"rudder", "fan", "block"}
        A craft with a propeller and a rudder, one with fixed fans, or a Python file with a Block.
    name : str
        Name of the craft or Block, an identifier.
    file : str
        The file's name, for the commands in its first comment.
    mass : float, optional
        [kg]

    Raises
    ------
    InputError
        If the kind is unknown or the name is not an identifier.

    Examples
    --------
    >>> print(template("rudder", "duck", "duck.toml").splitlines()[0])
    # A model of a craft with a propeller and a rudder: planar rigid-body motion plus the effects below.
    """
    check_known(kind, KINDS, f"--kind: unknown {kind!r}")
    if not name.isidentifier():
        raise InputError(f"{name!r} is not a valid model name; use letters, digits and _, a letter first")
    if kind == "block":
        return _BLOCK.format(name=name, file=file, stem=file.removesuffix(".py"), mass=mass or 50.0)
    craft = c17_experiment() if kind == "rudder" else four_fan()
    if mass and kind == "fan":
        craft = craft.with_effects([effect("fan_force", 1 / mass)])
    what = "a propeller and a rudder" if kind == "rudder" else "fixed fans"
    inputs = "thrust, rudder" if kind == "rudder" else ", ".join(f.name for f in craft.fans)
    of = {
        "rudder": "C17's Ikarus, 0.585 kg",
        "fan": "a craft of 0.18 kg",
    }[kind]
    given = f"{'' if mass else '# '}mass = {mass or 0.585!r}".ljust(COMMENT) + "# [kg]: forces may be in N\n"
    lines = [_HEAD.format(what=what, of=of, file=file, name=name, inputs=inputs, mass=given)]
    if kind == "rudder":
        lines.append(_INPUTS)
    lines += ["\n[effects]\n", *(_line(type(e), craft, dict(e.values)) for e in craft.effects)]
    lines.append("\n# Effects that could be added. Remove the # and set a number:\n")
    lines += [_line(cls, craft) for cls in craft.candidates()]
    if craft.fans:
        lines += [_FANS, *(_fan_line(f) for f in craft.fans)]
    return "".join(lines)


def _line(cls: type[Effect], craft: Model, values: dict[str, float] | None = None) -> str:
    """Return an effect's line: active if values are given, else a comment with an example."""
    active = values is not None
    shown = {
        key: number
        for key, number in (values or _example(cls)).items()
        if key == "value" or number != cls.numbers[key].default
    }
    if list(shown) == ["value"]:
        text = repr(float(f"{shown['value']:.6g}"))
    else:
        text = "{" + ", ".join(f"{k} = {v!r}" for k, v in shown.items()) + "}"
    units = {s.name: s.unit for s in (craft.thrust, craft.rudder)}
    unit = ", ".join(resolved_unit(cls.numbers[key].unit, units) for key in shown)
    sentence = (cls.__doc__ or "").strip().splitlines()[0].replace("``", "")
    left = f"{'' if active else '# '}{cls.name} = {text}"
    return f"{left.ljust(COMMENT - 1)} # {unit}: {sentence}\n"


def _example(cls: type[Effect]) -> dict[str, float]:
    """Return example values of an effect: the start of a search, else a small value."""
    found = {}
    for key, number in cls.numbers.items():
        if number.default is not None and any(n.default is None for n in cls.numbers.values()):
            continue
        start = number.search[0] if isinstance(number, Shape) and number.search else 0.1
        found[key] = min(max(start, number.lower), number.upper)
    return found


def _fan_line(fan: Fan) -> str:
    direction = 0.0 if fan.direction == 0.0 else round(fan.direction, 6)
    where = "forward" if math.cos(fan.direction) > 0 else "backward"
    text = f"{fan.name} = {{x = {fan.x!r}, y = {fan.y!r}, direction = {direction!r}}}"
    return f"{text}  # pushes {where}\n"
