"""Why a simulation does not go on: texts of a run's status, and the state and the switch that stop it.

Where a solver stalls, its steps have become so short that it makes no progress. Either the equations are
stiff (a coefficient is too large, a time constant too short), or a switch chatters: the motion drives an
expression such as max, atan2 or a piecewise one across its kink or jump and back at once. Short steps of
Euler's method from the point reached tell which: the switch that changes most often, and the state whose
derivative changes most.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from sympy.core.relational import Relational

from hovercontrol.core.block import Block
from hovercontrol.core.functions import FunctionPair, array_function, call_scalar, numpy_functions
from hovercontrol.core.sgn import sgn
from hovercontrol.errors import InputError

Array = NDArray[np.float64]

#: In the order of hc_solver.h.
REASONS = (
    "done",
    "no memory",
    "a derivative is not a number",
    "the step size is too small to meet the tolerance",
    "too many steps",
    "its worker failed",  # of :mod:`hovercontrol.targets.executors`
)

#: Steps that are looked at, their length as a share of the time that the run is to cover, and the share of
#: steps in which a switch that chatters changes: one that is passed changes in one step.
STEPS, LENGTH, CHATTERS = 300, 1e-5, 0.05

#: The steps end where a state becomes as large: Euler's method is unstable where the equations are stiff.
LARGEST = 1e100

#: Longest text of a switch.
WIDTH = 70


class StoppedError(InputError):
    """A simulation that cannot go on.

    Parameters
    ----------
    text : str
        The whole line.
    status : int, optional
        Of :data:`REASONS`.
    where : str, optional
        As of :func:`where_it_stops`.
    """

    def __init__(self, text: str, status: int = 4, where: str = "") -> None:
        super().__init__(text)
        self.status, self.where = status, where

    def __reduce__(self) -> tuple[Any, ...]:
        return StoppedError, (str(self), self.status, self.where)


@dataclass(frozen=True)
class Switch:
    """An expression that has a kink or a jump where another one passes through zero.

    Parameters
    ----------
    text : str
        The expression and the signal in whose equation it stands.
    curve : sympy.Expr
        What passes through zero.
    """

    text: str
    curve: sp.Expr


def where_it_stops(
    block: Block,
    t: float,
    x: Sequence[float],
    u: Sequence[float],
    p: Sequence[float],
    *,
    span: float,
    rtol: float = 1e-6,
    atol: float = 1e-9,
) -> str:
    """Return the state, and the switch if one chatters, at which a simulation stops, for the end of an error.

    Parameters
    ----------
    block : Block
        Continuous, without delays; of a hybrid one what moves between its ticks.
    t : float
        Time reached [s].
    x, u, p : sequence of float
        States there, inputs, parameter values in order.
    span : float
        Time that the run was to cover [s].
    rtol, atol : float, optional
        Of the solver.

    Returns
    -------
    str
        Begins with a colon and a space; empty where nothing can be told.

    Examples
    --------
    >>> from hovercontrol import Block, Signal
    >>> v, a = Signal("v", "m/s"), Signal("a", "m/s^2", start=2.0)
    >>> relay = sp.Piecewise((-a.symbol, v.symbol > 0), (a.symbol, True))
    >>> block = Block("relay", [v], [], [v], [a], {"v": relay})
    >>> print(where_it_stops(block, 0.3, [0.0], [], [2.0], span=10.0))
    : the state v = 0 m/s changes fastest, and the switch v > 0 in v' chatters
    """
    if not block.states or not span > 0.0:
        return ""
    rhs = numpy_functions(block).scalar_pair("derivatives")
    with np.errstate(all="ignore"):
        for length in (LENGTH * span, 0.01 * LENGTH * span):
            times, path = _trace(rhs, t, x, u, p, length)
            slopes = _slopes(block, times, path, u, p)
            switch = _chattering(block, times, path, u, p)
            if switch:
                break
        state = _fastest(path, slopes, rtol, atol)
    signal = block.states[state]
    unit = "" if signal.unit == "1" else f" {signal.unit}"
    text = f": the state {signal.name} = {x[state]:.6g}{unit} "
    if not np.isfinite(slopes[state, 0]):
        return f"{text}has the derivative {slopes[state, 0]}"
    return f"{text}changes fastest" + (f", and the switch {switch} chatters" if switch else "")


def _trace(
    rhs: FunctionPair, t: float, x: Sequence[float], u: Sequence[float], p: Sequence[float], length: float
) -> tuple[Array, Array]:
    """Return times and states, shape (n_states, n_times), of short steps, as far as these are numbers."""
    states, times = [list(x)], [t]
    for _ in range(STEPS):
        slope = call_scalar(rhs, times[-1], states[-1], u, p)
        now = [a + length * b for a, b in zip(states[-1], slope, strict=True)]
        if not all(abs(v) < LARGEST for v in now):  # nor a NaN
            break
        states.append(now)
        times.append(times[-1] + length)
    return np.array(times), np.array(states, dtype=float).T


def _slopes(block: Block, t: Array, x: Array, u: Sequence[float], p: Sequence[float]) -> Array:
    found = numpy_functions(block).array_derivatives(t, x, np.array(u, dtype=float), np.array(p))
    return np.array([np.broadcast_to(row, t.shape) for row in found], dtype=float)


def _fastest(x: Array, slopes: Array, rtol: float, atol: float) -> int:
    """Return the state whose derivative is no number, or changes most from step to step, scaled."""
    bad = np.flatnonzero(~np.isfinite(slopes[:, 0]))
    if bad.size:
        return int(bad[0])
    changes = np.abs(np.diff(slopes, axis=1)).max(axis=1) if slopes.shape[1] > 1 else np.abs(slopes[:, 0])
    if not np.isfinite(changes).all() or not changes.any():
        changes = np.abs(slopes[:, 0])
    return int(np.argmax(changes / (atol + rtol * np.abs(x).max(axis=1))))


def _chattering(block: Block, t: Array, x: Array, u: Sequence[float], p: Sequence[float]) -> str:
    """Return the switch that changes in most of the steps, or nothing if none chatters."""
    found = switches(block)
    if not found or len(t) < 10:
        return ""
    values = array_function(block, [s.curve for s in found])(t, x, np.array(u, dtype=float), np.array(p))
    signs = np.array([np.broadcast_to(np.sign(v), t.shape) for v in values], dtype=float)
    counts = (np.diff(signs, axis=1) != 0).sum(axis=1)
    most = int(np.argmax(counts))
    return found[most].text if counts[most] >= CHATTERS * len(t) else ""


@lru_cache(maxsize=64)
def switches(block: Block) -> tuple[Switch, ...]:
    """Return the switches in a Block's equations.

    Examples
    --------
    >>> from hovercontrol import Block, Signal
    >>> v, F, m = Signal("v", "m/s"), Signal("F", "m/s^2"), Signal("m", "m/s^2", start=1.0)
    >>> [s.text for s in switches(Block("cart", [v], [F], [v], [m], {"v": sp.Min(F.symbol, m.symbol)}))]
    ["Min(F, m) in v'"]
    """
    slopes = {f"{s.name}'": block.derivatives[s.name] for s in block.states}
    found: dict[sp.Expr, Switch] = {}
    for name, expression in (*block.definitions.items(), *slopes.items()):
        for shown, curve in _curves(expression):
            text = str(shown)
            text = text if len(text) <= WIDTH else text[: WIDTH - 3] + "..."
            found.setdefault(curve, Switch(f"{text} in {name}", curve))
    return tuple(found.values())


def _curves(expression: sp.Expr) -> Iterator[tuple[Any, sp.Expr]]:
    """Yield what switches in an expression, and what passes through zero there."""
    for e in sorted(expression.atoms(sp.Max, sp.Min), key=str):
        for k, first in enumerate(e.args):
            yield from ((e, first - other) for other in e.args[k + 1 :])
    for e in sorted(expression.atoms(Relational), key=str):
        yield e, e.lhs - e.rhs
    for e in sorted(expression.atoms(sp.Abs, sp.sign, sp.Heaviside, sgn), key=str):
        yield e, e.args[0]
    for e in sorted(expression.atoms(sp.atan2), key=str):
        y, x = e.args
        yield e, sp.Piecewise((y, x < 0), (sp.S.One, True))
