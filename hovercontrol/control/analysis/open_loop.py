"""The loop gain of a loop that is broken at one wire, from its Blocks or their whole.

Modes that the loop through the wire does not change (a position that nobody feeds back) are left out of it;
:class:`.OutsideModes` has those that do not decay.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple, TypeAlias

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.backends.trim import Trim
from hovercontrol.blocks.block import Block
from hovercontrol.control.analysis.cut_loop import CutLoop
from hovercontrol.control.analysis.loop_modes import OutsideModes, split_loop, split_sampled
from hovercontrol.control.analysis.stability_margins import Margins, loop_margins, negative

Loop: TypeAlias = Block | Sequence[Block] | control.StateSpace | control.TransferFunction
At: TypeAlias = ArrayLike | Mapping[str, float] | Trim | None
Slope = Literal["smooth", "none", "describing"]

#: Points of a curve where none are given, and how far beyond the slowest and the fastest corner it goes.
POINTS, BEYOND = 600, 100.0


@checked
def loop_gain(
    loop: Loop,
    wire: str | None = None,
    at: At = None,
    *,
    time: float | None = None,
    params: Mapping[str, float] | None = None,
    friction: Slope = "smooth",
    amplitude: Mapping[str, float] | None = None,
) -> control.StateSpace:
    """Return the loop gain L of a loop broken at one wire, for negative feedback.

    Parameters
    ----------
    loop : Block, sequence of Block, control.StateSpace or control.TransferFunction
        The Blocks of the loop, the loop that they make, or L itself (then nothing else is given).
    wire : str, optional
        Signal at which the loop is broken: one that a Block drives; of a loop in one Block a signal that its
        equations define, such as a command.
    at : Trim, mapping by name or array_like, shape (n_states,), optional
        Point of the closed loop; default its start values.
    time : float, optional
        [s]; default that of the Trim, or 0.
    params : mapping, optional
        Parameter values by key, in their units.
    friction, amplitude
        Slope of dry friction, as for :meth:`hovercontrol.Block.linearize`.

    Returns
    -------
    control.StateSpace
        One input and one output; in discrete time if Blocks are sampled, all with one period.

    Raises
    ------
    InputError
        If a name or a number of values is wrong, or parts of the loop tick with different
        periods.

    Examples
    --------
    >>> from hovercontrol.blocks.signals import Signal
    >>> v, a, k = Signal("v", "m/s"), Signal("a", "m/s^2"), Signal("k", "1/s", start=2.0)
    >>> cart = Block("cart", [v], [a], [v], derivatives={"v": a.symbol})
    >>> law = Block("law", [], [v], [a], [k], output_expressions={"a": -k.symbol * v.symbol})
    >>> complex(loop_gain([cart, law], "a")(1j))  # 2/s
    -2j
    """
    return broken(loop, wire, at, time, params, friction, amplitude).gain


class Broken(NamedTuple):
    """A loop that is broken at one wire.

    Attributes
    ----------
    gain : control.StateSpace
        L without the modes outside the loop that do not decay.
    outside : OutsideModes
        These.
    margins : Margins
    """

    gain: control.StateSpace
    outside: OutsideModes
    margins: Margins


def broken(
    loop: Loop,
    wire: str | None,
    at: At,
    time: float | None,
    params: Mapping[str, float] | None,
    friction: Slope,
    amplitude: Mapping[str, float] | None,
) -> Broken:
    """Return a loop broken at one wire; arguments and errors as of :func:`loop_gain`."""
    if isinstance(loop, control.StateSpace | control.TransferFunction):
        if wire is not None or at is not None:
            raise InputError("a linear system is the loop gain itself: it takes no wire and no point")
        if not loop.issiso():
            raise InputError(
                f"the loop gain has one input and one output, found {loop.ninputs} and {loop.noutputs}"
            )
        L = control.ss(loop)
    elif wire is None:
        raise InputError("wire: expected the signal at which the loop is broken")
    else:
        line = CutLoop(loop, wire).linearize(at, time, params, friction=friction, amplitude=amplitude)
        L = negative(line)
    gain, outside = (split_sampled if L.isdtime(strict=True) else split_loop)(L)
    gain.up_to = math.inf if wire is None else line.up_to
    return Broken(gain, outside, loop_margins(L))


def unstable_poles(system: control.StateSpace) -> int:
    """Return the number of poles in the right half-plane, or outside the unit circle of a sampled system."""
    poles = system.poles()
    return int(np.sum(np.abs(poles) > 1 + 1e-9 if system.isdtime(strict=True) else np.real(poles) > 1e-9))


def frequencies_of(gain: control.StateSpace, given: ArrayLike | None) -> Array:
    """Return the frequencies given, or a grid about the poles and zeros of L and its closed loop [rad/s].

    Raises
    ------
    InputError
        If one is not positive, is above Nyquist's frequency pi/h of a sampled loop, or above the frequency up
        to which a delay is exact.
    """
    dt = float(gain.dt) if gain.isdtime(strict=True) else 0.0
    up_to = float(getattr(gain, "up_to", math.inf))
    if given is not None:
        omega = np.atleast_1d(np.asarray(given, dtype=float))
        if omega.ndim != 1 or not len(omega) or not (np.isfinite(omega) & (omega > 0)).all():
            raise InputError("frequencies: expected positive finite numbers [rad/s]")
        if dt and omega.max() > math.pi / dt * (1 + 1e-9):
            raise InputError(
                f"frequencies: expected at most Nyquist's frequency, {math.pi / dt:.6g} rad/s at a step of "
                f"{dt:g} s, found {omega.max():g}"
            )
        if omega.max() > up_to * (1 + 1e-9):
            raise InputError(
                f"frequencies: expected at most {up_to:.6g} rad/s, up to which the delay's approximation is "
                f"exact to 1e-5, found {omega.max():g}"
            )
        return np.sort(omega)
    roots = np.concatenate([gain.poles(), gain.zeros(), control.feedback(gain, 1).poles()])
    if dt:
        with np.errstate(divide="ignore"):
            roots = np.log(roots[np.abs(roots) > 1e-12].astype(complex)) / dt
    corners = np.abs(roots)
    corners = corners[np.isfinite(corners) & (corners > 1e-6) & (corners < 1e6)]
    low, high = (corners.min(), corners.max()) if len(corners) else (1.0, 1.0)
    top = min(high * BEYOND, math.pi / dt if dt else math.inf, up_to)
    own = corners[corners < top]
    return np.unique(np.concatenate([np.geomspace(min(low / BEYOND, top / 10), top, POINTS), own]))


def response_of(system: control.StateSpace, omega: Array) -> NDArray[np.complex128]:
    """Return the response at frequencies [rad/s], shape (n,)."""
    points = np.exp(1j * omega * float(system.dt)) if system.isdtime(strict=True) else 1j * omega
    return np.asarray(system(points), dtype=complex).ravel()
