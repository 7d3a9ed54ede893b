"""The heading of the line between two units whose fixes come one slot apart, K06 section 6.2.1.2."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.hardware.sensors._parts import offset, pair, switch, tick, turned

_FIXES = (
    Signal("fix_x", "m", "position of the first unit"),
    Signal("fix_y", "m", "position of the first unit"),
    Signal("fix_valid", "1", "1 at the tick of a new fix of the first unit"),
    Signal("fix_2_x", "m", "position of the second unit"),
    Signal("fix_2_y", "m", "position of the second unit"),
    Signal("fix_2_valid", "1", "1 at the tick of a new fix of the second unit"),
)
_INS = (
    Signal("v_x_hat", "m/s", "velocity along x, from the INS"),
    Signal("v_y_hat", "m/s", "velocity along y, from the INS"),
    Signal("psi_hat", "rad", "heading from the INS"),
    Signal("r_hat", "rad/s", "yaw rate from the INS"),
)


@checked
def two_unit_heading(
    units: Sequence[Sequence[float]],
    *,
    assisted: bool = False,
    latency: bool = False,
    slot: float = 0.1,
    name: str = "two_unit_heading",
) -> Block:
    """Return the heading from the fixes of two units.

    The second unit's fix comes one slot after the first's; if the craft moves in between, the line between
    the fixes is not the line between the units. With `assisted`, the first fix is moved by the first unit's
    velocity, from INS outputs at earlier ticks; without latency these are extrapolated to the time between
    the fixes. So this heading can aid the INS without an algebraic loop.

    Parameters
    ----------
    units : sequence of two (float, float)
        Places in the body's axes [m].
    assisted : bool, optional
        Whether to use the INS.
    latency : bool, optional
        Whether fixes come one tick after they were measured; INS outputs of that time are then used.
    slot : float, optional
        Period [s].
    name : str, optional

    Returns
    -------
    Block
        Inputs ``fix_x, fix_y, fix_valid, fix_2_x, fix_2_y, fix_2_valid`` and, if assisted,
        ``v_x_hat, v_y_hat`` [m/s] in the earth's axes, ``psi_hat`` [rad] and
        ``r_hat`` [rad/s]; outputs ``heading_fix`` [rad], -pi to pi, held, and ``heading_fix_valid``, 1 at the
        tick of a new heading.

    Raises
    ------
    InputError
        If there are not two units in different places, or the slot is not positive.

    Examples
    --------
    >>> from hovercontrol.blocks.simulation.sampled import Ticking
    >>> heading = Ticking(two_unit_heading([(0.1, 0), (-0.1, 0)]))
    >>> still = dict(fix_x=0.0, fix_y=0.2, fix_2_x=0.0, fix_2_y=0.0)
    >>> first = heading.tick(0.0, {**still, "fix_valid": 1.0, "fix_2_valid": 0.0})
    >>> second = heading.tick(0.1, {**still, "fix_valid": 0.0, "fix_2_valid": 1.0})
    >>> second["heading_fix_valid"], round(second["heading_fix"], 4)
    (1, 1.5708)
    """
    places = [pair(f"{name}: unit {k}", p) for k, p in enumerate(units, 1)]
    if len(places) != 2 or places[0] == places[1]:
        raise InputError(f"{name}: expected two units at different positions, found {places}")
    mounts = [
        offset(f"unit_{k}_{axis}", "m", "position of the unit, body axes", name, value)
        for k, place in enumerate(places, 1)
        for axis, value in zip("xy", place, strict=True)
    ]
    x1, y1, x2, y2 = (s.symbol for s in mounts)
    fx, fy, valid, fx2, fy2, valid2 = (s.symbol for s in _FIXES)
    every = tick(name, slot)
    recent = Signal(
        "first_is_new", "1", "1 if the last tick had a fix of the first unit", lower=0.0, upper=1.0
    )
    held = Signal("heading_held", "rad", "last heading")
    told = Signal("heading_fix", "rad", "heading from the two units")
    new = Signal("heading_fix_valid", "1", "1 at the tick of a new heading")
    states: list[Signal] = [recent, held]
    following: dict[str, sp.Expr] = {recent.name: valid, held.name: told.symbol}
    definitions: dict[str, sp.Expr] = {
        new.name: sp.Piecewise((1, sp.And(valid2 > 0, recent.symbol > 0)), (0, True))
    }
    parameters = [*mounts]
    moved = [fx, fy]
    if assisted:
        late = switch("latency", "latency of one tick", latency)
        parameters += [every, late]
        vx, vy, psi, r = (s.symbol for s in _INS)
        arm = turned(psi, x1, y1)
        for i, (axis, velocity) in enumerate(zip("xy", (vx - r * arm[1], vy + r * arm[0]), strict=True)):
            now = Signal(f"velocity_{axis}", "m/s", "velocity of the first unit, from the INS")
            last = now.replace(name=f"velocity_{axis}_last")
            before = now.replace(name=f"velocity_{axis}_before")
            definitions[now.name] = velocity
            states += [last, before]
            following |= {last.name: now.symbol, before.name: last.symbol}
            mean = sp.Piecewise(
                ((last.symbol + before.symbol) / 2, late.symbol > 0),
                ((3 * last.symbol - before.symbol) / 2, True),
            )
            moved[i] = moved[i] + every.symbol * mean
    lx, ly, dx, dy = x1 - x2, y1 - y2, moved[0] - fx2, moved[1] - fy2
    # The angle from the line on the craft to the line in the room, whatever way it points on the craft.
    heading = sp.atan2(lx * dy - ly * dx, lx * dx + ly * dy)
    definitions[told.name] = sp.Piecewise((heading, new.symbol > 0), (held.symbol, True))
    return Block(
        name,
        states=tuple(states),
        inputs=(*_FIXES, *(_INS if assisted else ())),
        outputs=(told, new),
        parameters=tuple(parameters),
        derivatives=following,
        definitions=definitions,
        definition_signals=(told, new),
        period=every.start,
    )
