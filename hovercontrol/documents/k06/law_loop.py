"""K06's craft under one of its laws, with the delay of its link or without it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import finite
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delays import pade
from hovercontrol.blocks.interconnect import interconnect, rename
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.analysis.byrnes_isidori import symbol
from hovercontrol.control.controllers.k06 import force_to_command, setpoints, turn
from hovercontrol.control.controllers.k06.energy import body_signals, kinetic_energy, unwanted_level
from hovercontrol.control.controllers.k06.laws import SURGE_REF, YAW_RATE_REF
from hovercontrol.craft.hardware.actuators.signals import FORCE_X, FORCE_Y
from hovercontrol.craft.hardware.links import bluetooth_delays
from hovercontrol.craft.models.motion import MOTION
from hovercontrol.craft.models.vehicles import HOVERDEMON_BODY, hoverdemon
from hovercontrol.documents.scenarios import load_scenario

#: Mean round trip of K06's link, table 5.1 [s].
ROUND_TRIP = bluetooth_delays("linksys_22.0_round_trip").mean

#: A craft turns once W is below this share of W_bad: its yaw rate is then within 10 % of r_ref.
TURNING = 0.0026

#: Surge, sway and yaw rate: u, v, r.
MOVING = MOTION[3:]


@lru_cache(maxsize=4)
def trial_numbers(law: str) -> dict[str, float]:
    """Return reference [m/s or rad/s] and gains [kg/s] of a law's trial: tables 6.2 to 6.4.

    Examples
    --------
    >>> trial_numbers("forward")
    {'surge_ref': 1.1, 'k1': 1.0, 'k2': 4.0}
    """
    trial = load_scenario(f"k06-{law}")
    gains = {name: float(value) for name, value in (trial.controller or {}).items() if name != "kind"}
    return dict(trial.phases[0].setpoints) | gains


def force_craft() -> Block:
    """Return K06's reduced dynamics (2.10): states u, v, r of the HoverDemon, inputs force_x, force_y [N]."""
    whole = interconnect([hoverdemon().plant("craft"), force_to_command()], "whole")
    own = {symbol(f"craft.{s.name}"): s.symbol for s in MOVING}
    rates = {s.name: whole.expand(whole.derivatives[f"craft.{s.name}"]).xreplace(own) for s in MOVING}
    used = set().union(*(e.free_symbols for e in rates.values()))
    numbers = tuple(p for p in whole.parameters if p.symbol in used)
    return Block("craft", MOVING, (FORCE_X, FORCE_Y), MOVING, numbers, rates)


def delayed_force(seconds: float = ROUND_TRIP, order: int = 4) -> Block:
    """Return a Pade approximation of a delay of the force, without feedthrough.

    Inputs ``sent_x, sent_y``, outputs ``force_x, force_y`` [N]; the delay is the parameter ``delay.seconds``.
    """
    late = Signal("seconds", "s", "delay of the force", start=seconds, lower=0.0)
    sent = {force.name: force.replace(name=f"sent_{way}") for way, force in (("x", FORCE_X), ("y", FORCE_Y))}
    pure = Block(
        "delay",
        inputs=tuple(sent.values()),
        outputs=(FORCE_X, FORCE_Y),
        parameters=(late,),
        output_expressions={name: s.symbol for name, s in sent.items()},
        delays={s.name: late.symbol for s in sent.values()},
    )
    return pade(pure, order)


def law_loop(law: Block, *, delay: bool = False) -> Block:
    """Return K06's craft under a law; output ``distance`` [m/s] from the wanted motion.

    Parameters
    ----------
    law : Block
        With inputs ``u, v, r, surge_ref``.
    delay : bool, optional
        Delay the force by the mean round trip of K06's link.
    """
    wanted = Signal("speed", "m/s", "wanted surge velocity", start=1.0)
    reference = Block(
        "reference",
        outputs=(SURGE_REF,),
        parameters=(wanted,),
        output_expressions={SURGE_REF.name: wanted.symbol},
    )
    u, v, r = (s.symbol for s in MOVING)
    arm = Signal("arm", "m", "rudder behind the centre of mass", start=HOVERDEMON_BODY.arm)
    watch = Block(
        "watch",
        inputs=(*MOVING, SURGE_REF),
        outputs=(Signal("distance", "m/s", "from the wanted motion"),),
        parameters=(arm,),
        output_expressions={"distance": sp.sqrt((u - SURGE_REF.symbol) ** 2 + v**2 + (arm.symbol * r) ** 2)},
    )
    law = law.named("law")
    law = law.unchecked(inputs=tuple(s.replace(lower=-sp.oo, upper=sp.oo) for s in law.inputs))
    parts = [force_craft(), reference, watch]
    if delay:
        law = rename(law, {"force_x": "sent_x", "force_y": "sent_y"})
        parts.append(delayed_force())
    return interconnect([*parts, law], "loop", outputs=["distance"])


