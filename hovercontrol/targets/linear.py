"""Linear systems as python-control holds them, and the points about which it linearises."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import control
import numpy as np
from numpy.typing import NDArray

from hovercontrol.errors import InputError

Array = NDArray[np.float64]


def state_space(matrices: Sequence[Array], dt: float | None, **kwargs: Any) -> control.StateSpace:
    """Return the system ``A, B, C, D`` with all its states, also where it has no inputs.

    ``control.StateSpace`` takes a matrix of shape (1, 0) for one of shape (0, 0) (python-control #1176), so
    a system without inputs is made with one, which is then taken away.

    Parameters
    ----------
    matrices : sequence of four ndarray
    dt : float or None
        As for :class:`control.StateSpace`.
    **kwargs
        Names, as there.

    Examples
    --------
    >>> import numpy as np
    >>> decay = state_space([-np.eye(1), np.zeros((1, 0)), np.eye(1), np.zeros((1, 0))], 0, outputs=["v"])
    >>> decay.B.shape, decay.D.shape, decay.output_labels
    ((1, 0), (1, 0), ['v'])
    """
    A, B, C, D = matrices
    if B.shape[1]:
        return control.StateSpace(A, B, C, D, dt, remove_useless_states=False, **kwargs)
    without = kwargs.pop("inputs", [])
    with_one = (A, np.zeros((len(B), 1)), C, np.zeros((len(D), 1)))
    system = control.StateSpace(*with_one, dt, remove_useless_states=False, **kwargs)
    system.B, system.D = B, D
    system.set_inputs(without)
    return system


def point_values(given: Any, n: int, kind: str, name: str) -> Array:
    """Return the n values of a point as python-control reads them.

    Parameters
    ----------
    given : array_like or sequence of array_like or None
        None is 0, a scalar is every value, parts of a sequence are joined.
    n : int
    kind, name : str
        What the values are, and of which block: for errors.

    Raises
    ------
    InputError
        If the number of values is another, or one is not a finite number.

    Examples
    --------
    >>> point_values([1.0, [2.0, 3.0]], 3, "state", "cart")
    array([1., 2., 3.])
    >>> point_values(None, 2, "input", "cart")
    array([0., 0.])
    """
    try:
        if isinstance(given, list | tuple):
            parts = [np.ravel(np.asarray(part, dtype=float)) for part in given]
            point = np.concatenate([np.zeros(0), *parts])
        elif np.ndim(given) == 0:
            point = np.full(n, 0.0 if given is None else given, dtype=float)
        else:
            point = np.asarray(given, dtype=float).ravel()
    except (TypeError, ValueError):
        raise InputError(f"block {name!r}: expected {n} {kind} values, found {given!r}") from None
    if point.size != n:
        raise InputError(f"block {name!r}: expected {n} {kind} values, found {point.size}")
    if not np.isfinite(point).all():
        k = int(np.argmin(np.isfinite(point)))
        raise InputError(f"block {name!r}: {kind} value {k} must be finite, found {point[k]}")
    return point
