"""Velocity errors of an inertial navigation as states of the filter: an offset and a ramp over ground.

Between two corrections the velocity error over ground is ``offset + ramp * t``, t since the correction. Each
correction draws offset and ramp anew from their prior distribution.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.identification.engine.measure import Measured
from hovercontrol.identification.engine.navigation import Navigated
from hovercontrol.identification.engine.rows import Rows

#: Offset north, offset east, ramp north, ramp east.
STATES = 4


@dataclass(frozen=True, eq=False)
class DriftStates:
    """Additional states of a linear system that describe the drift.

    Attributes
    ----------
    A : ndarray, shape (K-1, W, 4, 4)
        Transition matrix from row to row; zero across a correction.
    Q : ndarray, shape (K-1, W, 4, 4)
        Covariance of the drift drawn at a correction; zero elsewhere.
    H : ndarray, shape (K, W, C, 4)
        Measurement matrix of the channels.
    P0 : ndarray, shape (W, 4, 4)
        Covariance of the first state.
    """

    A: Array
    Q: Array
    H: Array
    P0: Array


def drift_states(logs: Sequence[Measured], rows: Rows) -> DriftStates | None:
    """Return the drift states of logs from an inertial navigation; None if there is no such log."""
    drifting = [isinstance(log, Navigated) for log in logs]
    if not any(drifting):
        return None
    K, W, C = rows.values.shape
    dt = np.diff(rows.time, axis=0)
    A, Q = (np.zeros((K - 1, W, STATES, STATES)) for _ in range(2))
    H, P0 = np.zeros((K, W, C, STATES)), np.zeros((W, STATES, STATES))
    # offset' = ramp over a row of length dt; body velocities u, v from errors e_N, e_E over ground:
    #   du = cos(psi) e_N + sin(psi) e_E,  dv = -sin(psi) e_N + cos(psi) e_E
    A[..., range(STATES), range(STATES)] = 1.0
    A[..., 0, 2] = A[..., 1, 3] = dt
    u, v = rows.channels.index("u"), rows.channels.index("v")
    psi = np.nan_to_num(rows.guess.get("psi", rows.values[..., rows.channels.index("psi")]))
    c, s = np.cos(psi), np.sin(psi)
    for w, k in enumerate(rows.log):
        log = logs[k]
        if not isinstance(log, Navigated):
            continue
        P0[w] = np.diag([log.drift.offset**2] * 2 + [log.drift.ramp**2] * 2)
        number = np.searchsorted(log.corrected - log.origin, rows.time[:, w] + 1e-9)
        fresh = np.diff(number) > 0
        A[fresh, w], Q[fresh, w] = 0.0, P0[w]
        H[:, w, u, 0], H[:, w, u, 1] = c[:, w], s[:, w]
        H[:, w, v, 0], H[:, w, v, 1] = -s[:, w], c[:, w]
    return DriftStates(A, Q, H, P0)
