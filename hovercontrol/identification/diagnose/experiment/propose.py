"""The next experiment: commands that distinguish rivals, or reduce a large standard error.

Commands stay within the range of the logs. If the model bounds an input, up to twice that range is used,
within the bounds; a direction that was never driven is not used.

Every manoeuvre of a family is simulated with one rival as the truth. The other rival is fitted to this
simulation and to the information of the logs so far. The misfit that remains is the expected evidence of the
added log; the smaller one of both directions counts. This is the discrimination design of Atkinson and
Fedorov, Biometrika 62, 1975, over a family instead of a continuum. With what the logs say so far it gives the
probability that the right one will be ahead; short manoeuvres are tried first, longer ones if none is sure.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from scipy.stats import norm

from hovercontrol.base.arrays import Array
from hovercontrol.base.percent import percent
from hovercontrol.craft.effects.law import is_law
from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.evidence.traces import runs_of, simulate_runs
from hovercontrol.identification.diagnose.experiment.manoeuvres import MANOEUVRES, Manoeuvre, family, reach
from hovercontrol.identification.diagnose.experiment.proposal import Experiment
from hovercontrol.identification.diagnose.search.confirm import Selection
from hovercontrol.identification.diagnose.unknown.forms import rivals_of
from hovercontrol.identification.diagnose.unknown.function import FittedFunction
from hovercontrol.identification.engine.data import Data
from hovercontrol.identification.engine.fit import Fit, estimate
from hovercontrol.identification.engine.kalman import run_filter
from hovercontrol.identification.engine.measure import Measured
from hovercontrol.identification.engine.noise import augment
from hovercontrol.identification.engine.passes import inverse
from hovercontrol.identification.engine.problem import Problem
from hovercontrol.identification.engine.rows import arrange

if TYPE_CHECKING:
    from hovercontrol.identification.diagnose.diagnosis import Found


@dataclass(frozen=True)
class ProposalCriteria:
    """Settings that decide when a next experiment is proposed.

    No published source: set by hand, exercised by tests/identification/diagnose/test_experiment.py.

    Attributes
    ----------
    sure : float
        Probability that the logs then tell the right one of the rivals at which no longer one is tried.
    worth : float
        The same probability below which no manoeuvre is proposed.
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

#: Fractions of the manoeuvres that are tried in turn until one is sure enough, and most rivals considered.
LENGTHS, RIVALS = (1 / 16, 1 / 4, 1.0), 8

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


def next_experiment(
    selection: Selection,
    effects: Sequence[Found],
    functions: Sequence[FittedFunction] = (),
    search: Search | None = None,
) -> tuple[Experiment | None, str]:
    """Return the next experiment and a sentence on it; None and an empty text if none is needed.

    Parameters
    ----------
    effects : sequence of Found
        Parameters of the named effects.
    functions : sequence of FittedFunction, optional
        Unknown functions, with their forms.
    search : Search, optional
        The manoeuvres.
    """
    final, search = selection.final, search or Search()
    # twins shift every log alike; laws that are the same in these logs may differ in others
    apart = sorted((r for r in selection.rivals if not r.same or is_law(r.name)), key=lambda r: r.same)
    if apart:
        name = apart[0].instead_of
        others = [Other(r.fit, r.name, r.behind) for r in apart if r.instead_of == name]
        return _proposed(separate(final, name, others, search=search))
    for f in functions:
        best, rivals = f.forms[0], rivals_of(f)
        others = [Other(r.fit, r.text, 2.0 * math.log(best.odds(r))) for r in rivals]
        if others:
            return _proposed(separate(best.fit, f"{f.name} = {best.text}", others, search=search))
    if selection.rivals:
        return None, same_time((selection.rivals[0].instead_of, selection.rivals[0].name))
    numbers = [
        n
        for n in effects
        if abs(n.std) > PROPOSAL.badly * abs(n.value) and n.parameter in final.problem.names
    ]
    if not numbers:
        return None, ""
    worst = max(numbers, key=lambda n: abs(n.std) / max(abs(n.value), 1e-12))
    sharper = sharpen(final, worst.parameter, search=search)
    return sharper, sharper.text if sharper else ""


def _proposed(found: Experiment | str) -> tuple[Experiment | None, str]:
    return (None, found) if isinstance(found, str) else (found, found.text)


@dataclass(frozen=True, eq=False)
class Other:
    """A model that the logs so far do not tell from the likeliest one.

    Attributes
    ----------
    fit : Fit
    name : str
    behind : float
        By how much the likeliest one is ahead of it, in twice the log likelihood.
    """

    fit: Fit
    name: str
    behind: float = 0.0


