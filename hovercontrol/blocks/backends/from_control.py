"""A linear system of python-control as a Block whose matrix entries are parameters.

    x' = A x + B u,    y = C x + D u        (of a discrete-time system the next value of x in place of x')

The entries of A, B, C and D are the parameters ``A[i,j]``..., except those that are exactly 0 or 1: these are
the structure of a companion form or of a chain of integrators. A transfer function takes the controllable
companion form of each input (Kailath, Linear Systems, 1980, section 2.1): with
``(b_1 s^(n-1) + ... + b_n)/(s^n + a_1 s^(n-1) + ... + a_n) + d``

    A = [-a_1 ... -a_n; I 0],    B = [1; 0],    C = [b_1 ... b_n],    D = d.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import control
import numpy as np
import scipy.linalg
import sympy as sp
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.units import Dimension, dimension, unit_text

Matrices = list[Array]
Ones = list[NDArray[np.bool_]]


@checked
def from_control(system: Any, name: str | None = None, *, units: Mapping[str, str] | None = None) -> Block:
    """Return a linear system of python-control as a Block whose matrix entries are parameters.

    Parameters
    ----------
    system : control.StateSpace or control.TransferFunction
        Continuous (dt = 0 or None), or discrete with a known step, which becomes the Block's period. One or
        more inputs and outputs.
    name : str, optional
        Of the Block (default: the system's, or ``system`` where python-control has numbered it).
    units : mapping of str to str, optional
        SI units of states, inputs and outputs by name (default: all are dimensionless). Those of the
        parameters follow.

    Returns
    -------
    Block
        Signals by the system's labels; a state whose label is that of an input or of another output is
        ``x_LABEL``. Parameters ``A[0,1]``..., except entries that are exactly 0 or 1.

    Raises
    ------
    InputError
        If the system is of another kind, improper, of unknown step or not finite, or a label is no name.

    Examples
    --------
    >>> motor = from_control(control.tf([5.0], [1.0, 2.0, 0.0], name="motor"))
    >>> print(motor.equations())
    x[0]' = A[0,0]*x[0] + u[0]
    x[1]' = x[0]
    y[0] = C[0,1]*x[1]
    >>> motor.default_parameters
    {'motor.A[0,0]': -2.0, 'motor.C[0,1]': 5.0}
    """
    if not isinstance(system, control.StateSpace | control.TransferFunction):
        hint = (
            "; linearise it about a point first: control.linearize(system, x, u)"
            if isinstance(system, control.NonlinearIOSystem)
            else ""
        )
        raise InputError(
            f"from_control: expected a StateSpace or TransferFunction, found {type(system).__name__}{hint}"
        )
    if system.dt is True:
        raise InputError("from_control: the step of the system is unknown (dt = True): give it dt in seconds")
    linear = isinstance(system, control.StateSpace)
    matrices, ones = _of_state_space(system) if linear else _of_transfer_function(system)
    if not all(np.isfinite(matrix).all() for matrix in matrices):
        raise InputError("from_control: expected finite coefficients")
    return _block(system, matrices, ones, name or _name(system.name), float(system.dt or 0.0), units or {})


def _name(given: str) -> str:
    plain = re.sub(r"\W+", "_", given).strip("_")
    return "system" if re.fullmatch(r"sys_\d+|\d.*|", plain) else plain


def _of_state_space(system: control.StateSpace) -> tuple[Matrices, Ones]:
    """Return A, B, C, D, and which of their entries are 1."""
    matrices = [np.array(matrix, dtype=float) for matrix in (system.A, system.B, system.C, system.D)]
    return matrices, [matrix == 1.0 for matrix in matrices]


def _of_transfer_function(system: control.TransferFunction) -> tuple[Matrices, Ones]:
    """Return the companion forms of the inputs, one after the other; equal denominators share one.

    The entries that are 1 are those of the form: a coefficient that happens to be 1 is none of them.
    """
    parts: list[tuple[int, Array, Array]] = []  # input, A and C of a companion form
    D = np.zeros((system.noutputs, system.ninputs))
    for j in range(system.ninputs):
        shared: dict[tuple[float, ...], Array] = {}
        for i in range(system.noutputs):
            lists = (system.num_list[i][j], system.den_list[i][j])
            num, den = (np.trim_zeros(np.atleast_1d(c).astype(float), "f") for c in lists)
            if len(num) > len(den):
                raise InputError(
                    f"from_control: the transfer function from {system.input_labels[j]!r} to "
                    f"{system.output_labels[i]!r} is improper: its numerator has degree {len(num) - 1}, its "
                    f"denominator {len(den) - 1}"
                )
            num, den = np.r_[np.zeros(len(den) - len(num)), num] / den[0], den / den[0]
            D[i, j] = num[0]
            if len(den) > 1 and num.any():
                rows = shared.setdefault(tuple(den), np.zeros((system.noutputs, len(den) - 1)))
                rows[i] = num[1:] - num[0] * den[1:]
        for a, rows in shared.items():
            parts.append((j, np.vstack([-np.array(a[1:]), np.eye(len(a) - 2, len(a) - 1)]), rows))
    A = scipy.linalg.block_diag(*(A for _, A, _ in parts)) if parts else np.zeros((0, 0))
    B = np.zeros((len(A), system.ninputs))
    B[np.cumsum([0, *(len(A) for _, A, _ in parts)])[:-1], [j for j, *_ in parts]] = 1.0
    C = np.hstack([np.zeros((system.noutputs, 0)), *(rows for *_, rows in parts)])
    below = np.eye(len(A), k=-1, dtype=bool) & (A == 1.0)
    return [A, B, C, D], [below, B == 1.0, np.zeros(C.shape, dtype=bool), np.zeros(D.shape, dtype=bool)]


def _block(
    system: Any, matrices: Matrices, ones: Ones, name: str, period: float, units: Mapping[str, str]
) -> Block:
    _, _, C, D = matrices
    labels = getattr(system, "state_labels", None) or [f"x[{k}]" for k in range(len(matrices[0]))]
    u, y = system.input_labels, system.output_labels
    shown = {y[i]: _state_shown(C[i], ones[2][i], D[i], labels) for i in range(len(y))}
    x = [f"x_{one}" if one in u or shown.get(one, one) != one else one for one in labels]
    known = [*x, *u, *y]
    for key in units:
        check_known(key, known, f"from_control: units: no signal {key!r}")
    of_inputs, of_outputs = ([dimension(units.get(one, "1")) for one in group] for group in (u, y))
    given = {k: dimension(units[one]) for k, one in enumerate(x) if one in units}
    given |= {x.index(one): size for one, size in zip(y, of_outputs, strict=True) if one in x}
    second = dimension("1" if period else "s")
    of_states = _state_sizes(ones, second, given, of_inputs, of_outputs)
    rates = [_per(size, second) for size in of_states]
    # W rather than kg*m^2/s^3, but no rad: a state is an angle only if it is said so
    texts = {dimension(text): text for text in units.values()} | {dimension("1"): "1"}
    states, inputs, outputs = (
        [
            Signal(one, units.get(one) or texts.get(size) or unit_text(size))
            for one, size in zip(group, sizes, strict=True)
        ]
        for group, sizes in ((x, of_states), (u, of_inputs), (y, of_outputs))
    )
    entries = _Entries(matrices, ones, [])
    return Block(
        name,
        states=tuple(states),
        inputs=tuple(inputs),
        outputs=tuple(outputs),
        derivatives=entries.sums(states, rates, (0, states), (1, inputs)),
        output_expressions=entries.sums(outputs, of_outputs, (2, states), (3, inputs)),
        parameters=tuple(entries.parameters),
        period=period,
    )


@dataclass(frozen=True)
class _Entries:
    """The matrices' entries as parameters; an entry of exactly 1 without a unit is none."""

    matrices: Matrices
    ones: Ones
    parameters: list[Signal]

    def sums(
        self, rows: Sequence[Signal], sizes: Sequence[Dimension], *parts: tuple[int, Sequence[Signal]]
    ) -> dict[str, sp.Expr]:
        """Return each row's sum of entries times signals."""
        totals = dict.fromkeys((s.name for s in rows), sp.S.Zero)
        for part, by in parts:
            for i, j in np.argwhere(self.matrices[part]).tolist():
                unit = unit_text(_per(sizes[i], by[j].dimension))
                factor = self._entry(part, i, j, unit, f"{rows[i].name} by {by[j].name}")
                totals[rows[i].name] += factor * by[j].symbol
        return totals

    def _entry(self, part: int, i: int, j: int, unit: str, place: str) -> sp.Expr:
        if unit == "1" and self.ones[part][i, j]:
            return sp.S.One
        letter, value = "ABCD"[part], float(self.matrices[part][i, j])
        entry = Signal(f"{letter}[{i},{j}]", unit, f"{letter} of {place}", start=value, nominal=abs(value))
        self.parameters.append(entry)
        return entry.symbol


def _state_shown(row: Array, ones: NDArray[np.bool_], direct: Array, states: Sequence[str]) -> str:
    """Return the state that an output is, an empty text if it is none."""
    shown = np.flatnonzero(row)
    return states[shown[0]] if len(shown) == 1 and ones[shown[0]] and not direct.any() else ""


def _per(above: Dimension, below: Dimension) -> Dimension:
    return tuple(a - b for a, b in zip(above, below, strict=True))


def _state_sizes(
    ones: Ones,
    second: Dimension,
    given: Mapping[int, Dimension],
    of_inputs: Sequence[Dimension],
    of_outputs: Sequence[Dimension],
) -> list[Dimension]:
    """Return the dimensions of the states with which most entries that are 1 need no unit.

    ``A[i,j] = 1`` says that x_j has the dimension of x_i per second, ``B[i,j] = 1`` the same of u_j, and
    ``C[i,j] = 1`` that x_j has that of y_i. Where these contradict each other the earlier one holds.
    """
    A, B, C, _ = ones
    times = tuple(-a for a in second)
    known = dict(given)
    told = [(i, _per(of_inputs[j], times)) for i, j in np.argwhere(B).tolist()]
    told += [(j, of_outputs[i]) for i, j in np.argwhere(C).tolist()]
    told += [(k, dimension("1")) for k in range(len(A))]
    for k, size in (*given.items(), *told):
        known.setdefault(k, size)
        spread = [k]
        while spread:
            at = spread.pop()
            for j in np.flatnonzero(A[at]).tolist():
                if j not in known:
                    known[j] = _per(known[at], second)
                    spread.append(j)
            for i in np.flatnonzero(A[:, at]).tolist():
                if i not in known:
                    known[i] = _per(known[at], times)
                    spread.append(i)
    return [known[k] for k in range(len(A))]
