"""A scan for what acts in one regime only: functions of one signal, on the whitened rows of a fit.

In each equation the missing term is ``b f(a)``: a factor b (1, a signal, or a product of two) times a
function f of one signal a or of its size. So each coefficient of the model may differ with each signal. f is
a sum of hats (linear splines) with knots at quantiles of a. The columns ``b hat_k(a)`` are whitened like
those of any candidate; gains are counted on blocks that did not choose their coefficients, so that a scan of
many functions needs no further level. f acts where its hats are needed: the fewest neighbours that gain as
much.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias
from weakref import WeakKeyDictionary

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.short_repr import short_repr
from hovercontrol.craft.effects import Effect
from hovercontrol.craft.effects.law import (
    CURVES,
    VALUES,
    Factor,
    Law,
    TableLaw,
    knots,
    law_class,
    law_name,
)
from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.laws.grammar import signals_of
from hovercontrol.identification.diagnose.laws.symmetry import broken_by, symmetries
from hovercontrol.identification.diagnose.search.columns import Along
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.kalman import run_filter
from hovercontrol.identification.engine.noise import augment
from hovercontrol.identification.engine.passes import inverse, left_out_gain

#: A range of a signal: its name, and the limits, None without one.
Range: TypeAlias = dict[str, float | str | None]

#: Number of hats of a function.
KNOTS = 8

#: Ridges on the coefficients of hats, as parts of the mean information on one; the best on left-out blocks.
RIDGES = (1e-3, 1e-1, 1.0)

#: Most columns that are whitened together.
TOGETHER = 64

#: Most times that the ends of a table are moved.
ROUNDS = 4

#: A table acts where it exceeds this part of its largest value.
FLOOR = 0.1


@checked
@dataclass(frozen=True, eq=False)
class Yardstick:
    """How much any law of one signal, times factors, could still take in one equation.

    Attributes
    ----------
    equation : str
        ``"r'"``.
    signals : tuple of str
        The signals of the function that takes most: its own, then those of its factors.
    gain : float
        What functions of them gain in twice the log likelihood of blocks that did not choose them; zero if
        nothing of what is missing is such a function.
    at, force, std : ndarray, shape (k,)
        The function of the first signal, per factor, and its standard error.
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


@dataclass(frozen=True, eq=False)
class Local:
    """A function of one signal that an equation lacks.

    Attributes
    ----------
    equation : str
        The state in whose equation it acts, ``"r"``.
    by : tuple of Factor
        The factors that multiply the function; none for 1.
    of : Factor
        The signal, or its size, of which it is a function.
    gain : float
        In twice the log likelihood of blocks that did not choose it.
    among : int
        The number of functions from which it was chosen.
    kind : str
        ``"hump"``, ``"rise"`` or ``"fall"``: zero on both sides, below, or above.
    low, high : float
        Between which the function changes.
    """

    equation: str
    by: tuple[Factor, ...]
    of: Factor
    gain: float
    among: int = 1
    kind: str = ""
    low: float = 0.0
    high: float = 0.0

    __repr__ = short_repr

    @property
    def signals(self) -> set[str]:
        """The signals that it uses."""
        return {self.of.signal, *(f.signal for f in self.by)}

    def table(self) -> str:
        """Return the name of the law that is this function as a table."""
        return law_name(self.equation, (*self.by, Factor(self.kind, self.of.signal, self.of.of_abs)))

    def region(self) -> list[Range]:
        """Return where it acts, as :func:`region_of`."""
        low = None if self.kind == "fall" else self.low
        return ranges(self.of, low, None if self.kind == "rise" else self.high)

    def forms(self) -> list[str]:
        """Return the names of laws of few numbers with a form in place of the function."""
        signal, by = self.of.signal, self.by
        own = Factor("", signal)
        rest = tuple(f for f in by if f != own)
        curves = [c for c in CURVES if not (self.of.of_abs and c == "beyond")]
        found = [(*by, Factor(curve, signal, self.of.of_abs)) for curve in curves]
        found += [(*by, Factor(power, signal)) for power in ("abs", "sqr")]
        if own in by:  # b f(abs(a)) with a in b: the curves of a keep its sign
            found += [(*rest, Factor(form, signal)) for form in ("beyond", "saturating", "", "cub")]
        elif not self.of.of_abs:
            found += [(*by, Factor(form, signal)) for form in ("", "cub")]
        return [law_name(self.equation, product) for product in found]


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
    # the place of a value among the knots, counted from the first, and its distance from each of them
    place = np.interp(values, knots, np.arange(knots.size))
    return np.maximum(1.0 - np.abs(place - np.arange(knots.size).reshape(-1, *[1] * place.ndim)), 0.0)


