"""What a manoeuvre would give: predicted logs, their information, and the manoeuvre of most benefit.

Commands stay within the range of the logs. If the model bounds an input, up to twice that range is used,
within the bounds; a direction that was never driven is not used.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.identification.diagnose.evidence.traces import runs_of, simulate_runs
from hovercontrol.identification.diagnose.experiment.manoeuvres import MANOEUVRES, Manoeuvre, family, reach
from hovercontrol.identification.engine.data import Data
from hovercontrol.identification.engine.fit import Fit, estimate
from hovercontrol.identification.engine.kalman import run_filter
from hovercontrol.identification.engine.measure import Measured
from hovercontrol.identification.engine.noise import augment
from hovercontrol.identification.engine.problem import Problem
from hovercontrol.identification.engine.rows import arrange


@dataclass(frozen=True)
class ProposalCriteria:
    """Settings that decide when a next experiment is proposed.

    No published source: set by hand, exercised by tests/identification/diagnose/test_experiment.py.

    Attributes
    ----------
    sure : float
        Probability that the logs then tell the right one of the rivals at which no longer one is tried.
    worth : float
        Probability that they exclude one of the rivals below which no manoeuvre is proposed.
    badly : float
        Relative standard error above which a coefficient is to be estimated better.
    sharper : float
        Factor by which a manoeuvre must reduce that standard error.
    tick : float
        Shortest time between two commands [s].
    """

    sure: float = 0.95
    worth: float = 0.5
    badly: float = 0.1
    sharper: float = 1.5
    tick: float = 0.02


#: The values in use.
PROPOSAL = ProposalCriteria()

#: Ranges of channels, by name.
Box: TypeAlias = Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class Search:
    """Which manoeuvres are considered.

    Attributes
    ----------
    seed : int
        Of the manoeuvres drawn at random.
    drawn : int
        Number of these.
    within : mapping of str to (float, float)
        Range that a measured channel must not leave: the floor, a largest speed.
    """

    seed: int = 0
    drawn: int = MANOEUVRES.drawn
    within: Box = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Benefit:
    """The benefit of a manoeuvre.

    Attributes
    ----------
    value : float
        What is maximised.
    gain : float
        Expected difference of twice the log likelihood from a rival.
    manoeuvre : Manoeuvre
    seen : Data
        Its predicted log.
    rival : int
        Position of that rival, the one that it tells apart best.
    """

    value: float
    gain: float
    manoeuvre: Manoeuvre
    seen: Data
    rival: int = 0


def best_of(
    fit: Fit,
    benefit: Callable[[Manoeuvre], Benefit | None],
    search: Search,
    lengths: Sequence[float] = (1.0,),
) -> Benefit | None:
    """Return the manoeuvre of most benefit, the shortest one that is sure enough."""
    best: Benefit | None = None
    for part in lengths:
        for manoeuvre in family_of(fit, search):
            found = benefit(manoeuvre.until(part))
            if found and (best is None or (found.value, found.gain) > (best.value, best.gain)):
                best = found
        if best is not None and best.value >= PROPOSAL.sure:
            break
    return best


def stays(seen: Data, within: Box) -> bool:
    """Return whether the channels of a predicted log stay in their ranges."""
    log = seen.logs[0]
    rows = dict(zip(log.channels, log.values, strict=True))
    return all(
        low <= rows[name].min() and rows[name].max() <= high
        for name, (low, high) in within.items()
        if name in rows
    )


def predicted(fit: Fit, manoeuvre: Manoeuvre) -> Data | None:
    """Return the measurements that a fitted model predicts for a manoeuvre, from rest, without noise.

    None if the model diverges.
    """
    like, block = fit.problem.data, fit.problem.block
    n, names = manoeuvre.time.size, [s.name for s in block.states]
    rest = np.repeat(np.array([s.start for s in block.states])[:, None], n, axis=1)
    inputs = np.array([manoeuvre.commands[s.name] for s in block.inputs]).reshape(-1, n)
    whole = ((0, n),)
    empty = Measured(
        manoeuvre.name, manoeuvre.time, 0.0, inputs, like.channels, np.zeros((len(like.channels), n)), rest,
        whole, whole, np.ones(n, dtype=bool), (), n,
    )  # fmt: skip
    problem = Problem(
        fit.model, _data(like, empty, names, fit.problem.period), pieces=fit.problem.usual_pieces
    )
    (found,) = simulate_runs(problem, problem.start, problem.guess, list(runs_of(problem, 0)))
    if not np.isfinite(found[1]).all():
        return None
    return _data(like, replace(empty, states=found[0], values=found[1]), names, fit.problem.period)


def _data(like: Data, log: Measured, states: Sequence[str], period: float) -> Data:
    """Return data that consist of one log."""
    guess = [dict(zip(states, log.states, strict=True))]
    rows = arrange([log], guess, like.channels, period, like.tempo)
    scales = np.ones((1, len(like.channels)))
    return Data((log,), like.channels, like.noise, scales, rows, tempo=like.tempo)


def length(manoeuvre: Manoeuvre) -> str:
    """Return the time that a manoeuvre takes as text."""
    return f"{manoeuvre.time[-1] - manoeuvre.time[0]:.3g} s"


def family_of(fit: Fit, search: Search) -> Sequence[Manoeuvre]:
    """Return the manoeuvres within the range of a fit's logs and the bounds of its model."""
    logs, inputs = fit.problem.logs, fit.problem.block.inputs
    every = np.concatenate([m.inputs for m in logs], axis=1)
    limits = {s.name: reach(s, row) for s, row in zip(inputs, every, strict=True)}
    tempo = fit.problem.tempo
    usual = max(float(np.median(np.diff(logs[0].time))), PROPOSAL.tick * tempo)
    step = fit.problem.period or usual  # a sampled model's predictions have a row for each tick
    return family(limits, step, search.seed, tempo, search.drawn)


