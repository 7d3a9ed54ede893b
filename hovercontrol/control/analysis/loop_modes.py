"""The modes of a linear system beside a loop: its input does not move them, or its output does not see them.

Feedback changes none of them, so they count in no margin. Most often they integrate, as a craft's position
does where only its heading is fed back.

They are split off in two steps (Kailath, Linear Systems, 1980, section 2.4). The zeros of the matrices say
which states no path leads to from the input, or from which none leads to the output; that is exact. Of the
rest the modes of the closed loop that do not decay are separated, and a staircase says which of these few
are not moved or not seen.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import control
import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from hovercontrol.base.arrays import Array, Mask
from hovercontrol.base.boundary import checked

System = tuple[Array, Array, Array]

#: A rate below this part of the norm of the balanced A is 0: two integrators in a row, in other states, have
#: eigenvalues as far from 0 as the root of a rounding error, 1.5e-8, times the condition of these states.
STILL = 1e-6
#: A part of B or C below this part of its norm is 0, and so is what it couples.
COUPLED = 1e-8
#: An entry of a sampled A below this part of the largest is the rounding of a matrix exponential.
ROUNDING = 1e-13
#: A state is named if it takes part in the modes with this part of the largest participation.
NAMED = 0.1
#: States that a line names.
SHOWN = 8


@checked
@dataclass(frozen=True)
class OutsideModes:
    """The modes outside a loop that do not decay.

    Attributes
    ----------
    poles : tuple of complex
        [rad/s]
    states : tuple of str
        The states that take part in them.
    grow : bool
        Whether one of them grows: the system is unstable whatever the loop does.

    Examples
    --------
    >>> print(OutsideModes((0j, 0j), ("plant.x", "plant.y")))
    outside the loop, not decaying: plant.x, plant.y; poles [rad/s] 0 (2 times)
    """

    poles: tuple[complex, ...] = ()
    states: tuple[str, ...] = ()
    grow: bool = False

    def __str__(self) -> str:
        if not self.poles:
            return "outside the loop every mode decays"
        counts = Counter(f"{p.real:.3g}{f'{p.imag:+.3g}j' if p.imag else ''}" for p in self.poles)
        poles = ", ".join(pole if many == 1 else f"{pole} ({many} times)" for pole, many in counts.items())
        more = f" and {len(self.states) - SHOWN} more" if len(self.states) > SHOWN else ""
        what = "growing" if self.grow else "not decaying"
        return f"outside the loop, {what}: {', '.join(self.states[:SHOWN])}{more}; poles [rad/s] {poles}"


def split_loop(line: control.StateSpace) -> tuple[control.StateSpace, OutsideModes]:
    """Return a loop without the modes beside it that do not decay, and those modes.

    Parameters
    ----------
    line : control.StateSpace
        Continuous, one input and output, to be closed by negative feedback.

    Examples
    --------
    >>> import control
    >>> loop, outside = split_loop(control.ss([[0, 1], [0, -1]], [[0], [1]], [[0, 2]], 0, states=["x", "v"]))
    >>> loop.nstates, str(outside)
    (1, 'outside the loop, not decaying: x; poles [rad/s] 0')
    """
    A, B, C = _balanced(line.A, line.B, line.C)
    moved, seen = _closure(B[:, 0] != 0, A != 0), _closure(C[0] != 0, A.T != 0)
    names, still = np.array(line.state_labels), STILL * float(np.linalg.norm(A))
    poles, states = _lasting(A, ~(moved & seen), names)
    inside = moved & seen
    (A, B, C), names = (A[np.ix_(inside, inside)], B[inside], C[:, inside]), names[inside]
    modes = _Modes(A - B @ C / (1 + line.D), still)
    loop, hidden = modes.without_hidden(B, C, line.D)
    if hidden:
        poles += hidden
        states += modes.names(names)
        A, B, C = loop
    grow = any(pole.real > 0 for pole in poles)
    return control.ss(A, B, C, line.D), OutsideModes(tuple(poles), tuple(states), grow)


def split_sampled(line: control.StateSpace) -> tuple[control.StateSpace, OutsideModes]:
    """Return a sampled loop without the states beside it, and the modes of these that do not decay.

    A state is beside the loop if no path leads to it from the input or none from it to the output. Poles are
    told as those of the continuous system, log(z)/h.

    Parameters
    ----------
    line : control.StateSpace
        In discrete time of a known step h, one input and output.

    Examples
    --------
    >>> import control
    >>> line = control.ss([[1, 0.1], [0, 0.9]], [[0], [1]], [[0, 2]], 0, 0.1, states=["x", "v"])
    >>> loop, outside = split_sampled(line)
    >>> loop.nstates, str(outside)
    (1, 'outside the loop, not decaying: x; poles [rad/s] 0')
    """
    A, B, C = _balanced(line.A, line.B, line.C)
    leads = np.abs(A) > ROUNDING * float(np.abs(A).max(initial=0.0))
    inside = _closure(B[:, 0] != 0, leads) & _closure(C[0] != 0, leads.T)
    names, poles, states = np.array(line.state_labels), [], []
    _, groups = connected_components(leads, connection="strong")
    for group in np.unique(groups[~inside]):
        own = np.flatnonzero(groups == group)
        lasting = [z for z in np.linalg.eigvals(A[np.ix_(own, own)]) if abs(z) > 1 - STILL]
        poles += [0j if abs(z - 1) < STILL else complex(np.log(complex(z)) / line.dt) for z in lasting]
        states += [str(name) for name in names[own]] if lasting else []
    grow = any(pole.real * line.dt > STILL for pole in poles)
    loop = control.ss(A[np.ix_(inside, inside)], B[inside], C[:, inside], line.D, line.dt)
    return loop, OutsideModes(tuple(poles), tuple(states), grow)


def _lasting(A: Array, outside: Mask, names: NDArray[np.str_]) -> tuple[list[complex], list[str]]:
    """Return the poles of states outside a loop that do not decay, and the names of these states.

    States that no path leads back to have eigenvalues of their own, exact also in a chain of integrators.
    """
    poles, states = [], []
    _, groups = connected_components(A != 0, connection="strong")
    for group in np.unique(groups[outside]):
        own = np.flatnonzero(groups == group)
        block = A[np.ix_(own, own)]
        modes = _Modes(block, STILL * float(np.linalg.norm(block)))
        poles += _eigenvalues(modes.matrix, modes.still)
        states += modes.names(names[own])
    return poles, states


class _Modes:
    """The modes of a matrix that do not decay: ``A V = V F``, ``W' A = F' W'``, V and W orthonormal."""

    def __init__(self, A: Array, still: float) -> None:
        self.A, self.still = A, still
        self.matrix, self.V = self._invariant(A)
        self.W = self._invariant(A.T)[1]

    def _invariant(self, A: Array) -> tuple[Array, Array]:
        if not len(A):
            return A, A
        shift = max(self.still, np.finfo(float).tiny) * np.eye(len(A))
        F, Z, m = scipy.linalg.schur(A + shift, sort="rhp")
        return F[:m, :m] - shift[:m, :m], Z[:, :m]

    def names(self, states: NDArray[np.str_]) -> list[str]:
        """Return the states that take part."""
        part = np.linalg.norm(self.V, axis=1) * np.linalg.norm(self.W, axis=1)
        return [str(name) for name in states[(part > 0) & (part >= NAMED * part.max(initial=0.0))]]

    def without_hidden(
        self, B: Array, C: Array, D: Array
    ) -> tuple[tuple[Array, Array, Array], list[complex]]:
        """Return A, B, C of the open loop less the modes that are not moved or not seen, and these modes."""
        if not len(self.matrix):
            return (self.A, B, C), []
        # b = (W' V)^-1 W' B, c = C V
        across = np.linalg.inv(self.W.T @ self.V)
        b, c = across @ self.W.T @ B, C @ self.V
        least = COUPLED * float(np.linalg.norm(B) * np.linalg.norm(across, 2))
        F, b, c, unmoved = _moved_part(self.matrix, b, c, least, self.still)
        least = COUPLED * float(np.linalg.norm(C))
        F, c, b, unseen = _moved_part(F.T, c.T, b.T, least, self.still)
        rest = scipy.linalg.null_space(self.W.T)  # spans the other modes
        back = np.linalg.inv(np.hstack([self.V, rest]))[len(self.matrix) :]
        A = scipy.linalg.block_diag(back @ self.A @ rest, F.T)
        B, C = np.vstack([back @ B, b.T]), np.hstack([C @ rest, c.T])
        return (A + B @ C / (1 + D), B, C), unmoved + unseen


