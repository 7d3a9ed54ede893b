"""How much of the misfit each candidate takes, and whether all blocks of the logs agree on its size.

One filter run whitens a column for every unknown of the model and for every candidate; all that follows is
algebra of their products, block by block: gains (a score test, Rao 1948), and a coefficient of each block.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from hovercontrol.discrepancy.search.candidates import Candidate
from hovercontrol.discrepancy.search.columns import columns
from hovercontrol.effects import Effect, Shape
from hovercontrol.estimation.fit import Fit
from hovercontrol.estimation.kalman import run_filter
from hovercontrol.estimation.noise import augment
from hovercontrol.estimation.passes import inverse, products
from hovercontrol.io.short_repr import short_repr

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

    __repr__ = short_repr

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

    def left_out_gain(self, i: int) -> float:
        """Return the gain of candidate i on blocks that did not choose its size.

        Each block is judged with the size, and the model's unknowns, that all other blocks make likeliest; so
        what fits one block alone gains nothing::

            gain = sum over blocks b of (2 f_b' theta_(-b) - theta_(-b)' G_b theta_(-b)),

        less the same of the unknowns alone.
        """
        mine = self.movable.tolist()
        return self._left_out([*mine, *(self.P + c for c in self.own[i])]) - self._left_out_alone

    @cached_property
    def _left_out_alone(self) -> float:
        return self._left_out(self.movable.tolist())

    def _left_out(self, rows: list[int]) -> float:
        if not rows:
            return 0.0
        G, f = self.G[:, rows][:, :, rows], self.f[:, rows]
        added = np.zeros(len(rows) - len(self.movable))
        prior = np.r_[self.fit.prior.precision[self.movable], added]
        pull = np.r_[self.pull[self.movable], added]
        total, score, gain = G.sum(axis=0), f.sum(axis=0), 0.0
        for own, g in zip(G, f, strict=True):
            others = total - own + np.diag(prior + 1e-12 * np.diag(total))
            theta = np.linalg.lstsq(others, score - g - pull, rcond=1e-13)[0]
            gain += float(2.0 * g @ theta - theta @ own @ theta)
        return gain

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


def likelier_time(fit: Fit, name: str) -> Effect | None:
    """Return a fitted effect that begins at a likelier time, up to four rows away; None if none does."""
    e = fit.problem.model.effect(name)
    times = [k for k, n in e.numbers.items() if isinstance(n, Shape) and n.of == "time"]
    if not times:
        return None
    e, key = fit.model.effect(name), times[0]
    away = fit.problem.shortest * np.array([-4.0, -2.0, -1.0, -0.5, -0.25, 0.25, 0.5, 1.0, 2.0, 4.0])
    moved = [e.within_bounds(**{**e.values, key: t}) for t in (e.values[key] + away).tolist() if t > 0.0]
    each = Scores(fit, [Candidate(name, m, ()) for m in moved]).each()
    best = max(map(_as_it_is, each), key=lambda s: s.gain)
    return best.candidate.trial if best.allowed else None


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
        Candidate(trial.name, trial.within_bounds(**{**trial.values, key: float(t)}), amplitudes)
        for t in places
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
