"""A flexible yardstick: how much *any* law of a few signals could take from what a model lacks.

For each equation with a remainder the missing term is a sum of hat functions (linear splines) of a signal, of
products of hats of two signals, or ``f(a) + g(b) + h(c)``, each of the three a sum of hats. Their
columns are whitened and multiplied like those of any candidate, and their gain is counted on blocks that did
not choose their coefficients. Neither a name nor a law of these signals can take more than such a sum takes,
up to its resolution and its cost in parameters; what process noise holds and no function of these signals
predicts is not asked for.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.craft.effects.law import Factor, Law, law_class, law_name
from hovercontrol.identification.diagnose.laws.grammar import signals_of
from hovercontrol.identification.diagnose.search.columns import Along
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.kalman import run_filter
from hovercontrol.identification.engine.noise import augment
from hovercontrol.identification.engine.passes import inverse, left_out_gain

#: Hats over one signal alone, and over each of two or three.
KNOTS, KNOTS_OF_MORE = 7, 5

#: Signals that take most alone, of which pairs and triples are tried.
TOGETHER = 4

#: Ridges on the coefficients of hats, as parts of the mean information on one; the best on left-out blocks.
RIDGES = (1e-3, 1e-1, 1.0, 10.0)


@checked
@dataclass(frozen=True, eq=False)
class Yardstick:
    """How much any law of a few signals could still take in one equation.

    Attributes
    ----------
    equation : str
        ``"r'"``.
    signals : tuple of str
        The signals whose functions take most: one, two, or three whose functions are added.
    gain : float
        What functions of them gain in twice the log likelihood of blocks that did not choose them; zero if
        nothing of what is missing is such a function.
    at, force, std : ndarray, shape (k,)
        The missing term as a function of the first signal, and its standard error; in the signal's unit and
        the equation's.
    """

    equation: str
    signals: tuple[str, ...]
    gain: float
    at: Array
    force: Array
    std: Array

    def share(self, taken: float) -> float:
        """Return the share of what can be told from these signals that effects have taken already.

        Parameters
        ----------
        taken : float
            Gain of the effects that are in the model, in twice the log likelihood.

        Examples
        --------
        >>> none = np.zeros(0)
        >>> Yardstick("r'", ("v",), 25.0, none, none, none).share(75.0)
        0.75
        """
        return taken / (taken + self.gain) if taken + self.gain > 0.0 else 1.0


def hats(values: Array, knots: Array) -> Array:
    """Return the linear B-splines at values, shape (k, *values.shape); they sum to one.

    Parameters
    ----------
    values : ndarray
    knots : ndarray, shape (k,)
        Increasing; beyond the ends the outer hats stay at one.

    Examples
    --------
    >>> hats(np.array([0.0, 0.25, 5.0]), np.array([0.0, 1.0])).tolist()
    [[1.0, 0.75, 0.0], [0.0, 0.25, 1.0]]
    """
    inside = np.clip(values, knots[0], knots[-1])
    return np.stack([np.interp(inside, knots, row) for row in np.eye(knots.size)])


def yardsticks(fit: Fit, equations: Sequence[str]) -> tuple[Yardstick, ...]:
    """Return the yardstick of each equation.

    Parameters
    ----------
    fit : Fit
        Of the model as it is, amended or not.
    equations : sequence of str
        States whose equations are asked about.
    """
    return tuple(_Equation(fit, equation).result() for equation in equations)


class _Equation:
    """One equation of a fit: its signals along the path, and the gains of functions of them."""

    def __init__(self, fit: Fit, equation: str) -> None:
        model = fit.problem.model
        signals, units = signals_of(model), model.law_units()
        names = dict.fromkeys((*signals.moving, *signals.angles, *signals.places))
        laws: list[Law] = [law_class(law_name(equation, (Factor("", n),)), units)(1.0) for n in names]
        # a law that the model already has would change its coefficient
        have = {e.name for e in model.effects}
        laws = [e for e in laws if e.name not in have]
        self.fit, self.equation, self.along, self.linear = fit, equation, Along(fit), fit.linear
        self.values = {
            e.product[0].signal: form
            for e, form in zip(laws, self.along.forms(laws), strict=True)
            if np.ptp(form) > 0.0
        }

    def result(self) -> Yardstick:
        """Return the best functions of one, two or three signals."""
        alone = {n: self._gain([self._carried(self._hats(n, KNOTS))]) for n in self.values}
        if not alone:
            return Yardstick(f"{self.equation}'", (), 0.0, np.zeros(0), np.zeros(0), np.zeros(0))
        order = sorted(alone, key=lambda n: -alone[n][0])[:TOGETHER]
        gains: dict[tuple[str, ...], float] = {(n,): alone[n][0] for n in order}
        few = {n: self._hats(n, KNOTS_OF_MORE) for n in order}
        for a, b in itertools.combinations(order, 2):
            both = (few[a][:, None] * few[b][None]).reshape(-1, *few[a].shape[1:])
            gains[a, b] = self._gain([self._carried(both)])[0]
        carried = {n: self._carried(terms) for n, terms in few.items()}
        for three in itertools.combinations(order, 3):
            gains[three] = self._gain([carried[n] for n in three])[0]
        best = max(gains, key=lambda names: gains[names])
        _, theta, C = alone[best[0]]
        at = self._knots(best[0], KNOTS)
        std = np.sqrt(np.maximum(np.diag(C), 0.0))
        return Yardstick(f"{self.equation}'", best, max(float(gains[best]), 0.0), at, theta, std)

    def _knots(self, name: str, count: int) -> Array:
        """Return knots at quantiles of a signal, from its 1 % to its 99 %."""
        found = np.unique(np.quantile(self.values[name], np.linspace(0.01, 0.99, count)))
        return np.asarray(found if found.size > 1 else np.array([found[0], found[0] + 1.0]))

    def _hats(self, name: str, count: int) -> Array:
        return hats(self.values[name], self._knots(name, count))

    def _carried(self, terms: Array) -> Array:
        """Return what rates of the equation add to the free states from row to row, (k, K-1, W, n)."""
        return np.stack([self.along.carried(self.equation, one) for one in terms])

    def _gain(self, groups: Sequence[Array]) -> tuple[float, Array, Array]:
        """Return the gain on left-out blocks of functions, their coefficients and covariance.

        As :meth:`.Scores.left_out_gain`, with a ridge on the coefficients; the best of :data:`RIDGES`.
        """
        fit = self.fit
        terms = np.concatenate(groups)
        more = [(np.moveaxis(terms, 0, -1), None)]
        system = augment(fit.problem, self.linear, fit.noise, more=more)
        every = fit.problem.rows.by_block(run_filter(system).products)
        G, f = every[:, 1:, 1:], -every[:, 1:, 0]
        P = G.shape[-1] - len(terms)  # the model's unknowns; none of a fit with fixed coefficients
        free = np.diag(fit.prior.precision)[:P, :P]
        total, score = G.sum(axis=0), f.sum(axis=0)
        size = float(np.mean(np.diag(total)[P:])) or 1.0
        found = []
        for ridge in RIDGES:
            prior = np.zeros_like(total)
            prior[:P, :P] = free
            prior[P:, P:] = ridge * size * np.eye(len(terms))
            none = np.zeros(len(score))
            gain = left_out_gain(G, f, prior, none) - left_out_gain(G[:, :P, :P], f[:, :P], free, none[:P])
            found.append((gain, prior))
        gain, prior = max(found, key=lambda one: one[0])
        C = inverse(total + prior)
        return gain, (C @ score)[P:], C[P:, P:]
