"""How a model answers a small force along its free runs: transitions of its linearised motion.

With them the signature of any candidate effect, and the filter of process noise, cost one pass through the
rows, all windows side by side.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hovercontrol.discrepancy.windowed import Windowed

Array = NDArray[np.float64]


class Response:
    """The linearised motion along the last simulation of windows.

    Parameters
    ----------
    windowed : Windowed
    p : ndarray, shape (P,)

    Attributes
    ----------
    A : ndarray, shape (K-1, W, n, n)
        Transition of the free states from row to row.
    B : ndarray, shape (K-1, W, n, n)
        What a constant addition to the derivatives adds until the next row.
    C : ndarray, shape (K, W, n_channels, n)
        Of the channels by the states.
    dt : ndarray, shape (K-1, W)
        From row to row [s].
    pace : ndarray, shape (W, K, n_channels)
        Time derivative of each channel.
    """

    def __init__(self, windowed: Windowed, p: Array) -> None:
        w = windowed
        functions = w.block.to_numpy()
        params = dict(zip(w.block.default_parameters, w.parameters(p), strict=True))
        x = np.moveaxis(w.x, 1, 0)  # n, K, W
        u = np.moveaxis(w.cut.inputs, 2, 1)
        t = w.cut.time.T
        middle = 0.5 * (x[:, 1:] + x[:, :-1])
        n = len(w.free)
        J = functions.jacobian(t[:-1], middle, u[:, :-1], params)
        J = _points_first(J, t[:-1].shape)[..., w.free, :][..., w.free]
        self.dt = np.diff(t, axis=0)
        h = self.dt[..., None, None]
        step = J * h
        eye = np.eye(n)
        self.A = np.linalg.inv(eye - step + 0.5 * step @ step)  # L-stable, of order 2
        self.B = np.linalg.inv(eye - 0.5 * step) * h
        self.C = np.zeros((*t.shape, len(w.picked), n))
        outputs = None
        for c, (i, is_state) in enumerate(w.picked):
            if is_state:
                self.C[:, :, c, w.free.index(i)] = 1.0
            else:
                if outputs is None:
                    full = functions.jacobian(t, x, u, params, rows="outputs")
                    outputs = _points_first(full, t.shape)[..., w.free]
                self.C[:, :, c] = outputs[..., i, :]
        self.C *= (w.seen / w.scale).transpose(1, 0, 2)[..., None]
        slopes = np.moveaxis(functions.derivatives(t, x, u, params)[w.free], 0, -1)
        self.pace = np.swapaxes((self.C @ slopes[..., None])[..., 0], 0, 1)

    def of(self, windows: Array) -> Response:
        """Return the response of some of the windows, in that order, repeated ones too."""
        part = object.__new__(Response)
        part.A, part.B, part.C = self.A[:, windows], self.B[:, windows], self.C[:, windows]
        part.dt, part.pace = self.dt[:, windows], self.pace[windows]
        return part

    def to(self, forcing: Array) -> Array:
        """Return the channels' answer, (W, K, C, M), to additions to the derivatives.

        Parameters
        ----------
        forcing : ndarray, shape (K-1, W, n, M)
            Constant from row to row.
        """
        added = self.B @ forcing
        state = np.zeros_like(added[0])
        answer = np.zeros((added.shape[1], len(self.C), self.C.shape[2], added.shape[-1]))
        for k, (A, add) in enumerate(zip(self.A, added, strict=True)):
            state = A @ state + add
            answer[:, k + 1] = self.C[k + 1] @ state
        return answer


def _points_first(J: Array, shape: tuple[int, ...]) -> Array:
    """Return a Jacobian (rows, columns, points...) with the points' axes first, broadcast."""
    full = np.broadcast_to(J.reshape(*J.shape, *[1] * (2 + len(shape) - J.ndim)), (*J.shape[:2], *shape))
    return np.moveaxis(full, (0, 1), (-2, -1))
