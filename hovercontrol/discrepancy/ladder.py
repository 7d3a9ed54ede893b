"""Lengths of windows: short ones find the way, long ones weigh the evidence."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hovercontrol.blockmodel import BlockModel
from hovercontrol.discrepancy.data import Data
from hovercontrol.discrepancy.fit import fit
from hovercontrol.discrepancy.subject import Subject, structure
from hovercontrol.discrepancy.windowed import Windowed
from hovercontrol.identify.excitation import covariance

Array = NDArray[np.float64]

#: Windows [s] for a hovercraft, one after the other: short ones find the way, long ones weigh the evidence.
LADDER = (0.25, 1.0, 3.0)

#: How much longer they may be for other machines.
PACES = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)

#: Rows that a window of the ladder's second length holds at least.
ROWS = 8

#: And one more, for machines of which nobody knows how soon a free run gets lost.
MORE = 10.0

#: A window may be longer than from one correction of a navigation to the next by this factor.
ROOM = 1.1


def paced(model: Subject, data: Data) -> tuple[Data, Excited]:
    """Return the data with their pace, and what windows then tell of the model's coefficients.

    It is the least at which windows hold rows enough and tell of some coefficient.

    Parameters
    ----------
    model : Model or BlockModel
    data : Data
        At any pace.
    """
    step = float(np.median(np.concatenate([np.diff(m.time) for m in data.logs])))
    some = [pace for pace in PACES if pace >= ROWS * step and pace <= _longest(data) / 2] or [PACES[0]]
    for pace in some:
        found = replace(data, pace=pace)
        told = excited(model, found)
        if len(told.blind) < len(told.names):
            break
    return found, told


@dataclass(frozen=True)
class Excited:
    """What windows tell of the coefficients of a model as it was given.

    Attributes
    ----------
    windowed : Windowed
    names : list of str
    size, alone : ndarray, shape (P,)
        What each is compared with; standard error, were all others known.
    covariance : ndarray, shape (P, P)
    """

    windowed: Windowed
    names: list[str]
    size: Array
    alone: Array
    covariance: Array

    @property
    def std(self) -> Array:
        """Standard errors, shape (P,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def blind(self) -> list[int]:
        """Places of those that cannot be told."""
        return np.flatnonzero(self.std > self.size).tolist()


def excited(model: Subject, data: Data) -> Excited:
    """Return what windows of the ladder's second length tell of a model's coefficients."""
    found = fit(model, data, min(data.pace, _longest(data)), frozen=True)
    w, linear = found.windowed, set(model.linear_coefficients())
    own = [j for j, name in enumerate(w.names) if name in linear]
    C = covariance(found.normal.S[np.ix_(own, own)], found.normal.scores[:, own], w.size[own])
    alone = 1.0 / np.sqrt(np.maximum(np.diag(found.normal.S)[own], 1e-300))
    return Excited(w, [w.names[j] for j in own], w.size[own], alone, C)


def ladder(data: Data) -> tuple[float, ...]:
    """Return the lengths of windows [s] that the logs hold."""
    most = ROOM * _longest(data) if data.navigated else _longest(data) / 2  # from one correction to the next
    every = [data.pace * length for length in LADDER]
    return tuple(length for length in every if length <= most) or (every[0],)


def rungs(model: Subject, data: Data) -> tuple[float, ...]:
    """Return the lengths of windows to search in: where no velocity is measured short ones say nothing."""
    every = ladder(data)
    if data.navigated:  # the longer, the less is its error a ramp
        return every[:1]
    if isinstance(model, BlockModel) and MORE * data.pace <= _longest(data) / 2:
        every += (MORE * data.pace,)
    block = structure(model)
    slopes = {str(block.expand(e)) for e in block.derivatives.values()}
    moving = [s.name for s in block.states if s.name in slopes or s.name in ("u", "v", "r")]
    return every if not moving or set(moving) & set(data.channels) else every[1:] or every


def _longest(data: Data) -> float:
    return float(max(m.time[b - 1] - m.time[a] for m in data.logs for a, b in m.segments))
