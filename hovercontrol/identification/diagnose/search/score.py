"""Score tests of candidate effects: predicted gain in likelihood, and agreement of the blocks on the size.

One filter run whitens the residual and a column for every unknown of the model and for every candidate. Gains
(a score test, Rao 1948) and the estimates of each block follow from products of these columns::

    w0     whitened residual, of one block
    W      whitened columns: what a unit of each unknown and each amplitude adds to it
    cost(theta) = |w0 + W theta|^2 + const = const - 2 f'theta + theta'G theta,    G = W'W,    f = -W'w0
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import stats

from hovercontrol.base.arrays import Array
from hovercontrol.base.short_repr import short_repr
from hovercontrol.craft.effects import Effect
from hovercontrol.identification.diagnose.search.candidates import Candidate
from hovercontrol.identification.diagnose.search.columns import columns
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.kalman import run_filter
from hovercontrol.identification.engine.noise import augment
from hovercontrol.identification.engine.passes import inverse, left_out_gain

#: A candidate is ignored if less than this fraction of its information is left after the model's unknowns.
VANISHING = 1e-7


@dataclass(frozen=True, eq=False)
class Scored:
    """The predicted gain of a candidate, and the scatter of its size over blocks.

    Attributes
    ----------
    candidate : Candidate
    gain : float
        Predicted reduction of minus twice the log likelihood, with the model's unknowns re-estimated.
    parts : ndarray, shape (m,)
        Amplitudes relative to those of the trial.
    chi2 : float
        Wald statistic of the amplitudes, with their covariance from the scatter of scores over blocks.
    p_value : float
        Of chi2, given the number of blocks.
    allowed : bool
        Whether the amplitudes are within bounds.
    blocks : ndarray, shape (W, 2)
        Along the direction of `parts`: estimate of each block (1 equals the estimate from all blocks) and its
        standard error.
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
        """The effect at the amplitudes of the linear estimate."""
        return self.candidate.at(self.parts.tolist())


