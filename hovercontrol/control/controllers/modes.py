"""Uncontrollable modes, and modes that the weights do not observe: the Popov-Belevitch-Hautus test."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.base.caller import caller_level
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.linear_systems import growth

#: Smallest singular value of ``[A - s I, B]``, relative to the size of ``[A, B]``, that counts as full rank.
RANK = 1e-9

#: A mode decays if it grows by less than this [1/s; of a sampled plant per step].
DECAYS = -1e-7


def refuse_unmovable(
    where: str,
    A: Array,
    B: Array,
    names: Sequence[str],
    inputs: Sequence[str],
    *,
    every: bool,
    sampled: bool = False,
    frictions: Sequence[str] = (),
) -> None:
    """Raise if a system has an uncontrollable mode.

    Parameters
    ----------
    where : str
        Of the error.
    A, B : ndarray, shapes (n, n) and (n, m)
        Of the derivatives, or of the next values of a sampled plant.
    names, inputs : sequence of str
        Of the states and inputs.
    every : bool
        Whether all modes must be movable (pole placement), or only those that do not decay.
    sampled : bool, optional
        Whether the plant is sampled.
    frictions : sequence of str, optional
        States at rest whose dry friction the linear model leaves out.

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
    found = hidden_mode(A, B, every=every, sampled=sampled)
    if found is not None:
        pole, left = found
        moved = [name for name in frictions if abs(left[names.index(name)]) > 1e-6 * np.abs(left).max()]
        of = f", or have the dry friction of {' and '.join(moved)} in the linear model (friction='smooth')"
        raise InputError(
            f"{where}: {' and '.join(inputs)} cannot move the mode at {_pole(pole, sampled)}, "
            f"the state combination {combination(left, names)}; "
            f"leave it out (states=...) or choose another operating point{of if moved else ''}"
        )


def refuse_unweighted(where: str, A: Array, Q: Array, names: Sequence[str], *, sampled: bool = False) -> None:
    """Raise if the weights do not observe a mode that neither grows nor decays.

    No optimal control stabilises such a mode, on the imaginary axis or, sampled, on the unit circle.


    Parameters
    ----------
    where : str
        Of the error.
    A, Q : ndarray, shape (n, n)
        Of the derivatives, or of the next values of a sampled plant, and the states' weights.
    names : sequence of str
        Of the states.
    sampled : bool, optional
        Whether the plant is sampled.

    Raises
    ------
    InputError
        Naming the mode's pole and its states.
    """
    found = hidden_mode(A.T, Q.T, every=False, on_axis=True, sampled=sampled)
    if found is not None:
        pole, right = found
        raise InputError(
            f"{where}: Q does not weight the mode at {_pole(pole, sampled)}, "
            f"which moves {combination(right, names)}; "
            "give one of these a weight or leave it out (states=...)"
        )


def warn_of_unmoved(
    where: str, A: Array, B: Array, Q: Array, names: Sequence[str], inputs: Sequence[str]
) -> None:
    """Warn of each input that moves no weighted state, if another input does not move them all.

    Its optimal gain is 0. An input moves the states in its column of ``B, A B, A^2 B, ...``.

    Parameters
    ----------
    where : str
        Of the warning.
    A, B, Q : ndarray, shapes (n, n), (n, m) and (n, n)
        Of the derivatives, or of the next values of a sampled plant, and the states' weights.
    names, inputs : sequence of str
        Of the states and inputs.
    """
    least = RANK * np.linalg.norm(np.hstack([A, B]), 2)
    moves, weighted = np.abs(B) > least, np.diag(Q) > 0.0
    for _ in names:
        moves |= (np.abs(A) > least) @ moves
    unmoved = " and ".join(np.array(names)[weighted & ~moves.any(axis=1)])
    for name in np.array(inputs)[~moves[weighted].any(axis=0)] if unmoved else ():
        warnings.warn(
            f"{where}: at this point {name} cannot move {unmoved}: the gain is 0; "
            "choose another operating point",
            stacklevel=caller_level(),
        )


def hidden_mode(
    A: Array, B: Array, *, every: bool, on_axis: bool = False, sampled: bool = False
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
    sampled : bool, optional
        Whether A and B are of the next values.
    """
    poles, one = np.linalg.eigvals(A), np.eye(len(A))
    speeds = growth(poles, sampled)
    # of a map the change per step, A - I, has the size that A has in continuous time
    size = np.linalg.norm(np.hstack([A - one if sampled else A, B]), 2)
    for k in np.argsort(-speeds, kind="stable"):
        if (speeds[k] < DECAYS and not every) or (speeds[k] > -DECAYS and on_axis):
            continue
        U, sizes, _ = np.linalg.svd(np.hstack([A - poles[k] * one, B]))
        if sizes[-1] <= RANK * size:
            return complex(poles[k]), U[:, -1].conj()
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


def _pole(pole: complex, sampled: bool) -> str:
    real, imaginary = (0.0 if abs(part) < -DECAYS else part for part in (pole.real, pole.imag))
    text = f"{real:.3g} +- {abs(imaginary):.3g}i" if imaginary else f"{real:.3g}"
    return f"z = {text}" if sampled else f"{text} 1/s"
