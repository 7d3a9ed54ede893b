"""Identification: the coefficients of a model from logs, by maximum likelihood under process noise.

A thin layer on :mod:`hovercontrol.identification.engine`. Effects that the equations lack are modelled as
process noise: an unknown acceleration in each equation, whose estimated size shows how incomplete the model
is. :mod:`hovercontrol.identification.identify.trust` checks how far the coefficients of an incomplete model
can be trusted.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import overload

import numpy as np
from scipy import stats
from threadpoolctl import threadpool_limits

from hovercontrol.base.arguments import at_least
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.craft.models.functions import TableFunction
from hovercontrol.craft.models.interface import AnyModel, as_model
from hovercontrol.fmi.replay.plant import FmuPlant
from hovercontrol.identification.diagnose.checks.units import refuse_units
from hovercontrol.identification.diagnose.coefficients import Reading
from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.search.base import base_fit, likelier_start
from hovercontrol.identification.diagnose.unknown.tables import (
    constants,
    fitted_functions,
    sizes,
    tabulated,
    with_constants,
)
from hovercontrol.identification.engine.data import Data, gather
from hovercontrol.identification.engine.excitation import Excitation
from hovercontrol.identification.engine.fit import Fit, refit, scored
from hovercontrol.identification.engine.frame_check import check_frame
from hovercontrol.identification.engine.measure import MOST_ROWS, Measured, angles, measure, refuse_still
from hovercontrol.identification.engine.noise import averaging_time
from hovercontrol.identification.engine.prior import prior_of
from hovercontrol.identification.engine.subject import named, with_known_period
from hovercontrol.identification.identify.fmu import FmuIdentified, identify_fmu
from hovercontrol.identification.identify.predict import prediction
from hovercontrol.identification.identify.remaining import remaining
from hovercontrol.identification.identify.result import Fitted, Identified
from hovercontrol.identification.identify.subject import chosen
from hovercontrol.identification.identify.trust import trust
from hovercontrol.logs import Log
from hovercontrol.logs.codes import code_faults
from hovercontrol.logs.prepare import prepared
from hovercontrol.logs.scales import scale_faults


@overload
def identify(
    model: AnyModel,
    logs: Sequence[Log | Measured],
    coefficients: Sequence[str] | None = None,
    *,
    fixed: Sequence[str] = (),
    most_rows: int = MOST_ROWS,
    progress: Callable[[float, str], None] | None = None,
) -> Identified: ...


@overload
def identify(
    model: FmuPlant,
    logs: Sequence[Log],
    coefficients: Sequence[str] | None = None,
    *,
    fixed: Sequence[str] = (),
    most_rows: int = MOST_ROWS,
    progress: Callable[[float, str], None] | None = None,
) -> FmuIdentified: ...


@checked
def identify(
    model: AnyModel | FmuPlant,
    logs: Sequence[Log | Measured] | Sequence[Log],
    coefficients: Sequence[str] | None = None,
    *,
    fixed: Sequence[str] = (),
    most_rows: int = MOST_ROWS,
    progress: Callable[[float, str], None] | None = None,
) -> Identified | FmuIdentified:
    """Estimate coefficients of a model from logs.

    Parameters that the logs determine only together (a gain over a mass) keep about their values, and the
    product or sum that is determined is a row of its own (``found["k/m"]``).

    Parameters
    ----------
    model : Model, BlockModel, Block or FmuPlant
        Its current values are the initial values of the fit. A Block is fitted as a BlockModel without
        effects. An FMU (:func:`hovercontrol.fmu_plant`) is fitted by output error, through its events
        (:mod:`hovercontrol.fmi.replay.output_error`).
    logs : sequence of Log
        One or several, each with the model's inputs and pose (``x, y, psi``), body velocities
        (``u, v, r``), both, or any other states or outputs of the Block. Logs that were already prepared by
        :func:`~hovercontrol.identification.engine.measure.measure` are used unchanged.
    coefficients : sequence of str, optional
        Names of parameters, including shape parameters (``yaw_coulomb_width``). By default all parameters of
        a Block, linear or not; of a craft its linear coefficients. Of an FMU: its parameters, by default
        those of its ``fit``.
    fixed : sequence of str, optional
        Names of parameters that keep their values: a known gravity, a mass that was weighed, the period of a
        sampled Block.
    most_rows : int, optional
        Maximum number of rows of all logs together. Longer logs are reduced to evenly spaced stretches. All
        rows are used for an FMU.
    progress : callable, optional
        Called with the finished fraction (0 to 1) and a text on the current step.

    Returns
    -------
    Identified, or of an FMU :class:`~hovercontrol.identification.identify.fmu.FmuIdentified`

    Raises
    ------
    InputError
        If there is no log, a coefficient or an input is unknown, a log contains no motion, has too few rows
        or too large time steps, or the model's simulation diverges.

    Examples
    --------
    >>> from hovercontrol.blocks.signals import Signal
    >>> v, k = Signal("v", "m/s"), Signal("k", "1/s", start=1.0)
    >>> decay = Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol})
    >>> t = np.linspace(0, 2, 101)
    >>> found = identify(decay, [Log("demo", t, {"v": np.exp(-0.7 * t)})])
    >>> round(found["k"].value, 4)
    0.7
    """
    report = progress or (lambda part, what: None)
    if isinstance(model, FmuPlant):
        own = [log for log in logs if isinstance(log, Log)]
        if len(own) < len(logs):
            raise InputError(f"{model.name}: an FMU is fitted to logs, found prepared measurements")
        return identify_fmu(model, own, coefficients, fixed=fixed, progress=progress)
    model, assumed = with_known_period(as_model(model), coefficients, fixed)
    for line in assumed:
        warnings.warn(line, stacklevel=3)
    given, tables = model, constants(model)
    model, filled = with_constants(model), [p for t in tables for p in t.parameters]
    names, kept = chosen(model, coefficients, fixed, filled), named(model, fixed)
    if not logs:
        raise InputError("identification needs at least one log")
    if model.is_craft:
        refuse_other_units(logs)
    report(0.0, "reading the measurements")
    measured = measure_shared(model, logs, most_rows)
    with threadpool_limits(1, "blas"):  # with many small matrices BLAS threads would wait for each other
        data = gather(model, measured).joined
        if tables and isinstance(given, BlockModel):
            fit, tables = _with_functions(given, data, names, report)
            model, names = fit.problem.model, fit.problem.names
        else:
            fit = _fitted(model, data, names, report)
        found = _identified(model, names, kept, data, fit, tables, report)
    report(1.0, "done")
    return found


@checked
def measure_shared(model: AnyModel, logs: Sequence[Log | Measured], most_rows: int) -> list[Measured]:
    """Return the measurements of each log, at most `most_rows` rows in total; prepared ones are unchanged.

    Raises
    ------
    InputError
        As :func:`~hovercontrol.identification.engine.measure.measure`, or if a craft never moves.
    """
    subject = as_model(model)
    block = subject.plant()
    at_least("most_rows", most_rows, least=1)
    total = sum(len(log) for log in logs if isinstance(log, Log))
    found = []
    for log in logs:
        if not len(log.time):
            raise InputError(f"{log.name}: expected samples, found no rows")
        if isinstance(log, Log):
            log = _told(block, log)
            refuse_units(subject, log)
            check_frame(subject, log)
        own = log if isinstance(log, Measured) else measure(block, log, _share(log, total, most_rows))
        refuse_still(own.name, own.channels, own.values)
        found.append(own)
    return found


def _told(block: Block, log: Log) -> Log:
    """Return a log prepared for a fit, warning of each change; raise if it has codes for missing values."""
    inputs = [s.name for s in block.inputs if log.has(s.name)]
    seen = dict.fromkeys(s.name for s in (*block.outputs, *block.states) if log.has(s.name))
    channels = [name for name in seen if name not in inputs]
    for fault in code_faults(log, [*channels, *inputs]):
        raise InputError(fault)
    log, said = prepared(log, channels, inputs, angles(block))
    for line in said:
        warnings.warn(line, stacklevel=4)
    return log


def _share(log: Log, total: int, most_rows: int) -> int:
    return len(log) if total <= most_rows else int(most_rows * len(log) / total)


def refuse_other_units(logs: Sequence[Log | Measured]) -> None:
    """Raise if logs of a craft are not in SI units: time steps too large, or motion too fast for a craft.

    Raises
    ------
    InputError
        The message names the log.
    """
    for log in logs:
        for fault in scale_faults(log if isinstance(log, Log) else Log(log.name, log.time, {})):
            raise InputError(fault)


def _fitted(
    model: AnyModel,
    data: Data,
    names: Sequence[str],
    report: Callable[[float, str], None],
) -> Fit:
    subject = as_model(model)
    passes = [0]

    def passed(_: str) -> None:
        passes[0] += 1
        report(0.7 * (1 - 1 / (1 + passes[0] / 8)), "fitting")

    try:
        found = _without_noise(likelier_start(base_fit(subject, data, names, passed), passed), passed)
        return scored(found, prior_of(found.problem, subject))
    except FloatingPointError as error:
        raise InputError(f"{model.name!r}: {error}: try other start values") from error


def _with_functions(
    model: BlockModel, data: Data, names: Sequence[str], report: Callable[[float, str], None]
) -> tuple[Fit, tuple[TableFunction, ...]]:
    done = [0]

    def said(what: str) -> None:
        done[0] += 1
        report(0.7 * (1 - 0.7 ** done[0]), what)

    try:
        return tabulated(model, data, names, said)
    except FloatingPointError as error:
        raise InputError(f"{model.name!r}: {error}: try other start values") from error


def _without_noise(fit: Fit, passed: Callable[[str], None]) -> Fit:
    """Return the fit without process noise if all of it is negligible and not significant.

    At the bound 0 of one noise level twice the log likelihood ratio is half a chi-squared (Self and Liang,
    JASA 82 (1987)); the level is 5 %.
    """
    if not np.any(fit.noise.process) or np.any(CRITERIA.left(fit)):
        return fit
    none = replace(fit.noise, process=np.zeros_like(fit.noise.process))
    try:
        found = refit(fit, fit.problem, fit.prior, noise=none, trace=passed)
    except FloatingPointError:
        return fit
    return found if found.cost - fit.cost < stats.chi2.isf(0.1, 1) else fit


def _identified(
    model: AnyModel,
    names: Sequence[str],
    fixed: Sequence[str],
    data: Data,
    fit: Fit,
    tables: Sequence[TableFunction],
    report: Callable[[float, str], None],
) -> Identified:
    problem, subject = fit.problem, as_model(model)
    shown = Excitation(fit, sizes(fit, tables))
    other = trust(fit, np.sqrt(np.diag(shown.covariance)), fixed, lambda what: report(0.8, what))
    readings = [other.readings.get(name, ()) for name in names]
    found = tuple(_coefficient(fit, shown, j, readings[j]) for j in range(len(names)))
    values = problem.coefficients(fit.p)
    starts = dict(zip(shown.labels, problem.start.tolist(), strict=True))
    new = subject.with_coefficients(values)
    channels, logs = problem.rows.channels, problem.logs
    out = (np.isfinite(data.rows.values) & ~problem.seen).any(axis=2)
    used = problem.seen.sum(axis=(0, 1))
    return Identified(
        model=new,
        block=new.plant(),
        coefficients=found,
        covariance=shown.covariance,
        unexcited=shown.directions,
        remaining=remaining(fit),
        ahead=prediction(fit, averaging_time(fit.problem)).share,
        units={c: problem.block.signal(c).unit for c in channels},
        residual=dict(zip(channels, fit.noise.measured.tolist(), strict=True)),
        noise=dict(zip(channels, data.noise.tolist(), strict=True)),
        # sum over the channels c of n_c (residual_c / noise_c)^2 / sum of n_c, n_c samples used
        chi2_per_dof=float(used @ (fit.noise.measured / data.noise) ** 2 / used.sum()),
        rows=int(problem.seen.any(axis=2).sum()),
        rows_total=sum(m.rows_total for m in logs),
        outliers=int(out.sum()),
        rejected=sum(span.rows for m in logs for span in m.rejected),
        down_weighted=int(problem.data.down_weighted.any(axis=2).sum()),
        logs=tuple(m.name for m in logs),
        converged=fit.converged,
        fit=fit,
        missing=other.effects,
        gain=other.gain,
        groups=tuple(
            Fitted(g.name, g.value, g.std, g.unit, g.of(starts), noise_std=g.std) for g in shown.groups
        ),
        kept=_kept(fit, fixed),
        functions=fitted_functions(fit, tables, shown.covariance),
    )


def _kept(fit: Fit, fixed: Sequence[str]) -> tuple[Fitted, ...]:
    """Return the coefficients that the fit did not estimate, each with the reason."""
    problem = fit.problem
    free = problem.model.free_coefficients()
    shapes = {e.parameter(k) for e in problem.model.effects for k in e.numbers}
    found = []
    for name, value in problem.model.coefficients().items():
        if name in problem.names or name in problem.same:
            continue
        signal = problem.block.parameter(name)
        why = "by you" if name in fixed or name in free else "shape of an effect: fitted if named"
        why = why if name in free or name in shapes else "the sampling period"
        why, unit = why if signal.lower < signal.upper else "its bounds leave one value", signal.unit
        found.append(Fitted(name.rpartition(".")[2], value, 0.0, unit, value, kept=why))
    return tuple(found)


def _coefficient(fit: Fit, shown: Excitation, j: int, readings: tuple[Reading, ...]) -> Fitted:
    problem, value, std = fit.problem, float(fit.p[j]), float(shown.std[j])
    unit = problem.block.parameter(problem.names[j]).unit
    start = problem.model.coefficients()[problem.names[j]]
    bound = "lower" if value <= problem.lower[j] else "upper" if value >= problem.upper[j] else ""
    # Standard error: sqrt(noise_std^2 + max over the readings of (reading - value)^2).
    wide = math.hypot(std, max((abs(r.value - value) for r in readings), default=0.0))
    return Fitted(shown.labels[j], value, wide, unit, start, bound, shown.reason(j), std, readings)
