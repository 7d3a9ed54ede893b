"""Whether a fit's residuals are noise: their autocorrelation, and their correlation with the inputs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from scipy import stats

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.figure_style import BLUE, VERMILION
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.base.text_table import aligned
from hovercontrol.identification.engine.feedback import pieces_of
from hovercontrol.identification.engine.fit import Fit

#: Share of noise's correlations within the limits, as MATLAB's ``resid`` draws them.
WITHIN = 0.99


@checked
@dataclass(frozen=True, eq=False)
class Residuals:
    """Correlations of the errors of predictions from row to row (whitened innovations of the Kalman filter).

    Attributes
    ----------
    channels, inputs : tuple of str
    auto : ndarray, shape (n_channels, lags + 1)
        Autocorrelation of each channel's residual, 1 at lag 0.
    cross : ndarray, shape (n_channels, n_inputs, 2 lags + 1)
        Correlation of each residual with each input that many rows before, from -lags to lags.
    limit : float
        Of 100 autocorrelations of white noise, 99 lie within plus and minus this.
    cross_limits : ndarray, shape (n_channels, n_inputs)
        The same for noise that does not depend on the input.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> rng = np.random.default_rng(0)
    >>> v, k = hc.Signal("v", "m/s"), hc.Signal("k", "1/s", start=1.0)
    >>> decay = hc.Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol})
    >>> t = np.linspace(0, 4, 401)
    >>> log = hc.Log("demo", t, {"v": np.exp(-0.7 * t) + 0.01 * rng.normal(size=t.size)})
    >>> found = hc.identify(decay, [log]).residuals(lags=20)
    >>> found.outside("v") <= 2
    True
    """

    channels: tuple[str, ...]
    inputs: tuple[str, ...]
    auto: Array
    cross: Array
    limit: float
    cross_limits: Array

    def outside(self, channel: str, of: str = "") -> int:
        """Return how many correlations lie outside the limits: with itself, or with an input.

        Parameters
        ----------
        channel : str
        of : str, optional
            Name of an input.
        """
        c = self.channels.index(channel)
        if not of:
            return int((np.abs(self.auto[c, 1:]) > self.limit).sum())
        i = self.inputs.index(of)
        return int((np.abs(self.cross[c, i]) > self.cross_limits[c, i]).sum())

    def __repr__(self) -> str:
        lags = self.auto.shape[1] - 1
        head = ("channel", f"of {lags} lags", *(f"with {name}, of {2 * lags + 1}" for name in self.inputs))
        rows = [
            (c, str(self.outside(c)), *(str(self.outside(c, name)) for name in self.inputs))
            for c in self.channels
        ]
        return "\n".join([f"correlations outside the {100 * WITHIN:g} % limits", *aligned([head, *rows])])

    def plot(self) -> Figure:
        """Return a figure: for each channel its autocorrelation and its correlation with each input."""
        many, wide = len(self.channels), 1 + len(self.inputs)
        figure = Figure(figsize=(2.6 + 2.6 * wide, 0.8 + 1.7 * many), layout="constrained")
        axes = figure.subplots(many, wide, squeeze=False, sharex="col")
        lags = np.arange(self.auto.shape[1])
        both = np.arange(1 - lags.size, lags.size)
        for c, channel in enumerate(self.channels):
            columns = [(lags[1:], self.auto[c, 1:], self.limit, "itself")]
            columns += [
                (both, self.cross[c, i], self.cross_limits[c, i], name) for i, name in enumerate(self.inputs)
            ]
            for axis, (at, values, limit, name) in zip(axes[c], columns, strict=True):
                axis.axhspan(-limit, limit, color="0.88")
                far = np.abs(values) > limit
                axis.vlines(at, 0.0, values, colors=np.where(far, VERMILION, BLUE).tolist(), lw=1.4)
                axis.axhline(0.0, color="0.3", lw=0.6)
                axis.set_title(f"{channel} with {name}", fontsize="small")
                axis.set_ylabel("correlation [1]")
                axis.set_ylim(-1.15 * max(limit, np.abs(values).max()), None)
        for axis in axes[-1]:
            axis.set_xlabel("lag [rows]")
        figure.suptitle(
            f"Correlation of residuals; grey: {100 * WITHIN:g} % limits of noise", fontsize="medium"
        )
        return open_in_pyplot(figure)


def residuals_of(fit: Fit, lags: int) -> Residuals:
    """Return the correlations of a fit's residuals up to that many rows."""
    # r_e(k) = sum e(t) e(t-k) / sum e^2 has the variance 1/N, and r_eu(k) = sum e(t) u(t-k) / (|e| |u|) the
    # variance (1/N) sum_k r_e(k) r_u(k), if e is independent of u (Ljung, System Identification, 2nd ed.
    # (1999), 16.6).
    pieces = pieces_of(fit)
    channels, inputs = fit.problem.rows.channels, tuple(s.name for s in fit.problem.block.inputs)
    both = np.arange(-lags, lags + 1)
    mean_e = np.nanmean(np.concatenate([e for _, e in pieces]), axis=0)
    mean_u = np.mean(np.concatenate([u for u, _ in pieces], axis=1), axis=1)
    centred = [((u.T - mean_u).T, np.nan_to_num(e - mean_e).T) for u, e in pieces]
    long = [(u, e) for u, e in centred if e.shape[1] > lags]
    rows = max(sum(e.shape[1] for _, e in centred), 1)

    def correlation(a: list[Array], b: list[Array]) -> Array:
        power = np.sqrt(sum((x @ x) for x in a) * sum((x @ x) for x in b)) or 1.0
        found = sum((_lagged(x, y, lags) for x, y in zip(a, b, strict=True)), np.zeros(both.size))
        return np.asarray(found / power)

    e_of = [[e[c] for _, e in long] for c in range(len(channels))]
    u_of = [[u[i] for u, _ in long] for i in range(len(inputs))]
    auto = np.array([correlation(e, e) for e in e_of])
    own = np.array([correlation(u, u) for u in u_of]).reshape(len(inputs), both.size)
    cross = np.array([[correlation(e, u) for u in u_of] for e in e_of]).reshape(
        len(e_of), len(inputs), both.size
    )
    far = float(stats.norm.ppf(0.5 + WITHIN / 2))
    spread = np.sqrt(np.maximum(auto @ own.T, 1.0) / rows)
    return Residuals(channels, inputs, auto[:, lags:], cross, far / np.sqrt(rows), far * spread)


def _lagged(x: Array, y: Array, lags: int) -> Array:
    """Return sum x(t) y(t - k) for k from -lags to lags."""
    whole = np.correlate(x, y, "full")
    middle = len(y) - 1
    return whole[middle - lags : middle + lags + 1]
