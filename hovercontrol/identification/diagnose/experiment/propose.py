"""The next experiment: commands that distinguish rivals, or reduce a large standard error.

Commands stay within the range of the logs. If the model bounds an input, up to twice that range is used,
within the bounds; a direction that was never driven is not used.

Every manoeuvre of a family is simulated with one rival as the truth. The other rival is fitted to this
simulation and to the information of the logs so far. The misfit that remains is the expected evidence of the
added log; the smaller one of both directions counts. This is the discrimination design of Atkinson and
Fedorov, Biometrika 62, 1975, over a family instead of a continuum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.craft.effects.law import is_law
from hovercontrol.identification.diagnose.evidence.traces import runs_of, simulate_runs
from hovercontrol.identification.diagnose.experiment.manoeuvres import Manoeuvre, family, reach
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

    No published source: set by hand, exercised by tests/identification/diagnose/test_experiment.py. The
    required gain is twice the `least` of :class:`.Criteria`.

    Attributes
    ----------
    settles : float
        Required difference of twice the log likelihood between rivals.
    badly : float
        Relative standard error above which a coefficient is to be estimated better.
    sharper : float
        Factor by which a manoeuvre must reduce that standard error.
    tick : float
        Shortest time between two commands [s].
    """

    settles: float = 40.0
    badly: float = 0.1
    sharper: float = 1.5
    tick: float = 0.02


#: The values in use.
PROPOSAL = ProposalCriteria()


def next_experiment(
    selection: Selection, effects: Sequence[Found], functions: Sequence[FittedFunction] = (), seed: int = 0
) -> tuple[Experiment | None, str]:
    """Return the next experiment and a sentence on it; None and an empty text if none is needed.

    Parameters
    ----------
    effects : sequence of Found
        Parameters of the named effects.
    functions : sequence of FittedFunction, optional
        Unknown functions, with their forms.
    seed : int, optional
        Of the manoeuvres drawn at random.
    """
    final = selection.final
    # twins shift every log alike; laws that are the same in these logs may differ in others
    apart = sorted((r for r in selection.rivals if not r.same or is_law(r.name)), key=lambda r: r.same)
    if apart:
        rival = apart[0]
        found = separate(final, rival.fit, (rival.instead_of, rival.name), seed=seed)
        return (None, found) if isinstance(found, str) else (found, found.text)
    for f in functions:
        for other in rivals_of(f)[:1]:
            best = f.forms[0]
            found = separate(best.fit, other.fit, (f"{f.name} = {best.text}", other.text), seed=seed)
            return (None, found) if isinstance(found, str) else (found, found.text)
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
    sharper = sharpen(final, worst.parameter, seed=seed)
    return sharper, sharper.text if sharper else ""


def separate(one: Fit, other: Fit, names: tuple[str, str], *, seed: int = 0) -> Experiment | str:
    """Return the manoeuvre that best distinguishes two models, or why none does.

    Parameters
    ----------
    one, other : Fit
        Fits of the two models to the logs so far.
    names : (str, str)
        Names of the effects in `one` and in `other`.
    seed : int, optional
        Of the manoeuvres drawn at random.
    """
    best: tuple[float, Manoeuvre, Data] | None = None
    for manoeuvre in _family(one, seed):
        benefit, runs = np.inf, None
        for truth, rival in ((one, other), (other, one)):
            seen = predicted(truth, manoeuvre)
            runs = runs or seen
            if not np.isfinite(seen.logs[0].values).all():
                benefit = 0.0
                break
            benefit = min(benefit, _left(rival, seen))
        if runs is not None and (best is None or benefit > best[0]):
            best = benefit, manoeuvre, runs
    first, second = names
    if best is None or best[0] < PROPOSAL.settles:
        found = f" ({best[0]:.2g} of the {PROPOSAL.settles:g} needed, by {best[1].name})" if best else ""
        return f"no manoeuvre within the limits of the commands distinguishes {first} from {second}{found}"
    benefit, manoeuvre, seen = best
    text = (
        f"Drive {manoeuvre.text}{_room(seen)}: {first} and {second} then differ by about {benefit:.3g} "
        f"in twice the log likelihood ({PROPOSAL.settles:g} settle it)."
    )
    return Experiment(manoeuvre.name, text, manoeuvre.time, manoeuvre.commands, benefit)


def same_time(names: tuple[str, str]) -> str:
    """Return why no manoeuvre distinguishes two effects that are both time shifts."""
    first, second = names
    return (
        f"no log distinguishes {first} from {second}: a delay of the commands and late time stamps shift "
        f"every log alike; use one clock for commands and sensors, or measure the delay of a sensor "
        f"separately"
    )


def sharpen(final: Fit, parameter: str, *, seed: int = 0) -> Experiment | None:
    """Return the manoeuvre that most reduces a large standard error; None if none does.

    With the information I of the logs so far and S of the manoeuvre, the standard error of parameter j is
    reduced by the factor ``([I^-1]_jj / [(I + S)^-1]_jj)^(1/2)``.

    Parameters
    ----------
    final : Fit
        Fit of the logs so far.
    parameter : str
        Parameter of the fitted model.
    seed : int, optional
        Of the manoeuvres drawn at random.
    """
    j = final.problem.names.index(parameter)
    known = _information(final)
    now = float(inverse(known)[j, j])
    best: tuple[float, Manoeuvre, Data] | None = None
    for manoeuvre in _family(final, seed):
        seen = predicted(final, manoeuvre)
        if not np.isfinite(seen.logs[0].values).all():
            continue
        _, S, _ = _added(final, seen)
        then = float(inverse(known + S)[j, j])
        benefit = float(np.sqrt(now / then)) if then > 0.0 else 0.0
        if best is None or benefit > best[0]:
            best = benefit, manoeuvre, seen
    if best is None or best[0] < PROPOSAL.sharper:
        return None
    benefit, manoeuvre, seen = best
    text = (
        f"Drive {manoeuvre.text}{_room(seen)}: the standard error of {parameter} then falls by a factor of "
        f"{benefit:.2g}."
    )
    return Experiment(manoeuvre.name, text, manoeuvre.time, manoeuvre.commands, benefit)


def predicted(fit: Fit, manoeuvre: Manoeuvre) -> Data:
    """Return the measurements that a fitted model predicts for a manoeuvre, from rest, without noise."""
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
    return _data(like, replace(empty, states=found[0], values=found[1]), names, fit.problem.period)


def _data(like: Data, log: Measured, states: Sequence[str], period: float) -> Data:
    """Return data that consist of one log."""
    guess = [dict(zip(states, log.states, strict=True))]
    rows = arrange([log], guess, like.channels, period, like.tempo)
    scales = np.ones((1, len(like.channels)))
    return Data((log,), like.channels, like.noise, scales, rows, tempo=like.tempo)


def _family(fit: Fit, seed: int) -> Sequence[Manoeuvre]:
    logs, inputs = fit.problem.logs, fit.problem.block.inputs
    every = np.concatenate([m.inputs for m in logs], axis=1)
    limits = {s.name: reach(s, row) for s, row in zip(inputs, every, strict=True)}
    tempo = fit.problem.tempo
    return family(limits, max(float(np.median(np.diff(logs[0].time))), PROPOSAL.tick * tempo), seed, tempo)


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
