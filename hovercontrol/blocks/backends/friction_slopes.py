"""The slope of dry friction in a linear system: smoothed, omitted, or given by a describing function.

A Block contains dry friction as ``F sgn(v, w)``, smoothed to F tanh(v/w). Its slope at v = 0 is F/w. The
resulting pole depends on the width of the smoothing, not on the craft. Three slopes of sgn can be chosen:

smooth
    d/dv tanh(v/w) = (1 - tanh^2(v/w))/w, the derivative of the smoothed equations.
none
    0, the derivative while v keeps its sign: a moving craft.
describing
    N(A, v) = 4/(pi A) sqrt(1 - (v/A)^2), and 0 for abs(v) > A: the describing function of a relay whose input
    is v + A sin(w t) [Gelb and Vander Velde, Multiple-Input Describing Functions, 1968, section 6.2]. At
    v = 0 it is the well-known 4/(pi A).
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np
import sympy as sp
from scipy.optimize import linear_sum_assignment

from hovercontrol.base.arrays import Array
from hovercontrol.base.caller import caller_level
from hovercontrol.base.errors import InputError, SmoothedFrictionWarning, check_known, shown
from hovercontrol.base.tables import positive
from hovercontrol.blocks.block import Block, Columns, Rows
from hovercontrol.blocks.functions import Function, array_function
from hovercontrol.blocks.sgn import sgn
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.singular import finite_jacobian

Slope = Literal["smooth", "none", "describing"]

#: A pole is due to the smoothing if it moves by this fraction of its magnitude without the friction's slope.
MOVED = 0.1

_MATRICES: tuple[tuple[Rows, Columns], ...] = (
    ("derivatives", "states"),
    ("derivatives", "inputs"),
    ("outputs", "states"),
    ("outputs", "inputs"),
)


class Point(NamedTuple):
    """The point at which a Block is linearised.

    Attributes
    ----------
    t : float
        Time [s].
    x, u : ndarray, shapes (n_states,) and (n_inputs,)
    params : mapping of str to float
        Parameter values by key; others have their defaults.
    """

    t: float
    x: Array
    u: Array
    params: Mapping[str, float]


def linear_matrices(
    block: Block, point: Point, friction: Slope = "smooth", amplitude: Mapping[str, float] | None = None
) -> list[Array]:
    """Return A = df/dx, B = df/du, C = dg/dx, D = dg/du at a point, from exact Jacobians.

    f are the states' derivatives and g the outputs.

    Parameters
    ----------
    friction, amplitude
        As for :meth:`hovercontrol.Block.linearize`.

    Raises
    ------
    InputError
        If an amplitude is missing, not positive, or for a state without dry friction; or if a derivative at
        the point is not finite.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import vehicle
    >>> craft = vehicle("c17_simulation").plant()
    >>> ahead = Point(0.0, np.array([0, 0, 0, 1.0, 0, 0]), np.array([1.8, 0.0]), {})
    >>> [round(float(linear_matrices(craft, ahead, friction)[0][5, 5]), 2) for friction in ("smooth", "none")]
    [-83.48, -0.48]
    """
    rubbing = _lines_for(block)
    amplitudes = _amplitudes(block, rubbing, friction, amplitude)
    if friction == "smooth" or rubbing is None:
        return [_jacobian(block, point, *which) for which in _MATRICES]
    v, w = rubbing.at(point)
    values, slopes = np.tanh(v / w), np.zeros(len(v))
    for k, name in enumerate(rubbing.names):
        A = amplitudes.get(name, 0.0)
        if abs(v[k]) < A:
            # sgn(v + A sin(w t)) has the mean 2/pi asin(v/A) and the first harmonic A N(A, v)
            values[k] = 2 / np.pi * np.arcsin(v[k] / A)
            slopes[k] = 4 / (np.pi * A) * np.sqrt(1 - (v[k] / A) ** 2)
    line = point._replace(params={**point.params, **rubbing.line(values, slopes, v)})
    return [_jacobian(rubbing.block, line, *which) for which in _MATRICES]


def warn_of_smoothing(block: Block, A: Array, point: Point) -> None:
    """Warn if a pole of a continuous linearisation is due to the slope of smoothed dry friction.

    The eigenvalues p with and q without that slope are compared: the warning is given if
    abs(p - q) > 0.1 max(abs(p), abs(q)). It names pole, velocity and width.

    Parameters
    ----------
    A : ndarray, shape (n_states, n_states)
        System matrix of the smoothed equations.
    """
    rubbing = _lines_for(block)
    if rubbing is None or block.period or not len(A):
        return
    v, w = rubbing.at(point)
    values = np.tanh(v / w)
    slopes = (1 - values**2) / w
    found: dict[str, str] = {}
    for name in dict.fromkeys(rubbing.names):
        own = np.array([other == name for other in rubbing.names])
        if (slopes[own] * w[own] < 1e-9).all():
            continue
        line = point._replace(params={**point.params, **rubbing.line(values, np.where(own, 0.0, slopes), v)})
        pole, without = _moved_pole(A, _jacobian(rubbing.block, line, "derivatives", "states"))
        if abs(pole - without) > MOVED * max(abs(pole), abs(without)):
            found[name] = (
                f"the pole at {_number(pole)} rad/s comes from the smoothed dry friction in {name}, of width "
                f"{float(w[own].min()):g}{_unit(block, name)}; without its slope the pole is at "
                f"{_number(without)} rad/s"
            )
    if found:
        advice = (
            "Linearise with friction='none' if the velocity keeps its sign or friction is to be left out, or "
            f"with friction='describing', amplitude={{{next(iter(found))!r}: A}} for oscillations of size A"
        )
        text = block.where(f"{'; '.join(found.values())}. {advice}")
        warnings.warn(text, SmoothedFrictionWarning, stacklevel=caller_level())


def creeping(block: Block, point: Point) -> set[str]:
    """Return the velocities v at a point that creep: 1e-6 w < abs(v) < 2 w, w the width of their friction.

    Coulomb friction would hold them at rest.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import vehicle
    >>> craft = vehicle("c17_simulation").plant()
    >>> creeping(craft, Point(0.0, np.array([0, 0, 0, 0.005, 0, 0.2]), np.zeros(2), {}))
    {'u'}
    """
    rubbing = _lines_for(block)
    if rubbing is None:
        return set()
    v, w = rubbing.at(point)
    return {name for name, a, b in zip(rubbing.names, v, w, strict=True) if 1e-6 * b < abs(a) < 2 * b}


# ---- sgn as a line through a point -----------------------------------------------------------------------


class _Lines(NamedTuple):
    """A Block in which ``s + k (v - v0)`` replaces each ``sgn(v, w)``, with the parameters s, k and v0."""

    block: Block
    names: tuple[str, ...]
    evaluate: Function
    original: Block

    def at(self, point: Point) -> tuple[Array, Array]:
        """Return v and w of each sgn at a point."""
        p = self.original.parameter_values(point.params, bounded=False)
        found = np.array(self.evaluate(point.t, point.x, point.u, p), dtype=float)
        return found[: len(self.names)], found[len(self.names) :]

    def line(self, values: Array, slopes: Array, at: Array) -> dict[str, float]:
        """Return the parameters s, k and v0 of each sgn, by key."""
        return {
            self.block.parameter_key(f"sgn_{k}_{word}"): float(numbers[k])
            for word, numbers in (("value", values), ("slope", slopes), ("at", at))
            for k in range(len(self.names))
        }


@lru_cache(maxsize=64)
def _lines_for(block: Block) -> _Lines | None:
    """Return the Block with each sgn replaced by a line; None if it has no sgn."""
    atoms: set[sp.Expr] = set().union(*(e.atoms(sgn) for _, e in block.all_expressions()))
    found = sorted(atoms, key=str)
    if not found:
        return None
    new: list[Signal] = []
    swap: dict[sp.Expr, sp.Expr] = {}
    for k, f in enumerate(found):
        value, slope, at = (Signal(f"sgn_{k}_{word}") for word in ("value", "slope", "at"))
        swap[f] = value.symbol + slope.symbol * (f.args[0] - at.symbol)
        new += [value, slope, at]
    lines = block.unchecked(parameters=(*block.parameters, *new), **block.swapped(swap))
    wanted = [f.args[i] for i in (0, 1) for f in found]
    return _Lines(lines, tuple(str(f.args[0]) for f in found), array_function(block, wanted), block)


def _jacobian(block: Block, point: Point, rows: Rows, columns: Columns) -> Array:
    return finite_jacobian(block, *point, rows, columns)


def _amplitudes(
    block: Block, rubbing: _Lines | None, friction: Slope, amplitude: Mapping[str, float] | None
) -> Mapping[str, float]:
    if friction != "describing":
        if amplitude is not None:
            text = f"an amplitude is for friction='describing', found friction={friction!r}"
            raise InputError(block.where(text))
        return {}
    names = rubbing.names if rubbing else ()
    if names and not amplitude:
        text = f"friction='describing' needs an amplitude of the oscillation: amplitude={{{names[0]!r}: ...}}"
        raise InputError(block.where(text))
    for name, value in (amplitude or {}).items():
        check_known(name, names, block.where(f"no dry friction in {shown(name)}"))
        positive(block.where(f"amplitude of {name}"), value)
    return amplitude or {}


# ---- the warning -----------------------------------------------------------------------------------------


def _moved_pole(A: Array, other: Array) -> tuple[complex, complex]:
    """Return the eigenvalue that moves most from one matrix to the other, before and after."""
    # the pairs (p_i, q_j) minimise sum sqrt(|p_i - q_j|), which prefers one large move to many small ones
    poles, others = np.linalg.eigvals(A), np.linalg.eigvals(other)
    distance = np.abs(poles[:, None] - others)
    rows, columns = linear_sum_assignment(np.sqrt(distance))
    most = int(np.argmax(distance[rows, columns]))
    return complex(poles[rows[most]]), complex(others[columns[most]])


def _number(pole: complex) -> str:
    imaginary = f"{pole.imag:+.3g}j" if abs(pole.imag) > 1e-9 * abs(pole) else ""
    return f"{pole.real + 0.0:.3g}{imaginary}"


def _unit(block: Block, name: str) -> str:
    return next((f" {s.unit}" for s in block.states if s.name == name), "")
