"""Unknown functions as tables: cubic splines whose values at the nodes are parameters of the model.

A fit with a constant in place of each function gives the range of its argument. Then the values at the nodes
are fitted with all other unknowns; again, if the argument then leaves the range. The nodes lie between even
spacing and quantiles of the rows.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.unknown_function import UnknownFunction
from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.craft.models.functions import FEWEST, KnownFunction, TableFunction, Unknown, unknowns_of
from hovercontrol.identification.diagnose.search.base import base_fit
from hovercontrol.identification.diagnose.unknown.function import FittedFunction
from hovercontrol.identification.engine.data import Data
from hovercontrol.identification.engine.excitation import Excitation
from hovercontrol.identification.engine.fit import Fit, estimate, refit, scored
from hovercontrol.identification.engine.prior import Prior, prior_of
from hovercontrol.identification.engine.problem import Problem
from hovercontrol.identification.engine.subject import Subject

#: Most nodes of a table, fewest samples for each, and the part of its range by which an end may be off.
NODES, SAMPLES, SHORT = 10, 8, 0.02

#: Most times that a table is spread over a new range.
ROUNDS = 4

#: Process noise under which a table is fitted first, relative to the observed acceleration.
QUIETER = (0.3, 0.03)

#: Errors of its argument over which a function must be seen: that of pure noise is 6.
RANGE = 8.0


def constants(model: Subject) -> tuple[TableFunction, ...]:
    """Return a constant in place of each unknown function of a model; a craft has none."""
    if not isinstance(model, BlockModel):
        return ()
    return tuple(TableFunction(of, (0.0,), (0.0,)) for of in unknowns_of(model.block))


def with_constants(model: Subject) -> Subject:
    """Return a model that can be computed: with a constant in place of each unknown function."""
    return model.with_functions(constants(model)) if isinstance(model, BlockModel) else model


def tabulated(
    model: BlockModel,
    data: Data,
    names: Sequence[str],
    report: Callable[[str], None] = lambda what: None,
) -> tuple[Fit, tuple[TableFunction, ...]]:
    """Return the fit of a model with a table in place of each unknown function, and the tables.

    Parameters
    ----------
    model : BlockModel
        With unknown functions.
    data : Data
    names : sequence of str
        Its coefficients to fit, besides the tables.
    report : callable, optional
        Called with a message on each step.

    Raises
    ------
    InputError
        If the logs do not show a function, or not beside a coefficient.
    FloatingPointError
        If the simulation diverges from the logs.
    """
    tables = constants(model)
    report("fitting constants in place of the unknown functions")
    fit = base_fit(model.with_functions(tables), data, (*names, *_parameters(tables)))
    for _ in range(ROUNDS):
        report("fitting tables in place of the unknown functions")
        tables = tuple(_spread(table, fit) for table in tables)
        problem, prior, p = _beginning(model, tables, fit, names)
        # What a constant lacks is process noise, which must not stand for the table too: less and less of it
        for part in QUIETER:
            quiet = replace(fit.noise, measured=data.noise, process=part * problem.accelerations)
            fit = refit(fit, problem, prior, noise=quiet, p=p, levels=False)
            p = fit.p
        fit = scored(_judged(refit(fit, problem, prior), data), prior)
        if all(_covers(table, fit) for table in tables):
            break
    refuse_unseen(fit, tables)
    return fit, tables


def _judged(near: Fit, data: Data) -> Fit:
    """Return a fit with tables to all samples but its own outliers.

    Beside a constant, the samples at which the function is largest are outliers.
    """
    own = near.problem.data
    every = replace(own, rows=replace(own.rows, values=data.rows.values), variance=data.variance)
    problem = Problem(near.problem.model, every, near.problem.names)
    return estimate(problem, near.prior, near.noise, p=near.p, path=near.path, gate=True)


def fitted_with(
    model: BlockModel, functions: Sequence[KnownFunction], near: Fit, names: Sequence[str]
) -> Fit:
    """Return the fit of a model with functions in place of its unknown ones, beginning with their numbers.

    Parameters
    ----------
    near : Fit
        A previous fit: of the path, the noise and the other coefficients.
    names : sequence of str
        Other coefficients to fit.
    """
    problem, prior, p = _beginning(model, functions, near, names)
    return scored(refit(near, problem, prior, p=p), prior)


def _beginning(
    model: BlockModel, functions: Sequence[KnownFunction], near: Fit, names: Sequence[str]
) -> tuple[Problem, Prior, Array]:
    """Return a problem with functions in place of unknown ones, its prior, and unknowns to begin with."""
    subject, own = model.with_functions(functions), _parameters(functions)
    problem = Problem(subject, near.problem.data, (*names, *own))
    before = dict(zip(near.problem.names, near.p.tolist(), strict=True))
    values = zip(problem.names, problem.start.tolist(), strict=True)
    p = np.array([v if n in own else before.get(n, v) for n, v in values])
    return problem, prior_of(problem, model), p  # no prior of what the functions are


def _parameters(functions: Sequence[KnownFunction]) -> tuple[str, ...]:
    return tuple(p for f in functions for p in f.parameters)


def arguments_along(fit: Fit, calls: Sequence[UnknownFunction]) -> Array:
    """Return the arguments of a function at the measured rows of a fit's path, shape (calls, rows)."""
    problem = fit.problem
    outputs = tuple(Signal(f"a{k}") for k in range(len(calls)))
    e = Expressions((s.name, c.arguments[0]) for s, c in zip(outputs, calls, strict=True))
    probe = problem.block.unchecked(outputs=outputs, output_expressions=e)
    own, parameters = problem.seen.any(axis=2), problem.parameters(fit.p)
    t = problem.rows.time[own]
    u = problem.inputs.at(parameters, t, np.broadcast_to(problem.rows.log, own.shape)[own])
    found = probe.to_numpy().array_outputs(t, np.moveaxis(fit.path[own], 1, 0), u, parameters)
    return np.stack([np.broadcast_to(a, t.shape) for a in found])


