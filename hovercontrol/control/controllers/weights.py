"""Weights of a quadratic cost: by name, as a diagonal or as a matrix; and Bryson's rule."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.base.tables import finite, positive

#: Weights by name, one for all, a diagonal or a matrix.
Weights = Mapping[str, float] | ArrayLike


def chosen_weights(
    where: str, given: Weights | None, largest: Mapping[str, float] | None, names: tuple[str, str]
) -> Weights:
    """Return weights, given themselves or by Bryson's rule: 1 over the square of the largest deviation.

    Parameters
    ----------
    where : str
        Of errors.
    largest : mapping or None
        The largest acceptable deviation of each signal, in its unit.
    names : tuple of str
        The two arguments' names.

    Raises
    ------
    InputError
        If both are given, or neither.

    Examples
    --------
    >>> chosen_weights("lqr", None, {"v": 0.5}, ("Q", "max_states"))
    {'v': 4.0}
    """
    if (given is None) == (largest is None):
        found = "neither" if given is None else "both"
        raise InputError(f"{where}: expected either {names[0]} or {names[1]}, found {found}")
    if largest is None:
        assert given is not None
        return given
    return {key: positive(f"{where}: {names[1]}[{key!r}]", v) ** -2 for key, v in largest.items()}


def weight_matrix(where: str, given: Weights, names: Sequence[str], *, definite: bool) -> Array:
    """Return weights as a symmetric matrix, in the order of `names`.

    Parameters
    ----------
    where : str
        Of errors: function and argument.
    given : mapping or array_like, scalar, shape (n,) or (n, n)
    names : sequence of str
        A name without a weight has the weight 0.
    definite : bool
        Whether the matrix must be positive definite, not only semidefinite.

    Raises
    ------
    InputError
        If a name is unknown, a shape is wrong, or the matrix is not symmetric and positive (semi)definite.

    Examples
    --------
    >>> weight_matrix("lqr: Q", {"r": 2.0}, ["v", "r"], definite=False)
    array([[0., 0.],
           [0., 2.]])
    """
    n = len(names)
    if isinstance(given, Mapping):
        for key in given:
            check_known(key, names, f"{where}: no weight {key!r} is needed")
        matrix = np.diag([finite(f"{where}[{key!r}]", given.get(key, 0.0)) for key in names])
    else:
        matrix = np.asarray(given, dtype=float)
        if matrix.ndim < 2:
            matrix = np.diag(np.broadcast_to(matrix, n) if matrix.size in (1, n) else np.ravel(matrix))
    if matrix.shape != (n, n):
        raise InputError(
            f"{where}: expected weights of {', '.join(names)}: a number, {n} numbers or a matrix of shape "
            f"({n}, {n}), found shape {matrix.shape}"
        )
    if not np.isfinite(matrix).all() or np.abs(matrix - matrix.T).max() > 1e-9 * np.abs(matrix).max():
        raise InputError(f"{where}: expected a symmetric matrix of finite numbers")
    least = float(np.linalg.eigvalsh(matrix).min())
    if least < -1e-12 * np.abs(matrix).max() or (definite and least <= 0.0):
        kind = "positive definite" if definite else "positive semidefinite"
        raise InputError(f"{where}: expected a {kind} matrix, found an eigenvalue of {least:.3g}")
    return matrix
