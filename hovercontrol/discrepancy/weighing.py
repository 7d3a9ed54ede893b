"""How much evidence an effect must bring, and how much chance brings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hovercontrol.discrepancy.candidates import Scored
from hovercontrol.discrepancy.fit import Fit
from hovercontrol.discrepancy.subject import Subject
from hovercontrol.effects import Effect

#: Fall of minus twice the log likelihood that an effect must bring, beyond EACH for each of its numbers: some
#: sixty trials are looked at.
LEAST, EACH = 20.0, 4.0

#: A rival that is no more than this behind (odds of e^6) cannot be told apart.
APART = 12.0

#: chi2 per degree of freedom beyond which noise of the measurements alone does not explain what remains.
EXPLAINED = 1.1

#: chi2 per degree of freedom at which an effect explains all: others with less of a score need no fit.
SETTLED = 1.03

#: A smaller fall may as well be that of a fit that hung.
DOUBTFUL = 500.0


def are_kin(one: Effect, other: Effect) -> bool:
    """Whether two effects are drags along the same axis, which widths of friction blend."""
    return getattr(one, "axis", None) == getattr(other, "axis", 0)


def top_gain(worth: Sequence[Scored]) -> float:
    """Return the gain of the best, 0 if there is none."""
    return worth[0].gain if worth else 0.0


def least_gain(scored: Scored) -> float:
    """Return the fall of minus twice the log likelihood that an effect must bring."""
    return LEAST + EACH * len(scored.candidate.amplitudes)


def charged(of: Fit) -> float:
    """Return the cost of a fit, EACH added for each of its numbers: by this, effects compare."""
    return of.cost + EACH * len(of.p)


def by_chance(more: Fit, fewer: Fit) -> float:
    """Return what initial states take, mean and three standard deviations, that show in one fit alone.

    Without a heading in the log slope and wind turn freely in each window: that is many unknowns, not two.
    """
    extra = max(more.starts - fewer.starts, 0)
    return float(extra + 3.0 * np.sqrt(2.0 * extra))


def less(model: Subject, *names: str) -> Subject:
    """Return a model less some of its effects, all else as it is."""
    return replace(model, effects=tuple(e for e in model.effects if e.name not in names))


def wald(final: Fit, name: str) -> float:
    """Return how many standard errors an effect is from not being there, squared."""
    w, C = final.windowed, final.covariance
    e = w.model.effect(name)
    own = [
        (w.names.index(e.parameter(k)), n.neutral)
        for k, n in e.numbers.items()
        if not np.isnan(n.neutral) and e.parameter(k) in w.names
    ]
    if not own:
        return float("inf")
    rows = [j for j, _ in own]
    away = np.array([final.p[j] - neutral for j, neutral in own])
    return float(away @ np.linalg.pinv(C[np.ix_(rows, rows)], hermitian=True) @ away)
