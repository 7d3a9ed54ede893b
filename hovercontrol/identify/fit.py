"""Identification: the coefficients of a model from logs, by maximum-likelihood multiple shooting.

The logs are cut into windows of a few seconds. Within each the Block runs free from an initial
state that is itself sought; the coefficients are those that make all windows fit best (van
Domselaar and Hemker, 1975; Bock, 1983). Long windows would let model errors pile up and lose the
way to the minimum, one-step predictions would let measurement noise bias the coefficients; windows
of seconds do neither.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from hovercontrol.block import Block
from hovercontrol.errors import InputError, did_you_mean
from hovercontrol.estimators.regression import regression
from hovercontrol.identify.excitation import (
    NO_INFORMATION,
    blind_directions,
    covariance,
    idle_inputs,
    named_directions,
    reason,
    same_directions,
    stiff_pull,
    unexcited_directions,
    weak_pull,
)
from hovercontrol.identify.measure import MOST_ROWS, Array, Measured, measure_all, refuse_still
from hovercontrol.identify.problem import Problem
from hovercontrol.identify.result import Fitted, Identified
from hovercontrol.identify.shooting import STEP, known_states
from hovercontrol.identify.solve import Solution, Solver
from hovercontrol.identify.windows import noise_levels, refuse_slow_rows, thin, windows
from hovercontrol.logs import Log
from hovercontrol.model import Model

#: Length of a window [s], unless told. A model that lacks nothing gains from longer ones: 2 s make
#: the standard errors of a simulated pose log a third. But the errors of a model that does lack
#: something pile up with time: on the real logs 2 and 3 s scatter more from run to run.
WINDOW = 1.0

#: Windows of this part of the length find the start of the fit: short ones are nearly linear
#: problems, and on the real logs the way to the minimum takes a third of the iterations and does
#: not end beside it.
SHORT = 0.25


def identify(
    model: Model | Block,
    logs: Sequence[Log | Measured],
    coefficients: Sequence[str] | None = None,
    *,
    window: float = WINDOW,
    step: float = STEP,
    huber: float | None = None,
    most_rows: int = MOST_ROWS,
    progress: Callable[[float, str], None] | None = None,
) -> Identified:
    """Estimate coefficients of a model from logs.

    Parameters
    ----------
    model : Model or Block
        Its present values start the fit.
    logs : sequence of Log
        One or several, each with the model's inputs and pose (``x, y, psi``), body velocities
        (``u, v, r``), both, or any other states or outputs of the Block. Already measured ones
        (:func:`~hovercontrol.identify.measure.measure`) are taken as they are.
    coefficients : sequence of str, optional
        Names of parameters, shapes included (``yaw_coulomb_width``); by default all linear
        coefficients.
    window : float, optional
        Length of the windows [s].
    step : float, optional
        Longest sub-step of the simulation [s]; stiff friction makes it shorter, down to 1 ms.
    huber : float, optional
        Residuals beyond this many standard deviations weigh less (Huber's loss); without it all
        weigh alike.
    most_rows : int, optional
        Most rows used of all logs together; windows are then spread evenly.
    progress : callable, optional
        Called with the part done (0 to 1) and a word on what is being done.

    Returns
    -------
    Identified

    Raises
    ------
    InputError
        If there is no log, a coefficient or an input is unknown, nothing moves in a log, a window
        would hold too few rows, or no log holds a whole window.

    Examples
    --------
    >>> from hovercontrol.signals import Signal
    >>> v, k = Signal("v", "m/s"), Signal("k", "1/s", start=1.0)
    >>> decay = Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol})
    >>> t = np.linspace(0, 2, 101)
    >>> found = identify(decay, [Log("demo", t, {"v": np.exp(-0.7 * t)})])
    >>> round(found["k"].value, 4)
    0.7
    """
    tell = progress or (lambda part, what: None)
    block = model.plant() if isinstance(model, Model) else model
    names = _names(model, block, coefficients)
    if not logs:
        raise InputError("identification needs at least one log")
    if not window > 0:
        raise InputError(f"the window must be a time above 0 s, found {window:g}")
    refuse_slow_rows(logs, window)
    tell(0.0, "reading what was measured")
    measured = measure_all(block, logs, most_rows)
    channels = tuple(dict.fromkeys(c for m in measured for c in m.channels))
    states = [known_states(block, m, block.parameter_values(), step) for m in measured]
    full_names = [block.parameter(name).name for name in names]
    whole = windows(measured, window)
    for log in measured:
        refuse_still(log.name, log.channels, log.values)
    noise = noise_levels(measured, channels)

    def solver_of(found: list[tuple[int, int, int]], iterations: int = 0) -> Solver:
        problem = Problem(block, full_names, measured, states, channels, thin(found, most_rows))
        return Solver(problem, noise, huber, step, tell, iterations)

    solver = solver_of(windows(measured, SHORT * window))
    problem = solver.problem
    rough = solver.solve(problem.start, problem.first_states(), weak_pull(problem.nominal))
    solver = solver_of(whole, solver.iterations)
    problem = solver.problem
    solution = _held(solver, rough.point.p, problem.first_states(), _blind(problem, rough))
    size = _size(problem, solution)
    C = covariance(solution.information, solution.scores, size)
    directions = unexcited_directions(C, size)
    tell(1.0, "done")
    named = named_directions(directions, size, names)
    fitted = _fitted(problem, names, solution, C, size, named)
    return Identified(
        model=model.with_coefficients({f.name: f.value for f in fitted})
        if isinstance(model, Model)
        else None,
        block=block.with_values({n: f.value for n, f in zip(full_names, fitted, strict=True)}),
        coefficients=fitted,
        covariance=C,
        unexcited=named,
        units={c: block.signal(c).unit for c in channels},
        residual=dict(zip(channels, solution.residual.tolist(), strict=True)),
        noise=dict(zip(channels, noise.tolist(), strict=True)),
        chi2_per_dof=solution.chi2_per_dof,
        windows=len(problem.ranges),
        rows=sum(
            int(np.isfinite(measured[i].values[:, first:stop]).any(axis=0).sum())
            for i, first, stop in problem.ranges
        ),
        rows_total=sum(m.rows_total for m in measured),
        logs=tuple(m.name for m in measured),
        iterations=solver.iterations,
        converged=solution.converged,
    )


def _names(model: Model | Block, block: Block, coefficients: Sequence[str] | None) -> tuple[str, ...]:
    if coefficients is None:
        found = model.linear_coefficients() if isinstance(model, Model) else regression(block).names
    else:
        known = [p.name.rpartition(".")[2] for p in block.parameters]
        if isinstance(model, Model):
            known = list(model.coefficients())
        for name in coefficients:
            if name.rpartition(".")[2] not in known:
                raise InputError(f"{model.name!r} has no coefficient {name!r}{did_you_mean(name, known)}")
        if isinstance(model, Model):
            coefficients = [name.rpartition(".")[2] for name in coefficients]
        twice = [name for name in coefficients if list(coefficients).count(name) > 1]
        if twice:
            raise InputError(f"coefficient {twice[0]!r} is named twice")
        found = tuple(coefficients)
    if not found:
        raise InputError(f"{model.name!r} has no coefficients to identify")
    return tuple(found)


def _size(problem: Problem, solution: Solution) -> Array:
    """Return the sizes against which standard errors are held, shape (P,)."""
    return np.maximum(problem.nominal, np.abs(solution.point.p) / 4)


def _blind(problem: Problem, solution: Solution) -> Array:
    size = _size(problem, solution)
    return blind_directions(covariance(solution.information, solution.scores, size), size)


def _held(solver: Solver, p: Array, x0: list[Array], directions: Array) -> Solution:
    """Solve with start values kept along blind directions, until those are the right ones."""
    problem = solver.problem
    for _ in range(3):
        solution = solver.solve(p, x0, stiff_pull(directions, problem.nominal))
        p, x0 = solution.point.p, solution.point.x0
        found = _blind(problem, solution)
        if same_directions(found, directions):
            break
        directions = found
    return solution


def _fitted(
    problem: Problem,
    names: Sequence[str],
    solution: Solution,
    C: Array,
    size: Array,
    directions: Sequence[dict[str, float]],
) -> tuple[Fitted, ...]:
    moving = np.zeros(len(problem.block.inputs), dtype=bool)
    for group in problem.groups:
        moving |= (group.inputs != 0).any(axis=(1, 2))
    fitted = []
    for j, name in enumerate(names):
        signal = problem.block.parameter(problem.names[j])
        std = float(np.sqrt(C[j, j]))
        alone = 1.0 / np.sqrt(max(solution.information[j, j], 1e-300))
        value = float(np.clip(solution.point.p[j], problem.lower[j], problem.upper[j]))
        bound = "lower" if value <= signal.lower else "upper" if value >= signal.upper else ""
        why = reason(
            name,
            std,
            size[j],
            alone,
            directions,
            signal.unit,
            idle_inputs(problem.block, signal.name, moving.tolist()),
        )
        std = std if std < NO_INFORMATION * size[j] else np.inf
        fitted.append(Fitted(name, value, std, signal.unit, signal.start, bound, why))
    return tuple(fitted)
