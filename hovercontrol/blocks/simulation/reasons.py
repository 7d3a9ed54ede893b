"""Why a simulation stops: the texts of a run's status, and the state and the switch that stop it.

A solver stalls when its steps become so short that it makes no progress. Either the equations are stiff (a
coefficient is too large, a time constant too short), or a switch chatters: the motion drives an expression
such as max, atan2 or a piecewise one across its kink or jump and back at once. Short Euler steps from the
point reached show the cause: the switch that changes most often, and the state whose derivative changes most.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp
from sympy.core.relational import Relational

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.functions import FunctionPair, array_function, call_scalar, numpy_functions
from hovercontrol.blocks.sgn import sgn

#: Texts of the status codes, in the order of hc_solver.h.
REASONS = (
    "done",
    "no memory",
    "a derivative is not a number",
    "the step size is too small to meet the tolerance",
    "too many steps",
    "its worker failed",  # of :mod:`hovercontrol.blocks.backends.executors`
)

#: Number of Euler steps, length of a step as a fraction of the run's time span, and minimum fraction of the
#: steps in which a chattering switch changes. (A switch that is merely crossed changes in one step.)
STEPS, LENGTH, CHATTERS = 300, 1e-5, 0.05

#: The steps end where a state reaches this magnitude: Euler's method is unstable for stiff equations.
LARGEST = 1e100

#: Maximum number of characters in a switch's text.
WIDTH = 70


class StoppedError(InputError):
    """A simulation that cannot continue.

    Parameters
    ----------
    text : str
        The complete message.
    status : int, optional
        Index into :data:`REASONS`.
    where : str, optional
        Text from :func:`where_it_stops`.
    """

    def __init__(self, text: str, status: int = 4, where: str = "") -> None:
        super().__init__(text)
        self.status, self.where = status, where

    def __reduce__(self) -> tuple[Any, ...]:
        return StoppedError, (str(self), self.status, self.where)


@dataclass(frozen=True)
class Switch:
    """An expression that has a kink or a jump where another expression, its `curve`, crosses zero.

    Parameters
    ----------
    text : str
        The expression and the signal whose equation contains it.
    curve : sympy.Expr
        The expression whose zero crossing is the kink or jump.
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
    """Return the end of an error message: the state and any chattering switch that stop a simulation.

    Parameters
    ----------
    block : Block
        Continuous, without delays; for a hybrid Block, its equations between ticks.
    t : float
        Time reached [s].
    x, u, p : sequence of float
        States at that time, inputs, and parameter values in order.
    span : float
        Time span of the run [s].
    rtol, atol : float, optional
        Tolerances of the solver.

    Returns
    -------
    str
        Begins with a colon and a space; empty if the Block has no states or `span` is not positive.

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
    """Return times and states, shape (n_states, n_times), of short Euler steps, as far as they are finite."""
    # explicit Euler: x(k+1) = x(k) + h f(t(k), x(k), u, p), h = length
    states, times = [list(x)], [t]
    for _ in range(STEPS):
        slope = call_scalar(rhs, times[-1], states[-1], u, p)
        now = [a + length * b for a, b in zip(states[-1], slope, strict=True)]
        if not all(abs(v) < LARGEST for v in now):  # also false for a NaN
            break
        states.append(now)
        times.append(times[-1] + length)
    return np.array(times), np.array(states, dtype=float).T


def _slopes(block: Block, t: Array, x: Array, u: Sequence[float], p: Sequence[float]) -> Array:
    found = numpy_functions(block).array_derivatives(t, x, np.array(u, dtype=float), np.array(p))
    return np.array([np.broadcast_to(row, t.shape) for row in found], dtype=float)


def _fastest(x: Array, slopes: Array, rtol: float, atol: float) -> int:
    """Return the first state whose derivative is not a number, else the one whose derivative changes most."""
    bad = np.flatnonzero(~np.isfinite(slopes[:, 0]))
    if bad.size:
        return int(bad[0])
    # argmax over states i of  max_k |f_i(k+1) - f_i(k)| / (atol + rtol max_k |x_i(k)|);
    # |f_i(0)| replaces the numerator if all differences are zero, one is not finite, or there is one point
    changes = np.abs(np.diff(slopes, axis=1)).max(axis=1) if slopes.shape[1] > 1 else np.abs(slopes[:, 0])
    if not np.isfinite(changes).all() or not changes.any():
        changes = np.abs(slopes[:, 0])
    return int(np.argmax(changes / (atol + rtol * np.abs(x).max(axis=1))))


def _chattering(block: Block, t: Array, x: Array, u: Sequence[float], p: Sequence[float]) -> str:
    """Return the text of the switch that changes in most steps, or "" if no switch chatters."""
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
    """Yield each switching part of an expression with the curve whose zero crossing switches it."""
    # max(a, b), min(a, b): a - b;  a < b, a == b: a - b;  |a|, sgn a: a;  atan2(y, x): y where x < 0, else 1
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
