"""A scan for what acts in one regime only: functions of one signal, on the whitened rows of a fit.

In each equation the missing term is ``b f(a)``: a factor b (1, a signal, a product of two commands, or what
multiplies a coefficient of the model) times a function f of one signal a or of its size. So each coefficient
of the model may differ with each signal. f is
a sum of hats (linear splines) with knots at quantiles of a. The columns ``b hat_k(a)`` are whitened like
those of any candidate; gains are counted on blocks that did not choose their coefficients, so that a scan of
many functions needs no further level. f acts where its hats are needed: the fewest neighbours that gain as
much.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np
import sympy as sp

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.short_repr import short_repr
from hovercontrol.craft.effects.law import (
    CURVES,
    OPERATIONS,
    WINDOWS,
    Factor,
    Law,
    law_class,
    law_name,
)
from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.laws.ends import hats, placed
from hovercontrol.identification.diagnose.laws.grammar import signals_of
from hovercontrol.identification.diagnose.laws.regions import Range, ranges, window_ranges
from hovercontrol.identification.diagnose.laws.symmetry import broken_by, symmetries
from hovercontrol.identification.diagnose.search.columns import Along
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.kalman import run_filter
from hovercontrol.identification.engine.noise import augment
from hovercontrol.identification.engine.passes import inverse, left_out_gain
from hovercontrol.identification.engine.subject import Subject, structure

#: Number of hats of a function.
KNOTS = 8

#: Ridges on the coefficients of hats, as parts of the mean information on one; the best on left-out blocks.
RIDGES = (1e-3, 1e-1, 1.0)

#: Most columns that are whitened together.
TOGETHER = 64

#: Number of functions whose ends are sought, the part of the largest gain that they have at least, and how
#: many are fitted.
FEW, NEAR, FITTED = 6, 0.3, 6


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
        The operation: a table, ``"hump"``, ``"rise"`` or ``"fall"``, which is zero on both sides, below, or
        above; or one of :data:`WINDOWS`.
    ends : tuple of float
        The numbers of the operation: between which the function changes.
    """

    equation: str
    by: tuple[Factor, ...]
    of: Factor
    gain: float
    among: int = 1
    kind: str = ""
    ends: tuple[float, ...] = ()

    __repr__ = short_repr

    @property
    def signals(self) -> set[str]:
        """The signals that it uses."""
        return {self.of.signal, *(f.signal for f in self.by)}

    def table(self) -> str:
        """Return the name of the law that is this function as a table."""
        return law_name(self.equation, (*self.by, Factor(self.kind, self.of.signal, self.of.of_abs)))

    def numbers(self) -> dict[str, float]:
        """Return the numbers of its law that say where it acts."""
        return dict(zip(OPERATIONS[self.kind].numbers, self.ends, strict=True))

    def region(self) -> list[Range]:
        """Return where it acts, as :func:`region_of`."""
        if self.kind in WINDOWS:
            return window_ranges(self.of, self.kind, self.ends)
        low, high = self.ends
        return ranges(self.of, None if self.kind == "fall" else low, None if self.kind == "rise" else high)

    def complement(self) -> list[Local]:
        """Return the range of all other values, of a range with one limit."""
        other = {"above": "below", "below": "above"}.get(self.kind)
        return [replace(self, kind=other)] if other else []

    def forms(self) -> list[str]:
        """Return the names of laws of few numbers with a form in place of a table."""
        signal, by = self.of.signal, self.by
        own = Factor("", signal)
        rest = tuple(f for f in by if f.signal != signal)
        curves = [c for c in CURVES if not (self.of.of_abs and c == "beyond")]
        found = [(*by, Factor(curve, signal, self.of.of_abs)) for curve in curves]
        found += [(*by, Factor(power, signal)) for power in ("abs", "sqr")]
        if own in by:  # b f(abs(a)) with a in b: the curves of a keep its sign
            found += [(*rest, Factor(form, signal)) for form in ("beyond", "saturating", "", "cub")]
        elif not self.of.of_abs:
            found += [(*by, Factor(form, signal)) for form in ("", "cub")]
        return [law_name(self.equation, product) for product in found]