def yardsticks(fit: Fit, equations: Sequence[str]) -> tuple[Yardstick, ...]:
    """Return the yardstick of each equation: neither a name nor a law of these signals takes more.

    Parameters
    ----------
    fit : Fit
        Of the model as it is, amended or not.
    equations : sequence of str
        States whose equations are asked about.
    """
    return tuple(Scan(fit, equation).yardstick() for equation in equations)


#: The function of all signals that gains most in an equation of a fit.
_BEST: WeakKeyDictionary[Fit, dict[str, list[tuple[Local, Array, Array]]]] = WeakKeyDictionary()


class Scan:
    """Functions of one signal that an equation of a fit may lack.

    Parameters
    ----------
    fit : Fit
    equation : str
        ``"r"``
    only : set of str, optional
        Signals to which the functions are limited.
    """

    def __init__(self, fit: Fit, equation: str, only: set[str] | None = None) -> None:
        self.fit, self.equation, self.along, self.linear = fit, equation, Along(fit), fit.linear
        model = fit.problem.model
        signals = signals_of(model)
        self._inputs = signals.inputs
        names = [*signals.moving, *signals.angles, *signals.places, "time"]
        names = [n for n in dict.fromkeys(names) if only is None or n in only]
        have = {e.name for e in model.effects}  # a law that the model has would change its coefficient
        units = model.law_units()
        laws: list[Law] = [law_class(law_name(equation, (Factor("sqr", n),)), units)(1.0) for n in names]
        linear: list[Law] = [law_class(law_name(equation, (Factor("", n),)), units)(1.0) for n in names]
        linear = [b if b.name not in have else a for a, b in zip(laws, linear, strict=True)]
        self.values: dict[str, Array] = {}
        for e, form in zip(linear, self.along.forms(linear), strict=True):
            if np.ptp(form) > 0.0:
                self.values[e.product[0].signal] = form
        self._of_all = only is None
        self._P = fit.S.shape[-1]  # unknowns; none if coefficients are fixed
        self._alone: float | None = None
        self._moving = [n for n in signals.moving if n in self.values]

    def yardstick(self) -> Yardstick:
        """Return the function that gains most, wherever it acts."""
        none = np.zeros(0)
        for local, G, f in self._best():
            places, ridge = self._knots(local.of), self._ridge(G, f)
            prior = np.zeros(G.shape[1])
            prior[: self._P] = self.fit.prior.precision[: self._P]
            prior[self._P :] = ridge * self._size(G)
            C = inverse(G.sum(axis=0) + np.diag(prior))
            theta, std = (C @ f.sum(axis=0))[self._P :], np.sqrt(np.maximum(np.diag(C)[self._P :], 0.0))
            signals = tuple(dict.fromkeys((local.of.signal, *(b.signal for b in local.by))))
            return Yardstick(f"{self.equation}'", signals, local.gain, places, theta, std)
        return Yardstick(f"{self.equation}'", (), 0.0, none, none, none)

    def found(self) -> list[Local]:
        """Return the function that gains most where it acts, or nothing."""
        return [self._placed(*one) for one in self._best()]

    def best(self) -> Local | None:
        """Return the function that gains most, wherever it acts; None if none gains."""
        return next((local for local, _, _ in self._best()), None)

    def argument(self, local: Local) -> Array:
        """Return the argument of a function along the logs."""
        return self._of(local.of)

    def information(self, local: Local, places: Array) -> Array:
        """Return the information of the logs on the unknowns and on a function's hats at places."""
        own = hats(self._of(local.of), places)
        return np.asarray(next(self._products([(local.by, local.of, own)]))[1].sum(axis=0))

    def _best(self) -> list[tuple[Local, Array, Array]]:
        """Return the function that gains most, or nothing; of all signals it is sought once a fit."""
        if not self._of_all:
            return self._tried()[:1]
        known = _BEST.setdefault(self.fit, {})
        if self.equation not in known:
            known[self.equation] = self._tried()[:1]
        return known[self.equation]

    def _tried(self) -> list[tuple[Local, Array, Array]]:
        """Return the functions that gain, the best first, with their products and scores."""
        pairs = list(self._pairs())
        knots_of = {of: self._knots(of) for of in dict.fromkeys(of for _, of in pairs)}
        found: list[tuple[Local, Array, Array]] = []
        for own, G, f in self._products([(by, of, hats(self._of(of), knots_of[of])) for by, of in pairs]):
            by, of = own
            gain = max(self._gain(G, f, ridge) for ridge in RIDGES)
            found.append((Local(self.equation, by, of, gain, len(pairs)), G, f))
        return self._simplest([one for one in found if one[0].gain > 0.0])

    def _simplest(self, found: list[tuple[Local, Array, Array]]) -> list[tuple[Local, Array, Array]]:
        """Return functions, the best first; of those as likely, one that keeps the model's symmetries."""
        model = self.fit.problem.model
        signs, most = symmetries(model), max((one[0].gain for one in found), default=0.0)

        def place(one: tuple[Local, Array, Array]) -> tuple[bool, int, int, float]:
            if one[0].gain < most - CRITERIA.apart:
                return True, 0, 0, -one[0].gain
            law = law_class(replace(one[0], kind="hump").table(), model.law_units())
            return False, broken_by(law, signs), len(one[0].by), -one[0].gain

        return sorted(found, key=place)

    def _pairs(self) -> Iterator[tuple[tuple[Factor, ...], Factor]]:
        """Return factors and the signals of functions; of signals of both signs, their size too."""
        inputs = [n for n in self._moving if n in self._inputs]
        by: list[tuple[Factor, ...]] = [(), *((Factor("", n),) for n in self._moving)]
        by += [(Factor("", a), Factor("", b)) for a, b in itertools.combinations(inputs, 2)]
        for factors, name in itertools.product(by, self.values):
            values = self.values[name]
            own = any(f.signal == name for f in factors)
            if not own or len(factors) > 1:
                yield factors, Factor("", name)
            if values.min() < -0.1 * np.ptp(values) and values.max() > 0.1 * np.ptp(values):
                yield factors, Factor("", name, of_abs=True)

    def _of(self, of: Factor) -> Array:
        values = self.values[of.signal]
        return np.abs(values) if of.of_abs else values

    def _knots(self, of: Factor) -> Array:
        """Return knots at quantiles, from 1 % to 99 %."""
        found = np.unique(np.quantile(self._of(of), np.linspace(0.01, 0.99, KNOTS)))
        return np.asarray(found if found.size > 1 else np.array([found[0], found[0] + 1.0]))

    def _products(
        self, terms: Sequence[tuple[tuple[Factor, ...], Factor, Array]]
    ) -> Iterator[tuple[tuple[tuple[Factor, ...], Factor], Array, Array]]:
        """Return the products of the unknowns and the columns of each term, and their scores, by block."""
        fit, at = self.fit, 0
        while at < len(terms):
            part, count = list[tuple[tuple[Factor, ...], Factor, Array]](), 0
            while at < len(terms) and (not part or count + len(terms[at][2]) <= TOGETHER):
                part.append(terms[at])
                count += len(terms[at][2])
                at += 1
            columns = np.concatenate([self._factor(by) * own for by, _, own in part])
            drive = np.moveaxis(self.along.carried(self.equation, columns), 0, -1)
            system = augment(fit.problem, self.linear, fit.noise, more=[(drive, None)])
            every = fit.problem.rows.by_block(run_filter(system).products)
            P = self._P
            first = 1 + P
            for by, of, own in part:
                mine = [*range(1 + P), *range(first, first + len(own))]
                first += len(own)
                some = every[:, mine][:, :, mine]
                yield (by, of), some[:, 1:, 1:], -some[:, 1:, 0]

    def _factor(self, by: tuple[Factor, ...]) -> Array:
        found = np.ones(())
        for f in by:
            found = found * self.values[f.signal]
        return found

    def _gain(self, G: Array, f: Array, ridge: float, hat: Sequence[int] | None = None) -> float:
        """Return the gain on left-out blocks of some of the hats, beyond that of the unknowns alone."""
        fit, P = self.fit, self._P
        movable = fit.movable.tolist() if P else []
        own = [P + k for k in (range(G.shape[1] - P) if hat is None else hat)]
        rows = [*movable, *own]
        prior = np.r_[fit.prior.precision[movable], np.full(len(own), ridge * self._size(G))]
        pull = np.r_[fit.prior.slope(fit.problem.inside(fit.p))[movable], np.zeros(len(own))]
        k = len(movable)
        G, f = G[:, rows][:, :, rows], f[:, rows]
        if self._alone is None:  # that of the unknowns is the same beside any hats
            bare = G[:, :k, :k], f[:, :k], np.diag(prior[:k]), pull[:k]
            self._alone = left_out_gain(*bare) if k else 0.0
        return left_out_gain(G, f, np.diag(prior), pull) - self._alone

    def _size(self, G: Array) -> float:
        """Return the mean information on a hat."""
        return float(np.mean(np.diagonal(G[:, self._P :, self._P :].sum(axis=0)))) or 1.0

    def _ridge(self, G: Array, f: Array) -> float:
        return max(RIDGES, key=lambda r: self._gain(G, f, r))

    def _placed(self, local: Local, G: Array, f: Array) -> Local:
        """Return a function with the fewest neighbouring hats that gain as much, as the ends of a table."""
        places, ridge = self._knots(local.of), self._ridge(G, f)
        n = places.size
        spans = [(i, j) for i in range(n) for j in range(i, n) if not (i == 0 and j == n - 1)]
        gains = {span: self._gain(G, f, ridge, range(span[0], span[1] + 1)) for span in spans}
        most = max(gains.values())
        near = [s for s, g in gains.items() if g > most - CRITERIA.apart]
        i, j = min(near, key=lambda s: (s[1] - s[0], -gains[s]))
        kind = "fall" if i == 0 else "rise" if j == n - 1 else "hump"
        low, high = places[max(i - 1, 0)], places[min(j + 1, n - 1)]
        return self._refined(replace(local, kind=kind, low=float(low), high=float(high)), ridge)

    def _refined(self, local: Local, ridge: float) -> Local:
        """Return a table with its ends moved to where it gains most, a quarter of its width at a time."""
        a = self._of(local.of)
        least, most = float(a.min()), float(a.max())
        for _ in range(ROUNDS):
            wide = local.high - local.low
            steps = wide * np.array([-0.5, -0.25, 0.0, 0.25])
            ends = [
                (low, high)
                for low in np.clip(local.low + steps, least, most).tolist()
                for high in np.clip(local.high - steps, least, most).tolist()
                if high - low > 0.1 * wide
            ]
            if not ends:  # the signal ends within the table: it has no room to move
                break
            tables = [(local.by, local.of, _table_hats(local.kind, a, *one)) for one in ends]
            gains = [self._gain(G, f, ridge) for _, G, f in self._products(tables)]
            low, high = ends[int(np.argmax(gains))]
            same = (low, high) == (local.low, local.high)
            local = replace(local, low=low, high=high, gain=max(local.gain, max(gains)))
            if same:
                break
        return local


