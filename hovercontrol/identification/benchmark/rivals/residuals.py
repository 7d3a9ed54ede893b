"""What a model leaves of the measured derivatives: the data of tools that work on residuals."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
import sympy as sp
from scipy.ndimage import median_filter
from scipy.signal import savgol_filter

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.derivatives import linear_parameters
from hovercontrol.blocks.sgn import sgn
from hovercontrol.blocks.signals import Signal
from hovercontrol.identification.benchmark.cases import law_unit, with_rates
from hovercontrol.logs import Log

#: A sample is an outlier this many scaled median deviations from the median of seven.
OUTLIER = 6.0


@dataclass(frozen=True, eq=False)
class Residuals:
    """Residuals of one log on an even grid.

    Attributes
    ----------
    signals : dict of str to ndarray, shape (n + 2 window,)
        States as measured, without outliers, and inputs.
    window : int
        Of the smoothing [samples]; so many samples at both ends are left out of all columns.
    left : dict of str to ndarray, shape (n,)
        By equation: smoothed derivative minus that of the model.
    known : dict of str to ndarray, shape (n, p)
        By equation: derivative of the model by its coefficients, which are refitted beside any new term.
    coefficients : tuple of str
        The p coefficients.
    """

    signals: dict[str, Array]
    window: int
    left: dict[str, Array]
    known: dict[str, Array]
    coefficients: tuple[str, ...]


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
    measured, rate = {}, {}
    for s in block.states:
        z = np.interp(t, log.time, _without_outliers(log[s.name]))
        measured[s.name] = z
        rate[s.name] = savgol_filter(z, window, 3, deriv=1, delta=dt)
    held = np.clip(np.searchsorted(log.time, t + 1e-9, side="right") - 1, 0, len(log) - 1)
    # An input holds from its row to the next: about a row, half the time it has the value before
    earlier = np.maximum(held - 1, 0)
    inputs = {s.name: 0.5 * (log[s.name][held] + log[s.name][earlier]) for s in block.inputs}
    x, u = np.array(list(measured.values())), np.array(list(inputs.values()))
    values = block.default_parameters
    f = block.to_numpy().derivatives
    now = f(0.0, x, u, values)
    # The measured derivative is S z', S the smoothing; the model's must be S f(z, u), the same filter once
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
        own = np.array([c[i] for c in columns])
        if not np.abs(own).max(initial=0.0) > 1e-12:  # x' = speed: no law can be missing
            continue
        left[s.name] = (rate[s.name] - model[i])[inside]
        known[s.name] = own.T[inside]
    return Residuals({**measured, **inputs}, window, left, known, tuple(linear))


def _without_outliers(z: Array) -> Array:
    middle = median_filter(z, 7, mode="nearest")
    off = z - middle
    scale = 1.4826 * float(np.median(np.abs(off))) or 1e-300
    return np.where(np.abs(off) > OUTLIER * scale, middle, z)


def beside(columns: Array, known: Array) -> Array:
    """Return the part of columns that known columns cannot take, shape as given."""
    size = np.linalg.norm(known, axis=0)
    basis = scipy.linalg.orth(known[:, size > 0] / size[size > 0], rcond=1e-8)
    return columns - basis @ (basis.T @ columns)


def columns_of(laws: Sequence[sp.Expr], block: Block, of: Residuals) -> Array:
    """Return the smoothed values of expressions, shape (n, laws)."""
    symbols = [s.symbol for s in (*block.states, *block.inputs)]
    n = next(iter(of.signals.values())).size
    values = sp.lambdify(symbols, list(laws), "numpy")(*(of.signals[s.name] for s in symbols))
    rows = np.array([np.broadcast_to(np.asarray(v, dtype=float), (n,)) for v in values]).reshape(-1, n)
    smooth: Array = savgol_filter(rows, of.window, 3, axis=1)
    return smooth[:, of.window : -of.window].T


def solved(columns: Array, y: Array) -> Array:
    """Return the least-squares coefficients of columns, each scaled to unit length."""
    size = np.linalg.norm(columns, axis=0)
    size[size == 0] = 1.0
    found: Array = np.linalg.lstsq(columns / size, y, rcond=1e-6)[0] / size
    return found


Found = tuple[str, sp.Expr, float, float]


def refitted(
    block: Block, fits: Sequence[Residuals], terms: Sequence[tuple[str, sp.Expr]]
) -> tuple[Block, list[Found]]:
    """Return the Block with terms, all coefficients fitted together, and the terms with standard errors.

    Each equation counts by the inverse of what remains of it. Residuals of a smoothed derivative correlate:
    the number of samples is divided by their correlation time in samples.
    """
    coefficients = fits[0].coefficients
    parts, ys, together = [], [], 1.0
    for equation in fits[0].left:
        known = np.concatenate([f.known[equation] for f in fits])
        y = np.concatenate([f.left[equation] for f in fits])
        new = np.zeros((y.size, len(terms)))
        own = [k for k, (e, _) in enumerate(terms) if e == equation]
        if own:
            laws = [terms[k][1] for k in own]
            new[:, own] = np.concatenate([columns_of(laws, block, f) for f in fits])
        A = np.column_stack([known, new])
        off = y - A @ solved(A, y)
        scale = float(off.std()) or 1e-12
        lags = [float(off[:-k] @ off[k:] / (off @ off)) for k in range(1, min(60, off.size // 2))]
        # correlation time in samples: 1 + 2 sum of r_k
        together = max(together, 1.0 + 2.0 * sum(itertools.takewhile(lambda r: r > 0.05, lags)))
        parts.append(A / scale)
        ys.append(y / scale)
    A, y = np.concatenate(parts), np.concatenate(ys)
    c = solved(A, y)
    # covariance (A' A)^-1 of independent samples of unit variance, columns scaled to unit length
    size = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    B = A / size
    std = np.sqrt(np.diag(np.linalg.pinv(B.T @ B, rcond=1e-9)) * together) / size
    p = len(coefficients)
    now = block.default_parameters
    moved = {k: now[k] + float(d) for k, d in zip(coefficients, c, strict=False)}
    rates, parameters, found = dict(block.derivatives), [], []
    for k, (equation, law) in enumerate(terms):
        value = float(c[p + k])
        signal = Signal(f"found_{k}", law_unit(equation, law, block), start=value)
        parameters.append(signal)
        found.append((equation, law, value, float(std[p + k])))
        for of in law.atoms(sp.sign):  # dry friction, of a width with the unit of its signal
            state = block.signal(of.args[0].name)
            width = Signal(f"found_{k}_width", state.unit, start=1e-2 * state.nominal)
            parameters.append(width)
            law = law.xreplace({of: sgn(state.symbol, width.symbol)})
        rates[equation] = rates[equation] + signal.symbol * law
    bounded = {}
    for s in block.parameters:
        key = block.parameter_key(s.name)
        if key in moved:
            bounded[s.name] = min(max(moved[key], s.lower), s.upper)
    return with_rates(block.with_values(bounded), rates, parameters=tuple(parameters)), found
