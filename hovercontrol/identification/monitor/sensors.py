"""Lost, repeated and outlying samples of a monitor's measured channels, as equations of its Block.

A sample is used if it is marked as present, differs from the sample before (of a sensor that is not coarse),
and is not an outlier: an innovation of more than :data:`GATE` standard deviations, unless :data:`MOST` of
them were left out within a given time, since a change is then likelier than so many outliers. A sensor is
dead if no new sample has come for a given time.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
import sympy as sp

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.observers.filter_equations import expected
from hovercontrol.control.observers.ins.kalman import Equations, Estimate, wrapped
from hovercontrol.control.observers.observed import Observed
from hovercontrol.identification.engine.measure import steps

#: Standard deviations of its innovation beyond which a sample is an outlier; noise exceeds it once in 2 10^6.
GATE = 5.0

#: Outliers of a channel that are left out within the given time.
MOST = 3

#: Variance of rounding from which on a sensor is coarse, as a part of that of its noise: evidence is then
#: 10 % larger.
ROUNDED = 0.1


@dataclass(frozen=True)
class Sensors:
    """What the check of samples adds to the monitor's Block.

    Attributes
    ----------
    observed : Observed
        The estimation model with the samples that are used.
    states : tuple of Signal
    next_values : dict of str to sympy.Expr
    many : list of sympy.Expr
        1 for each channel with so many outliers within the given time that none is left out.
    jump : sympy.Expr
        1 at the first outlier within the given time: a sensor may have changed there.
    dead : list of sympy.Expr
        1 for each channel whose sensor is dead.
    """

    observed: Observed
    states: tuple[Signal, ...]
    next_values: dict[str, sp.Expr]
    many: list[sp.Expr]
    jump: sp.Expr
    dead: list[sp.Expr]


def rounded_to(samples: Array, std: float) -> float:
    """Return the resolution q of a coarse sensor: the smallest change of its samples; 0 if it is not coarse.

    It is coarse if the variance ``q^2/12`` of rounding is more than :data:`ROUNDED` of that of its noise.

    Parameters
    ----------
    samples : ndarray
        Not a number where there is none.
    std : float
        Standard deviation of the noise.
    """
    q = float(steps(samples[np.isfinite(samples)]).min(initial=math.inf))
    return q if math.isfinite(q) and q**2 / 12.0 > ROUNDED * std**2 else 0.0


def check_samples(
    model: Observed,
    write: Equations,
    prior: Estimate,
    seconds: float,
    within: float,
    period: sp.Expr,
    dead_after: sp.Expr,
    *,
    repeats: Collection[str],
) -> Sensors:
    """Write which samples are used and which sensors are dead.

    Parameters
    ----------
    prior : Estimate
        Before the measurement update.
    seconds : float
        Time between two ticks [s].
    within : float
        Time within which :data:`MOST` outliers are left out [s], of more than :data:`MOST` ticks.
    period, dead_after : sympy.Expr
        Time between two ticks, and time without a new sample after which a sensor is dead [s].
    repeats : collection of str
        Channels of which a value equal to the one before is a sample.
    """
    h, H = expected(model, write, prior.x)
    states: list[Signal] = []
    following: dict[str, sp.Expr] = {}
    used, many, dead, first = [], [], [], []
    for i, s in enumerate(model.measured):
        last = Signal(f"last[{i}]", s.unit, f"last value of {s.name}")
        silent = Signal(f"silent[{i}]", "s", f"time without a new sample of {s.name}")
        left_out = Signal(f"left_out[{i}]", "1", f"outliers of {s.name} left out lately")
        states += [last, silent, left_out]
        present = model.fresh[i] > sp.S.Half
        if s.name not in repeats:
            present = sp.And(present, sp.Abs(s.symbol - last.symbol) > 0)
        received = write.define(f"received[{i}]", sp.Piecewise((1, present), (0, True)))
        difference = s.symbol - h[i]
        away = wrapped(difference) if s.unit == "rad" else difference
        variance = (H[i, :] * prior.P * H[i, :].T)[0] + model.noise[i].symbol ** 2
        spent = sp.Piecewise((1, left_out.symbol > MOST - 1), (0, True))
        many.append(write.define(f"many[{i}]", spent))
        outlier = write.define(
            f"outlier[{i}]",
            sp.Piecewise(
                (0, received < sp.S.Half),
                (0, many[-1] > sp.S.Half),
                (1, away**2 > GATE**2 * variance),
                (0, True),
            ),
        )
        first.append(sp.Piecewise((outlier, left_out.symbol <= 0), (0, True)))
        one = Signal(f"used[{i}]", "1", f"1 if the sample of {s.name} is used")
        write.define(one.name, received - outlier)
        used.append(one)
        quiet = write.define(
            f"quiet[{i}]", sp.Piecewise((0 * period, received > sp.S.Half), (silent.symbol + period, True))
        )
        dead.append(write.define(f"dead_{s.name}", sp.Piecewise((1, quiet >= dead_after), (0, True))))
        following |= {
            last.name: sp.Piecewise((s.symbol, model.fresh[i] > sp.S.Half), (last.symbol, True)),
            silent.name: quiet,
            left_out.name: sp.Max(0, left_out.symbol - sp.Float(MOST * seconds / within)) + outlier,
        }
    jump = write.define("jump", sp.Max(*first))
    return Sensors(replace(model, lost=tuple(used)), tuple(states), following, many, jump, dead)