def _table_hats(kind: str, a: Array, low: float, high: float) -> Array:
    """Return what a unit of each value of a table adds, over its signal."""
    at, below, above = knots(kind, low, high), kind != "fall", kind != "rise"
    return hats(a, np.array([*[low] * below, *at, *[high] * above]))[below:][: len(VALUES)]


def region_of(e: Effect) -> list[Range]:
    """Return where an effect acts: ranges of a signal, in any of which it does; empty if everywhere.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> craft = hc.vehicle("c17_experiment")
    >>> region_of(craft.effect_class("law_r__over_r")(-1.2, at=1.5))
    [{'signal': 'r', 'low': 1.5, 'high': None}]
    >>> [(one["low"], one["high"]) for one in region_of(craft.effect_class("law_r__beyond_r")(-1.2, at=1.5))]
    [(None, -1.5), (1.5, None)]
    """
    own = e.curve() if isinstance(e, Law) else None
    if own is None:
        return []
    if isinstance(e, TableLaw):
        _, at, values = e.table()
        large = [abs(v) > FLOOR * max(map(abs, values)) for v in values]
        if not any(large):
            return []
        first, last = large.index(True), len(large) - 1 - large[::-1].index(True)
        low = None if first == 0 else at[first - 1]
        return ranges(own, low, None if last == len(large) - 1 else at[last + 1])
    if own.operation in ("over", "beyond", "logistic"):
        return ranges(own, e.values["at"], None)
    return ranges(own, None, e.values["at"]) if own.operation == "under" else []


def ranges(of: Factor, low: float | None, high: float | None) -> list[Range]:
    """Return the ranges of a signal in which it, or its size, lies between two limits; None for no limit."""
    ahead: Range = {"signal": of.signal, "low": low, "high": high}
    if not of.of_abs and of.operation != "beyond":
        return [ahead]
    if not low:
        return [ahead | {"low": None if high is None else -high}]
    return [ahead | {"low": None if high is None else -high, "high": -low}, ahead]