def separate(
    one: Fit, name: str, others: Sequence[Other], *, search: Search | None = None
) -> Experiment | str:
    """Return the shortest manoeuvre that surely tells a model from others, or why there is none.

    Parameters
    ----------
    one : Fit
        Fit of the likeliest model to the logs so far.
    name : str
        Its name.
    others : sequence of Other
        Of which the likeliest few are considered.
    search : Search, optional
        The manoeuvres.
    """
    search = search or Search()
    others = sorted(others, key=lambda o: o.behind)[:RIVALS]
    weights = np.exp([-0.5 * max(o.behind, 0.0) for o in others])

    def benefit(manoeuvre: Manoeuvre) -> Benefit | None:
        mine = predicted(one, manoeuvre)
        if mine is None or not _stays(mine, search.within):
            return None
        gains = []
        for o in others:
            theirs, gain = predicted(o.fit, manoeuvre), _left(o.fit, mine)
            if theirs is not None and not _stays(theirs, search.within):
                return None
            gains.append(gain if theirs is None else min(gain, _left(one, theirs)))
        sure = [assurance(gain, o.behind) for gain, o in zip(gains, others, strict=True)]
        return Benefit(float(np.average(sure, weights=weights)), gains[0], manoeuvre, mine)

    best = _best(one, benefit, search, LENGTHS)
    second = others[0].name
    if best is None or best.value < PROPOSAL.worth:
        found = f" ({percent(best.value)} sure, by {best.manoeuvre.name})" if best else ""
        return f"no manoeuvre within the limits distinguishes {name} from {second}{found}"
    text = (
        f"Drive {best.manoeuvre.text}, {_length(best.manoeuvre)}{_room(best.seen)}: {name} and {second} then "
        f"differ by about {best.gain:.3g} in twice the log likelihood, and with {percent(best.value)} "
        "probability the logs tell the right one."
    )
    return Experiment(
        best.manoeuvre.name, text, best.manoeuvre.time, best.manoeuvre.commands, best.gain, best.value
    )


@dataclass(frozen=True, eq=False)
class Benefit:
    """The benefit of a manoeuvre.

    Attributes
    ----------
    value : float
        What is maximised.
    gain : float
        Expected difference of twice the log likelihood from the likeliest rival.
    manoeuvre : Manoeuvre
    seen : Data
        Its predicted log.
    """

    value: float
    gain: float
    manoeuvre: Manoeuvre
    seen: Data


def assurance(gain: float, behind: float) -> float:
    """Return the probability that the right one of two models will be ahead by `CRITERIA.apart`.

    Parameters
    ----------
    gain : float
        Expected difference of twice the log likelihood in a new log.
    behind : float
        By how much one is ahead so far; it may be the wrong one.

    Examples
    --------
    >>> round(assurance(40.0, 0.0), 3), round(assurance(12.0, 0.0), 3)
    (0.987, 0.5)
    """
    # twice a log likelihood ratio of mean D has the variance 4 D
    return float(norm.cdf((gain - abs(behind) - CRITERIA.apart) / (2.0 * math.sqrt(max(gain, 1e-12)))))


def _best(
    fit: Fit,
    benefit: Callable[[Manoeuvre], Benefit | None],
    search: Search,
    lengths: Sequence[float] = (1.0,),
) -> Benefit | None:
    """Return the manoeuvre of most benefit, the shortest one that is sure enough."""
    best: Benefit | None = None
    for part in lengths:
        for manoeuvre in _family(fit, search):
            found = benefit(manoeuvre.until(part))
            if found and (best is None or (found.value, found.gain) > (best.value, best.gain)):
                best = found
        if best is not None and best.value >= PROPOSAL.sure:
            break
    return best


def _stays(seen: Data, within: Box) -> bool:
    """Return whether the channels of a predicted log stay in their ranges."""
    log = seen.logs[0]
    rows = dict(zip(log.channels, log.values, strict=True))
    return all(
        low <= rows[name].min() and rows[name].max() <= high
        for name, (low, high) in within.items()
        if name in rows
    )


def same_time(names: tuple[str, str]) -> str:
    """Return why no manoeuvre distinguishes two effects that are both time shifts."""
    first, second = names
    return (
        f"no log distinguishes {first} from {second}: a delay of the commands and late time stamps shift "
        f"every log alike; use one clock for commands and sensors, or measure the delay of a sensor "
        f"separately"
    )


