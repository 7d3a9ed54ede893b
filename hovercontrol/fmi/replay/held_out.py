"""How well a fitted FMU predicts a log that took no part in the fit."""

from __future__ import annotations

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.fmi.replay.output_error import FmuFit, refine
from hovercontrol.fmi.replay.plant import FmuPlant
from hovercontrol.fmi.replay.rows import rows_of
from hovercontrol.fmi.replay.runs import RunFailed
from hovercontrol.fmi.replay.unknowns import Unknowns
from hovercontrol.logs.log import Log


def held_out(plant: FmuPlant, log: Log) -> FmuFit:
    """Return the fit of a log in which only the states at its start are estimated.

    Raises
    ------
    InputError
        If the log lacks a column, or the FMU cannot be run over it.
    """
    rows = rows_of(plant, log)[0]
    unknowns = Unknowns(plant, rows, starts_only=True)
    try:
        return refine(unknowns, unknowns.start(), 10)
    except RunFailed as fault:
        raise InputError(f"FMU {plant.name!r} failed on {log.name}: {fault}") from None


def shares_of(fit: FmuFit) -> dict[str, float]:
    """Return residual over spread of each channel."""
    plant, rows = fit.unknowns.plant, fit.unknowns.logs
    signals = (*plant.outputs, *plant.states)
    spread = np.nanstd(np.concatenate([r.values for r in rows]), axis=0)
    shares = fit.rms / np.maximum(spread, 1e-300)
    return {signals[i].name: float(x) for i, x in zip(rows[0].places, shares, strict=True)}
