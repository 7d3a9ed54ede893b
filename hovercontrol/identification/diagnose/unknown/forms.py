"""The form of an unknown function: forms of few numbers, fitted in the place of its table.

The numbers of a form that come nearest to the table, in the table's own metric, are where the fit of the
whole model begins. The probability of a form is its evidence (:mod:`.occam`) relative to that of all forms
and of the table, each as likely beforehand.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import chi2

from hovercontrol.base.arrays import Array
from hovercontrol.craft.effects.law import LEVELS
from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.craft.models.forms import FORMS, bounds
from hovercontrol.craft.models.functions import FormFunction, TableFunction, Unknown
from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.unknown.function import FittedFunction, Form
from hovercontrol.identification.diagnose.unknown.occam import Whitened
from hovercontrol.identification.diagnose.unknown.tables import (
    arguments_along,
    fitted_functions,
    fitted_with,
    span,
)
from hovercontrol.identification.engine.fit import Fit

#: Most forms that are fitted with the whole model: those nearest to the table.
FITTED = 8

#: Number of places at which forms are compared.
PLACES = 60

#: Relative differences below which two functions are the same, and below which one form contains another.
SAME, CONTAINED = 1e-6, 1e-3


def named_forms(
    model: BlockModel, fit: Fit, tables: Sequence[TableFunction], report: Callable[[str], None]
) -> tuple[FittedFunction, ...]:
    """Return the functions of a fit with tables, each with the forms that it may have, the likeliest first.

    While the form of one function is sought, the others are tables.

    Parameters
    ----------
    model : BlockModel
        With unknown functions.
    fit : Fit
        With the tables in their place.
    """
    found = []
    for table, function in zip(tables, fitted_functions(fit, tables, fit.covariance), strict=True):
        own = [fit.problem.names.index(p) for p in table.parameters]
        others = [t for t in tables if t is not table]
        names = [n for n in fit.problem.names if n not in (*table.parameters, *_of(others))]
        along = arguments_along(fit, table.of.calls).ravel()
        low, high = span(table, fit)
        along = np.clip(along[np.isfinite(along)], low, high)
        covariance = fit.covariance[np.ix_(own, own)]
        at = np.linspace(low, high, PLACES)
        seen = whitened(function.grid, function.values, covariance, along)
        forms = [_form(table.with_numbers(_values(fit)), fit, at)]
        evidence = [_evidence(fit, seen.of_table())]
        for near, unused in nearest_forms(table.of, seen)[:FITTED]:
            report(f"trying {function.name} = {near.text(bool(at[0] >= 0.0))}")
            try:
                forms.append(_form(near, fitted_with(model, [near, *others], fit, names), at))
            except FloatingPointError:
                continue
            evidence.append(_evidence(forms[-1].fit, unused))
        found.append(replace(function, forms=_weighed(forms, evidence)))
    return tuple(found)


def likeliest(
    model: BlockModel, functions: Sequence[FittedFunction], tables: Sequence[TableFunction]
) -> BlockModel:
    """Return a model with the likeliest form in place of each unknown function, a table where none is."""
    values = {n: v for f in functions for n, v in _values(f.forms[0].fit).items()}
    known = [f.forms[0].function.with_numbers(values) for f in functions]
    own = {n for t in tables for n in t.parameters} | {n for k in known for n in k.parameters}
    filled = model.with_functions(known)
    return filled.with_coefficients({n: v for n, v in values.items() if n not in own})


def rivals_of(function: FittedFunction) -> tuple[Form, ...]:
    """Return the forms that the logs do not tell from the likeliest one.

    They are less likely by less than `CRITERIA.apart` in twice the log. One that contains the likeliest form
    as a limit is a rival only if what it has more is significant (`CRITERIA.chance`; Wilks, Ann. Math. Stat.
    9 (1938)); so is the table.
    """
    best, *others = function.forms
    return tuple(
        f
        for f in others
        if f.name != "table"
        and 2.0 * math.log(best.odds(f)) < CRITERIA.apart
        and not (_contains(f, best) and best.fit.cost - f.fit.cost < _chance(f, best))
    )


def _chance(larger: Form, smaller: Form) -> float:
    more = max(len(larger.numbers) - len(smaller.numbers), 1)
    return float(chi2.isf(CRITERIA.chance, more))


def _contains(larger: Form, smaller: Form) -> bool:
    """Return whether a form can be another one, with more numbers."""
    if not isinstance(larger.function, FormFunction) or len(larger.numbers) <= len(smaller.numbers):
        return False
    size = float(np.abs(smaller.values).max()) or 1.0
    same = Whitened(smaller.at, np.eye(PLACES) / size, smaller.values / size, smaller.at)
    near = _nearest(larger.function, same)
    return near is not None and near[1] < PLACES * CONTAINED**2


def whitened(grid: Array, values: Array, covariance: Array, along: Array) -> Whitened:
    """Return a table in its own metric.

    Parameters
    ----------
    grid, values : ndarray, shape (n,)
    covariance : ndarray, shape (n, n)
        Of the values.
    along : ndarray
        The argument in the rows of the logs.
    """
    # C = V diag(l) V': W = diag(l^-1/2) V', |W (f - y)|^2
    eigenvalues, V = np.linalg.eigh(covariance)
    W = (V / np.sqrt(np.maximum(eigenvalues, 1e-12 * eigenvalues[-1]))).T
    return Whitened(grid, W, W @ values, along)


def nearest_forms(of: Unknown, seen: Whitened) -> list[tuple[FormFunction, float]]:
    """Return the forms with the numbers nearest to a table, the likeliest first.

    With each, the log of its mean likelihood relative to the largest (:mod:`.occam`). Forms that are the same
    over the logs are listed once. One that needs more numbers than there are nodes is left out.

    Parameters
    ----------
    of : Unknown
    seen : Whitened
        The table.

    Examples
    --------
    >>> grid, along = np.linspace(0.5, 20.0, 8), np.linspace(0.5, 20.0, 400)
    >>> of = Unknown("mu", "1/s", "kg/m^3", ())
    >>> best, _ = nearest_forms(of, whitened(grid, 0.4 * grid / (4.0 + grid), 1e-6 * np.eye(8), along))[0]
    >>> best.form, np.round(best.numbers, 3).tolist()
    ('saturating', [0.4, 4.0])
    """
    places = np.linspace(float(seen.along.min()), float(seen.along.max()), PLACES)
    found: list[tuple[float, FormFunction, float]] = []
    shapes: list[Array] = []
    for form in FORMS:
        near = _nearest(FormFunction(of, form, ()), seen)
        if near is None:
            continue
        shape = near[0].values(places)
        if any(np.abs(shape - one).max() <= SAME * np.abs(one).max() for one in shapes):
            continue
        shapes.append(shape)
        unused = seen.unused(*near)
        found.append((unused - 0.5 * near[1], near[0], unused))
    return [(f, unused) for _, f, unused in sorted(found, key=lambda one: -one[0])]


def _nearest(form: FormFunction, seen: Whitened) -> tuple[FormFunction, float] | None:
    """Return a form with the numbers nearest to a table, and its squared distance; None without numbers."""
    count, numbers, along, target = len(form.terms), form.own, seen.along, seen.y
    if len(form.keys) > seen.grid.size:
        return None
    columns = form.columns(seen.grid)

    def solved(own: Array) -> tuple[Array, Array]:
        A = seen.W @ columns(own.tolist())
        size = np.linalg.norm(A, axis=0)
        if not np.all(size > 0.0):
            return np.zeros(count), target
        c = np.linalg.lstsq(A / size, target, rcond=1e-12)[0] / size
        return c, A @ c - target

    starts = []
    for n, t in numbers:
        levels = np.unique(np.quantile(along if t.signed else np.abs(along), LEVELS))
        starts.append(
            np.array([0.5, 1.5, 3.0]) if n == "n" else levels[t.signed | (levels > bounds(n, t)[0])]
        )
    tried = [np.array(s, dtype=float) for s in itertools.product(*starts)]
    if not tried:
        return None
    best = min(tried, key=lambda s: float((solved(s)[1] ** 2).sum()))
    if numbers:
        limits = tuple(zip(*(bounds(n, t) for n, t in numbers), strict=True))
        scale = np.abs(best) + 1e-9
        best = least_squares(lambda s: solved(s)[1], best, bounds=limits, x_scale=scale).x
    c, rest = solved(best)
    return replace(form, numbers=(*c.tolist(), *best.tolist())), float(rest @ rest)


def _of(tables: Sequence[TableFunction]) -> list[str]:
    return [p for t in tables for p in t.parameters]


def _values(fit: Fit) -> dict[str, float]:
    return dict(zip(fit.problem.names, fit.p.tolist(), strict=True))


def _form(function: TableFunction | FormFunction, fit: Fit, at: Array) -> Form:
    """Return a function as it was fitted."""
    function = function.with_numbers(_values(fit))
    if isinstance(function, TableFunction):
        return Form("table", "none of these forms", function, {}, {}, 0.0, at, function.values(at), fit)
    std = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
    own = [fit.problem.names.index(p) for p in function.parameters]
    numbers = {k: (float(fit.p[j]), float(std[j])) for k, j in zip(function.keys, own, strict=True)}
    units = {
        k: fit.problem.block.parameter(p).unit
        for k, p in zip(function.keys, function.parameters, strict=True)
    }
    text = function.text(bool(at[0] >= 0.0))
    return Form(function.form, text, function, numbers, units, 0.0, at, function.values(at), fit)


def _weighed(forms: Sequence[Form], evidence: Sequence[float]) -> tuple[Form, ...]:
    """Return forms with their probabilities, the likeliest first."""
    weight = np.exp(np.array(evidence) - max(evidence))
    weight /= weight.sum()
    every = [replace(f, probability=float(w)) for f, w in zip(forms, weight, strict=True)]
    return tuple(sorted(every, key=lambda f: -f.probability))


def _evidence(fit: Fit, unused: float) -> float:
    """Return the log evidence: the largest log likelihood without the prior, and the mean relative to it."""
    return -0.5 * (fit.cost - fit.prior.cost(fit.problem.inside(fit.p))) + unused
