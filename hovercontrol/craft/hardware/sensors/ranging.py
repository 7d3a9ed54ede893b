"""Ranges measured by Cricket units in turn, K06 section 5.5: time slots, noise, range of hearing, latency."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.expressions import Definitions
from hovercontrol.blocks.random_numbers import random_numbers
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.hardware.sensors._parts import offset, pair, size, switch, tick, turned
from hovercontrol.craft.hardware.sensors.bancroft import RANGE_UNIT, range_signals
from hovercontrol.craft.hardware.sensors.beacons import Beacons
from hovercontrol.craft.hardware.sensors.cone import cone_ratio, cone_signals

#: One unit's slot [s], and how many there are in a round.
SLOT, SLOTS = 0.1, 10

#: Places of K06's two units on the craft [m]: 8 in apart along the bow, the first at the centre of mass.
#: K06 prints only their distance.
K06_UNITS = ((0.0, 0.0), (-8 * 0.0254, 0.0))

_VALID = Signal("range_valid", "1", "1 while ranges are valid")


def unit_places(units: Sequence[Sequence[float]], slots: int = SLOTS) -> tuple[tuple[float, float], ...]:
    """Return the units' positions, checked: at least one, at most one for each slot, all different."""
    places = tuple(pair(f"unit {k}: place", p) for k, p in enumerate(units, 1))
    if not 1 <= len(places) <= slots:
        raise InputError(f"units: expected 1 to {slots}, one for each slot, found {len(places)}")
    if len(set(places)) < len(places):
        raise InputError(f"units: expected different positions, found {places}")
    return places


#: What the position of a unit is called.
MOUNT = "position of the unit, body axes"


