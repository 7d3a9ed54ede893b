"""Forms of few numbers nearest to a function that was fitted as a table."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import sympy as sp
from scipy.optimize import least_squares

from hovercontrol.base.arrays import Array
from hovercontrol.craft.effects import Effect, Shape
from hovercontrol.craft.effects.law import LEVELS, Law, TableLaw
from hovercontrol.identification.engine.subject import Subject

#: Number of places at which a form is compared with a table, at equal parts of the rows.
PLACES = 60


def nearest(model: Subject, names: list[str], table: TableLaw, along: Array) -> list[Effect]:
    """Return laws of some forms with the numbers that come nearest to a table, the nearest first.

    The distance is the mean square over the rows of the logs, with the same factors on both sides.

    Parameters
    ----------
    model : Model or BlockModel
    names : list of str
        Of laws whose factors beside the signal of the table are those of the table.
    table : TableLaw
    along : ndarray
        The signal along the logs.
    """
    local = table.curve()
    assert local is not None
    a = np.unique(np.quantile(along, np.linspace(0.005, 0.995, PLACES)))
    of, _, _ = _function(type(table), local.signal)
    target = of(a, list(table.values.values()))
    found = [_near(model.effect_class(name), local.signal, a, target) for name in names]
    return [e for _, e in sorted(found, key=lambda one: one[0])]


def _function(cls: type[Effect], signal: str) -> tuple[Callable[..., Array], list[str], sp.Expr]:
    """Return a law's factors that depend on a signal, as a function of it and of the law's numbers."""
    assert issubclass(cls, Law)
    keys = list(cls.numbers)
    c = SimpleNamespace(**{k: sp.Symbol(k, real=True) for k in keys})
    x = sp.Symbol("x", real=True)
    form = sp.Mul(*(f.expression(x, c) for f in cls.product if f.signal == signal))
    whole = form if issubclass(cls, TableLaw) else c.value * form
    made = sp.lambdify([x, [getattr(c, k) for k in keys]], whole, "numpy")
    return lambda values, numbers: np.broadcast_to(made(values, numbers), values.shape), keys, form


def _near(cls: type[Effect], signal: str, a: Array, target: Array) -> tuple[float, Effect]:
    """Return the mean square distance of a form to a function, and the form with its nearest numbers."""
    of, keys, _ = _function(cls, signal)
    shapes = [k for k in keys if isinstance(cls.numbers[k], Shape)]
    lower = [cls.numbers[k].lower for k in shapes]
    levels = [np.unique(np.quantile(a if low < 0.0 else np.abs(a), LEVELS)) for low in lower]
    starts = itertools.product(*(v[v > low] for v, low in zip(levels, lower, strict=True)))

    def size(shape: Array) -> tuple[float, Array]:
        with np.errstate(all="ignore"):
            one = of(a, [1.0 if k == "value" else shape[shapes.index(k)] for k in keys])
        one = np.where(np.isfinite(one), one, 0.0)
        value = float(one @ target) / max(float(one @ one), 1e-300)
        return value, value * one - target

    best = min((np.array(s) for s in starts), key=lambda s: float((size(s)[1] ** 2).sum()))
    if shapes:
        bounds = (np.maximum(lower, -np.inf), np.full(len(shapes), np.inf))
        best = least_squares(lambda s: size(s)[1], best, bounds=bounds, x_scale=np.abs(best) + 1e-9).x
    value, rest = size(best)
    numbers = dict(zip(shapes, best.tolist(), strict=True))
    return float(np.mean(rest**2)), cls.within_bounds(value=value, **numbers)
