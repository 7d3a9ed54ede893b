"""K06's complete autopilot with a control law as one hybrid Block [K06 fig 5.1, 6.1].

It contains sensors, links, actuators and the craft.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.base.tables import positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.autopilot.ground_onboard import (
    board_side,
    held_side,
    pilot_side,
    sent_commands,
    stage_signal,
)
from hovercontrol.control.autopilot.imperfections import Imperfections
from hovercontrol.control.autopilot.limits import lossy_tables
from hovercontrol.control.autopilot.navigation import HATS, NAVIGATION, check_beacons, sampled_motion
from hovercontrol.control.autopilot.selector import selector
from hovercontrol.control.autopilot.thrusters import reversing_fan, variable_pitch
from hovercontrol.control.observers.ins import K06_NOISE, InsNoise
from hovercontrol.craft.hardware.actuators import FanTable, ServoTable, servo_table, table_pair
from hovercontrol.craft.hardware.actuators.pitch import BLADE_PITCH, VariablePitch
from hovercontrol.craft.hardware.actuators.signals import TICK, UPDATE
from hovercontrol.craft.hardware.links import constant_delay, k06_downlink, k06_uplink
from hovercontrol.craft.hardware.sensors import Beacons, with_specific_force
from hovercontrol.craft.models.motion import MOTION
from hovercontrol.craft.models.vehicles import hoverdemon


@checked
def autopilot(
    law: Block,
    *,
    guidance: Block | None = None,
    references: Mapping[str, float] | None = None,
    plant: Block | None = None,
    start: Mapping[str, float] | None = None,
    navigation: str = "error_model",
    noise: InsNoise = K06_NOISE,
    beacons: Beacons | None = None,
    tables: FanTable | Sequence[FanTable] | None = None,
    servo: ServoTable | None = None,
    propeller: VariablePitch | None = None,
    rudder_loss: float = 0.0,
    imperfections: Imperfections | None = None,
    seed: int = 1,
    period: float = TICK,
    name: str = "autopilot",
) -> Block:
    """Return K06's real loop as one hybrid Block (section 6.1.1, figure 6.1).

    Each imperfection is a parameter, so that one Block runs with any set of them
    (:meth:`Imperfections.parameters`). :func:`seeds` gives runs their random numbers. With all imperfections
    switched off it is the ideal loop with a command delay of one base tick.

    Parameters
    ----------
    law : Block
        One of :mod:`hovercontrol.control.controllers.k06`, with outputs ``force_x, force_y`` [N].
    guidance : Block, optional
        Sampled at `period`; it computes the references of the law. For heading guidance use
        :func:`~hovercontrol.control.autopilot.nearest_heading`.
    references : mapping, optional
        Constant references of law and guidance, by input (``surge_ref``); they become parameters
        ``reference.surge_ref``.
    plant : Block, optional
        A craft with inputs ``thrust`` [N] and ``rudder`` [rad]; default: K06's.
    start : mapping, optional
        Initial motion by state; the filters start from the same values.
    navigation : {"error_model", "magnetometer", "cricket"}, optional
        K06's model of its navigation's errors (figure 6.2); or inertial sensors and K06's filters, aided by a
        magnetometer and fixes of the position, or by Cricket for both.
    noise : InsNoise, optional
        Noise covariances assumed by the filters.
    beacons : Beacons, optional
        Beacons of Cricket; default: :func:`~hovercontrol.craft.hardware.sensors.k06_beacons`, a stand-in.
        With two beacons the craft is assumed to stay on the side of their line on which it starts.
    tables : FanTable or two of them, optional
        Measured tables of the fan: see :func:`~hovercontrol.craft.hardware.actuators.read_fan_table`. From
        one table the other is computed (:func:`~hovercontrol.craft.hardware.actuators.table_pair`). Default:
        K06's stand-ins.
    servo : ServoTable, optional
        Measured table of the rudder: see :func:`~hovercontrol.craft.hardware.actuators.read_servo_table`.
        Default: K06's stand-in.
    propeller : VariablePitch, optional
        A variable-pitch propeller in place of the fan. Its ``rudder_loss`` is replaced by `rudder_loss`.
    rudder_loss : float, optional
        Share of the thrust that the stand-ins lose with the rudder at 35 degrees, in addition to the cosine;
        it grows with the square of the angle. K06 says that the thrust decreases, but not how much.
    imperfections : Imperfections, optional
        Initial values of the switches; default: K06's simulation.
    seed : int, optional
    period : float, optional
        Base tick [s].
    name : str, optional

    Returns
    -------
    Block
        Hybrid. Outputs: the true motion ``x ... r``; the navigation's estimates ``x_hat ... r_hat``; the
        motion received by the law, ``u_seen`` ...; ``force_x, force_y``; the commands of servo and fan;
        ``thrust_clipped`` and ``rudder_clipped``, the number of ticks so far at which the law requested more
        than they can do; ``drive_mode`` or ``blade_pitch``; the actuator outputs ``thrust`` [N] and
        ``rudder`` [rad]; and with guidance its outputs.

    Raises
    ------
    InputError
        If the navigation is unknown (the message names the nearest), the loss is not between 0 and 1, the
        period is not positive, tables or beacons are of the wrong type or not used, or the parts do not fit
        together.

    Examples
    --------
    >>> from hovercontrol.control.controllers.k06 import turn
    >>> loop = autopilot(turn(k1=0.5, k2=3.5), references={"yaw_rate_ref": 3.0}, start={"r": 0.1})
    >>> loop.inputs, len(loop.ticks) > 5
    ((), True)
    """
    parts = autopilot_parts(
        law,
        guidance=guidance,
        references=references,
        plant=plant,
        start=start,
        navigation=navigation,
        noise=noise,
        beacons=beacons,
        tables=tables,
        servo=servo,
        propeller=propeller,
        rudder_loss=rudder_loss,
        imperfections=imperfections,
        seed=seed,
        period=period,
    )
    pilot = next(part for part in parts if part.name == "pilot")
    shown = [*(s.name for s in MOTION), *HATS, *(s.name for s in (*pilot.inputs, *pilot.outputs))]
    board = next(part for part in parts if part.name == "board")
    shown += [s.name for s in board.outputs if s.name in ("drive_mode", BLADE_PITCH.name, "thrust", "rudder")]
    return interconnect(parts, name, inputs=[], outputs=shown)


def autopilot_parts(
    law: Block,
    *,
    guidance: Block | None = None,
    references: Mapping[str, float] | None = None,
    plant: Block | None = None,
    start: Mapping[str, float] | None = None,
    navigation: str = "error_model",
    noise: InsNoise = K06_NOISE,
    beacons: Beacons | None = None,
    tables: FanTable | Sequence[FanTable] | None = None,
    servo: ServoTable | None = None,
    propeller: VariablePitch | None = None,
    rudder_loss: float = 0.0,
    imperfections: Imperfections | None = None,
    seed: int = 1,
    period: float = TICK,
) -> list[Block]:
    """Return the Blocks that :func:`autopilot` connects, from craft and sensors to actuators.

    Arguments and errors are those of :func:`autopilot`.

    Examples
    --------
    >>> from hovercontrol.control.controllers.k06 import stop
    >>> [part.name for part in autopilot_parts(stop(k1=1.0, k2=2.5))][:3]
    ['plant', 'gyro_dynamics', 'navigation']
    """
    positive("autopilot: period", period)
    check_known(navigation, NAVIGATION, f"autopilot: unknown navigation {navigation!r}")
    if beacons is not None:
        check_beacons("autopilot", beacons, navigation)
    if propeller is None:
        fan, servo = _tables(tables, servo, rudder_loss)
        thruster = reversing_fan(fan, period)
    else:
        if tables is not None:
            raise InputError("autopilot: tables belong to a fan, not to a variable-pitch propeller")
        _, servo = _tables(None, servo, rudder_loss)
        thruster = variable_pitch(replace(propeller, rudder_loss=rudder_loss), period)
    commands = sent_commands(thruster)
    craft = (hoverdemon().plant() if plant is None else plant).with_values(start or {})
    make, rate = NAVIGATION[navigation]
    sensing = make({s.name: s.start for s in craft.states}, noise, seed, beacons)
    if navigation != "error_model":
        craft = with_specific_force(craft)
    pilot = pilot_side(law, guidance, references, period, thruster, servo)
    seen = [s for s in MOTION if f"{s.name}_seen" in {i.name for i in pilot.inputs}]
    told = [s.replace(name=f"{s.name}_told", description=f"{s.description}, sent to the law") for s in seen]
    parts = [
        craft,
        *sensing,
        sampled_motion(rate),
        _ins_update(seen),
        k06_downlink(told),
        selector(
            "downlink_delay",
            "36 ms from the craft to the law",
            {s.replace(name=f"{s.name}_seen"): (f"{s.name}_told_received", f"{s.name}_told") for s in seen},
        ),
        pilot,
        k06_uplink(commands),
        constant_delay(commands, period, period, suffix="_next", name="base_tick"),
        selector(
            "uplink_delay",
            "40 ms from the law to the craft",
            {stage_signal(s, "sent"): (f"{s.name}_received", f"{s.name}_next") for s in commands},
        ),
        held_side(UPDATE, commands),
        board_side(period, thruster, servo),
    ]
    there = imperfections or Imperfections()
    return [part.with_values(there.parameters(part)) for part in parts]


def _tables(
    tables: FanTable | Sequence[FanTable] | None, servo: ServoTable | None, rudder_loss: float
) -> tuple[tuple[FanTable, FanTable], ServoTable]:
    """Return the tables of the fan (speeds over forces, forces over speeds) and the table of the servo."""
    if servo is not None and not isinstance(servo, ServoTable):
        raise InputError(f"autopilot: servo: expected a ServoTable, found {servo!r}")
    servo = servo_table() if servo is None else servo
    if tables is None:
        return lossy_tables(rudder_loss), servo
    if rudder_loss:
        raise InputError(
            "autopilot: rudder_loss belongs to the stand-in tables; measured tables include their own"
        )
    return table_pair(tables, "autopilot: tables"), servo


@checked
def seeds(loop: Block, values: Iterable[int] | int) -> dict[str, list[float]]:
    """Return the parameters that give each run of a sweep its own random numbers.

    Parameters
    ----------
    loop : Block
        Result of :func:`autopilot`.
    values : iterable of int, or int
        One seed per run; a single number n stands for 1 ... n.

    Examples
    --------
    >>> from hovercontrol.control.controllers.k06 import stop
    >>> seeds(autopilot(stop(k1=1.0, k2=2.5)), 3)
    {'navigation.seed': [1.0, 2.0, 3.0]}
    """
    each = [float(v) for v in (range(1, values + 1) if isinstance(values, int) else values)]
    return {key: each for key in loop.default_parameters if key.endswith(".seed")}


def _ins_update(seen: list[Signal]) -> Block:
    """Return the selector between the navigation's output and the current motion plus its errors."""
    # on: x_hat;  off: x + (x_hat - x_sampled), the navigation's error added to the motion of this instant.
    ways = {}
    for s in seen:
        hat, sampled = (s.replace(name=f"{s.name}_{end}").symbol for end in ("hat", "sampled"))
        ways[s.replace(name=f"{s.name}_told")] = (hat, s.symbol + hat - sampled)
    return selector("ins_update", "the navigation updates at the IMU's ticks", ways)
