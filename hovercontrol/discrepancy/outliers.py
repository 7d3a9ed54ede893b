"""Samples that stand out from their neighbours by more than noise does: taken out, and counted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import median_filter

from hovercontrol.discrepancy.fit import Fit
from hovercontrol.discrepancy.windowed import Data
from hovercontrol.identify.windows import noise_levels

#: Standard deviations by which a residual stands out from the median of its neighbours, and how many of them.
STANDS_OUT, NEIGHBOURS = 5.5, 5

#: Beyond this part of all samples they are no outliers.
MOST = 0.15


def without_outliers(fit: Fit) -> Data | None:
    """Return the data without what stands out of a fit's residuals, or None if nothing does.

    A model's errors are smooth from row to row, so that they raise neighbours as well.

    Parameters
    ----------
    fit : Fit
        In short windows.
    """
    w = fit.windowed
    z = np.where(w.seen, fit.residual / w.data.noise, 0.0)
    apart = z - median_filter(z, size=(1, NEIGHBOURS, 1), mode="mirror")
    out = w.seen & (np.abs(apart) > STANDS_OUT)
    if not out.any() or out.mean() > MOST * w.seen.mean():
        return None
    values = [m.values.copy() for m in w.data.logs]
    for j, (log, first, stop) in enumerate(w.ranges):
        for row, c in zip(*np.nonzero(out[j, : stop - first]), strict=True):
            measured = w.data.logs[log]
            values[log][measured.channels.index(w.data.channels[c]), first + row] = np.nan
    logs = tuple(replace(m, values=v) for m, v in zip(w.data.logs, values, strict=True))
    return replace(w.data, logs=logs, noise=noise_levels(logs, w.data.channels))