def sharpen(final: Fit, parameter: str, *, search: Search | None = None) -> Experiment | None:
    """Return the manoeuvre that most reduces a large standard error; None if none does.

    With the information I of the logs so far and S of the manoeuvre, the standard error of parameter j is
    reduced by the factor ``([I^-1]_jj / [(I + S)^-1]_jj)^(1/2)``.

    Parameters
    ----------
    final : Fit
        Fit of the logs so far.
    parameter : str
        Parameter of the fitted model.
    search : Search, optional
        The manoeuvres.
    """
    search = search or Search()
    j, known = final.problem.names.index(parameter), _information(final)
    now = float(inverse(known)[j, j])

    def benefit(manoeuvre: Manoeuvre) -> Benefit | None:
        seen = predicted(final, manoeuvre)
        if seen is None or not _stays(seen, search.within):
            return None
        then = float(inverse(known + _added(final, seen)[1])[j, j])
        factor = float(np.sqrt(now / then)) if then > 0.0 else 0.0
        return Benefit(factor, factor, manoeuvre, seen)

    best = _best(final, benefit, search)
    if best is None or best.value < PROPOSAL.sharper:
        return None
    factor, manoeuvre, seen = best.value, best.manoeuvre, best.seen
    text = (
        f"Drive {manoeuvre.text}, {_length(manoeuvre)}{_room(seen)}: the standard error of {parameter} then "
        f"falls by a factor of {factor:.2g}."
    )
    return Experiment(manoeuvre.name, text, manoeuvre.time, manoeuvre.commands, factor)


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


def _length(manoeuvre: Manoeuvre) -> str:
    return f"{manoeuvre.time[-1] - manoeuvre.time[0]:.3g} s"


def _family(fit: Fit, search: Search) -> Sequence[Manoeuvre]:
    logs, inputs = fit.problem.logs, fit.problem.block.inputs
    every = np.concatenate([m.inputs for m in logs], axis=1)
    limits = {s.name: reach(s, row) for s, row in zip(inputs, every, strict=True)}
    tempo = fit.problem.tempo
    usual = max(float(np.median(np.diff(logs[0].time))), PROPOSAL.tick * tempo)
    step = fit.problem.period or usual  # a sampled model's predictions have a row for each tick
    return family(limits, step, search.seed, tempo, search.drawn)


def _information(fit: Fit) -> Array:
    """Return the information of logs and prior on a fit's unknowns, sum_w S_w + Lambda, shape (P, P)."""
    return np.asarray(fit.S.sum(axis=0) + np.diag(fit.prior.precision))


def _added(fit: Fit, seen: Data) -> tuple[float, Array, Array]:
    """Return the misfit of a fitted model to another log, and the normal equations of its unknowns.

    The path is fitted to the log. With the whitened residual w0 and columns W of the unknowns, the result is
    ``|w0|^2``, ``S = W'W`` and ``g = -W'w0``.
    """
    problem = Problem(fit.model, seen, fit.problem.names, pieces=fit.problem.usual_pieces)
    noise = replace(fit.noise, scale=np.ones((1, len(seen.channels))))
    try:
        with np.errstate(all="ignore"):  # a rival may diverge
            path = estimate(problem, fit.prior, noise, frozen=True, levels=False).path
    except FloatingPointError:
        return np.inf, np.zeros((len(fit.p),) * 2), np.zeros(len(fit.p))
    linear = problem.linearise(path, problem.start)
    every = run_filter(augment(problem, linear, noise)).products.sum(axis=0)
    return float(every[0, 0]), every[1:, 1:], -every[1:, 0]


def _left(rival: Fit, seen: Data) -> float:
    """Return the misfit of a rival to the noise-free simulation of the other model.

    Its coefficients are fitted to the simulation and to the logs so far, of information I:
    ``|w0|^2 - g'(I + S)^-1 g`` (:func:`_added`).
    """
    rest, S, g = _added(rival, seen)
    if not np.isfinite(rest):
        return 0.0  # cannot be judged
    return rest - float(g @ inverse(_information(rival) + S) @ g)


def _room(seen: Data) -> str:
    """Return the floor area of a manoeuvre as text."""
    log = seen.logs[0]
    if not {"x", "y"} <= set(log.channels):
        return ""
    wide, deep = (float(np.ptp(log.values[log.channels.index(c)])) for c in ("x", "y"))
    return f" (takes {wide:.0f} m by {deep:.0f} m)"
