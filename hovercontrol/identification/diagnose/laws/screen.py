"""Screening of laws: all forms on one table, and the few that are worth a fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.craft.effects import Effect
from hovercontrol.craft.effects.law import Law, MemoryLaw
from hovercontrol.identification.diagnose.criteria import Criteria
from hovercontrol.identification.diagnose.laws.grammar import elsewhere
from hovercontrol.identification.diagnose.laws.symmetry import Signs, broken_by, symmetries
from hovercontrol.identification.diagnose.search.candidates import Candidate, candidates
from hovercontrol.identification.diagnose.search.fit import TRIALS
from hovercontrol.identification.diagnose.search.score import Scores
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.subject import Subject

#: Two columns with a correlation beyond this are the same law in these logs.
SAME = 0.98

#: Laws that are tried alone, and the best partner of so many of them.
ALONE, PARTNERS = 6, 3


@dataclass(frozen=True, eq=False)
class LikelyLaw:
    """A law worth a fit.

    Attributes
    ----------
    name : str
    gain : float
        On left-out segments, alone or with its partner.
    same : dict of str to bool
        Laws that these logs do not tell from it, and whether each breaks more symmetries of the model.
    trials : dict of str to Law
        These laws as they were tried, of a law with a memory at the likeliest of its time constants.
    """

    name: str
    gain: float
    same: dict[str, bool]
    trials: dict[str, Law]


@dataclass(frozen=True, eq=False)
class Screened:
    """What a screening found.

    Attributes
    ----------
    laws : list of LikelyLaw
        The best first.
    elsewhere : list of str
        Laws of the same forms in other equations.
    tests : float
        The effective number of independent laws that were looked at (:func:`effective_tests`).
    forces : dict of str to float
        Gains of the forces of the catalogue on the same table.
    """

    laws: list[LikelyLaw]
    elsewhere: list[str]
    tests: float
    forces: dict[str, float]


def effective_tests(correlations: Array) -> float:
    """Return the effective number of independent tests among correlated ones.

    With the eigenvalues lambda of the matrix of correlations, ``(sum lambda^(1/2))^2 / sum lambda`` (Galwey,
    Genetic Epidemiology 33 (2009), 559).

    Parameters
    ----------
    correlations : ndarray, shape (n, n)

    Examples
    --------
    >>> effective_tests(np.eye(5)), round(effective_tests(np.ones((5, 5))), 6)
    (5.0, 1.0)
    """
    if not correlations.size:
        return 0.0
    found = np.maximum(np.linalg.eigvalsh(correlations), 0.0)
    return float(np.sqrt(found).sum() ** 2 / found.sum())


def screened(fit: Fit, names: Sequence[str], criteria: Criteria, given: Subject) -> Screened:
    """Return the laws worth a fit: the best alone, and the best partners of these.

    Laws that the logs do not tell apart are one. It goes by the name of the one that breaks fewest symmetries
    of the model, then the simplest. A law that is also in the catalogue is left to the catalogue.

    Parameters
    ----------
    fit : Fit
    names : sequence of str
        Of laws.
    criteria : Criteria
    given : Model or BlockModel
        The model whose symmetries a law should keep: the given one, without what a search has added.
    """
    return _screening(fit, names, criteria, given).result()


def best_gains(fit: Fit, names: Sequence[str], criteria: Criteria, given: Subject) -> dict[str, float]:
    """Return the largest gain of a single law on left-out segments, by the equation in which it acts."""
    screening, found = _screening(fit, names, criteria, given), dict[str, float]()
    for law, gain in zip(screening.laws, screening.gains.tolist(), strict=True):
        found[law.equation] = max(gain, found.get(law.equation, 0.0))
    return found


def _screening(fit: Fit, names: Sequence[str], criteria: Criteria, given: Subject) -> _Screening:
    model = fit.problem.model
    have = {e.name for e in model.effects}
    tried = _tried(fit, [n for n in names if n not in have])
    known = [c for c in candidates(fit) if len(c.amplitudes) == 1 and type(c.trial).kind() == "force"]
    scores = Scores(fit, [*tried, *known])
    return _Screening(scores, [c.trial for c in tried], criteria, symmetries(given))


def _tried(fit: Fit, names: Sequence[str]) -> list[Candidate]:
    """Return trials of laws; of a law with a memory, one for each time constant."""
    classes = {n: fit.problem.model.effect_class(n) for n in names}
    lasting = [n for n, cls in classes.items() if issubclass(cls, MemoryLaw)]
    prompt = [Candidate(n, cls(1.0), ("value",)) for n, cls in classes.items() if n not in lasting]
    return [*prompt, *(candidates(fit, lasting) if lasting else [])]


class _Screening:
    """The table of laws (the first columns) and of what the catalogue has, and the choice on it."""

    def __init__(self, scores: Scores, trials: Sequence[Effect], criteria: Criteria, signs: Signs) -> None:
        self.scores = scores
        self.laws = [e for e in trials if isinstance(e, Law)]
        self.broken = [broken_by(type(e), signs) for e in self.laws]
        n = len(self.laws)
        told = np.array([scores.of(i).gain > 0.0 for i in range(n)])  # the model does not have it already
        rho = scores.correlations()
        known = (np.abs(rho[:n, n:]) > SAME).any(axis=1) if rho.shape[1] > n else np.zeros(n, dtype=bool)
        self.open = told & ~known
        self.alike = np.abs(rho[:n, :n]) > SAME
        self.tests = effective_tests(rho[:n, :n][np.ix_(told, told)])
        self.least = TRIALS.promised * criteria.least
        self.gains = np.array([scores.left_out_gain(i) if self.open[i] else 0.0 for i in range(n)])

    def result(self) -> Screened:
        found: dict[str, LikelyLaw] = {}
        tops: list[int] = []
        for i in np.argsort(-self.gains, kind="stable").tolist():
            if self.gains[i] >= self.least and len(found) < ALONE and self.laws[i].name not in found:
                likely = self._likely(i, self.gains[i])
                tops += [i] if found.setdefault(likely.name, likely) is likely else []
        for i in tops[:PARTNERS]:
            j, gain = self._partner(i)
            if gain > self.gains[i] + self.least:
                likely = self._likely(j, gain)
                found.setdefault(likely.name, likely)
        there = {e.name for e, open_ in zip(self.laws, self.open, strict=True) if open_}
        others = [n for n in elsewhere(self.scores.fit.problem.model, list(found)) if n in there]
        return Screened(sorted(found.values(), key=lambda s: -s.gain), others, self.tests, self._forces())

    def _forces(self) -> dict[str, float]:
        found: dict[str, float] = {}
        for i, known in enumerate(self.scores.tried[len(self.laws) :], len(self.laws)):
            found[known.name] = max(self.scores.left_out_gain(i), found.get(known.name, 0.0))
        return found

    def _likely(self, i: int, gain: float) -> LikelyLaw:
        """Return a law with those that these logs do not tell from it, under the name of the simplest."""
        group: dict[str, int] = {}  # a law with a memory: at the time constant that gains most
        for j in np.flatnonzero(self.open & (self.alike[i] | (np.arange(len(self.laws)) == i))).tolist():
            other = group.setdefault(self.laws[j].name, j)
            group[self.laws[j].name] = max(j, other, key=lambda k: (k == i, self.gains[k]))
        best = min(group.values(), key=lambda j: (self.broken[j], self.laws[j].complexity(), -self.gains[j]))
        own = self.laws[best].name
        same = {n: self.broken[j] > self.broken[best] for n, j in group.items() if n != own}
        return LikelyLaw(own, float(gain), same, {n: self.laws[j] for n, j in group.items()})

    def _partner(self, i: int) -> tuple[int, float]:
        """Return the law that gains most beside another one, and their gain together."""
        own = self.scores.columns_of(i)
        others = [j for j in np.flatnonzero(self.open & ~self.alike[i]).tolist() if self._other(i, j)]
        gains = [self.scores.left_out_gain_of((*own, *self.scores.columns_of(j))) for j in others]
        return (others[int(np.argmax(gains))], max(gains)) if gains else (i, 0.0)

    def _other(self, i: int, j: int) -> bool:
        """Return whether two trials are of different laws, not of one law at two time constants."""
        return self.laws[i].name != self.laws[j].name