def _moved_part(
    F: Array, b: Array, c: Array, least: float, still: float
) -> tuple[Array, Array, Array, list[complex]]:
    """Return the part of (F, b, c) that its input moves, and the poles of the rest.

    ``Q' [b F] Q`` is a staircase, an upper Hessenberg matrix: where a step is 0, no input comes further.
    """
    n = len(F)
    H, Q = scipy.linalg.hessenberg(np.block([[np.zeros((1, n + 1))], [b, F]]), calc_q=True)
    steps = np.abs(np.diag(H, -1))
    ends = np.flatnonzero(steps <= np.where(np.arange(n) == 0, least, still))
    k = int(ends[0]) if ends.size else n
    outside = _eigenvalues(H[k + 1 :, k + 1 :], still)
    return H[1 : k + 1, 1 : k + 1], H[1 : k + 1, :1], (c @ Q[1:, 1:])[:, :k], outside


def _closure(start: Mask, leads: Mask) -> Mask:
    """Return the states that paths lead to: ``leads[i, j]`` from j to i."""
    found = start
    for _ in range(len(start)):
        found = found | (leads & found).any(axis=1)
    return found


def _balanced(A: Array, B: Array, C: Array) -> System:
    """Return the system in states whose rows and columns have sizes alike."""
    M = np.block([[A, B], [C, np.zeros((1, 1))]])
    s = scipy.linalg.matrix_balance(M, permute=False, separate=True)[1][0]
    M = M * s / s[:, None]
    n = len(A)
    return M[:n, :n], M[:n, n:], M[n:, :n]


def _eigenvalues(F: Array, still: float) -> list[complex]:
    """Return eigenvalues with what is below `still` set to 0."""
    values = np.linalg.eigvals(F) if len(F) else np.zeros(0)
    parts = [np.where(np.abs(part) <= still, 0.0, part) for part in (values.real, values.imag)]
    return [complex(*pair) for pair in zip(*parts, strict=True)]