class Scores:
    """Products of the whitened residual and columns of a fit's unknowns and of candidates.

    Parameters
    ----------
    fit : Fit
    tried : sequence of Candidate
    """

    def __init__(self, fit: Fit, tried: Sequence[Candidate]) -> None:
        self.fit, self.tried = fit, list(tried)
        groups, self.own = columns(fit, tried)
        system = augment(fit.problem, fit.linear, fit.noise, more=groups)
        every = fit.problem.rows.by_block(run_filter(system).products)
        self.G = every[:, 1:, 1:]  # W, P+M, P+M
        self.f = -every[:, 1:, 0]
        # The whitened columns carry the sign with which an unknown changes the residual, so cost(theta) =
        # |w0 + W theta|^2 and f is minus their product with w0. With the prior, of precision Lambda about z0,
        # the slope is f - Lambda (z - z0). An unknown at a bound that it would leave is held.
        problem, P = fit.problem, len(fit.p)
        z = problem.inside(fit.p)
        slack = self.f[:, :P].sum(axis=0) - fit.prior.precision * (z - fit.prior.centre)
        self.movable = np.flatnonzero(~problem.held(fit.p, slack))
        self.pull = fit.prior.precision * (z - fit.prior.centre)
        self.P = P

    def of(self, i: int) -> Scored:
        """Return the score of candidate i."""
        return self.each()[i]

    def _scored(self, candidate: Candidate, cols: list[int]) -> Scored:
        mine = self.movable
        G, f = self.G, self.f
        own = G[:, mine][:, :, mine].sum(axis=0) + np.diag(self.fit.prior.precision[mine])
        cross = G[:, mine][:, :, cols].sum(axis=0)
        # p: unknowns that can move, c: amplitudes of the candidate, Lambda: precision of the prior.
        # Re-estimated on all blocks, the unknowns move by -E per amplitude:
        #   E = (sum_w G_pp + Lambda)^-1 sum_w G_pc
        back = inverse(own) @ cross  # E: P, m
        # Score and information of block w along the candidate:
        #   u_w = f_c - E'f_p,    J_w = G_cc - G_cp E - E'G_pc + E'G_pp E
        u = f[:, cols] - f[:, mine] @ back
        J = (
            G[:, cols][:, :, cols]
            - np.swapaxes(G[:, mine][:, :, cols], 1, 2) @ back
            - np.swapaxes(np.swapaxes(G[:, mine][:, :, cols], 1, 2) @ back, 1, 2)
            + np.einsum("pm,wpq,qk->wmk", back, G[:, mine][:, :, mine], back)
        )
        # J = sum_w J_w + E'Lambda E: the Schur complement G_cc - G_cp (G_pp + Lambda)^-1 G_pc of all blocks
        # g = sum_w u_w + E'Lambda (z - z0)
        total = J.sum(axis=0) + back.T * self.fit.prior.precision[mine] @ back
        g = u.sum(axis=0) + self.pull[mine] @ back
        bare = np.diag(G[:, cols][:, :, cols].sum(axis=0))
        if (np.diag(total) <= VANISHING * np.maximum(bare, 1e-300)).any():
            return Scored(candidate, 0.0, np.zeros(len(cols)), 0.0, 1.0, True, np.zeros((len(G), 2)))
        # estimate theta = C g, C = J^-1; reduction of the cost g'C g (score statistic)
        C = inverse(total)
        parts = C @ g
        gain = float(g @ parts)
        # Sandwich covariance from B informative blocks with scores r_w = u_w - J_w theta:
        #   V = C M C,    M = B/(B - 1) sum_w r_w r_w' (negative entries of M set to zero)
        left = u - np.einsum("wmk,k->wm", J, parts)
        B = int((np.einsum("wmm->w", J) > 1e-3 * np.trace(total) / len(G)).sum())
        meat = left.T @ left * B / max(B - 1, 1)
        covariance = C @ np.maximum(meat, 0.0) @ C + 0.0
        m = len(cols)
        # a ridge keeps V invertible where blocks hardly scatter; Wald statistic chi2 = theta'V^-1 theta, at
        # most the gain where three blocks or fewer say too little about the scatter
        V = covariance + 1e-12 * np.eye(m) * np.trace(C)
        chi2 = float(min(parts @ np.linalg.solve(V, parts), 1e12)) if m else 0.0
        chi2 = min(chi2, gain) if B <= 3 else chi2
        # as Hotelling's T^2: chi2 (B - m) / (m (B - 1)) has the distribution F(m, B - m)
        dof = max(B - m, 1)
        F = chi2 / m * dof / max(B - 1, 1)
        p_value = float(stats.f.sf(F, m, dof))
        # along theta block w estimates u_w'theta / (theta'J_w theta), standard error (theta'J_w theta)^-1/2
        Jd = np.einsum("m,wmk,k->w", parts, J, parts)
        ud = u @ parts
        with np.errstate(all="ignore"):
            each = np.stack([ud / Jd, 1.0 / np.sqrt(Jd)], axis=1)
        return Scored(candidate, gain, parts, chi2, p_value, candidate.allowed(parts.tolist()), each)

    def left_out_gain(self, i: int) -> float:
        """Return the cross-validated gain of candidate i: each block is predicted from all others.

        The size of the candidate and the model's unknowns are estimated without the block on which they are
        judged, so a candidate that fits one block alone gains nothing (:func:`.passes.left_out_gain`, minus
        that of the unknowns alone).
        """
        return self.left_out_gain_of(self.columns_of(i))

    def columns_of(self, i: int) -> tuple[int, ...]:
        """Return the columns of candidate i in the table."""
        return tuple(self.P + c for c in self.own[i])

    def correlations(self) -> Array:
        """Return the correlation of each two columns of candidates, with the unknowns re-estimated.

        Shape (M, M). With c, d: columns of candidates, p: the unknowns that can move, Lambda: the prior::

            S = G_cc - G_cp (G_pp + Lambda)^-1 G_pc,    rho_cd = S_cd / (S_cc S_dd)^(1/2)
        """
        mine, total = self.movable, self.G.sum(axis=0)
        cross = total[mine][:, self.P :]
        own = total[np.ix_(mine, mine)] + np.diag(self.fit.prior.precision[mine])
        left = total[self.P :, self.P :] - cross.T @ inverse(own) @ cross
        size = np.sqrt(np.maximum(np.diag(left), 1e-300))
        found: Array = left / size[:, None] / size
        return found

    def left_out_gain_of(self, columns: Sequence[int]) -> float:
        """Return the cross-validated gain of some columns together (:meth:`left_out_gain`)."""
        return self._left_out([*self.movable.tolist(), *columns]) - self._left_out_alone

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
        return left_out_gain(G, f, np.diag(prior + 1e-12 * np.einsum("wii->i", G)), pull)

    def each(self) -> list[Scored]:
        """Return the score of every candidate."""
        return self._each

    @cached_property
    def _each(self) -> list[Scored]:
        return [self._scored(c, list(self.columns_of(i))) for i, c in enumerate(self.tried)]

    def best(self) -> list[Scored]:
        """Return the best trial of each effect, the largest gain first."""
        found: dict[str, Scored] = {}
        for s in self.each():
            old = found.get(s.candidate.name)
            if old is None or (s.allowed, s.gain) > (old.allowed, old.gain):
                found[s.candidate.name] = s
        return sorted(found.values(), key=lambda s: -float(f"{s.gain:.9g}"))  # ties in the catalogue's order


