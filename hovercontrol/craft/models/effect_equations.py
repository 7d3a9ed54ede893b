"""The equations of a list of effects: accelerations, states, commands as they act, measured motion."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from types import SimpleNamespace

import sympy as sp

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.craft.effects import Effect
from hovercontrol.craft.models.fans import Fan, fans_alike
from hovercontrol.craft.models.motion import MOTION, THRUST, add_forces

#: What effects make of commands, by all that it depends on.
_WAYS: dict[tuple[Hashable, ...], tuple[dict[Signal, sp.Expr], SimpleNamespace]] = {}


def accelerations(effects: Sequence[Effect], owner: str, motion: SimpleNamespace) -> dict[str, sp.Expr]:
    """Return the sum of all effects' terms, by equation ``u``, ``v``, ``r``.

    Parameters
    ----------
    effects : sequence of Effect
    owner : str
        Name of the Block; its parameters are the coefficients.
    motion : namespace
        As :func:`motion_symbols` gives it, or with other expressions in its place.

    Raises
    ------
    InputError
        If the terms of an effect are not a dict with these keys.
    """
    total = dict.fromkeys(("u", "v", "r"), sp.S.Zero)
    seen = _motion_seen(effects, owner, motion)
    factors: dict[str, sp.Expr] = {}
    for e in effects:
        for name, factor in e.factors(e.symbols(owner), seen).items():
            factors[name] = factors.get(name, sp.S.One) * factor
    masses: dict[str, dict[str, sp.Expr]] = {axis: {} for axis in total}
    for e in effects:
        for axis, factor in e.inertia(e.symbols(owner), seen).items():
            masses[axis][e.name] = factor
    for e in effects:
        terms = e.terms(e.symbols(owner), seen)
        if not isinstance(terms, dict) or not set(terms) <= set(total):
            raise InputError(f"effect {e.name}: terms() must return a dict with keys u, v, r, not {terms!r}")
        for axis, term in terms.items():
            mass = sp.Mul(*(m for name, m in masses[axis].items() if name != e.name))
            total[axis] += factors.get(e.name, sp.S.One) * mass * term
    return total


def own_states(effects: Sequence[Effect], owner: str, motion: SimpleNamespace) -> dict[Signal, sp.Expr]:
    """Return the states that effects add to the motion, with their derivatives.

    Parameters
    ----------
    effects, owner, motion
        As of :func:`accelerations`.
    """
    seen = _motion_seen(effects, owner, motion)
    return {k: d for e in effects for k, d in e.states(e.symbols(owner), seen).items()}


def apply_to_commands(
    effects: Sequence[Effect],
    fans: Sequence[Fan],
    units: Mapping[str, str],
    owner: str,
    motion: SimpleNamespace,
) -> tuple[dict[Signal, sp.Expr], SimpleNamespace]:
    """Apply the input effects to the commands; return the derivatives of their states, and the commands.

    The force and the angle that act replace ``motion.thrust`` and ``motion.rudder``. What the effects make of
    the commands is kept, because SymPy is slow on nested limits and dead zones.

    Parameters
    ----------
    effects : sequence of Effect
    fans : sequence of Fan
    units : mapping of str to str
        Unit of each command.
    owner, motion
        As of :func:`accelerations`.
    """
    changing = sorted((e for e in effects if e.kind() == "input"), key=lambda e: e.order)
    key = (owner, *units.items(), fans_alike(fans), *(type(e) for e in changing))
    if key not in _WAYS:
        if len(_WAYS) > 500:
            _WAYS.clear()
        sent = {f.name: f.command().symbol for f in fans} or {THRUST.name: motion.thrust}
        way = SimpleNamespace(
            thrusts=sent,
            rudder=motion.rudder,
            inputs=dict(motion.inputs),
            time=time,
            units=dict(units),
            delay=None,
        )
        states: dict[Signal, sp.Expr] = {}
        for e in (e for e in changing if e.before_curve):
            states |= e.commands(e.symbols(owner), way)
        way.thrusts |= {f.name: f.force(owner, way.thrusts[f.name]) for f in fans}
        way.units |= {f.name: "N" for f in fans}
        for e in (e for e in changing if not e.before_curve):
            states |= e.commands(e.symbols(owner), way)
        _WAYS[key] = states, way
    states, way = _WAYS[key]
    motion.thrust, motion.rudder = way.thrusts.get(THRUST.name, motion.thrust), way.rudder
    add_forces(motion, fans, owner, way.thrusts)
    return dict(states), way


def measured_motion(effects: Sequence[Effect], owner: str) -> SimpleNamespace:
    """Apply the measurement effects to the motion."""
    symbols = {signal.name: signal.symbol for signal in MOTION}
    seen = SimpleNamespace(**symbols, true=SimpleNamespace(**symbols), late=None)
    for e in sorted(effects, key=lambda e: e.order):
        e.measured(e.symbols(owner), seen)
    return seen


def _motion_seen(effects: Sequence[Effect], owner: str, motion: SimpleNamespace) -> SimpleNamespace:
    """Apply the effects that change the motion seen by all effects."""
    seen = SimpleNamespace(**vars(motion))
    for e in effects:
        e.motion(e.symbols(owner), seen)
    return seen