def known_products(model: Subject, equation: str, signals: Sequence[str]) -> list[tuple[Factor, ...]]:
    """Return the products of signals, or of their sizes, that a model multiplies by coefficients.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> known_products(hc.vehicle("c17_experiment"), "v", ["u", "v", "r", "thrust"])
    []
    >>> u, d, k, c = (hc.Signal(name, "1/s" if name in "kc" else "1") for name in "udkc")
    >>> law = k.symbol * u.symbol * d.symbol - c.symbol * u.symbol * sp.Abs(u.symbol)
    >>> found = known_products(hc.BlockModel(hc.Block("ship", [u], [d], [u], [k, c], {"u": law})), "u", "ud")
    >>> [" ".join(f.text for f in product) for product in found]
    ['abs(u) u', 'd u']
    """
    block = structure(model)
    own = {
        block.signal(n).symbol: n for n in signals if n in {s.name for s in (*block.states, *block.inputs)}
    }
    others = {s.symbol for s in block.parameters}
    forms = {sp.Abs(symbol): Factor("abs", n) for symbol, n in own.items()}
    forms |= {symbol: Factor("", n) for symbol, n in own.items()}
    found = set[tuple[Factor, ...]]()
    for term in sp.Add.make_args(block.expand(block.derivatives[equation]).expand()):
        rest = [f for f in sp.Mul.make_args(term) if not f.is_number and f not in others]
        if len(rest) > 1 and term.free_symbols & others and all(f in forms for f in rest):
            found.add(tuple(sorted((forms[f] for f in rest), key=lambda f: f.text)))
    return sorted(found, key=lambda product: [f.text for f in product])


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


