"""How long the steps of a run of an FMU over logs are: short enough that its outputs do not change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.fmi.replay.plant import FmuPlant
from hovercontrol.fmi.replay.rows import Rows
from hovercontrol.fmi.replay.runs import RunFailed
from hovercontrol.fmi.replay.unknowns import Unknowns

#: Halving of steps until they must reach this difference of outputs, over their spread.
ACCURACY, MOST_PIECES = 1e-5, 256
#: How far rows may lie from the fixed steps of an FMU, in steps.
BETWEEN = 1e-6


def accurate(plant: FmuPlant, logs: Sequence[Rows]) -> FmuPlant:
    """Return the model with steps short enough: half as long, they change outputs by ``ACCURACY`` at most.

    Of Co-Simulation the steps are the FMU's own.

    Raises
    ------
    InputError
        If the FMU cannot be run with its present values, or rows lie between its fixed steps.
    """
    if (fixed := plant.interface.fixed_step) is not None:
        for one in logs:
            steps = np.diff(one.time) / fixed
            if (np.abs(steps - np.maximum(np.round(steps), 1.0)) > BETWEEN).any():
                raise InputError(
                    f"{one.name}: expected rows that are multiples of {fixed:.9g} s apart, the fixed step of "
                    f"FMU {plant.name!r}; found {float(np.median(np.diff(one.time))):.9g} s"
                )
    rows = max(logs, key=lambda r: len(r.time)).head(0.2)
    pieces = plant.pieces_of(rows.time)
    if plant.interface.kind != "ModelExchange":
        return replace(plant, pieces=pieces)
    last, why = None, ""
    while pieces <= MOST_PIECES:
        trial = replace(plant, pieces=pieces)
        unknowns = Unknowns(trial, [rows])
        try:
            found = unknowns.predict(unknowns.start())[0]
        except RunFailed as fault:  # perhaps unstable with so long a step
            found, why = None, str(fault)
            if "process" in why:  # it crashed or hung
                raise InputError(f"FMU {plant.name!r} failed on {rows.name}: {why}") from None
        if found is not None and last is not None:
            spread = np.where(np.isfinite(rows.values), rows.values, found).std(axis=0)
            spread = np.maximum(spread, 1e-12)
            if float(np.max(np.median(np.abs(found - last), axis=0) / spread)) <= ACCURACY:
                return replace(plant, pieces=max(pieces // 2, 1))
        last, pieces = found, pieces * 2
    if last is None:
        raise InputError(f"FMU {plant.name!r} failed on {rows.name}: {why}")
    return replace(plant, pieces=pieces // 2)
