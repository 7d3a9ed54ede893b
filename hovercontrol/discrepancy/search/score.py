"""How much of the misfit each candidate takes, and whether all blocks of the logs agree on its size.

One filter run whitens a column for every unknown of the model and for every candidate; all that follows is
algebra of their products, block by block: gains (a score test, Rao 1948), and a coefficient of each block.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from hovercontrol.core.block import Block
from hovercontrol.discrepancy.search.candidates import Candidate
from hovercontrol.effects import Effect, Shape
from hovercontrol.estimation.fit import Fit
from hovercontrol.estimation.inputs import Inputs
from hovercontrol.estimation.kalman import run_filter
from hovercontrol.estimation.noise import augment
from hovercontrol.estimation.passes import inverse, products
from hovercontrol.estimation.steps import in_order
from hovercontrol.estimation.subject import Subject, structure, timing
from hovercontrol.estimation.substeps import within
from hovercontrol.models.base import shown_by
from hovercontrol.targets.follow import follow

Array = NDArray[np.float64]

#: A column of which less than this part is left, after the model's own unknowns, says nothing.
VANISHING = 1e-7


@dataclass(frozen=True, eq=False)
class Scored:
    """What a candidate would gain, and how its size scatters.

    Attributes
    ----------
    candidate : Candidate
    gain : float
        Fall of minus twice the log likelihood, the model's unknowns moved along.
    parts : ndarray, shape (m,)
        Amplitudes, in parts of the trial's.
    chi2 : float
        Gain judged by how scores scatter from block to block (a Wald statistic with that covariance).
    p_value : float
        Of chi2, for as many blocks.
    allowed : bool
        Whether the amplitudes are within bounds.
    blocks : ndarray, shape (W, 2)
        Along the direction of `parts`: estimate of each block (1: as all together) and its standard error.
    """

    candidate: Candidate
    gain: float
    parts: Array
    chi2: float
    p_value: float
    allowed: bool
    blocks: Array

    @property
    def effect(self) -> Effect:
        """The effect at its linear best."""
        return self.candidate.at(self.parts.tolist())


class Scores:
    """Products of whitened columns of a fit's residual, unknowns and candidates.

    Parameters
    ----------
    fit : Fit
    tried : sequence of Candidate
    """

    def __init__(self, fit: Fit, tried: Sequence[Candidate]) -> None:
        self.fit, self.tried = fit, list(tried)
        drive, seen, self.own = columns(fit, tried)
        system = augment(fit.problem, fit.linear, fit.noise, drive=drive, seen=seen)
        every = fit.problem.rows.by_block(products(run_filter(system).white))
        self.G = every[:, 1:, 1:]  # W, P+M, P+M
        self.f = -every[:, 1:, 0]
        # columns are minus what an unknown adds to a channel: signs of both cancel in G
        problem, P = fit.problem, len(fit.p)
        z = problem.inside(fit.p)
        slack = self.f[:, :P].sum(axis=0) - fit.prior.precision * (z - fit.prior.centre)
        stuck = ((fit.p <= problem.lower) & (slack < 0)) | ((fit.p >= problem.upper) & (slack > 0))
        self.movable = np.flatnonzero(~stuck)
        self.pull = fit.prior.precision * (z - fit.prior.centre)
        self.P = P

    def of(self, i: int) -> Scored:
        """Return how candidate i scores."""
        cols = [self.P + c for c in self.own[i]]
        return self._scored(self.tried[i], cols)

    def _scored(self, candidate: Candidate, cols: list[int]) -> Scored:
        mine = self.movable
        G, f = self.G, self.f
        own = G[:, mine][:, :, mine].sum(axis=0) + np.diag(self.fit.prior.precision[mine])
        cross = G[:, mine][:, :, cols].sum(axis=0)
        back = inverse(own) @ cross  # P, m
        # each block's score and information along the candidate, unknowns at what all blocks make of them
        u = f[:, cols] - f[:, mine] @ back
        J = (
            G[:, cols][:, :, cols]
            - np.swapaxes(G[:, mine][:, :, cols], 1, 2) @ back
            - np.swapaxes(np.swapaxes(G[:, mine][:, :, cols], 1, 2) @ back, 1, 2)
            + np.einsum("pm,wpq,qk->wmk", back, G[:, mine][:, :, mine], back)
        )
        total = J.sum(axis=0) + back.T * self.fit.prior.precision[mine] @ back
        g = u.sum(axis=0) + self.pull[mine] @ back
        bare = np.diag(G[:, cols][:, :, cols].sum(axis=0))
        if (np.diag(total) <= VANISHING * np.maximum(bare, 1e-300)).any():
            return Scored(candidate, 0.0, np.zeros(len(cols)), 0.0, 1.0, True, np.zeros((len(G), 2)))
        C = inverse(total)
        parts = C @ g
        gain = float(g @ parts)
        left = u - np.einsum("wmk,k->wm", J, parts)
        B = int((np.einsum("wmm->w", J) > 1e-3 * np.trace(total) / len(G)).sum())
        meat = left.T @ left * B / max(B - 1, 1)
        covariance = C @ np.maximum(meat, 0.0) @ C + 0.0
        m = len(cols)
        # where blocks scatter less than noise says they should, noise it is
        V = covariance + 1e-12 * np.eye(m) * np.trace(C)
        chi2 = float(min(parts @ np.linalg.solve(V, parts), 1e12)) if m else 0.0
        chi2 = min(chi2, gain) if B <= 3 else chi2
        dof = max(B - m, 1)
        F = chi2 / m * dof / max(B - 1, 1)
        p_value = float(stats.f.sf(F, m, dof))
        Jd = np.einsum("m,wmk,k->w", parts, J, parts)
        ud = u @ parts
        with np.errstate(all="ignore"):
            each = np.stack([ud / Jd, 1.0 / np.sqrt(Jd)], axis=1)
        return Scored(candidate, gain, parts, chi2, p_value, candidate.allowed(parts.tolist()), each)

    def each(self) -> list[Scored]:
        """Return how every candidate scores."""
        return [self.of(i) for i in range(len(self.tried))]

    def best(self) -> list[Scored]:
        """Return each effect at its best trial, the largest gain first."""
        found: dict[str, Scored] = {}
        for s in self.each():
            old = found.get(s.candidate.name)
            if old is None or (s.allowed, s.gain) > (old.allowed, old.gain):
                found[s.candidate.name] = s
        return sorted(found.values(), key=lambda s: -float(f"{s.gain:.9g}"))  # twins in the catalogue's order


def at_its_time(fit: Fit, scored: Scored) -> Scored:
    """Return a candidate with the time of its jump, or its delay, where it scores best."""
    trial = scored.candidate.trial
    times = [k for k, n in trial.numbers.items() if isinstance(n, Shape) and n.of == "time"]
    if times:
        return _jump(fit, scored, times[0])
    return _delay(fit, scored) if trial.shifts_time else scored


def _jump(fit: Fit, scored: Scored, key: str) -> Scored:
    """Return the candidate with the time of its jump found to half a row."""
    best, number = scored, type(scored.candidate.trial).numbers[key]
    longest = max(float(m.time[-1] - m.origin) for m in fit.problem.logs)
    reach = longest / max(len(number.search), 1)  # type: ignore[attr-defined]
    while reach > 0.5 * fit.problem.shortest:
        places = best.candidate.trial.values[key] + reach * np.linspace(-1.0, 1.0, 9)
        best = _best_of(fit, scored, key, np.clip(places, 0.0, longest), scored.candidate.amplitudes)
        reach *= 0.25
    return best


def _delay(fit: Fit, scored: Scored) -> Scored:
    """Return the candidate with its delay found to 4 %, unless it is too small for its trial to say.

    Commands jump: the likelihood of a delay has many tops, and a linear answer from far off leads to any. A
    push of which half is late and half is not, as behind a lag, is no delay.
    """
    best, key = scored, next(iter(scored.candidate.trial.numbers))
    for octaves in (1.0, 0.25):
        places = best.candidate.trial.values[key] * 2.0 ** np.linspace(-octaves, octaves, 9)
        best = _best_of(fit, best, key, places, ())
    return best if best.allowed else scored


def _best_of(fit: Fit, scored: Scored, key: str, places: Array, amplitudes: tuple[str, ...]) -> Scored:
    """Return a candidate at the best of these values of one of its numbers."""
    trial = scored.candidate.trial
    tried = [
        Candidate(trial.name, type(trial)(**{**trial.values, key: float(t)}), amplitudes) for t in places
    ]
    each = Scores(fit, tried).each()
    return max(each if amplitudes else map(_as_it_is, each), key=lambda s: (s.allowed, s.gain))


def _as_it_is(scored: Scored) -> Scored:
    """Return a candidate that is there or not with what it gains at its full size, not at a part of it.

    More than the full size is noise of the model without it, which takes part of what it does.
    """
    part = float(scored.parts[0])
    gain = scored.gain if part >= 1.0 else scored.gain * (2.0 * part - 1.0) / max(part, 1e-9) ** 2
    return replace(scored, gain=gain, allowed=gain > 0.0)


def columns(fit: Fit, tried: Sequence[Candidate]) -> tuple[Array, Array, list[tuple[int, ...]]]:
    """Return what each amplitude of each candidate adds to states and channels, and each one's columns."""
    problem = fit.problem
    K, W, C = fit.linear.residual.shape
    n = len(problem.free)
    width = sum(max(len(c.amplitudes), 1) for c in tried)
    drive, seen = np.zeros((K - 1, W, n, width)), np.zeros((K, W, C, width))
    own, at = [], 0
    runs = _Along(fit)
    for candidate in tried:
        mine = []
        for key in candidate.amplitudes or ("",):
            alone = _alone(candidate, key)
            mine.append(at)
            late = timing(problem.model.with_effects([alone])) != timing(problem.model)
            with np.errstate(all="ignore"):
                if type(alone).kind() == "measurement" and not late:
                    seen[..., at] = _finite(runs.seen(alone))
                else:
                    drive[..., at] = _finite(runs.forcing(alone))
            at += 1
        own.append(tuple(mine))
    return drive, seen, own