#: The functions of all signals that gain most in an equation of a fit.
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
            places, ridge = self.knots(local.of), self._ridge(G, f)
            prior = np.zeros(G.shape[1])
            prior[: self._P] = self.fit.prior.precision[: self._P]
            prior[self._P :] = ridge * self._size(G)
            C = inverse(G.sum(axis=0) + np.diag(prior))
            theta, std = (C @ f.sum(axis=0))[self._P :], np.sqrt(np.maximum(np.diag(C)[self._P :], 0.0))
            signals = tuple(dict.fromkeys((local.of.signal, *(b.signal for b in local.by))))
            return Yardstick(f"{self.equation}'", signals, local.gain, places, theta, std)
        return Yardstick(f"{self.equation}'", (), 0.0, none, none, none)

    def found(self) -> list[Local]:
        """Return the functions that gain most where they act, the best first; at most :data:`FITTED`.

        Knots far apart show where a function acts only roughly, so the few that gain most are compared with
        the ends at which each gains most. These gains are under the noise of a fit without them, which holds
        part of what they add: fits must decide.
        """
        best = self._best()
        if not best or best[0][0].gain < CRITERIA.least:
            return [local for local, _, _ in best[:1]]
        most = max(local.gain for local, _, _ in best)
        return self.placed([local for local, _, _ in best if local.gain > NEAR * most])

    def placed(self, found: Sequence[Local]) -> list[Local]:
        """Return functions with the ends at which each gains most, the best first."""
        return self._simplest([one for local in found for one in placed(self, local)])[:FITTED]

    def best(self) -> Local | None:
        """Return the function that gains most, wherever it acts; None if none gains."""
        return next((local for local, _, _ in self._best()), None)

    def information(self, local: Local, places: Array) -> Array:
        """Return the information of the logs on the unknowns and on a function's hats at places."""
        own = hats(self.along_logs(local.of), places)
        return np.asarray(next(self.products([(local.by, local.of, own)]))[1].sum(axis=0))

    def _best(self) -> list[tuple[Local, Array, Array]]:
        """Return the functions that gain most; of all signals they are sought once a fit."""
        if not self._of_all:
            return self._tried()[:FEW]
        known = _BEST.setdefault(self.fit, {})
        if self.equation not in known:
            known[self.equation] = self._tried()[:FEW]
        return known[self.equation]

    def _tried(self) -> list[tuple[Local, Array, Array]]:
        """Return the functions that gain, the best first, with their products and scores."""
        pairs = list(dict.fromkeys(self._pairs()))
        knots_of = {of: self.knots(of) for of in dict.fromkeys(of for _, of in pairs)}
        found: list[tuple[Local, Array, Array]] = []
        for own, G, f in self.products(
            [(by, of, hats(self.along_logs(of), knots_of[of])) for by, of in pairs]
        ):
            by, of = own
            gain = max(self._gain(G, f, ridge) for ridge in RIDGES)
            found.append((Local(self.equation, by, of, gain, len(pairs)), G, f))
        found = [one for one in found if one[0].gain > 0.0]
        order = self._simplest([one[0] for one in found])
        return sorted(found, key=lambda one: order.index(one[0]))

    def _simplest(self, found: list[Local]) -> list[Local]:
        """Return functions, the best first; of those as likely, one that keeps the model's symmetries."""
        model = self.fit.problem.model
        signs, most = symmetries(model), max((one.gain for one in found), default=0.0)

        def place(one: Local) -> tuple[bool, int, int, float]:
            if one.gain < most - CRITERIA.apart:
                return True, 0, 0, -one.gain
            law = law_class(replace(one, kind=one.kind or "hump").table(), model.law_units())
            return False, broken_by(law, signs), len(one.by), -one.gain

        return sorted(found, key=place)

    def _pairs(self) -> Iterator[tuple[tuple[Factor, ...], Factor]]:
        """Return factors and the signals of functions; of signals of both signs, their size too."""
        inputs = [n for n in self._moving if n in self._inputs]
        by: list[tuple[Factor, ...]] = [(), *((Factor("", n),) for n in self._moving)]
        by += [(Factor("", a), Factor("", b)) for a, b in itertools.combinations(inputs, 2)]
        by += known_products(self.fit.problem.model, self.equation, self._moving)
        for factors, name in itertools.product(by, self.values):
            values = self.values[name]
            if {f.signal for f in factors} != {name}:
                yield factors, Factor("", name)
            if values.min() < -0.1 * np.ptp(values) and values.max() > 0.1 * np.ptp(values):
                yield factors, Factor("", name, of_abs=True)

    def along_logs(self, of: Factor) -> Array:
        """Return what a function is of, along the logs."""
        values = self.values[of.signal]
        return np.abs(values) if of.of_abs else values

    def knots(self, of: Factor, n: int = KNOTS) -> Array:
        """Return n knots at quantiles, from 1 % to 99 %."""
        found = np.unique(np.quantile(self.along_logs(of), np.linspace(0.01, 0.99, n)))
        return np.asarray(found if found.size > 1 else np.array([found[0], found[0] + 1.0]))

    def products(
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
            values = self.values[f.signal]
            found = found * (np.abs(values) if f.operation == "abs" else values)
        return found

    def gain_of(self, G: Array, f: Array, T: Array) -> float:
        """Return the gain on left-out blocks of functions that are sums of hats.

        Parameters
        ----------
        G, f : ndarray
            Products of the unknowns and the hats, and scores (:meth:`products`).
        T : ndarray, shape (k, hats)
            What each function has of each hat.
        """
        B = np.eye(G.shape[1])[:, : self._P]
        B = np.hstack([B, np.vstack([np.zeros((self._P, len(T))), T.T])])
        return self._gain(B.T @ G @ B, f @ B, RIDGES[0])

    def _gain(self, G: Array, f: Array, ridge: float) -> float:
        """Return the gain of hats on left-out blocks, beyond that of the unknowns alone."""
        fit, P = self.fit, self._P
        movable = fit.movable.tolist() if P else []
        own = list(range(P, G.shape[1]))
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
