"""The states of a design, and the elimination of states that equal no output, such as lags."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.linear_systems import growth

#: Smallest entry of A, relative to the largest, that counts as a dependence: trims are solved to about 1e-9.
DEPENDS = 1e-12


def closure(A: Array, kept: Collection[int], through: Collection[int] | None = None) -> list[int]:
    """Return some states and all on which their derivatives depend, in order.

    Parameters
    ----------
    A : ndarray, shape (n, n)
    kept : collection of int
        Indices of states.
    through : collection of int, optional
        States that may be added (default: all).

    Examples
    --------
    >>> closure(np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 1.0, 0.0]]), [0])
    [0, 1]
    """
    depends = np.abs(A) > DEPENDS * max(float(np.abs(A).max()), 1.0)
    found = set(kept)
    while True:
        reached = {j for k in found for j in np.flatnonzero(depends[k]).tolist()}
        more = found | (reached if through is None else reached & set(through))
        if more == found:
            return sorted(found)
        found = more


def eliminated(
    where: str,
    A: Array,
    B: Array,
    kept: Sequence[int],
    hidden: Collection[int],
    names: Sequence[str],
    *,
    sampled: bool = False,
) -> tuple[Array, Array]:
    """Return A and B of the kept states with hidden states taken as infinitely fast.

    A hidden state z equals no output. With ``z' = A_zx x + A_zz z + B_z u = 0``::

        A = A_xx - A_xz A_zz^-1 A_zx        B = B_x - A_xz A_zz^-1 B_z

    Of a sampled plant ``x+ = A x + B u`` the same holds of the change per step, with A - I in place of A.

    Parameters
    ----------
    where : str
        Of errors.
    A, B : ndarray, shapes (n, n) and (n, m)
    kept, hidden : collection of int
        Indices of states. Others are held at the operating point.
    names : sequence of str
        Of all states.
    sampled : bool, optional
        Whether A and B are of the next values.

    Raises
    ------
    InputError
        If a hidden state does not decay by itself.

    Examples
    --------
    >>> A, B = np.array([[0.0, 2.0], [0.0, -10.0]]), np.array([[0.0], [10.0]])
    >>> eliminated("lqr", A, B, [0], [1], ["r", "lag"])
    (array([[0.]]), array([[2.]]))
    """
    z = [k for k in closure(A, kept, hidden) if k in hidden and k not in kept]
    if not z:
        return A[np.ix_(kept, kept)], B[kept]
    if growth(np.linalg.eigvals(A[np.ix_(z, z)]), sampled).max() > -1e-6:
        raise InputError(
            f"{where}: no output shows {' and '.join(names[k] for k in z)}, which does not decay by itself; "
            "estimate it (measured='{}_hat')"
        )
    one = np.eye(len(kept)) if sampled else 0.0
    A = A - np.eye(len(A)) if sampled else A
    A_xx, A_xz, A_zz = A[np.ix_(kept, kept)], A[np.ix_(kept, z)], A[np.ix_(z, z)]
    follow = np.linalg.solve(A_zz, np.hstack([A[np.ix_(z, kept)], B[z]]))
    n = len(kept)
    return one + A_xx - A_xz @ follow[:, :n], B[kept] - A_xz @ follow[:, n:]
