"""The observability Gramian of coefficients over a window: C17 section III, [C17 eq 6].

For ``x' = h + G c`` with measured x, and Gamma(t) the integral of G from t0 to t,

    W(t0, tf) = integral over t from t0 to tf of [I  Gamma(t)]' [I  Gamma(t)] dt.

C17 prints (6) with tf as the inner integral's upper limit, for which W has rank n and is never
invertible; the proof of its Lemma 2 integrates to t, and so does this. The same slip stands before (6): the
Peano-Baker series of the transition matrix Phi(t, t0), and what its nilpotent A leaves of it, integrate to tf
where they must integrate to t (so printed, Phi would not depend on t).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike
from scipy.integrate import cumulative_trapezoid

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.base.short_repr import short_repr
from hovercontrol.blocks.block import Block
from hovercontrol.control.analysis.directions import Direction
from hovercontrol.control.analysis.excitation import mean_weights
from hovercontrol.control.observers.observable_subspace import readable
from hovercontrol.control.observers.regression import regression
from hovercontrol.control.observers.regressors import regressors_along

#: Eigenvalues below this share of the largest are zero: neither solvers nor sensors give signals to
#: better than 1e-6, and W has them squared.
SINGULAR = 1e-12


@dataclass(frozen=True, eq=False)
class _Sampled:
    """G over time, scaled: rows by the states' sizes, columns by the coefficients'.

    Of a sampled Block, whose period is positive, Gamma and W are sums over its steps, not integrals.
    """

    time: Array
    G: Array
    period: float

    def between(self, start: float, stop: float) -> _Sampled:
        inside = (self.time >= start) & (self.time <= stop)
        return _Sampled(self.time[inside], self.G[..., inside], self.period)

    def root(self) -> Array:
        """Return a matrix whose square (from the left) is W."""
        n, m, k = self.G.shape
        if self.period:
            gamma = np.cumsum(self.G, axis=-1) - self.G
        else:
            gamma = cumulative_trapezoid(self.G, self.time, axis=-1, initial=0.0)
        rows = np.concatenate([np.broadcast_to(np.eye(n)[..., None], (n, n, k)), gamma], axis=1)
        return (rows * np.sqrt(self.weights)).transpose(2, 0, 1).reshape(-1, n + m)

    @property
    def weights(self) -> Array:
        if self.period:
            return np.ones(len(self.time))
        return mean_weights(self.time) * (self.time[-1] - self.time[0])


@checked
@dataclass(frozen=True, eq=False)
class SlidingGramian:
    """Spectra of the Gramian over windows that slide along a motion.

    Attributes
    ----------
    time : ndarray, shape (k,)
        End of each window [s].
    eigenvalues : ndarray, shape (n + m, k)
        Rising.
    width : float
        Of a window [s].

    Examples
    --------
    >>> import hovercontrol as hc
    >>> t = np.linspace(0.0, 2.0, 101)
    >>> craft = hc.vehicle("c17_simulation").plant()
    >>> W = observability_gramian(craft, t, {"u": 1.0 + t}, ["surge_linear_drag"])
    >>> W.sliding(1.0).eigenvalues.shape
    (2, 11)
    """

    time: Array
    eigenvalues: Array
    width: float

    __repr__ = short_repr

    @property
    def condition(self) -> Array:
        """Condition number of each window, shape (k,); infinite where W is singular."""
        low, high = self.eigenvalues[0], self.eigenvalues[-1]
        return np.where(low > 0, high / np.where(low > 0, low, 1.0), np.inf)

    def plot(self) -> Figure:
        """Return eigenvalues and condition number over the windows."""
        return open_in_pyplot(_sliding_figure(self, "SI units, or s"))


def _sliding_figure(sliding: SlidingGramian, unit: str) -> Figure:
    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    spectrum, condition = figure.subplots(2, 1, sharex=True)
    positive = np.where(sliding.eigenvalues > 0, sliding.eigenvalues, np.nan)
    spectrum.semilogy(sliding.time, positive.T)
    spectrum.set(title=f"windows of {sliding.width:g} s", ylabel=f"eigenvalues [{unit}]")
    finite = np.where(np.isfinite(sliding.condition), sliding.condition, np.nan)
    condition.semilogy(sliding.time, finite)
    condition.set(xlabel="end of the window [s]", ylabel="condition number [1]")
    return figure


@checked
@dataclass(frozen=True, eq=False)
class Gramian:
    """The observability Gramian of states and coefficients over a window.

    Attributes
    ----------
    window : tuple of float
        t0 and tf [s].
    states, coefficients : tuple of str
        n and m names: rows and columns of ``matrix``, states first.
    units : dict of str to str
        Of the coefficients.
    sizes : dict of str to float
        What states and coefficients are measured in: their nominal sizes, or 1.
    matrix : ndarray, shape (n + m, n + m)
        W; in seconds where it is scaled, of a sampled Block without unit.
    eigenvalues : ndarray, shape (n + m,)
        Rising; those below ``SINGULAR`` of the largest are 0.
    coefficient_matrix : ndarray, shape (m, m)
        What W knows of the coefficients when the initial state is unknown: its Schur complement,
        the integral of (Gamma - mean)'(Gamma - mean).
    hidden : tuple of Direction
        The combinations of coefficients that are not seen: null space of ``coefficient_matrix``.
    weakest : Direction
        The first of those, or the combination that is seen least.
    std : dict of str to float
        Standard deviation that is left of each coefficient, in its unit, when every measured state
        has noise of intensity 1 (in ``sizes`` of the state, squared, times s) and nothing else is
        known; infinite where a hidden combination holds the coefficient.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> t = np.linspace(0.0, 1.0, 101)
    >>> craft = hc.vehicle("c17_simulation").plant()
    >>> W = observability_gramian(craft, t, {"u": 1.0 + t}, ["surge_linear_drag"])
    >>> W.observable, W.matrix.shape
    (True, (2, 2))
    """

    window: tuple[float, float]
    states: tuple[str, ...]
    coefficients: tuple[str, ...]
    units: dict[str, str]
    sizes: dict[str, float]
    matrix: Array
    eigenvalues: Array
    coefficient_matrix: Array
    hidden: tuple[Direction, ...]
    weakest: Direction
    std: dict[str, float]
    _sampled: _Sampled = field(repr=False)

    __repr__ = short_repr

    @property
    def condition(self) -> float:
        """Largest over smallest eigenvalue; infinite where W is singular."""
        low = float(self.eigenvalues[0])
        return float(self.eigenvalues[-1]) / low if low > 0 else math.inf

    @property
    def observable(self) -> bool:
        """Whether W is invertible [C17 lemma 1]."""
        return math.isfinite(self.condition)

    def sentence(self) -> str:
        """Return as text the direction that the window excites least."""
        where = f"between {self.window[0]:.4g} s and {self.window[1]:.4g} s"
        if self.hidden:
            changes = "; ".join(d.sentence() for d in self.hidden)
            return f"{where} the motion does not show a change of {changes}"
        text = f"the motion shows a change of {self.weakest.sentence()} least"
        return f"{where} {text} (condition number {self.condition:.3g})"

    def table(self) -> str:
        """Return the coefficients as text, the worst known first."""
        wide = max(len(name) for name in self.coefficients)
        share = {name: self.std[name] / self.sizes[name] for name in self.coefficients}
        lines = [f"{'coefficient':{wide}} {'std':>10} {'std / size':>10}  unit"]
        for name in sorted(share, key=lambda key: -share[key]):
            numbers = f"{self.std[name]:10.3g} {share[name]:10.3g}"
            lines.append(f"{name:{wide}} {numbers}  {self.units[name]}")
        return "\n".join([*lines, self.sentence()])

    def sliding(self, width: float, step: float | None = None) -> SlidingGramian:
        """Return the spectra over windows that slide along this one.

        Parameters
        ----------
        width : float
            Of each window [s].
        step : float, optional
            From one to the next [s]; default a tenth of the width.

        Raises
        ------
        InputError
            If width or step is not positive, or no window with two samples fits.
        """
        step = width / 10 if step is None else step
        start, stop = self.window
        if not (0 < width <= (stop - start) * (1 + 1e-9) and step > 0):
            raise InputError(
                f"sliding: expected 0 < width <= {stop - start:g} s and step > 0, "
                f"found width {width:g} and step {step:g}"
            )
        ends = start + width + step * np.arange(int((stop - start - width) / step + 1e-9) + 1)
        slack = 1e-9 * width
        parts = [self._sampled.between(end - width - slack, end + slack) for end in ends]
        if min(len(part.time) for part in parts) < 2:
            raise InputError(f"sliding: a window of {width:g} s has less than two samples")
        spectra = np.array([_spectrum(part.root())[0] for part in parts])
        return SlidingGramian(np.asarray(ends), spectra.T, width)

    def plot(self, width: float | None = None) -> Figure:
        """Return a figure: eigenvalues and condition number over sliding windows.

        Parameters
        ----------
        width : float, optional
            Of the windows [s]; default a fifth of the whole.
        """
        width = (self.window[1] - self.window[0]) / 5 if width is None else width
        unit = "s" if any(size != 1.0 for size in self.sizes.values()) else "SI units"
        return open_in_pyplot(_sliding_figure(self.sliding(width), unit))


@checked
def observability_gramian(
    block: Block,
    time: ArrayLike,
    signals: Mapping[str, ArrayLike],
    coefficients: Sequence[str] | None = None,
    window: tuple[float, float] | None = None,
    *,
    scaled: bool = True,
) -> Gramian:
    """Return the observability Gramian of a Block's coefficients along a motion.

    Parameters
    ----------
    block : Block
        Linear in the coefficients; continuous, or sampled.
    time : array_like, shape (n,)
        Increasing times [s]; steps may differ. Of a sampled Block its period apart.
    signals : mapping of str to array_like, shape (n,)
        The states and inputs that G needs, by name; more are ignored.
    coefficients : sequence of str, optional
        Default: all in which the Block is linear.
    window : tuple of float, optional
        t0 and tf [s]; default the whole motion.
    scaled : bool, optional
        Measure states and coefficients in their nominal sizes (default), so that the condition
        number does not depend on units.

    Returns
    -------
    Gramian

    Raises
    ------
    InputError
        If signals are missing (all are named), of another length or not finite, time does not
        increase or has other steps than a sampled Block, the window has less than two samples, or the Block
        is not linear in a coefficient.

    Notes
    -----
    C17 (6), with the trapezoidal rule for both integrals; of a sampled Block both are sums over its steps.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import c17_simulation
    >>> t = np.linspace(0.0, 1.0, 101)
    >>> drag = ["surge_coulomb", "surge_linear_drag"]
    >>> W = observability_gramian(c17_simulation().plant(), t, {"u": 2.0 + 0 * t}, drag)
    >>> W.observable, str(W.weakest)
    (False, 'surge_coulomb - 0.5 surge_linear_drag')
    """
    model = regression(block, coefficients)
    t = np.asarray(time, dtype=float)
    G = regressors_along(model, t, signals)
    x_sizes = np.array([s.nominal if scaled else 1.0 for s in model.states])
    c_sizes = np.array([c.nominal if scaled else 1.0 for c in model.coefficients])
    if block.period and not np.allclose(np.diff(t), block.period, rtol=1e-6):
        raise InputError(f"time: expected rows {block.period:g} s apart, the period of block {block.name!r}")
    sampled = _Sampled(t, G * c_sizes[None, :, None] / x_sizes[:, None, None], block.period)
    if window is not None:
        sampled = sampled.between(*window)
        if len(sampled.time) < 2:
            wanted, there = f"{window[0]:g} s to {window[1]:g} s", f"{t[0]:g} s to {t[-1]:g} s"
            raise InputError(f"window: less than two samples from {wanted}; time is {there}")
    n = len(model.states)
    root = sampled.root()
    matrix = root.T @ root
    eigenvalues, _ = _spectrum(root)
    # The Schur complement is the same integral with Gamma less its mean.
    mean = matrix[:n, n:] / sampled.weights.sum()
    centred = root[:, n:] - np.kron(np.sqrt(sampled.weights)[:, None], mean)
    known, vectors = _spectrum(centred, eigenvalues[-1])
    null = vectors[:, known == 0]
    units = {name: c.unit for name, c in zip(model.names, model.coefficients, strict=True)}
    hidden = tuple(Direction.of(units, v, c_sizes) for v in readable(null.T))
    seen = vectors[:, known > 0] / np.sqrt(known[known > 0])
    lost = np.linalg.norm(null, axis=1) > math.sqrt(SINGULAR)
    std = c_sizes * np.where(lost, np.inf, np.linalg.norm(seen, axis=1))
    states = tuple(s.name for s in model.states)
    sizes = dict(zip((*states, *model.names), (*x_sizes.tolist(), *c_sizes.tolist()), strict=True))
    return Gramian(
        (float(sampled.time[0]), float(sampled.time[-1])),
        states,
        model.names,
        units,
        sizes,
        matrix,
        eigenvalues,
        centred.T @ centred,
        hidden,
        hidden[0] if hidden else Direction.of(units, vectors[:, 0], c_sizes),
        dict(zip(model.names, std.tolist(), strict=True)),
        sampled,
    )


def _spectrum(root: Array, largest: float | None = None) -> tuple[Array, Array]:
    """Return the eigenvalues of root' root, rising, and its eigenvectors as columns."""
    _, s, Vt = np.linalg.svd(root, full_matrices=len(root) < root.shape[1])
    values = np.append(s, np.zeros(len(Vt) - len(s))) ** 2
    top = values[0] if largest is None else largest
    return np.where(values > SINGULAR * top, values, 0.0)[::-1], Vt[::-1].T
