"""K06's whole autopilot around a law as one hybrid Block (figure 6.1): sensors, links, actuators, craft."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from hovercontrol.autopilot.choice import choice
from hovercontrol.autopilot.imperfections import Imperfections
from hovercontrol.autopilot.limits import lossy_tables
from hovercontrol.autopilot.navigation import HATS, NAVIGATION, sampled_motion
from hovercontrol.autopilot.sides import COMMANDS, after, board_side, held_side, pilot_side
from hovercontrol.block import Block
from hovercontrol.errors import InputError, did_you_mean
from hovercontrol.estimators.ins import K06_NOISE, InsNoise
from hovercontrol.hardware.actuators.signals import TICK, UPDATE
from hovercontrol.hardware.links import constant_delay, k06_downlink, k06_uplink
from hovercontrol.hardware.sensors import with_specific_force
from hovercontrol.interconnect import interconnect
from hovercontrol.model import MOTION
from hovercontrol.signals import Signal
from hovercontrol.vehicles import hoverdemon


def autopilot(
    law: Block,
    *,
    guidance: Block | None = None,
    references: Mapping[str, float] | None = None,
    plant: Block | None = None,
    start: Mapping[str, float] | None = None,
    navigation: str = "error_model",
    noise: InsNoise = K06_NOISE,
    rudder_loss: float = 0.0,
    imperfections: Imperfections | None = None,
    seed: int = 1,
    period: float = TICK,
    name: str = "autopilot",
) -> Block:
    """Return K06's real loop as one hybrid Block (section 6.1.1, figure 6.1).

    Each imperfection is a parameter, so that one built Block runs with any set of them
    (:meth:`Imperfections.parameters`), and :func:`seeds` gives runs their random numbers. With all switched
    off it is the ideal loop, its commands one base tick late.

    Parameters
    ----------
    law : Block
        One of :mod:`hovercontrol.controllers.k06`: tells ``force_x, force_y`` [N].
    guidance : Block, optional
        Sampled at `period`: tells the law its references. A heading wants
        :func:`~hovercontrol.autopilot.nearest_heading`.
    references : mapping, optional
        What law and guidance are told to hold, by input (``surge_ref``); parameters ``reference.surge_ref``.
    plant : Block, optional
        A craft with inputs ``thrust`` [N] and ``rudder`` [rad]; default: K06's.
    start : mapping, optional
        Initial motion by state, which the filters know.
    navigation : {"error_model", "magnetometer", "cricket"}, optional
        K06's model of its navigation's errors (figure 6.2); or inertial sensors and K06's filters, aided by a
        magnetometer and fixes of the position, or by Cricket for both.
    noise : InsNoise, optional
        What the filters take for noise.
    rudder_loss : float, optional
        Share of the thrust that the tables lose with the rudder at 35 degrees, beyond the cosine of K06's
        stand-in; it grows with the square of the angle. K06 says that the thrust falls, not how far.
    imperfections : Imperfections, optional
        Start values of the switches; default: K06's simulation.
    seed : int, optional
    period : float, optional
        Base tick [s].
    name : str, optional

    Returns
    -------
    Block
        Hybrid. Outputs the true motion ``x ... r``, the navigation's ``x_hat ... r_hat``, what the law is
        told ``u_seen`` ..., ``force_x, force_y``, the servo's and the fan's commands, ``drive_mode``, and
        what acts: ``thrust`` [N], ``rudder`` [rad]; with guidance its outputs.

    Raises
    ------
    InputError
        If the navigation is unknown (the nearest is named), the loss not between 0 and 1, or the parts do not
        fit together.

    Examples
    --------
    >>> from hovercontrol.controllers.k06 import turn
    >>> loop = autopilot(turn(k1=0.5, k2=3.5), references={"yaw_rate_ref": 3.0}, start={"r": 0.1})
    >>> loop.inputs, len(loop.ticks) > 5
    ((), True)
    """
    if navigation not in NAVIGATION:
        raise InputError(
            f"autopilot: unknown navigation {navigation!r}{did_you_mean(navigation, NAVIGATION)}"
        )
    craft = (hoverdemon().plant() if plant is None else plant).with_values(start or {})
    make, rate = NAVIGATION[navigation]
    sensing = make({s.name: s.start for s in craft.states}, noise, seed)
    if navigation != "error_model":
        craft = with_specific_force(craft)
    fan = lossy_tables(rudder_loss)
    pilot = pilot_side(law, guidance, references, period, fan[0])
    seen = [s for s in MOTION if f"{s.name}_seen" in {i.name for i in pilot.inputs}]
    told = [s.but(name=f"{s.name}_told", description=f"{s.description}, sent to the law") for s in seen]
    parts = [
        craft,
        *sensing,
        sampled_motion(rate),
        _ins_update(seen),
        k06_downlink(told),
        choice(
            "downlink_delay",
            "36 ms from the craft to the law",
            {s.but(name=f"{s.name}_seen"): (f"{s.name}_told_received", f"{s.name}_told") for s in seen},
        ),
        pilot,
        k06_uplink(COMMANDS),
        constant_delay(COMMANDS, period, period, suffix="_next", name="base_tick"),
        choice(
            "uplink_delay",
            "40 ms from the law to the craft",
            {after(s, "sent"): (f"{s.name}_received", f"{s.name}_next") for s in COMMANDS},
        ),
        held_side(UPDATE),
        board_side(period, fan[1]),
    ]
    shown = [*(s.name for s in MOTION), *HATS, *(s.name for s in pilot.inputs)]
    shown += [s.name for s in pilot.outputs]
    shown += ["drive_mode", "thrust", "rudder"]
    loop = interconnect(parts, name, inputs=[], outputs=shown)
    return loop.with_values((imperfections or Imperfections()).parameters(loop))


def seeds(loop: Block, values: Iterable[int] | int) -> dict[str, list[float]]:
    """Return the parameters that give each run of a sweep its own random numbers.

    Parameters
    ----------
    loop : Block
        By :func:`autopilot`.
    values : iterable of int, or int
        One for each run; a number stands for 1 up to it.

    Examples
    --------
    >>> from hovercontrol.controllers.k06 import stop
    >>> seeds(autopilot(stop(k1=1.0, k2=2.5)), 3)
    {'navigation.seed': [1.0, 2.0, 3.0]}
    """
    each = [float(v) for v in (range(1, values + 1) if isinstance(values, int) else values)]
    return {key: each for key in loop.default_parameters if key.endswith(".seed")}


def _ins_update(seen: list[Signal]) -> Block:
    """Return the choice between the navigation's own ticks and its errors on the motion of any instant."""
    ways = {}
    for s in seen:
        hat, sampled = (s.but(name=f"{s.name}_{end}").symbol for end in ("hat", "sampled"))
        ways[s.but(name=f"{s.name}_told")] = (hat, s.symbol + hat - sampled)
    return choice("ins_update", "navigation tells the motion at the IMU's ticks", ways)