def _quantiles(fit: Fit, of: Unknown) -> Array:
    """Return the argument of a function at equal parts of the rows of a fit, one for each node."""
    along = arguments_along(fit, of.calls)
    along = along[np.isfinite(along)]
    count = min(max(int(fit.problem.seen.sum()) // SAMPLES, FEWEST), NODES)
    return np.quantile(along, np.linspace(0.0, 1.0, count)) if along.size else np.zeros(count)


def _covers(table: TableFunction, fit: Fit) -> bool:
    """Return whether a table spans the range of its argument in a fit, no less and no more."""
    ends = np.array(table.grid)[[0, -1]]
    return bool(np.all(np.abs(_quantiles(fit, table.of)[[0, -1]] - ends) < SHORT * np.ptp(ends)))


def _spread(table: TableFunction, near: Fit) -> TableFunction:
    """Return a table over the range of its argument in a fit, beginning where that ended."""
    of, quantiles = table.of, _quantiles(near, table.of)
    low, high = float(quantiles[0]), float(quantiles[-1])
    if not high - low > max(RANGE * _error_of(near, of), 1e-9 * max(abs(low), abs(high))):
        raise InputError(
            f"the unknown function {of.name}({of.argument}): {of.argument} stays between {low:.4g} and "
            f"{high:.4g} {of.argument_unit} in these logs, too little to show a function of it"
        )
    grid = 0.5 * (quantiles + np.linspace(low, high, quantiles.size))
    values = dict(zip(near.problem.names, near.p.tolist(), strict=True))
    start = table.with_numbers(values).values(grid)
    return TableFunction(of, tuple(grid.tolist()), tuple(start.tolist()))


def _error_of(fit: Fit, of: Unknown) -> float:
    """Return the error of a function's argument, if it is a state: its noise if measured, else the fit's."""
    problem, found = fit.problem, 0.0
    noise = dict(zip(problem.data.channels, problem.data.noise.tolist(), strict=True))
    states = {problem.block.states[i].symbol: j for j, i in enumerate(problem.free)}
    measured = problem.seen.any(axis=2)
    for a in (call.arguments[0] for call in of.calls):
        if a in states:
            std = math.sqrt(float(np.median(fit.variance_of_path[measured][:, states[a]])))
            found = max(found, noise.get(str(a), std))
    return found


def span(table: TableFunction, fit: Fit) -> tuple[float, float]:
    """Return the ends of a table; zero for one that lies beyond zero by the argument's error."""
    low, high, slack = table.grid[0], table.grid[-1], 0.5 * RANGE * _error_of(fit, table.of)
    return 0.0 if -slack < low < 0.0 else low, 0.0 if 0.0 < high < slack else high


def refuse_unseen(fit: Fit, tables: Sequence[TableFunction]) -> None:
    """Raise if the logs do not determine a function, or not beside another coefficient.

    A coefficient is not determined beside a function if its standard error exceeds its size, and does not if
    the function is known.

    Raises
    ------
    InputError
        The message names the function and the reason.
    """
    every, size = list(fit.problem.names), sizes(fit, tables)
    joint = Excitation(fit, size)
    wide = np.sqrt(np.diag(joint.covariance))
    names = {p: t.of.name for t in tables for p in t.parameters}
    for table in tables:
        where = f"the unknown function {table.of.name}({table.of.argument})"
        own = [every.index(p) for p in table.parameters]
        if np.all(joint.alone[own] > size[own]):
            raise InputError(f"{where}: nothing measured depends on it enough")
        rest = [j for j in range(len(every)) if j not in own]
        known = Excitation(fit, size[rest], [every[j] for j in rest]) if rest else None
        alone = np.sqrt(np.diag(known.covariance)) if known else np.zeros(0)
        for k, j in enumerate(rest):
            if wide[j] > size[j] >= alone[k]:
                name = names.get(every[j], every[j].rpartition(".")[2])
                keep = "" if every[j] in names else f"keep {name} (fixed), or "
                raise InputError(
                    f"{where}: the logs do not tell it from {name}, a change of which it can make up for; "
                    f"{keep}leave one of them out"
                )


def sizes(fit: Fit, functions: Sequence[KnownFunction]) -> Array:
    """Return the sizes of the unknowns of a fit; of a table's nodes the root mean square of all of them."""
    nominal = fit.problem.model.nominal_sizes()
    size = np.maximum([nominal[name] for name in fit.problem.names], np.abs(fit.p) / 4)
    for f in functions:
        if isinstance(f, TableFunction):
            own = [fit.problem.names.index(p) for p in f.parameters]
            size[own] = float(np.sqrt(np.mean(fit.p[own] ** 2))) or 1.0
    return np.asarray(size)


def fitted_functions(
    fit: Fit, tables: Sequence[TableFunction], covariance: Array
) -> tuple[FittedFunction, ...]:
    """Return the functions of a fit with tables.

    Parameters
    ----------
    covariance : ndarray, shape (P, P)
        Of the unknowns.
    """
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    found = []
    for t in tables:
        own, of = [fit.problem.names.index(p) for p in t.parameters], t.of
        grid = np.array(t.grid)
        found.append(
            FittedFunction(of.name, of.argument, of.unit, of.argument_unit, grid, fit.p[own], std[own])
        )
    return tuple(found)