def information(fit: Fit) -> Array:
    """Return the information of logs and prior on a fit's unknowns, sum_w S_w + Lambda, shape (P, P)."""
    return np.asarray(fit.S.sum(axis=0) + np.diag(fit.prior.precision))


def followed(fit: Fit, seen: Data) -> Fit:
    """Return a fit of the path alone to another log, with the noise and the coefficients of a fit.

    Raises
    ------
    FloatingPointError
        If the model diverges.
    """
    problem = Problem(fit.model, seen, fit.problem.names, pieces=fit.problem.usual_pieces)
    noise = replace(fit.noise, scale=np.ones((1, len(seen.channels))))
    with np.errstate(all="ignore"):
        own = estimate(problem, fit.prior, noise, frozen=True, levels=False)
    return replace(own, S=np.zeros((len(own.S), *(len(fit.p),) * 2)))  # its linearisation has the unknowns


def added(fit: Fit, seen: Data) -> tuple[float, Array, Array]:
    """Return the misfit of a fitted model to another log, and the normal equations of its unknowns.

    The path is fitted to the log. With the whitened residual w0 and columns W of the unknowns, the result is
    ``|w0|^2``, ``S = W'W`` and ``g = -W'w0``.
    """
    try:
        own = followed(fit, seen)
    except FloatingPointError:
        return np.inf, np.zeros((len(fit.p),) * 2), np.zeros(len(fit.p))
    every = run_filter(augment(own.problem, own.linear, own.noise)).products.sum(axis=0)
    return float(every[0, 0]), every[1:, 1:], -every[1:, 0]


def room(seen: Data) -> str:
    """Return the floor area of a manoeuvre as text."""
    log = seen.logs[0]
    if not {"x", "y"} <= set(log.channels):
        return ""
    wide, deep = (float(np.ptp(log.values[log.channels.index(c)])) for c in ("x", "y"))
    return f" (takes {wide:.0f} m by {deep:.0f} m)"
