"""Consistency of a filter's errors with its covariance: NEES and NIS and their chi-square bands.

Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and Navigation", section 5.4.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.base.short_repr import short_repr

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@checked
@dataclass(frozen=True)
class Consistency:
    """Result of :func:`consistency`.

    Attributes
    ----------
    level : float
        Probability that a value lies in its band if the noise is as the filter assumes.
    nees : ndarray, shape (ticks, runs)
        Normalised squared error, ``e^T P^-1 e``: chi-square with n degrees of freedom.
    nees_band : tuple of 2 float
        Band of a single value of `nees`.
    mean_nees : ndarray, shape (ticks,)
        Mean of `nees` over the runs.
    mean_nees_band : tuple of 2 float
        Band of that mean.
    nis : ndarray, shape (runs,)
        Mean over a run of ``innovation^2 / variance``; empty without innovations.
    nis_band : ndarray, shape (2, runs)
        Band of the NIS of each run.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> found = consistency(rng.normal(size=(1, 50, 40)), np.ones((1, 1, 50, 40)))
    >>> found.nees.shape, found.level
    ((50, 40), 0.95)
    """

    level: float
    nees: Array
    nees_band: tuple[float, float]
    mean_nees: Array
    mean_nees_band: tuple[float, float]
    nis: Array
    nis_band: Array

    __repr__ = short_repr

    @property
    def nees_inside(self) -> float:
        """Fraction of all ticks and runs with NEES in its band; its expected value is `level`."""
        return float(np.mean((self.nees >= self.nees_band[0]) & (self.nees <= self.nees_band[1])))

    @property
    def nis_inside(self) -> float:
        """Fraction of the runs with NIS in its band; its expected value is `level`."""
        return float(np.mean((self.nis >= self.nis_band[0]) & (self.nis <= self.nis_band[1])))

    def plot(self, time: ArrayLike | None = None) -> Figure:
        """Draw NEES over time and NIS of each run with their bands.

        Parameters
        ----------
        time : array_like, shape (ticks,), optional
            Times [s]; default: the index of the tick.

        Returns
        -------
        matplotlib.figure.Figure
            One axes, or two if there is a NIS.
        """
        from matplotlib.figure import Figure

        t = np.arange(len(self.nees)) if time is None else np.asarray(time, dtype=float)
        figure = Figure(figsize=(10, 4), layout="constrained")
        axes = figure.subplots(1, 2 if len(self.nis) else 1, squeeze=False)
        left = axes[0, 0]
        left.plot(t, self.nees, color="0.85", linewidth=0.5)
        left.plot(t, self.mean_nees, color="C0", label="mean over runs")
        left.axhspan(*self.mean_nees_band, color="C0", alpha=0.25, label=f"{self.level:.0%} band of the mean")
        for k, edge in enumerate(self.nees_band):
            left.axhline(
                edge, color="0.5", linestyle="--", label="" if k else f"{self.level:.0%} band of a run"
            )
        left.set(xlabel="number of the tick [1]" if time is None else "time [s]", ylabel="NEES [1]")
        left.set_title(f"{self.nees_inside:.0%} in the band")
        left.legend()
        if len(self.nis):
            runs = np.arange(len(self.nis))
            axes[0, 1].fill_between(
                runs, *self.nis_band, color="C0", alpha=0.25, label=f"{self.level:.0%} band"
            )
            axes[0, 1].plot(runs, self.nis, "o", markersize=4)
            axes[0, 1].set(xlabel="number of the run [1]", ylabel="NIS, mean over the run [1]")
            axes[0, 1].set_title(f"{self.nis_inside:.0%} in the band")
            axes[0, 1].legend()
        return open_in_pyplot(figure)


@checked
def consistency(
    error: ArrayLike,
    covariance: ArrayLike,
    innovation: ArrayLike | None = None,
    innovation_variance: ArrayLike | None = None,
    *,
    measured: ArrayLike = True,
    level: float = 0.95,
) -> Consistency:
    """Compare a filter's errors with its covariance, and its innovations with their variances.

    Parameters
    ----------
    error : array_like, shape (n, ticks, runs)
        Estimated minus true values.
    covariance : array_like, shape (n, n, ticks, runs)
        Covariance of the error.
    innovation, innovation_variance : array_like, shape (m, ticks, runs), optional
        Innovations of m scalar measurements and their variances.
    measured : array_like of bool, broadcast to the shape of the innovation, optional
        True where there was a measurement.
    level : float, optional
        Probability of the bands.

    Returns
    -------
    Consistency

    Raises
    ------
    InputError
        If shapes do not fit, the level is not between 0 and 1, a covariance is not positive definite or a
        variance not positive.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> found = consistency(rng.normal(size=(2, 50, 40)), np.eye(2)[:, :, None, None] * np.ones((50, 40)))
    >>> 0.9 < found.nees_inside < 0.99
    True
    """
    if not 0 < level < 1:
        raise InputError(f"consistency: level must be between 0 and 1, found {level!r}")
    e, P = np.asarray(error, dtype=float), np.asarray(covariance, dtype=float)
    if e.ndim != 3 or P.shape != (e.shape[0], *e.shape):
        raise InputError(
            "consistency: expected error of shape (n, ticks, runs) and covariance of (n, n, ticks, runs), "
            f"found {e.shape} and {P.shape}"
        )
    # NEES = e^T P^-1 e = |L^-1 e|^2 with P = L L^T.  One value is chi2(n), the mean of N runs chi2(n N) / N;
    # the band lies between the quantiles (1 - level)/2 and (1 + level)/2.
    n, _, runs = e.shape
    matrices, vectors = np.moveaxis(P, (0, 1), (-2, -1)), np.moveaxis(e, 0, -1)
    try:
        root = np.linalg.cholesky(matrices)
    except np.linalg.LinAlgError:
        raise InputError("consistency: a covariance is not positive definite") from None
    nees = (np.linalg.solve(root, vectors[..., None])[..., 0] ** 2).sum(-1)
    tails = np.array([(1 - level) / 2, (1 + level) / 2])
    nis, nis_band = _nis(innovation, innovation_variance, measured, tails)
    one, mean = chdtri(n, 1.0 - tails), chdtri(n * runs, 1.0 - tails) / runs
    return Consistency(
        level,
        nees,
        (float(one[0]), float(one[1])),
        nees.mean(axis=1),
        (float(mean[0]), float(mean[1])),
        nis,
        nis_band,
    )


def _nis(
    innovation: ArrayLike | None, variance: ArrayLike | None, measured: ArrayLike, tails: Array
) -> tuple[Array, Array]:
    if innovation is None and variance is None:
        return np.empty(0), np.empty((2, 0))
    v, S = np.asarray(innovation, dtype=float), np.asarray(variance, dtype=float)
    if v.ndim != 3 or v.shape != S.shape:
        raise InputError(
            "consistency: expected innovation and innovation_variance of one shape (m, ticks, runs), "
            f"found {v.shape} and {S.shape}"
        )
    there = np.broadcast_to(np.asarray(measured, dtype=bool), v.shape)
    count = there.sum(axis=(0, 1))
    if not count.all():
        raise InputError(f"consistency: there is no measurement in run {int(np.argmin(count))}")
    if not (S[there] > 0).all():
        raise InputError("consistency: a variance of an innovation is not positive")
    # NIS = (1/M) sum nu^2 / S over the M measurements of a run: chi2(M) / M.
    total = np.where(there, v**2 / np.where(there, S, 1.0), 0.0).sum(axis=(0, 1))
    return total / count, chdtri(count, 1.0 - tails[:, None]) / count
