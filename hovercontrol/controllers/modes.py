"""Uncontrollable modes, and modes that the weights do not observe: the Popov-Belevitch-Hautus test."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hovercontrol.errors import InputError

Array = NDArray[np.float64]

#: Smallest singular value of ``[A - s I, B]``, relative to the largest, that counts as full rank.
RANK = 1e-9

#: A mode decays if its pole lies left of this [1/s].
DECAYS = -1e-7


def refuse_unmovable(
    where: str, A: Array, B: Array, names: Sequence[str], inputs: Sequence[str], *, every: bool
) -> None:
    """Raise if a system has an uncontrollable mode.

    Parameters
    ----------
    where : str
        Of the error.
    A, B : ndarray, shapes (n, n) and (n, m)
        Of a continuous system.
    names, inputs : sequence of str
        Of the states and inputs.
    every : bool
        Whether all modes must be movable (pole placement), or only those that do not decay.

    Raises
    ------
    InputError
        Naming the mode's pole and its state combination.

    Examples
    --------
    >>> A, B = np.diag([0.0, -1.0]), np.array([[0.0], [1.0]])
    >>> try:
    ...     refuse_unmovable("lqr", A, B, ["y", "v"], ["rudder"], every=False)
    ... except InputError as error:
    ...     print(str(error).partition(";")[0])
    lqr: rudder cannot move the mode at 0 1/s, the state combination y
    """
    found = hidden_mode(A, B, every=every)
    if found is not None:
        pole, left = found
        raise InputError(
            f"{where}: {' and '.join(inputs)} cannot move the mode at {_pole(pole)} 1/s, "
            f"the state combination {combination(left, names)}; "
            "leave it out (states=...) or choose another operating point"
        )


def refuse_unweighted(where: str, A: Array, Q: Array, names: Sequence[str]) -> None:
    """Raise if the weights do not observe a mode on the imaginary axis: no optimal control stabilises it.

    Parameters
    ----------
    where : str
        Of the error.
    A, Q : ndarray, shape (n, n)
        Of a continuous system, and the states' weights.
    names : sequence of str
        Of the states.

    Raises
    ------
    InputError
        Naming the mode's pole and its states.
    """
    found = hidden_mode(A.T, Q.T, every=False, on_axis=True)
    if found is not None:
        pole, right = found
        raise InputError(
            f"{where}: Q does not weight the mode at {_pole(pole)} 1/s, "
            f"which moves {combination(right, names)}; "
            "give one of these a weight or leave it out (states=...)"
        )


def hidden_mode(
    A: Array, B: Array, *, every: bool, on_axis: bool = False
) -> tuple[complex, NDArray[np.complex128]] | None:
    """Return the pole and the left eigenvector of a mode that B does not enter, None if there is none.

    ``w' A = s w'`` and ``w' B = 0``, where ``[A - s I, B]`` loses rank.

    Parameters
    ----------
    A, B : ndarray, shapes (n, n) and (n, m)
    every : bool
        Whether modes that decay count.
    on_axis : bool, optional
        Whether modes that grow do not count.
    """
    for pole in sorted(np.linalg.eigvals(A), key=lambda s: -s.real):
        if (pole.real < DECAYS and not every) or (pole.real > -DECAYS and on_axis):
            continue
        test = np.hstack([A - pole * np.eye(len(A)), B])
        U, sizes, _ = np.linalg.svd(test)
        if sizes[-1] <= RANK * max(sizes[0], 1.0):
            return complex(pole), U[:, -1].conj()
    return None


def combination(vector: NDArray[np.complex128], names: Sequence[str]) -> str:
    """Return a vector as a combination of states; for a complex vector only the names of the states.

    Examples
    --------
    >>> combination(np.array([0.5, 0.0, -1.0]), ["y", "psi", "r"])
    'r - 0.5 y'
    """
    largest = int(np.argmax(np.abs(vector)))
    scaled = vector / vector[largest]
    present = np.flatnonzero(np.abs(scaled) > 1e-6).tolist()
    order = sorted(present, key=lambda k: (k != largest, k))
    if np.abs(scaled.imag).max() > 1e-6:
        return " and ".join(names[k] for k in order)
    text = names[largest]
    for k in order[1:]:
        size = f"{abs(scaled[k].real):.3g}"
        text += f" {'-' if scaled[k].real < 0 else '+'} {'' if size == '1' else size + ' '}{names[k]}"
    return text


def _pole(pole: complex) -> str:
    if abs(pole) < -DECAYS:
        return "0"
    return f"{pole.real:.3g}" if abs(pole.imag) < -DECAYS else f"{pole.real:.3g} +- {abs(pole.imag):.3g}i"
