"""The sampled estimator as a Block: C17's estimator for use in a loop, switched on at a given time.

It writes the step of :mod:`.sampled_step` as equations, so that it compiles and exports with the loop and can
be used in parameter sweeps.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import number, positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal, suffixed, time
from hovercontrol.control.observers.diagonal import diagonal, intensities
from hovercontrol.control.observers.ins.kalman import Equations, Estimate, Memory, remember
from hovercontrol.control.observers.regression import Regression, regression
from hovercontrol.control.observers.sampled_step import (
    Names,
    Values,
    corrected,
    initialised,
    predicted,
    rates,
)


@checked
def sampled_estimator(
    block: Block,
    estimate: Sequence[str] | None = None,
    *,
    period: float | None = None,
    R: ArrayLike = 1e-5,
    Q: ArrayLike = 1e-2,
    P0: ArrayLike = 1e-2,
    start: float = 0.0,
    name: str = "estimator",
) -> Block:
    """Return the discrete Kalman filter of chosen coefficients of a Block.

    Parameters
    ----------
    block : Block
        Its states are measured, under their own names. Its values of the coefficients are the first estimate.
    estimate : sequence of str, optional
        Coefficients to estimate (default: all in which the Block is linear); the others remain parameters of
        the estimator.
    period : float, optional
        Sampling period [s]; default: that of a sampled Block, or 0.01.
    R, Q, P0 : array_like, scalar or shape (n,), (n + m,), (n + m,), optional
        Intensities of the noise of the n measured states (that of a sample has covariance R/period) and of
        the disturbances of those states and of the m coefficients (a period adds covariance Q period);
        initial variances of both. The first n of P0 are not used: the first sample gives the states, with
        covariance R/period.
    start : float, optional
        Time at which it is switched on [s]; until then the estimates are constant.
    name : str, optional

    Returns
    -------
    Block
        Sampled. Inputs: the measured states, and the Block's inputs, each held from its tick to the next.
        Outputs: ``NAME_hat`` for each coefficient, including the sample of the tick. States:
        ``last_xhat[i]``, ``last_P[i,j]``, i <= j, and the last sample.

    Raises
    ------
    InputError
        As :func:`~hovercontrol.control.observers.kalman_bucy`; or if the period is not positive or not that
        of a sampled Block, or the start is not a finite number.

    Examples
    --------
    >>> from hovercontrol.blocks.simulation.sampled import Ticking
    >>> from hovercontrol.craft.models.vehicles import hoverdemon
    >>> prior = hoverdemon().plant().with_values({"plant.thrust": 0.5})
    >>> e = Ticking(sampled_estimator(prior, start=1.0))
    >>> signals = {"v": 0.0, "r": 0.0, "thrust": 2.0, "rudder": 0.0}
    >>> found = [e.tick(k / 100, {"u": k / 100 * 2 / 2.6, **signals})["thrust_hat"] for k in range(400)]
    >>> found[99], round(found[399], 3)
    (0.5, 0.385)
    """
    regression(block, estimate)  # errors name the Block, not the estimator
    model = regression(block.named(name), estimate)
    n, m = model.G.shape
    tick = positive(f"{name}: period", (block.period or 0.01) if period is None else period)
    if block.period and tick != block.period:
        raise InputError(f"{name}: period: expected that of the block, {block.period:g} s, found {tick:g}")
    if not number(f"{name}: start", start) < float("inf"):
        raise InputError(f"{name}: start must be finite, found {start!r}")
    xi = [*model.states, *model.coefficients]
    step = Signal("period", "s", "of the samples, fixed", start=tick, lower=tick, upper=tick)
    since = Signal("start", "s", "when the estimator is switched on", start=float(start))
    started = Signal("begun", "1", "1 once a sample was taken in", lower=0.0, upper=1.0)
    noise, drift = intensities(model.states, xi, R, Q)
    memory = remember("xhat", "P", xi, diagonal("P0", P0, n + m))
    used = set().union(*(e.free_symbols for e in (*model.h, *model.G))) - {time}
    measured = [s for s in block.states if s.symbol in used or s in model.states]
    held = [s for s in block.inputs if s.symbol in used]
    before = {s.symbol: s.replace(name=suffixed(s.name, "before")) for s in (*measured, *held)}
    on, first = (sp.Symbol(key, real=True) for key in ("switched_on", "first_sample"))
    write = Equations()
    names = Names(write)
    write.definitions[on.name] = sp.Piecewise((1, time >= since.symbol), (0, True))
    write.definitions[first.name] = on * (1 - started.symbol)
    new, fresh = _after(model, memory, noise, drift, before, step, names)
    next_values = {
        s.name: sp.Piecewise((fresh[s.name], first > 0), (new[s.name], on > 0), (s.symbol, True))
        for s in memory.states
    }
    # both outputs and next states
    hats = {suffixed(short, "hat"): sp.Symbol(f"now_{short}", real=True) for short in model.names}
    for short, s in zip(model.names, memory.values[n:], strict=True):
        write.definitions[f"now_{short}"] = next_values[s.name]
        next_values[s.name] = sp.Symbol(f"now_{short}", real=True)
    parameters = [p for p in model.block.parameters if p.symbol in used and p not in model.coefficients]
    return Block(
        name,
        states=(started, *memory.states, *before.values()),
        inputs=(*measured, *held),
        outputs=model.hats,
        parameters=(step, since, *noise, *drift, *parameters),
        derivatives={
            "begun": sp.Max(started.symbol, on),
            **next_values,
            **{old.name: now for now, old in before.items()},
        },
        output_expressions=hats,
        definitions=write.definitions,
        period=tick,
    )


def _after(
    model: Regression,
    memory: Memory,
    noise: Sequence[Signal],
    drift: Sequence[Signal],
    before: dict[sp.Symbol, Signal],
    step: Signal,
    names: Names,
) -> tuple[dict[str, sp.Expr], dict[str, sp.Expr]]:
    """Return the next values of the memory by a sample, and by the first sample."""
    x, P = _objects(memory.estimate.x), _objects(memory.estimate.P)
    sample = np.array([s.symbol for s in model.states], dtype=object)
    R = np.array([s.symbol / step.symbol for s in noise], dtype=object)
    Q = np.array(sp.diag(*(s.symbol for s in drift)), dtype=object)
    after = predicted(x, P, *_ends(model, names, before, step.symbol), Q, step.symbol, names)
    new, fresh = (
        memory.next_values(Estimate(sp.Matrix(x), sp.Matrix(P)))
        for x, P in (corrected(*after, sample, R, names), initialised(x, P, sample, R))
    )
    return new, fresh


def _ends(
    model: Regression, names: Names, before: dict[sp.Symbol, Signal], step: sp.Symbol
) -> tuple[Values, Values]:
    """Return ``[h G]`` at the last sample and now, both with the inputs held in between.

    Of a sampled Block both are those of its rates at the last sample.
    """
    inputs = {s.symbol for s in model.block.inputs}
    early = {now: old.symbol for now, old in before.items()}
    late = {now: old for now, old in early.items() if now in inputs} | {time: time}
    early |= {time: time - step}
    table = sp.Matrix([[h, *model.G.row(i)] for i, h in enumerate(model.h)])
    if model.block.period:
        y = np.array([before[s.symbol].symbol for s in model.states], dtype=object)
        once = names.matrix("before", rates(_objects(table.xreplace(early)), y, step))
        return once, once
    was, now = (_objects(table.xreplace(places)) for places in (early, late))
    return names.matrix("before", was), names.matrix("now", now)


def _objects(matrix: sp.Matrix) -> Values:
    """Return a matrix as an array of expressions; a column becomes one-dimensional."""
    return np.array(matrix.tolist() if matrix.cols > 1 else list(matrix), dtype=object)
