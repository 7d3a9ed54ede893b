"""What can be diagnosed: a model's equations, timing and unknowns, whatever its numbers."""

from __future__ import annotations

from hovercontrol.core.block import Block
from hovercontrol.effects import Shape
from hovercontrol.models.blockmodel import BlockModel
from hovercontrol.models.model import Model

#: What can be diagnosed.
Subject = Model | BlockModel

#: Largest rate at which bristles of a friction follow the motion [1/s]: logs do not show a millisecond. Times
#: the length of a sub-step it is at most the other: Runge-Kutta is stable to 2.8.
FASTEST, FOLLOWED = 1e3, 1.25

_STRUCTURES: dict[tuple[object, ...], Block] = {}


def structure(model: Subject) -> Block:
    """Return a Block with the equations of a model, whatever its numbers; made once for a set of effects."""
    key = (type(model), *model.signature)
    if key not in _STRUCTURES:
        if len(_STRUCTURES) > 500:
            _STRUCTURES.clear()
        _STRUCTURES[key] = model.plant(late=True, fastest=FASTEST)
    return _STRUCTURES[key]


def rate_key(block: Block) -> str:
    """Return what the parameter is called that says how fast bristles follow, if a Block has it."""
    return f"{block.name}.fastest"


def followed_rate(step: float) -> float:
    """Return how fast bristles may follow in sub-steps as long as this [1/s].

    Examples
    --------
    >>> followed_rate(1e-3), followed_rate(5e-3)
    (1000.0, 250.0)
    """
    return min(FASTEST, FOLLOWED / max(step, 1e-9))


_TIMINGS: dict[tuple[object, ...], tuple[str, str]] = {}


def timing(model: Subject) -> tuple[str, str]:
    """Return which parameters say how late a model's inputs act and measurements are; made once as well."""
    key = (type(model), *model.signature)
    if key not in _TIMINGS:
        if len(_TIMINGS) > 500:
            _TIMINGS.clear()
        _TIMINGS[key] = model.timing()
    return _TIMINGS[key]


def unknowns(model: Subject) -> tuple[str, ...]:
    """Return the parameters of a model that a fit seeks: coefficients, widths of dry friction, shapes.

    A time at which something jumps is none: residuals do not change smoothly with it.

    Examples
    --------
    >>> from hovercontrol.models.vehicles import hoverdemon
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
    return (*model.linear_coefficients(), *(s for s in shapes if s not in same))


def same_widths(model: Subject) -> dict[str, str]:
    """Return widths of friction that are another's: along one axis dry friction has one.

    Examples
    --------
    >>> from hovercontrol.effects import effect
    >>> from hovercontrol.models.vehicles import c17_simulation
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
