"""Dispersion of a monitor's scores along a reference log: how much more they vary than the noise says.

Without a change, and with the noise as stated, the score b of a test has the mean 0 and the variance J. Noise
that is not white, noise larger than stated and slow errors of the model keep the mean, but the variance is

    var b = sum over i, k of eta_i cov(e_i, e_k) eta_k = phi J.

As in quasi-likelihood (McCullagh and Nelder, Generalized Linear Models, 2nd ed., 1989, section 9.2) the
dispersion phi divides the log-likelihood: b and J become b/phi and J/phi, the estimate b/J stays, its
standard error is phi^(1/2) times as large. phi is estimated for each candidate by the mean of b^2/J over the
ticks and windows of a log in which nothing changes, and is at least 1. The scores are those of limited
innovations, as in :mod:`hovercontrol.identification.monitor.bank`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.identification.monitor.threshold import Signatures, floors, next_content


def dispersion_of(found: Signatures, innovations: Array) -> Array:
    """Return phi of each candidate, at least 1.

    Parameters
    ----------
    innovations : ndarray, shape (K, m)
        Along the motion of the signatures, divided by their standard deviations and limited.
    """
    K, W, J, _ = found.eta.shape
    floor = floors(found)
    score, squares, tests = np.zeros((W, J)), np.zeros(J), np.zeros(J)
    for k in range(K):
        score = score + found.eta[k] @ innovations[k]
        info = found.information[k]
        told = info > floor  # a test below that says little
        squares += np.where(told, score**2 / np.where(told, info, 1.0), 0.0).sum(axis=0)
        tests += told.sum(axis=0)
        score = next_content(score, 0.0, found.moved[k])
    return np.maximum(1.0, squares / np.maximum(tests, 1.0))


def divided(found: Signatures, phi: Array) -> Signatures:
    """Return the signatures of scores that are divided by their dispersion: those of eta/phi^(1/2)."""
    return replace(found, eta=found.eta / np.sqrt(phi)[:, None], information=found.information / phi)
