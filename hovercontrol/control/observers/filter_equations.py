"""Equations shared by the Kalman filters: their states, the measurement update and the resulting Block."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.derivatives import partial_derivatives
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.blocks.units import simplified
from hovercontrol.control.observers.ins.kalman import Correction, Equations, Estimate, wrapped
from hovercontrol.control.observers.observed import Observed, measured_expressions
from hovercontrol.control.observers.propagation import written_at


def filter_states(model: Observed) -> tuple[Signal, ...]:
    """Return a filter's states: the estimate and the upper triangle of its covariance."""
    plant, variances = model.plant.states, [v**2 for v in model.start_std]
    n = len(plant)
    values = tuple(
        s.replace(name=f"xhat[{i}]", description=f"estimate of {s.name}", lower=-sp.oo, upper=sp.oo)
        for i, s in enumerate(plant)
    )
    covariance = tuple(
        Signal(
            f"P[{i},{j}]",
            simplified(f"({plant[i].unit})*({plant[j].unit})"),
            f"covariance of the errors of {plant[i].name} and {plant[j].name}",
            start=variances[i] if i == j else 0.0,
        )
        for i in range(n)
        for j in range(i, n)
    )
    return (*values, *covariance)


def estimate_of(states: Sequence[Signal], n: int) -> Estimate:
    """Return the n estimates and their covariance, in the symbols of a filter's states."""
    upper = {s.name: s.symbol for s in states[n:]}
    P = sp.Matrix(n, n, lambda i, j: upper[f"P[{min(i, j)},{max(i, j)}]"])
    return Estimate(sp.Matrix([s.symbol for s in states[:n]]), P)


def expected(model: Observed, write: Equations, x: sp.Matrix) -> tuple[list[sp.Expr], sp.Matrix]:
    """Return the expected measurements h and H = dh/dx, both at the estimate x."""
    plant = measured_expressions(model.plant, model.measured)
    entries = partial_derivatives(plant, "outputs", [s.name for s in plant.states])
    values = list(plant.output_expressions.values())
    swap = written_at(plant, write, "expected", list(x), time, [*values, *entries.values()])
    H = sp.Matrix(len(values), x.rows, lambda i, j: entries.get((i, j), sp.S.Zero).xreplace(swap))
    h = [write.define(f"expected_output[{i}]", e.xreplace(swap)) for i, e in enumerate(values)]
    return h, write.matrix("H", H)


def innovations(model: Observed, write: Equations, h: Sequence[sp.Expr]) -> list[sp.Expr]:
    """Return the innovations y - h; angles are wrapped to -pi ... pi, and 0 stands for no sample."""
    every = []
    for i, (s, expected) in enumerate(zip(model.measured, h, strict=True)):
        difference = s.symbol - expected
        turned = wrapped(difference) if s.unit == "rad" else difference
        seen = sp.Piecewise((turned, model.fresh[i] > sp.S.Half), (0, True))
        every.append(write.define(f"innovation[{i}]", seen))
    return every


def shares(model: Observed) -> list[sp.Expr]:
    """Return a factor for each measurement: 1 with a sample, else 0."""
    return [sp.Piecewise((1, fresh > sp.S.Half), (0, True)) for fresh in model.fresh]


def corrections(model: Observed, write: Equations, prior: Estimate) -> list[Correction]:
    """Write the measurement update; return the update by each measurement, in order.

    Scalar measurements are processed one after the other. All are linearised at the prediction x0, so the
    result equals that of one update with the whole vector. With x the estimate after the first k - 1
    measurements, the innovation of the k-th is ``y_k - h_k(x0) - H_k (x - x0)``.
    """
    h, H = expected(model, write, prior.x)
    estimate, every = prior, []
    for i, first in enumerate(innovations(model, write, h)):
        row = H[i, :]
        moved = (row * (estimate.x - prior.x))[0] if i else sp.S.Zero
        variance = model.noise[i].symbol ** 2
        one = write.correct(f"measured_{i}", estimate, row, first - moved, variance, model.fresh[i])
        estimate = one.estimate
        every.append(one)
    return every


def corrected(model: Observed, write: Equations, prior: Estimate) -> Estimate:
    """Write the measurement update (:func:`corrections`); return the estimate after it."""
    return corrections(model, write, prior)[-1].estimate


def sampled_block(
    model: Observed,
    states: Sequence[Signal],
    write: Equations,
    now: Estimate,
    then: Estimate,
    step: Signal,
) -> Block:
    """Return the sampled Block whose outputs are the estimate `now` and whose next states are `then`."""
    n = then.P.rows
    upper = [then.P[i, j] for i in range(n) for j in range(i, n)]
    return Block(
        model.name,
        states=tuple(states),
        inputs=model.inputs,
        outputs=(*model.estimates, *model.deviations),
        parameters=(step, *model.parameters),
        derivatives={s.name: e for s, e in zip(states, [*then.x, *upper], strict=True)},
        output_expressions=model.output_values(list(now.x), now.P),
        definitions=write.definitions,
        period=step.start,
    )
