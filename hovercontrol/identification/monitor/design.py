"""What determines a monitor: the plant as its filter knows it, its candidates, windows and times."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.control.observers.disturbance import disturbance_name, with_disturbances
from hovercontrol.control.observers.observed import Observed, observed
from hovercontrol.identification.monitor.candidates import Candidate


@dataclass(frozen=True)
class Design:
    """All that determines the equations of a monitor, except the numbers of its parameters.

    Attributes
    ----------
    model : Observed
        Plant, noise and measured channels.
    candidates : tuple of Candidate
    period, dead_after : float
        [s]
    repeats : tuple of str
        Channels of which a value equal to the one before is a sample.
    windows, first : int
        Number of windows, and ticks after which the first begins anew.
    substeps : int
        Runge-Kutta steps per tick.
    settle : float
        Time after the start and after a reset before which the tests do not begin [s].
    outliers_within : float
        Time within which a few outliers of a channel are left out [s].
    unknowns : tuple of Candidate
        Changes of any cause beside which the candidates are judged: accelerations, then offsets of sensors.
    """

    model: Observed
    candidates: tuple[Candidate, ...]
    period: float
    dead_after: float
    repeats: tuple[str, ...]
    windows: int
    first: int
    substeps: int
    settle: float = 2.0
    outliers_within: float = 1.0
    unknowns: tuple[Candidate, ...] = ()

    @property
    def every(self) -> tuple[Candidate, ...]:
        """Candidates, then unknown changes."""
        return (*self.candidates, *self.unknowns)


def estimation_model(
    plant: Block,
    measured: Sequence[str],
    process_noise: Mapping[str, float],
    measurement_noise: Mapping[str, float],
    gusts: Mapping[str, float],
    gust_seconds: float,
    coefficient_std: Mapping[str, float],
    start_std: Mapping[str, float],
    name: str,
    lost_samples: bool | Sequence[str],
) -> Observed:
    """Return the plant as the filter knows it.

    Gusts are Ornstein-Uhlenbeck accelerations of standard deviation sigma and correlation time tau: states
    ``d' = -d/tau + w`` with the intensity ``2 sigma^2/tau``. Added to the next values of a sampled plant of
    period h they have ``d+ = exp(-h/tau) d + w``, of variance ``sigma^2 (1 - exp(-2 h/tau))``. Uncertain
    coefficients are constant states.
    """
    # The filter learns uncertain coefficients; its innovations stay white for every value of them.
    noise, start = dict(process_noise), dict(start_std)
    block = _with_uncertain(plant, coefficient_std, name)
    start |= {_short(key): std for key, std in coefficient_std.items()}
    if gusts:
        block = with_disturbances(block, list(gusts), correlation_time=gust_seconds)
        for state, sigma in gusts.items():
            d = disturbance_name(state)
            share = -math.expm1(-2.0 * block.period / gust_seconds) if block.period else 2.0 / gust_seconds
            noise[d] = sigma * share**0.5
            start[d] = sigma
    return observed(
        block, measured, noise, measurement_noise, start, name, continuous=False, lost_samples=lost_samples
    )


def _short(key: str) -> str:
    return key.rpartition(".")[2]


def _with_uncertain(plant: Block, std: Mapping[str, float], name: str) -> Block:
    """Return a plant some of whose parameters are constant states."""
    states, swap = [], {}
    known = {_short(p.name): p for p in plant.parameters}
    for key in std:
        if _short(key) not in known:
            raise InputError(
                f"{name}: coefficient_std: unknown coefficient {key!r}{did_you_mean(key, known)}"
            )
        p = known[_short(key)]
        s = p.replace(name=_short(key), lower=-sp.oo, upper=sp.oo)
        states.append(s)
        swap[p.symbol] = s.symbol

    def swapped(expressions: Mapping[str, sp.Expr]) -> Expressions:
        return Expressions((k, e.xreplace(swap)) for k, e in expressions.items())

    if not states:
        return plant
    return Block(
        plant.name,
        states=(*plant.states, *states),
        inputs=plant.inputs,
        outputs=plant.outputs,
        parameters=tuple(p for p in plant.parameters if p.symbol not in swap),
        derivatives=Expressions(
            [
                *swapped(plant.derivatives).items(),
                *((s.name, s.symbol if plant.period else 0 * s.symbol) for s in states),
            ]
        ),
        output_expressions=swapped(plant.output_expressions),
        definitions=swapped(plant.definitions),
        definition_signals=plant.definition_signals,
        period=plant.period,
    )
