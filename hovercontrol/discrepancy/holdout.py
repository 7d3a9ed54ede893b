"""The gap on a log that took no part: windows run free from fitted states, coefficients as they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.discrepancy.data import Data
from hovercontrol.discrepancy.fit import Fit, fit
from hovercontrol.discrepancy.subject import Subject

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Gap:
    """Errors of a model on logs.

    Attributes
    ----------
    rms : dict of str to float
        Of each channel, in its unit.
    nrmse : dict of str to float
        Over the channel's root mean square about its mean.
    floor : dict of str to float
        The measurement noise, likewise over the channel's: no model can do better.
    chi2 : float
        Sum of squares over the measurement noise's.
    count : int
        Samples.
    """

    rms: dict[str, float]
    nrmse: dict[str, float]
    floor: dict[str, float]
    chi2: float
    count: int


def gap(model: Subject, data: Data, length: float) -> Gap:
    """Return how far windows of `length` seconds run from what was measured.

    Parameters
    ----------
    model : Model or BlockModel
        Its coefficients stay.
    data : Data
    length : float
        Of the windows [s].
    """
    return gap_of(fit(model, data, length, frozen=True))


def gap_of(found: Fit) -> Gap:
    """Return how far the windows of a fit run from what was measured."""
    data = found.windowed.data
    w = found.windowed
    seen = w.seen.reshape(-1, w.seen.shape[-1])
    residual = (found.left * w.scale).reshape(seen.shape)
    values = (w.cut.values.transpose(1, 2, 0) * w.scale).reshape(seen.shape)
    levels = (data.noise * w.scale * w.seen).reshape(seen.shape)
    rms, nrmse, floor = {}, {}, {}
    for c, channel in enumerate(data.channels):
        count = max(int(seen[:, c].sum()), 1)
        rms[channel] = float(np.sqrt((residual[:, c] ** 2).sum() / count))
        size = float(np.nanstd(values[:, c])) or 1.0
        nrmse[channel] = rms[channel] / size
        floor[channel] = float(np.sqrt((levels[:, c] ** 2).sum() / count)) / size
    chi2 = float((w.plainly_white(found.residual) ** 2).sum())
    return Gap(rms, nrmse, floor, chi2, int(seen.sum()))


def may_rise(final: Fit, data: Data, length: float) -> float:
    """Return how much the errors of a fit's unknowns may add to the chi2 of logs that took no part.

    Mean and three standard deviations: logs that never slowed down do not tell a width of friction, say,
    on which one that stops depends.
    """
    told = fit(final.model, data, length, frozen=True).normal.S
    added = told @ final.covariance
    return float(np.trace(added) + 3.0 * np.sqrt(2.0 * np.trace(added @ added)))
