"""Coefficients estimated along a log, sample by sample."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.base.short_repr import short_repr
from hovercontrol.blocks.block import Block
from hovercontrol.control.observers.regression import regression
from hovercontrol.control.observers.regressors import Regressors
from hovercontrol.control.observers.sampled import SampledEstimator

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@checked
@dataclass(frozen=True, eq=False)
class CoefficientHistory:
    """Estimated coefficients over time.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Times [s].
    coefficients, std : dict of str to ndarray, shape (n,)
        Estimate and its standard deviation, by name.
    units : dict of str to str

    Examples
    --------
    >>> t = np.array([0.0, 1.0])
    >>> history = CoefficientHistory(t, {"k": 1.0 + t}, {"k": 0.1 + 0 * t}, {"k": "1/s"})
    >>> history.coefficients["k"].tolist()
    [1.0, 2.0]
    """

    time: Array
    coefficients: dict[str, Array]
    std: dict[str, Array]
    units: dict[str, str]

    __repr__ = short_repr

    @property
    def values(self) -> Array:
        """The estimates as columns, shape (n, m)."""
        return np.column_stack(list(self.coefficients.values()))

    def table(self) -> str:
        """Return the last estimates as text, one line per coefficient."""
        wide = max(len(name) for name in self.coefficients)
        return "\n".join(
            f"{name:{wide}}  {values[-1]:10.4g} +- {self.std[name][-1]:<8.2g} {self.units[name]}"
            for name, values in self.coefficients.items()
        )

    def plot(self) -> Figure:
        """Return a figure: every coefficient over time, with a band of two standard deviations."""
        from matplotlib.figure import Figure

        columns = min(2, len(self.coefficients))
        rows = -(-len(self.coefficients) // columns)
        figure = Figure(figsize=(4.5 * columns, 1.0 + 1.6 * rows), layout="constrained")
        axes = figure.subplots(rows, columns, sharex=True, squeeze=False).ravel()
        for ax, (name, values) in zip(axes, self.coefficients.items(), strict=False):
            band = 2 * self.std[name]
            ax.fill_between(self.time, values - band, values + band, alpha=0.25, linewidth=0)
            ax.plot(self.time, values)
            ax.set(title=name, ylabel=f"[{self.units[name]}]")
        for ax in axes[len(self.coefficients) :]:
            ax.set_visible(False)
        figure.supxlabel("time [s]")
        return open_in_pyplot(figure)


@checked
def estimate_from_log(
    block: Block,
    time: ArrayLike,
    signals: Mapping[str, ArrayLike],
    estimate: Sequence[str] | None = None,
    *,
    hold: Literal["zero", "linear"] = "zero",
    R: ArrayLike = 1e-5,
    Q: ArrayLike = 1e-2,
    P0: ArrayLike = 1e-2,
    x0: Sequence[float] | None = None,
) -> CoefficientHistory:
    """Return the coefficients estimated along a log.

    Parameters
    ----------
    block : Block
    time : array_like, shape (n,)
        Increasing times [s]. Steps may differ; the median is the nominal sample time. After a gap
        (as defined by :class:`~hovercontrol.logs.Log`) the states are initialised again from the sample.
    signals : mapping of str to array_like, shape (n,)
        The states and inputs that h and G need, by name; other signals are ignored.
    hold : {"zero", "linear"}, optional
        How an input runs from its row to the next: constant or linear.
    estimate, R, Q, P0, x0
        As for :class:`SampledEstimator`.

    Raises
    ------
    InputError
        As :class:`SampledEstimator`; or if time does not increase, hold is unknown, or signals are
        missing (all are named), of another length or not finite.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import hoverdemon
    >>> t = np.arange(0.0, 3.0, 0.01)
    >>> signals = {"u": t * 2 / 2.6, "v": 0 * t, "r": 0 * t, "thrust": 0 * t + 2, "rudder": 0 * t}
    >>> plant = hoverdemon().plant().with_values({"plant.thrust": 0.5})
    >>> print(estimate_from_log(plant, t, signals, ["thrust"]).table())
    thrust      0.3848 +- 0.073    m/s^2/N
    """
    from hovercontrol.logs.log import gap_rows

    if hold not in ("zero", "linear"):
        raise InputError(f"hold must be 'zero' or 'linear', found {hold!r}")
    t = np.asarray(time, dtype=float)
    model = regression(block, estimate)
    rows = Regressors(model).columns(t, signals)
    e = SampledEstimator(block, estimate, dt=float(np.median(np.diff(t))), R=R, Q=Q, P0=P0, x0=x0)
    k, m = len(e.measured), len(e.names)
    values, variances = np.empty((len(t), m)), np.empty((len(t), m))
    # Input of the step from k - 1 to k: u_{k-1} ("zero"), or the mean (u_{k-1} + u_k)/2 ("linear").
    steps, gaps = np.diff(t, prepend=t[0] - e.dt), set(gap_rows(t).tolist())
    before = np.roll(rows[k:], 1, axis=1)
    inputs = before if hold == "zero" else 0.5 * (before + rows[k:])
    samples, held = rows[:k].T.tolist(), inputs.T.tolist()
    for i, now in enumerate(t.tolist()):
        if i in gaps:
            e.pause(float(steps[i]))
        values[i] = e.step(now, samples[i], held[i], float(steps[i]))
        variances[i] = np.diag(e.covariance)[-m:]
    return CoefficientHistory(
        t,
        dict(zip(e.names, values.T, strict=True)),
        dict(zip(e.names, np.sqrt(variances).T, strict=True)),
        {name: c.unit for name, c in zip(e.names, model.coefficients, strict=True)},
    )