def linearly_stable(loop: Block, params: Mapping[str, Array]) -> NDArray[np.bool_]:
    """Return where the linearisation about the wanted motion is stable, shape (n,).

    Parameters
    ----------
    loop : Block
        As :func:`law_loop` makes it.
    params : mapping of str to ndarray, shape (n,)
        By key; ``reference.speed`` among them.
    """
    # At (u, v, r) = (u_ref, 0, 0) every force is zero: J depends on the parameters alone.
    keys = {s.symbol: loop.parameter_key(s.name) for s in loop.parameters}
    rest = {s: loop.default_parameters[key] for s, key in keys.items() if key not in params}
    rest |= {s.symbol: 0.0 for s in loop.states if s.name != "craft.u"}
    J = loop.jacobian().xreplace({s: sp.Float(v) for s, v in rest.items()})
    wanted = symbol("reference.speed")
    J = J.xreplace({symbol("craft.u"): wanted})
    given = [s for s, key in keys.items() if key in params]
    values = [np.asarray(params[keys[s]], dtype=float) for s in given]
    entries = sp.lambdify(given, list(J))(*values)
    size = len(values[0])
    full = np.stack([np.broadcast_to(np.asarray(e, dtype=float), size) for e in entries], axis=-1)
    return np.linalg.eigvals(full.reshape(size, *J.shape)).real.max(axis=-1) < 0


def turn_loop(*, k1: float, k2: float, yaw_rate: float) -> Block:
    """Return K06's craft under the turn law, with outputs for the energy and the unwanted limit point.

    Outputs ``level``, W/W_bad of (2.36); ``away`` [m/s], the distance from the unwanted limit point with yaw
    rates as velocities at the rudder; ``waited`` [s], the time during which W was above :data:`TURNING` of
    W_bad: since W never grows, the time until the craft turns. States ``craft.u``, ``craft.v``, ``craft.r``.

    Parameters
    ----------
    k1, k2 : float
        Gains [kg/s], positive.
    yaw_rate : float
        r_ref [rad/s].

    Raises
    ------
    InputError
        If a gain is not positive, or the yaw rate zero: then both limit points are one.
    """
    finite("yaw_rate", yaw_rate)
    if yaw_rate == 0:
        raise InputError("yaw_rate: expected a turn, found 0 rad/s: the two limit points are one")
    law = turn(k1=k1, k2=k2, name="law")
    u, v, r = (s.symbol for s in MOVING)
    parameters = body_signals(HOVERDEMON_BODY)
    m, J, d = (s.symbol for s in parameters)
    ref = YAW_RATE_REF.symbol
    waited = Signal("waited", "s", "until W is below a share of W_bad")
    level = Signal("level", "1", "W/W_bad")
    watch = Block(
        "watch",
        states=(waited,),
        inputs=(*MOVING, YAW_RATE_REF),
        outputs=(level, Signal("away", "m/s", "from the unwanted limit point"), waited),
        parameters=parameters,
        definitions={"level": kinetic_energy(m, J, u, v, r - ref) / unwanted_level(m, J, d, ref)},
        definition_signals=(level,),
        derivatives={"waited": sp.Piecewise((1, level.symbol > TURNING), (0, True))},
        output_expressions={"away": sp.sqrt(u**2 + (v + d * ref) ** 2 + (d * r) ** 2)},
    )
    told = setpoints([law], {"yaw_rate_ref": yaw_rate})
    return interconnect([force_craft(), law, told, watch], "loop", outputs=["level", "away", "waited"])
