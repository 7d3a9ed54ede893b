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


def response_of(system: control.StateSpace, omega: Array) -> NDArray[np.complex128]:
    """Return the response at frequencies [rad/s], shape (n,)."""
    points = np.exp(1j * omega * float(system.dt)) if system.isdtime(strict=True) else 1j * omega
    return np.asarray(system(points), dtype=complex).ravel()
