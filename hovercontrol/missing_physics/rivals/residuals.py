"""What a model leaves of the measured derivatives: the data of tools that work on residuals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.signal import savgol_filter

from hovercontrol.core.block import Block
from hovercontrol.core.derivatives import linear_parameters
from hovercontrol.logs import Log

Array = NDArray[np.float64]

#: A sample is an outlier this many scaled median deviations from the median of seven.
OUTLIER = 6.0


@dataclass(frozen=True, eq=False)
class Residuals:
    """Residuals of one log on an even grid.

    Attributes
    ----------
    signals : dict of str to ndarray, shape (n,)
        Smoothed states, and inputs.
    left : dict of str to ndarray, shape (n,)
        By equation: smoothed derivative minus that of the model.
    known : dict of str to ndarray, shape (n, p)
        By equation: derivative of the model by its coefficients, which are refitted beside any new term.
    """

    signals: dict[str, Array]
    left: dict[str, Array]
    known: dict[str, Array]


def residuals(block: Block, log: Log, window: int) -> Residuals:
    """Return the residuals of a log.

    Outliers are replaced by the median of seven samples, samples interpolated to an even grid, and states and
    their derivatives are taken from cubic polynomials over `window` samples [Savitzky and Golay 1964].

    Parameters
    ----------
    block : Block
        All its states are measured.
    log : Log
    window : int
        Odd.
    """
    dt = float(np.median(np.diff(log.time)))
    t = np.arange(log.time[0], log.time[-1], dt)
    smooth, rate = {}, {}
    for s in block.states:
        z = np.interp(t, log.time, _without_outliers(log[s.name]))
        smooth[s.name] = savgol_filter(z, window, 3)
        rate[s.name] = savgol_filter(z, window, 3, deriv=1, delta=dt)
    held = np.clip(np.searchsorted(log.time, t + 1e-9, side="right") - 1, 0, len(log) - 1)
    inputs = {s.name: log[s.name][held] for s in block.inputs}
    x, u = np.array(list(smooth.values())), np.array(list(inputs.values()))
    values = block.default_parameters
    f = block.to_numpy().derivatives
    now = f(0.0, x, u, values)
    # the same smoothing on both sides: a step of an input is smeared in the measured derivative
    model = savgol_filter(now, window, 3, axis=1)
    names = linear_parameters(block)
    linear = [block.parameter_key(p.name) for p in block.parameters if p.name in names]
    columns = []
    for name in linear:
        step = max(abs(values[name]), 1.0)
        moved = {**values, name: values[name] + step}
        columns.append(savgol_filter((f(0.0, x, u, moved) - now) / step, window, 3, axis=1))
    inside = slice(window, -window)
    left, known = {}, {}
    for i, s in enumerate(block.states):
        own = [c[i] for c in columns if np.abs(c[i]).max(initial=0.0) > 1e-12]
        if not own:  # x' = speed: no law can be missing
            continue
        left[s.name] = (rate[s.name] - model[i])[inside]
        known[s.name] = np.array(own).T[inside]
    every = {**smooth, **{k: savgol_filter(v, window, 3) for k, v in inputs.items()}}
    return Residuals({k: v[inside] for k, v in every.items()}, left, known)


def _without_outliers(z: Array) -> Array:
    middle = median_filter(z, 7, mode="nearest")
    off = z - middle
    scale = 1.4826 * float(np.median(np.abs(off))) or 1e-300
    return np.where(np.abs(off) > OUTLIER * scale, middle, z)


def beside(columns: Array, known: Array) -> Array:
    """Return the part of columns that known columns cannot take, shape as given."""
    basis, _ = np.linalg.qr(known / np.maximum(np.linalg.norm(known, axis=0), 1e-300))
    return columns - basis @ (basis.T @ columns)
