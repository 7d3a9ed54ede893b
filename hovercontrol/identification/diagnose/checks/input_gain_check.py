"""Check of fitted input gains against the model's: inputs in other units or of opposite sign."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.identification.engine.excitation import inputs_beside
from hovercontrol.identification.engine.fit import Fit


@dataclass(frozen=True)
class InputGainCriteria:
    """Settings that decide when the gain of an input differs so much that its unit or sign must be wrong.

    No published source: set by hand, exercised by tests/identification/diagnose/test_checks.py. A missing
    effect may reduce a gain to nearly nothing, but never with so small a standard error.

    Attributes
    ----------
    far : float
        Ratio of the fitted gain to the model's gain, or its inverse, above which the unit is taken as wrong.
    opposite : float
        Ratio below which the sign is taken as wrong.
    known : float
        Maximum relative standard error of the fitted gain.
    slight : float
        A coefficient with less than this fraction of the effect of the largest one is not checked.
    """

    far: float = 20.0
    opposite: float = -0.5
    known: float = 0.02
    slight: float = 0.1


#: The values in use.
INPUT_GAIN = InputGainCriteria()


def refuse_gains(base: Fit) -> None:
    """Refuse inputs whose fitted gain is far smaller, far larger or opposite to the model's.

    Parameters
    ----------
    base : Fit
        Fit of the given model.

    Raises
    ------
    InputError
        If the coefficient of an input is well known, and 20 times as large or as small as the model's or
        about its opposite: its column is in another unit or of opposite sign.
    """
    problem, std = base.problem, np.sqrt(np.diag(base.covariance))
    own = [problem.names.index(n) for n in problem.model.free_coefficients() if n in problem.names]
    if not any(_is_far(base.p[j], problem.start[j], std[j]) for j in own):
        return
    S = base.S.sum(axis=0)
    beside = {j: inputs_beside(problem.block, problem.block.parameter(problem.names[j]).name) for j in own}
    # effect of a coefficient on the whitened residual: S_jj^(1/2) |given value|
    does = {j: float(np.sqrt(S[j, j]) * abs(problem.start[j])) for j in own if beside[j]}
    main = [j for j, much in does.items() if much > INPUT_GAIN.slight * max(does.values())]
    far = {j: beside[j] for j in main if _is_far(base.p[j], problem.start[j], std[j])}
    if not far:
        return
    first = min(far, key=lambda j: len(far[j]))
    shared = [n for n in far[first] if all(n in inputs for inputs in far.values())] or far[first]
    units = {s.name: "" if s.unit == "1" else f" ({s.unit})" for s in problem.block.inputs}
    columns = " and ".join(f"{n!r}{units[n]}" for n in shared)
    logs, name = ", ".join(m.name for m in problem.logs), problem.names[first]
    raise InputError(
        f"{logs}: {name} would be {base.p[first]:.3g} {problem.block.parameter(name).unit}, the model has "
        f"{problem.start[first]:.3g}: {'are columns' if len(shared) > 1 else 'is column'} {columns} in the "
        "model's units, and of its sign (--columns NAME=COLUMN:-UNIT turns it)? If so, the model is far off: "
        "fit it first (hovercontrol identify)"
    )


def _is_far(value: float, given: float, std: float) -> bool:
    if given == 0.0 or std > INPUT_GAIN.known * abs(value):
        return False
    times = value / given
    return bool(times > INPUT_GAIN.far or abs(times) < 1.0 / INPUT_GAIN.far or times < INPUT_GAIN.opposite)
