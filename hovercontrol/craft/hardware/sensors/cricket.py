"""Cricket, K06's ultrasonic positioning system (section 5.5): from ranges to fixes and a heading."""

from __future__ import annotations

import math
from collections.abc import Sequence

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.hardware.sensors._parts import tick
from hovercontrol.craft.hardware.sensors.bancroft import PREVIOUS, RANGE_UNIT, range_solver
from hovercontrol.craft.hardware.sensors.beacons import Beacons, k06_beacons
from hovercontrol.craft.hardware.sensors.cone import K06_CONE
from hovercontrol.craft.hardware.sensors.ranging import K06_UNITS, SLOT, SLOTS, cricket_ranges, unit_places
from hovercontrol.craft.hardware.sensors.two_units import two_unit_heading


@checked
def cricket_fixes(count: int = 2, *, slot: float = SLOT, name: str = "cricket_fixes") -> Block:
    """Return a Block that sorts solved positions by unit and holds them.

    Parameters
    ----------
    count : int, optional
        Number of units.
    slot : float, optional
        Period [s].
    name : str, optional

    Returns
    -------
    Block
        Inputs ``solved_x, solved_y, solved_bias`` [m], ``solved`` and ``range_unit``; outputs ``fix_x,
        fix_y`` [m], the position of the first unit, ``fix_valid``, 1 at the tick of a new fix, and
        ``fix_bias`` [m], the common error of its ranges; for the others ``fix_2_x, fix_2_y, fix_2_valid`` and
        so on.

    Raises
    ------
    InputError
        If the slot is not positive or there are no units.

    Examples
    --------
    >>> [s.name for s in cricket_fixes(1).outputs]
    ['fix_x', 'fix_y', 'fix_bias', 'fix_valid']
    """
    if not isinstance(count, int) or count < 1:
        raise InputError(f"{name}: expected at least one unit, found {count!r}")
    solved = {
        "x": Signal("solved_x", "m", "position of the unit"),
        "y": Signal("solved_y", "m", "position of the unit"),
        "bias": Signal("solved_bias", "m", "common error of all ranges"),
    }
    good = Signal("solved", "1", "1 where the ranges give a position")
    states, outputs = [], []
    definitions: dict[str, sp.Expr] = {}
    for k in range(1, count + 1):
        label = "fix" if k == 1 else f"fix_{k}"
        mine = sp.And(good.symbol > 0, RANGE_UNIT.symbol > k - 0.5, RANGE_UNIT.symbol < k + 0.5)
        valid = Signal(f"{label}_valid", "1", "1 at the tick of a new fix")
        definitions[valid.name] = sp.Piecewise((1, mine), (0, True))
        for what, source in solved.items():
            if what == "bias" and k > 1:
                continue
            told = source.replace(name=f"{label}_{what}", description=f"{source.description}, unit {k}")
            held = told.replace(name=f"{told.name}_held")
            definitions[told.name] = sp.Piecewise((source.symbol, valid.symbol > 0), (held.symbol, True))
            states.append(held)
            outputs.append(told)
        outputs.append(valid)
    return Block(
        name,
        states=tuple(states),
        inputs=(*solved.values(), good, RANGE_UNIT),
        outputs=tuple(outputs),
        definitions=definitions,
        definition_signals=tuple(outputs),
        derivatives={s.name: sp.Symbol(s.name.removesuffix("_held"), real=True) for s in states},
        period=tick(name, slot).start,
    )


def _last_position(slot: float) -> Block:
    """Return the memory of the last solved position of any unit; mirror images are farther apart."""
    solved = tuple(s.replace(name=s.name.replace("previous", "solved")) for s in PREVIOUS[:2])
    good = Signal("solved", "1", "1 where the ranges give a position")
    held = [s.replace(name=f"{s.name}_held") for s in PREVIOUS]
    new = [
        sp.Piecewise((s.symbol, good.symbol > 0), (h.symbol, True))
        for s, h in zip(solved, held, strict=False)
    ]
    return Block(
        "last_position",
        states=tuple(held),
        inputs=(*solved, good),
        outputs=PREVIOUS,
        derivatives={
            h.name: e for h, e in zip(held, (*new, sp.Max(held[2].symbol, good.symbol)), strict=True)
        },
        output_expressions={s.name: h.symbol for s, h in zip(PREVIOUS, held, strict=True)},
        period=slot,
    )


