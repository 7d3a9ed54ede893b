"""K06's ground station and craft as one hybrid Block; the pilot's commands are inputs (K06 figure 5.2).

It is the real loop of :mod:`hovercontrol.control.autopilot`, with lossy links of table 5.1 and the further
parts of figure 5.2: transmit enable, lift mode, calibration of the sensors' platform, the switch between the
laws, power-on time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import sympy as sp

from hovercontrol.app.cockpit.disturbances import with_disturbances
from hovercontrol.app.cockpit.gusts import GUST, gusts
from hovercontrol.app.cockpit.laws import STICK
from hovercontrol.app.cockpit.real_laws import LAW, switched_laws
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect, rename
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.control.autopilot.loop import autopilot_parts
from hovercontrol.control.observers.ins import aided_ins
from hovercontrol.control.observers.ins.calibration import (
    CALIBRATE,
    CALIBRATED,
    rest_calibration,
    restartable,
)
from hovercontrol.control.observers.ins.imu import IMU
from hovercontrol.craft.effects import effect
from hovercontrol.craft.hardware.actuators.lift import FLOOR, LIFT, skirt_on_floor
from hovercontrol.craft.hardware.actuators.signals import FAN_SPEED_COMMAND, SERVO_COMMAND, UPDATE
from hovercontrol.craft.hardware.links import bluetooth_delays, lossy_link
from hovercontrol.craft.hardware.links.failsafe import failsafe
from hovercontrol.craft.hardware.sensors.platform import tilted_platform
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.motion import MOTION

#: What K06's ground side sends for rudder and fan.
COMMANDS = (SERVO_COMMAND, FAN_SPEED_COMMAND)

TRANSMIT = Signal("transmit", "1", "1: ground station sends commands", start=1.0, modes=("off", "on"))
LIFT_ORDER = LIFT.replace(name="lift_command", start=0.0)

#: What the pilot orders, with what holds at the start.
ORDERS = (LAW, *STICK, TRANSMIT, LIFT_ORDER.replace(start=1.0), CALIBRATE)

_POWER_ON = Signal("power_on_time", "s", "time since the craft was switched on")
_INERTIAL = (
    Signal("force_x_inertial", "m/s^2", "specific force along x, earth frame, bias removed"),
    Signal("force_y_inertial", "m/s^2", "specific force along y, earth frame, bias removed"),
)

#: What the downlink carries besides the motion: all that the ground station shows.
_SHOWN = (
    "v_x_hat", "v_y_hat", "force_x_hat", "force_y_hat", "gyro_bias_hat", "acceleration_x_bias_hat",
    "acceleration_y_bias_hat", "platform_roll", "platform_pitch", "calibrating",
)  # fmt: skip

#: Time from one message up to the next, and down [s]: the servos' 20 ms, the IMU's tick in whole ms.
UP, DOWN = UPDATE, 0.006


def ground_station(model: Model, *, name: str = "cockpit") -> Block:
    """Return the complete real loop with the pilot's commands as inputs.

    Parameters
    ----------
    model : Model
        A craft whose thrust is in newton, with a rudder.

    Returns
    -------
    Block
        Hybrid. Inputs :data:`ORDERS`; outputs the true motion ``x ... r``, the navigation's ``x_hat ...``,
        the signals at the ground station (``u_told_received``, ``v_x_hat_received`` ...), forces and
        commands, disturbances of the craft, and the counters of both links.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import hoverdemon
    >>> [s.name for s in ground_station(hoverdemon()).inputs]
    ['law', 'stick_ahead', 'stick_right', 'transmit', 'lift_command', 'calibrate']
    """
    plant = _pushed_plant(model)
    parts = {
        part.name: part
        for part in autopilot_parts(
            switched_laws(), plant=plant, navigation="magnetometer", rudder_loss=0.5
        )
    }  # fmt: skip
    # Link, filters and IMU are put in with what K06's simulation leaves out.
    told = [s.replace(name=s.name.removesuffix("_received")) for s in parts["downlink"].outputs[:-1]]
    parts["imu"] = rename(
        parts["imu"],
        {s.name: f"{s.name}_raw" for s in IMU} | {f"specific_force_{a}": f"tilted_force_{a}" for a in "xy"},
    )
    parts["ins"] = _filters()
    parts["downlink"] = _downlink([*told, *_shown_signals(parts["ins"])])
    parts["uplink"] = _uplink()
    more = [
        tilted_platform(),
        rest_calibration(),
        _inertial_force(),
        _clock(),
        failsafe((*COMMANDS, LIFT_ORDER), "uplink_age"),
        rename(skirt_on_floor(), {LIFT.name: f"{LIFT_ORDER.name}_received"}),
        gusts(),
    ]
    whole = [*parts.values(), *more]
    hidden = {s.name for block in whole for s in block.outputs if _is_inside(s.name)}
    outputs = [s.name for block in whole for s in block.outputs if s.name not in hidden]
    joined = interconnect(whole, name, inputs=[s.name for s in ORDERS], outputs=outputs)
    return joined.with_values({s.name: s.start for s in ORDERS})


def _is_inside(name: str) -> bool:
    """Return whether a signal is internal, not an output."""
    return name.endswith(("_raw", "_sampled", "_told", "_innovation", "_innovation_variance")) or "[" in name


def _pushed_plant(model: Model) -> Block:
    """Return the craft with the effects of disturbances, and inputs for gusts and friction of the floor."""
    plant = with_disturbances(model)
    if "sway_coulomb" not in {e.name for e in plant.effects}:
        plant = plant.with_effects([effect("sway_coulomb", 0.0)])
    added = dict(zip(("surge_coulomb", "sway_coulomb", "yaw_coulomb"), FLOOR, strict=True))
    return _driven(plant.plant(), added | {f"wind_{a}": s for a, s in zip("xy", GUST, strict=True)})


def _driven(plant: Block, added: Mapping[str, Signal]) -> Block:
    """Return a plant with inputs added to some of its parameters."""
    own = {name: plant.parameter(name).symbol for name in added}
    swap = {symbol: symbol + added[name].symbol for name, symbol in own.items()}
    return replace(plant, inputs=(*plant.inputs, *added.values()), **plant.swapped(swap))


def _filters() -> Block:
    """Return K06's navigation, which restarts at rest at its present position after a calibration.

    Heading, position and their covariance are kept. Velocities and biases restart at zero with the variance
    of the process noise: with K06's covariance at power-on, a fix would be taken for a motion.
    """
    filters = aided_ins(name="filters")
    states = {s.name: s.symbol for s in filters.states}
    begin = {name: sp.S.Zero for name in states if ".last_P" in name}
    begin |= {
        name: states[name] for name in begin if name.endswith(("P1[0,0]", "P2[2,2]", "P2[2,3]", "P2[3,3]"))
    }
    for axis, off in (("psi", "heading.last_x1[0]"), ("x", "motion.last_x2[2]"), ("y", "motion.last_x2[3]")):
        integrated = f"mechanisation.last_{axis}_ins"
        begin[integrated] = states[integrated] - states[off]
    shown = [*(f"{s.name}_hat" for s in MOTION), *(n for n in _SHOWN if n.endswith("_hat"))]
    return interconnect([restartable(filters, CALIBRATED, begin)], "ins", outputs=shown)


def _shown_signals(ins: Block) -> list[Signal]:
    """Return the further signals of the downlink, besides the motion."""
    known = {s.name: s for s in (*ins.outputs, *rest_calibration().outputs)}
    return [*(known[name] for name in _SHOWN), *_INERTIAL, _POWER_ON]


def _downlink(signals: list[Signal]) -> Block:
    return lossy_link(
        [s.replace(start=0.0) for s in signals], 0.0, DOWN, retransmissions=1, timeout=DOWN,
        delays=bluetooth_delays("linksys_22.0_downlink"), name="downlink",
    )  # fmt: skip


def _uplink() -> Block:
    """Return the link to the craft; it sends values computed one base tick earlier (section 5.3.4)."""
    link = lossy_link(
        (*COMMANDS, LIFT_ORDER), 0.0, UP, retransmissions=1, timeout=UP,
        delays=bluetooth_delays("linksys_22.0_uplink"), gate=TRANSMIT, suffix="_heard", name="uplink",
    )  # fmt: skip
    return rename(link, {s.name: f"{s.name}_next" for s in COMMANDS})


def _inertial_force() -> Block:
    """Return the specific force in earth axes, from the navigation's heading and force."""
    body = (Signal("force_x_hat", "m/s^2"), Signal("force_y_hat", "m/s^2"))
    psi = Signal("psi_hat", "rad")
    cos, sin = sp.cos(psi.symbol), sp.sin(psi.symbol)
    f_x, f_y = (s.symbol for s in body)
    values = (cos * f_x - sin * f_y, sin * f_x + cos * f_y)
    return Block(
        "inertial_force",
        inputs=(*body, psi),
        outputs=_INERTIAL,
        output_expressions={s.name: e for s, e in zip(_INERTIAL, values, strict=True)},
    )


def _clock() -> Block:
    return Block("clock", outputs=(_POWER_ON,), output_expressions={_POWER_ON.name: time}, period=DOWN)