@checked
def cricket_ranges(
    beacons: Beacons,
    units: Sequence[Sequence[float]] = K06_UNITS,
    *,
    slot: float = SLOT,
    slots: int = SLOTS,
    noise: float = 0.0,
    bias: float = 0.0,
    sound: float = 1.0,
    cone: tuple[float, float] = (0.0, 0.0),
    cone_limit: float = 0.0,
    latency: bool = False,
    seed: int = 1,
    name: str = "cricket_ranges",
) -> Block:
    """Return the ranges measured by units in turn; 0, the default, switches an error off.

    Unit k pings at the start of slot k of each round, so it has ranges once a round.

    Parameters
    ----------
    beacons : Beacons
        True positions; a difference to the solver's beacons is a survey error.
    units : sequence of (float, float), optional
        Places in the body's axes [m].
    slot : float, optional
        Period of the Block [s].
    slots : int, optional
        Slots of a round; slots without a unit belong to other craft.
    noise : float, optional
        Standard deviation of a range [m].
    bias : float, optional
        Common error of all ranges [m], b in (5.6).
    sound : float, optional
        Ratio of assumed to true speed of sound, a scale error of each range; see
        :func:`~hovercontrol.craft.hardware.sensors.speed_of_sound`.
    cone : (float, float), optional
        Coefficients of the cone-angle error (5.7),
        :data:`~hovercontrol.craft.hardware.sensors.cone.K06_CONE`.
    cone_limit : float, optional
        Beacons at larger cone angles [rad] are not heard; K06's limit is about 45 degrees; 0: no limit.
    latency : bool, optional
        Whether ranges are given at the end of their slot, one tick late, rather than at its start.
    seed : int, optional
    name : str, optional

    Returns
    -------
    Block
        Inputs ``x, y`` [m], ``psi`` [rad]; outputs ``range_1...`` [m], 0 if not heard, ``range_1_heard...``
        (0 or 1), ``range_valid`` (0 or 1) and ``range_unit``, from 1.

    Raises
    ------
    InputError
        If the slot is not positive, there are more units than slots, or a size is negative.

    Examples
    --------
    >>> from hovercontrol.blocks.simulation.sampled import Ticking
    >>> square = Beacons([(0, 0), (2, 0), (0, 2)], 2.0)
    >>> unit = Ticking(cricket_ranges(square, [(0, 0)], slots=2))
    >>> [float(unit.tick(0.0, {"x": 0.0, "y": 0.0, "psi": 0.0})["range_1"]) for k in range(3)]
    [2.0, 0.0, 2.0]
    """
    seconds = tick(name, slot).start
    if not isinstance(slots, int) or slots < 1:
        raise InputError(f"{name}: slots must be a positive whole number, found {slots!r}")
    mounts = [
        [offset(f"unit_{k}_{axis}", "m", MOUNT, name, value) for axis, value in zip("xy", place, strict=True)]
        for k, place in enumerate(unit_places(units, slots), 1)
    ]
    ranges, heard = range_signals(len(beacons.positions))
    places = beacons.signals()
    white = size("noise", "m", "standard deviation of a range", name, noise)
    long = offset("bias", "m", "common error of all ranges", name, bias)
    ratio, text = positive(f"{name}: sound", sound), "ratio of assumed to true speed of sound"
    taken = Signal("sound", "1", text, start=ratio, lower=0.5)
    text = "largest cone angle at which beacons are heard; 0: no limit"
    limit = size("cone_limit", "rad", text, name, cone_limit)
    late = switch("latency", "latency of one tick", latency)
    drawn = random_numbers(len(ranges), salt=name, seed=seed, prefix="random")
    x, y, psi = Signal("x", "m"), Signal("y", "m"), Signal("psi", "rad", "heading")
    turn = Signal("slot", "1", "slot of the round, from 0", upper=slots - 1.0, lower=0.0)
    define = Definitions(drawn.definitions)
    unit = define("unit_now", sp.Piecewise((turn.symbol + 1, turn.symbol < len(mounts) - 0.5), (0, True)))
    arm = [
        sp.Piecewise(
            *((mount[i].symbol, turn.symbol < k + 0.5) for k, mount in enumerate(mounts[:-1])),
            (mounts[-1][i].symbol, True),
        )
        for i in (0, 1)
    ]
    dx, dy = turned(psi.symbol, define("arm_x", arm[0]), define("arm_y", arm[1]))
    at_x, at_y = define("unit_x", x.symbol + dx), define("unit_y", y.symbol + dy)
    measured: dict[str, sp.Symbol] = {}
    for k, (place, n) in enumerate(zip(places, drawn.values, strict=True), 1):
        true, angle = _to_beacon(define, k, place, at_x, at_y)
        deaf = sp.Or(unit < 0.5, sp.And(limit.symbol > 0, angle > limit.symbol))
        hears = define(f"heard_now_{k}", sp.Piecewise((0, deaf), (1, True)))
        rho = taken.symbol * true / cone_ratio(angle) + long.symbol + white.symbol * n
        measured[f"range_{k}"] = define(f"range_now_{k}", sp.Piecewise((rho, hears > 0), (0, True)))
        measured[f"range_{k}_heard"] = hears
    measured["range_unit"] = unit
    measured["range_valid"] = define("valid_now", sp.Max(*(measured[s.name] for s in heard)))
    told = (*ranges, *(s.replace(start=0.0) for s in heard), RANGE_UNIT, _VALID)
    held = [s.replace(name=f"{s.name}_held", description=f"{s.description}, at the last tick") for s in told]
    beside = (white, long, taken, limit, late, *cone_signals(cone, name), *drawn.parameters)
    return Block(
        name,
        states=(turn, *held, *drawn.states),
        inputs=(x, y, psi),
        outputs=told,
        parameters=(*chain(*places), *chain(*mounts), *beside),
        derivatives={
            "slot": sp.Piecewise((0, turn.symbol > slots - 1.5), (turn.symbol + 1, True)),
            **{old.name: measured[s.name] for old, s in zip(held, told, strict=True)},
            **drawn.next_values,
        },
        output_expressions={
            s.name: sp.Piecewise((old.symbol, late.symbol > 0), (measured[s.name], True))
            for old, s in zip(held, told, strict=True)
        },
        definitions=define,
        period=seconds,
    )


def _to_beacon(
    define: Definitions, k: int, place: Sequence[Signal], x: sp.Expr, y: sp.Expr
) -> tuple[sp.Symbol, sp.Symbol]:
    """Write distance and cone angle of a beacon, seen from a unit at x, y."""
    bx, by, h = (s.symbol for s in place)
    across = (x - bx) ** 2 + (y - by) ** 2
    distance = define(f"distance_{k}", sp.sqrt(across + h**2))
    return distance, define(f"cone_angle_{k}", sp.atan2(sp.sqrt(across), h))
