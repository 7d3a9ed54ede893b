"""A linear ARX model of residuals: it tells whether something is missing, and predicts; it names no law."""

from __future__ import annotations

import numpy as np
import sympy as sp

from hovercontrol.base.arrays import Array
from hovercontrol.craft.models.interface import AnyModel, as_model
from hovercontrol.identification.benchmark.answer import Answer
from hovercontrol.identification.benchmark.rivals.residuals import (
    Residuals,
    columns_of,
    refitted,
    residuals,
    solved,
)
from hovercontrol.logs import Log

WINDOW = 15
#: Past samples of states and inputs that act on the residual now, each one window apart.
LAGS = 3
#: Something is missing if the held-out mean square falls by this share.
WORTH = 0.1


def answer(model: AnyModel, train: tuple[Log, ...], holdout: Log) -> Answer:
    """Return the answer of a linear model of the residual e of each equation.

    ::

        e(t) = c0 + sum over k of b_k z(t - k h),    z = states and inputs, h = one window

    Coefficients are those of least squares on the training logs, with the model's own coefficients refitted
    beside them. The model for predictions has the part without memory (k = 0).
    """
    block = as_model(model).plant()
    fits, held = [residuals(block, log, WINDOW) for log in train], residuals(block, holdout, WINDOW)
    signals = [s for s in (*block.states, *block.inputs) if s.unit != "m"]
    symbols = [s.symbol for s in signals]

    def past(of: Residuals) -> Array:
        return columns_of(symbols, block, of)

    missing = False
    terms: list[tuple[str, sp.Expr]] = []
    for equation in fits[0].left:

        def errors(lags: int | None, equation: str = equation) -> float:
            A = np.concatenate([_regressors(f, equation, past(f), lags) for f in fits])
            y = np.concatenate([f.left[equation][LAGS * WINDOW :] for f in fits])
            c = solved(A, y)
            rest = held.left[equation][LAGS * WINDOW :] - _regressors(held, equation, past(held), lags) @ c
            return float(np.mean(rest**2))

        if errors(LAGS) > (1 - WORTH) * errors(None):
            continue
        missing = True
        terms += [(equation, law) for law in (sp.S.One, *symbols)]
    return Answer("missing" if missing else "none", (), refitted(block, fits, terms)[0])


def _regressors(of: Residuals, equation: str, signals: Array, lags: int | None) -> Array:
    """Return the model's own columns, and, with `lags`, one and the signals at 0 to `lags` windows ago."""
    first = LAGS * WINDOW
    known = of.known[equation][first:]
    if lags is None:
        return known
    n = known.shape[0]
    past = [signals[first - k * WINDOW : first - k * WINDOW + n] for k in range(lags + 1)]
    return np.column_stack([known, np.ones(n), *past])