def likeliest_onset(fit: Fit, scored: Scored) -> Scored:
    """Return a candidate with the time of its jump, or its delay, at the value of the highest score."""
    trial = scored.candidate.trial
    if trial.moment():
        return _jump(fit, scored, trial.moment())
    return _delay(fit, scored) if trial.shifts_time else scored


def likelier_time(fit: Fit, name: str) -> Effect | None:
    """Return a fitted effect moved to a likelier start, up to four rows away; None if there is none."""
    e = fit.model.effect(name)
    key = e.moment()
    if not key:
        return None
    away = fit.problem.shortest * np.array([-4.0, -2.0, -1.0, -0.5, -0.25, 0.25, 0.5, 1.0, 2.0, 4.0])
    moved = [e.within_bounds(**{**e.values, key: t}) for t in (e.values[key] + away).tolist() if t > 0.0]
    each = Scores(fit, [Candidate(name, m, ()) for m in moved]).each()
    best = max(map(_as_it_is, each), key=lambda s: s.gain)
    return best.candidate.trial if best.allowed else None


def _jump(fit: Fit, scored: Scored, key: str) -> Scored:
    """Return the candidate with the time of its jump, found to half a row on refined grids."""
    best, number = scored, type(scored.candidate.trial).numbers[key]
    longest = max(float(m.time[-1] - m.origin) for m in fit.problem.logs)
    reach = longest / max(len(number.search), 1)  # type: ignore[attr-defined]
    while reach > 0.5 * fit.problem.shortest:
        places = best.candidate.trial.values[key] + reach * np.linspace(-1.0, 1.0, 9)
        best = _best_of(fit, scored, key, np.clip(places, 0.0, longest), scored.candidate.amplitudes)
        reach *= 0.25
    return best


def _delay(fit: Fit, scored: Scored) -> Scored:
    """Return the candidate with its delay found to 4 %, or unchanged if none of those tried gains.

    Commands jump, so the likelihood has many local maxima over the delay, and a linear step from far away may
    lead to any of them; hence the search on a grid. If half of a push is late and half is not, as behind a
    lag, the effect is not a delay.
    """
    best, key = scored, next(iter(scored.candidate.trial.numbers))
    for octaves in (1.0, 0.25):
        places = best.candidate.trial.values[key] * 2.0 ** np.linspace(-octaves, octaves, 9)
        best = _best_of(fit, best, key, places, ())
    return best if best.allowed else scored


def _best_of(fit: Fit, scored: Scored, key: str, places: Array, amplitudes: tuple[str, ...]) -> Scored:
    """Return a candidate with one parameter at the best of the given values."""
    trial = scored.candidate.trial
    tried = [
        Candidate(trial.name, trial.within_bounds(**{**trial.values, key: float(t)}), amplitudes)
        for t in places
    ]
    each = Scores(fit, tried).each()
    return max(each if amplitudes else map(_as_it_is, each), key=lambda s: (s.allowed, s.gain))


def _as_it_is(scored: Scored) -> Scored:
    """Return an all-or-nothing candidate with its gain at full size, not at the estimated fraction.

    The estimate theta gains ``J theta^2``; the full size, 1, gains ``J (2 theta - 1)``. An estimate above 1
    keeps its gain: it arises because the noise of the model without the effect absorbs part of the effect.
    """
    part = float(scored.parts[0])
    gain = scored.gain if part >= 1.0 else scored.gain * (2.0 * part - 1.0) / max(part, 1e-9) ** 2
    return replace(scored, gain=gain, allowed=gain > 0.0)
