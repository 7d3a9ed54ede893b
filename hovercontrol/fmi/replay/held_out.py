"""How well a fitted FMU predicts a log that took no part in the fit."""

from __future__ import annotations

import numpy as np

from hovercontrol.errors import InputError
from hovercontrol.fmi.replay.output_error import refine
from hovercontrol.fmi.replay.plant import FmuPlant
from hovercontrol.fmi.replay.rows import rows_of
from hovercontrol.fmi.replay.runs import RunFailed
from hovercontrol.fmi.replay.unknowns import Unknowns
from hovercontrol.logs.log import Log


def held_out(plant: FmuPlant, log: Log) -> dict[str, float]:
    """Return residual over spread of each channel; only the states at the log's start are estimated.

    Raises
    ------
    InputError
        If the log lacks a column, or the FMU cannot be run over it.
    """
    rows = rows_of(plant, log)[0]
    unknowns = Unknowns(plant, rows, starts_only=True)
    try:
        fit = refine(unknowns, unknowns.start(), 10)
    except RunFailed as fault:
        raise InputError(f"FMU {plant.name!r} failed on {log.name}: {fault}") from None
    signals = (*plant.outputs, *plant.states)
    spread = np.nanstd(np.concatenate([r.values for r in rows]), axis=0)
    shares = fit.rms / np.maximum(spread, 1e-300)
    return {signals[i].name: float(x) for i, x in zip(rows[0].places, shares, strict=True)}