@checked
def cricket(
    beacons: Beacons,
    units: Sequence[Sequence[float]] = K06_UNITS,
    *,
    slot: float = SLOT,
    slots: int = SLOTS,
    noise: float = 0.0,
    bias: float = 0.0,
    cone: tuple[float, float] = (0.0, 0.0),
    cone_limit: float = 0.0,
    latency: bool = False,
    corrected: bool = True,
    side: float = 1.0,
    assisted: bool = False,
    seed: int = 1,
    name: str = "cricket",
) -> Block:
    """Return the complete Cricket: ranges, positions by Bancroft's method, and with two units a heading.

    Where only two of more beacons were heard, the solution nearer to the last position is used, as in K06.

    It joins :func:`~hovercontrol.craft.hardware.sensors.ranging.cricket_ranges`,
    :func:`~hovercontrol.craft.hardware.sensors.bancroft.range_solver`, :func:`cricket_fixes` and
    :func:`~hovercontrol.craft.hardware.sensors.two_units.two_unit_heading`; parameters have these names as
    prefix (``cricket_ranges.noise``).

    Parameters
    ----------
    beacons, units, slot, slots, noise, bias, cone, cone_limit, latency, seed
        As for :func:`~hovercontrol.craft.hardware.sensors.ranging.cricket_ranges`.
    corrected : bool, optional
        Whether the solver corrects ranges for the cone angle, by (5.9).
    side : float, optional
        With two beacons only: the side of their line on which all units are, as for
        :func:`~hovercontrol.craft.hardware.sensors.bancroft.range_solver`. A craft that crosses the line is
        mirrored, position and heading.
    assisted : bool, optional
        Whether an INS extrapolates the first unit's fix to the time of the second's.
    name : str, optional

    Returns
    -------
    Block
        Inputs ``x, y`` [m], ``psi`` [rad], if assisted also those of the two-unit heading; outputs those of
        all parts: ``fix_x, fix_y`` [m], ``fix_valid``, ``range_1...``, ``range_valid``, with two units
        ``heading_fix`` [rad], ``heading_fix_valid``, and so on.

    Raises
    ------
    InputError
        As of the parts.

    Examples
    --------
    >>> from hovercontrol.craft.hardware.sensors import k06_beacons
    >>> block = cricket(k06_beacons())
    >>> [s.name for s in block.outputs][:4]
    ['range_1', 'range_2', 'range_3', 'range_4']
    """
    places = unit_places(units, slots)
    ranges = cricket_ranges(
        beacons,
        places,
        slot=slot,
        slots=slots,
        noise=noise,
        bias=bias,
        cone=cone,
        cone_limit=cone_limit,
        latency=latency,
        seed=seed,
    )
    several = len(beacons.positions) > 2
    solver = range_solver(beacons, cone=cone if corrected else (0.0, 0.0), side=side, previous=several)
    parts = [ranges, solver, cricket_fixes(len(places), slot=slot)]
    if several:
        parts.append(_last_position(slot))
    if len(places) == 2:
        parts.append(two_unit_heading(places, assisted=assisted, latency=latency, slot=slot))
    elif assisted:
        raise InputError(f"{name}: a heading needs two units, found {len(places)}")
    return interconnect(parts, name)


@checked
def k06_cricket(
    beacons: Beacons | None = None,
    units: Sequence[Sequence[float]] = K06_UNITS,
    *,
    side: float = 1.0,
    assisted: bool = False,
    latency: bool = True,
    seed: int = 1,
    name: str = "cricket",
) -> Block:
    """Return K06's Cricket: cone-angle error and correction, 45 degrees of cone limit, one slot of latency.

    K06 prints no range noise; 3.5 mm give its static circular error probable of about 0.5 cm in the middle of
    :func:`~hovercontrol.craft.hardware.sensors.beacons.k06_beacons`.

    Parameters
    ----------
    beacons : Beacons, optional
        Default: :func:`~hovercontrol.craft.hardware.sensors.beacons.k06_beacons`.
    units, side, assisted, latency, seed, name
        As for :func:`cricket`.

    Examples
    --------
    >>> [s.name for s in k06_cricket().inputs]
    ['x', 'y', 'psi']
    """
    return cricket(
        beacons or k06_beacons(),
        units,
        noise=0.0035,
        cone=K06_CONE,
        cone_limit=math.radians(45.0),
        latency=latency,
        side=side,
        assisted=assisted,
        seed=seed,
        name=name,
    )