def _finite(column: Array) -> Array:
    """Return a column, or nothing at all where a trial runs away: it says nothing."""
    return column if np.isfinite(column).all() else np.zeros_like(column)


def _alone(candidate: Candidate, key: str) -> Effect:
    """Return the trial with one amplitude, the others neutral."""
    numbers, values = type(candidate.trial).numbers, dict(candidate.trial.values)
    for other in candidate.amplitudes:
        if other != key:
            values[other] = numbers[other].neutral
    return type(candidate.trial)(**values)


class _Along:
    """Forces and measurements of models along a fit's path."""

    def __init__(self, fit: Fit) -> None:
        self.fit, self.problem = fit, fit.problem
        problem = self.problem
        self._values = dict(zip(problem.block.default_parameters, problem.parameters(fit.p), strict=True))
        self._within = within(fit)
        self._steps = problem.steps.finest(problem.parameters(fit.p))
        self._t = self._steps.t + 0.5 * self._steps.h
        self._base: Array | None = None
        self._means: dict[float, Array] = {}
        self._lagged: dict[tuple[object, ...], list[Array]] = {}

    def forcing(self, e: Effect) -> Array:
        """Return what an effect adds to the free states from row to row, (K-1, W, n)."""
        problem = self.problem
        if self._base is None:
            self._base = self._slopes(problem.model, self._values)
        model = problem.model.with_effects([e])
        own = {f"{problem.block.name}.{e.parameter(k)}": v for k, v in e.values.items()}
        added = self._slopes(model, {**self._values, **own}) - self._base
        return np.moveaxis(self._within.become(added).reshape(-1, *problem.dt.shape), 0, -1)

    def _slopes(self, model: Subject, values: Mapping[str, float]) -> Array:
        """Return the slopes of the free states in the middles of sub-steps, (n, S, N)."""
        problem, block = self.problem, structure(model)
        every = [values.get(name, start) for name, start in block.default_parameters.items()]
        x = np.zeros((len(block.states), *self._t.shape))
        names = [s.name for s in problem.block.states]
        u, lagged = self._commands(model, block, every)
        new = []
        for i, s in enumerate(block.states):
            if s.name in names:
                x[i] = self._within.states[names.index(s.name)]
            elif i in lagged:
                x[i] = lagged[i]
            else:
                new.append(i)
        for i in lagged:
            x[i] = lagged[i]
        if new:
            self._simulate(block, new, x, u, every)
        with np.errstate(all="ignore"):
            slopes = block.to_numpy().array_derivatives(self._t, x, u, every)
        rows = [[s.name for s in block.states].index(names[i]) for i in problem.free]
        return np.stack([np.broadcast_to(slopes[i], self._t.shape) for i in rows])

    def _simulate(self, block: Block, new: list[int], x: Array, u: Array, every: list[float]) -> None:
        """Run states that only a candidate has along the path, from rest in each stretch."""
        S, (steps, W) = self.problem.pieces, self.problem.dt.shape
        t, h, path, inputs = (in_order(a, W) for a in (self._t, self._steps.h, x, u))
        values = follow(block, new, t, h, path, inputs, every)[:, :-1]
        x[new] = values.reshape(len(new), steps, S, W).swapaxes(1, 2).reshape(len(new), S, -1)

    def _commands(self, model: Subject, block: Block, every: list[float]) -> tuple[Array, dict[int, Array]]:
        inputs, steps, log = Inputs(block, model, self.problem.logs), self._steps, self.problem.steps.log
        delay = inputs.delay(every)
        if delay not in self._means:
            self._means[delay] = inputs.means(delay, steps.t, steps.h, log)
        parameters = {s.symbol: value for s, value in zip(block.parameters, every, strict=True)}
        laws = [block.expand(block.derivatives[block.states[i].name]) for i in inputs.known]
        used = sorted(set().union(*(law.free_symbols for law in laws)) & parameters.keys(), key=str)
        key = delay, tuple(laws), tuple((s, parameters[s]) for s in used)
        if key not in self._lagged:
            self._lagged[key] = list(inputs.lagged(every, steps.t, steps.h, log).values())
        return self._means[delay], dict(zip(inputs.known, self._lagged[key], strict=True))

    def seen(self, e: Effect) -> Array:
        """Return what a measurement effect adds to the channels, (K, W, C)."""
        problem = self.problem
        block = structure(problem.model.with_effects([e]))
        own = {f"{problem.block.name}.{e.parameter(k)}": v for k, v in e.values.items()}
        values = {k: {**self._values, **own}.get(k, v) for k, v in block.default_parameters.items()}
        x = np.moveaxis(self.fit.path, 2, 0)
        u = problem._inputs_at_rows(problem.parameters(self.fit.p))
        after = block.to_numpy().outputs(problem.rows.time, x, u, values)
        before = problem.block.to_numpy().outputs(problem.rows.time, x, u, self._values)
        new = [s.name for s in block.outputs]
        old = [s.name for s in problem.block.outputs]
        found = np.zeros(problem.rows.values.shape)
        for c, channel in enumerate(problem.rows.channels):
            seen, was = new.index(shown_by(new, channel)), old.index(shown_by(old, channel))
            found[..., c] = after[seen] - before[was]
        return np.where(problem.seen, found, 0.0)
