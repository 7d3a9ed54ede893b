"""Models that can be diagnosed: their equations, timing and unknowns, independent of parameter values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.blocks.block import Block
from hovercontrol.craft.effects import Shape
from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.craft.models.model import Model

#: A model that can be diagnosed.
Subject = Model | BlockModel

#: FASTEST: largest rate at which bristle states of friction follow the motion [1/s], as logs do not resolve a
#: millisecond. FOLLOWED: largest product of that rate and the length of a sub-step; Runge-Kutta is stable up
#: to 2.8.
FASTEST, FOLLOWED = 1e3, 1.25

_STRUCTURES: dict[tuple[object, ...], Block] = {}


def structure(model: Subject) -> Block:
    """Return a Block with the equations of a model; cached, as it does not depend on parameter values.

    Of a sampled model these are the rates, whose Euler steps are its next values.
    """
    key = (type(model), *model.signature)
    if key not in _STRUCTURES:
        if len(_STRUCTURES) > 500:
            _STRUCTURES.clear()
        if isinstance(model, BlockModel) and model.period:
            _STRUCTURES[key] = model.rates(FASTEST)
        else:
            _STRUCTURES[key] = model.plant(late=True, fastest=FASTEST)
    return _STRUCTURES[key]


def rate_key(block: Block) -> str:
    """Return the name of the parameter for the rate at which bristle states follow, if a Block has one."""
    return f"{block.name}.fastest"


def followed_rate(step: float, tempo: float = 1.0) -> float:
    """Return the largest stable rate of bristle states [1/s] for sub-steps of length `step` [s].

    ``min(FASTEST / tempo, FOLLOWED / step)``

    Examples
    --------
    >>> followed_rate(1e-3), followed_rate(5e-3)
    (1000.0, 250.0)
    """
    return min(FASTEST / tempo, FOLLOWED / max(step, 1e-9 * tempo))


_TIMINGS: dict[tuple[object, ...], tuple[str, ...]] = {}


def timing(model: Subject) -> tuple[str, ...]:
    """Return the names of the parameters for the delays of a model's inputs and measurements; cached."""
    key = (type(model), *model.signature)
    if key not in _TIMINGS:
        if len(_TIMINGS) > 500:
            _TIMINGS.clear()
        _TIMINGS[key] = model.timing()
    return _TIMINGS[key]


def unknowns(model: Subject) -> tuple[str, ...]:
    """Return the parameters of a model that a fit can estimate.

    They are a craft's coefficients or all parameters of a Block, and the shapes of effects, such as widths of
    dry friction.

    The time of a jump is not estimated, because residuals do not change smoothly with it.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import hoverdemon
    >>> unknowns(hoverdemon())
    ('thrust', 'rudder_torque')
    """
    shapes = [
        e.parameter(k)
        for e in model.effects
        for k, n in e.numbers.items()
        if isinstance(n, Shape) and n.of != "time" and not n.fixed
    ]
    same = same_widths(model)
    return (*model.free_coefficients(), *(s for s in shapes if s not in same))


def named(subject: Subject, names: Sequence[str]) -> tuple[str, ...]:
    """Return coefficients as the model names them.

    Raises
    ------
    InputError
        If a name is unknown (the message names the nearest) or listed twice.
    """
    known, found = subject.coefficients(), list[str]()
    for name in names:
        if name not in known and name.rpartition(".")[2] not in known:
            hint = did_you_mean(name, known)
            raise InputError(f"{subject.name!r} has no coefficient {name!r}{hint}")
        found.append(name if name in known else subject.coefficient_name(name))
    twice = [name for name, own in zip(names, found, strict=True) if found.count(own) > 1]
    if twice:
        raise InputError(f"coefficient {twice[0]!r} is named twice")
    return tuple(found)


def with_known_period(
    model: Subject, names: Sequence[str] | None, fixed: Sequence[str]
) -> tuple[Subject, list[str]]:
    """Return a sampled model of which it is settled which parameter is the period, and what was assumed.

    A parameter with the value of the period may be the period or a time constant that starts there. One to
    be fitted is not the period. Of the others those that are fixed are meant, if any is, and a single one is
    the period.

    Parameters
    ----------
    names : sequence of str or None
        Coefficients to fit; None for all.
    fixed : sequence of str
        Coefficients that keep their values.

    Raises
    ------
    InputError
        If all coefficients are to be fitted and two may be the period, or a name is unknown.
    """
    if not isinstance(model, BlockModel) or not model.period:
        return model, []
    fitted, kept, said = named(model, names or ()), named(model, fixed), list[str]()
    settled = model.period_parameter is not None
    equal = [n for n in (model.periods() if settled else model.equal_to_period()) if n not in fitted]
    found = [n for n in equal if n in kept] or equal
    if names is None and not settled and found and found[0] not in kept:
        what = f"{model.name}: {' and '.join(map(repr, found))} = {model.period:g} s, as the period"
        if len(found) > 1:
            raise InputError(f"{what}: fix the one that is the period, as in fixed=[{found[0]!r}]")
        said = [f"{what}: it is kept; fixed=[{found[0]!r}] confirms it, another start value has it fitted"]
    return (replace(model, period_parameter="".join(found)) if len(found) < 2 else model), said


def same_widths(model: Subject) -> dict[str, str]:
    """Return widths of friction that equal another one: along one axis, dry friction has a single width.

    Examples
    --------
    >>> from hovercontrol.craft.effects import effect
    >>> from hovercontrol.craft.models.vehicles import c17_simulation
    >>> same_widths(c17_simulation().with_effects([effect("surge_stribeck", 0.1, speed=0.2)]))
    {'surge_stribeck_width': 'surge_coulomb_width'}
    """
    first: dict[str, str] = {}
    found: dict[str, str] = {}
    for e in model.effects:
        name = e.friction_width()
        if name and e.axis in first:
            found[name] = first[e.axis]
        elif name and e.axis:
            first[e.axis] = name
    return found
