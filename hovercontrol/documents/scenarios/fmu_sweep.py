"""Runs of an FMU at every point of a grid of parameters and start values."""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.backends.checkpoint import Checkpoint
from hovercontrol.blocks.backends.sweep import FIGURES, WORKER_FAILED, SweepResult
from hovercontrol.documents.scenarios.fmu_runs import Drive, drive_of, ready, run_over
from hovercontrol.documents.scenarios.grid import PART, GridResult, Variable, run_grid
from hovercontrol.fmi.replay.plant import FmuPlant
from hovercontrol.fmi.replay.runs import RunFailed
from hovercontrol.logs.log import Log

#: Band of the settling time, in each output's unit; runs that a file of the checkpoint has.
BAND, TOGETHER = 0.02, 64


def vary_fmu(
    plant: FmuPlant,
    ranges: Mapping[str, Array],
    of: str = "",
    figure: str = "rms",
    *,
    commands: Log | None = None,
    progress: Callable[[float], None] | None = None,
    checkpoint: str | Path | None = None,
) -> GridResult:
    """Drive an FMU by steps of its inputs, or by those of a log, at every point of a grid.

    Parameters
    ----------
    plant : FmuPlant
    ranges : mapping of str to ndarray
        One or two parameters by the FMU's names, or continuous states to start from (Model Exchange).
    of : str, optional
        The output, or state, that is asked about; default: the first.
    figure, progress, checkpoint
        As of :func:`hovercontrol.documents.scenarios.grid.vary`.
    commands : Log, optional
        Log with the FMU's inputs, held from row to row.

    Raises
    ------
    InputError
        If a name or a range is wrong, or the FMU cannot be run with its own values.
    """
    drive = drive_of(plant, None, commands)
    outputs = {s.name: s.unit for s in (*plant.outputs, *plant.states)}
    starts = {s.name: s for s in plant.states} if plant.free_start else {}
    known: dict[str, Variable] = {**starts, **plant.parameters}

    def runs(given: Mapping[str, Array]) -> SweepResult:
        return _swept(_ready(plant, drive, given), drive, given, outputs, progress, checkpoint)

    title = f"{plant.name}: {'steps of its inputs' if commands is None else f'inputs of {commands.name}'}"
    return run_grid(plant.name, title, str(plant.path), outputs, known, ranges, of, figure, runs)


def _ready(plant: FmuPlant, drive: Drive, given: Mapping[str, Array]) -> FmuPlant:
    """Return the FMU with steps short enough at its own values and at the corners of the grid."""
    pieces = ready(plant, drive).pieces
    for corner in itertools.product(*((v.min(), v.max()) for v in given.values())):
        own = {n: float(v) for n, v in zip(given, corner, strict=True) if n in plant.parameters}
        try:
            pieces = max(pieces, ready(plant.with_values(own), drive).pieces)
        except InputError:  # a run that fails is told in the result
            continue
    return replace(plant, pieces=pieces)


def _swept(
    plant: FmuPlant,
    drive: Drive,
    given: Mapping[str, Array],
    outputs: Mapping[str, str],
    progress: Callable[[float], None] | None,
    checkpoint: str | Path | None,
) -> SweepResult:
    count, states = len(next(iter(given.values()))), [s.name for s in plant.states]
    x0 = {n: v for n, v in given.items() if n not in plant.parameters}
    units = dict(outputs) | {f"{s.name}.start": s.unit for s in plant.states}
    units |= {n: plant.parameters[n].unit for n in given if n not in x0}
    parameters = {n: v for n, v in given.items() if n not in x0}
    status = np.full(count, WORKER_FAILED, dtype=np.intc)  # until they are done
    result = SweepResult(
        tuple(outputs), tuple(states), parameters, x0, units,
        **{figure: np.full((count, len(outputs)), np.nan) for figure in FIGURES},
        states_final=np.full((count, len(states)), np.nan), status=status,
    )  # fmt: skip
    kept = None
    if checkpoint is not None:
        kept = Checkpoint(Path(checkpoint) / PART, _fingerprint(plant, drive, given))
        kept.load(result)
    first = 0
    for k in range(count):
        if status[k] == WORKER_FAILED:
            values = {n: float(v[k]) for n, v in given.items()}
            status[k] = _one(plant, drive, values, result, k)
        if k + 1 == count or k + 1 - first == TOGETHER:
            if kept is not None:
                kept.add(result, slice(first, k + 1))
            first = k + 1
        if progress is not None:
            progress((k + 1) / count)
    return result


def _one(plant: FmuPlant, drive: Drive, values: Mapping[str, float], result: SweepResult, k: int) -> int:
    """Write the figures of one run into the result; return its status."""
    plant = plant.with_values({n: v for n, v in values.items() if n in plant.parameters})
    names = [s.name for s in plant.states]
    try:
        states = plant.initial(drive.inputs[0]) if plant.free_start else None
        if states is not None:
            states = [
                values.get(n, x) if n not in plant.parameters else x
                for n, x in zip(names, states, strict=True)
            ]
        seen = run_over(plant, drive, states)
    except RunFailed as fault:
        result.errors[k] = str(fault)
        return WORKER_FAILED
    every = [s.name for s in (*plant.outputs, *plant.states)]
    for j, name in enumerate(result.outputs):
        for figure, value in zip(FIGURES, _figures(drive.time, seen[:, every.index(name)]), strict=True):
            getattr(result, figure)[k, j] = value
    if names:
        result.states_final[k] = seen[-1, len(plant.outputs) :]
    return 0


def _figures(time: Array, y: Array) -> tuple[float, float, float, float, float]:
    """Return final, largest, smallest and root mean square value, and settling time, as ``hc_sweep`` does."""
    square = float(np.trapezoid(y**2, time) / (time[-1] - time[0]))
    outside = np.flatnonzero(np.abs(y - y[-1]) > BAND)
    settled = time[outside[-1] + 1] if len(outside) else time[0]
    return float(y[-1]), float(y.max()), float(y.min()), square**0.5, float(settled)


def _fingerprint(plant: FmuPlant, drive: Drive, given: Mapping[str, Array]) -> str:
    """Return the identifier of a sweep: a digest of the FMU, its values, its inputs and the grid."""
    grid = {n: v.tolist() for n, v in given.items()}
    said = json.dumps([sorted(plant.values.items()), grid, plant.around.values, plant.pieces])
    parts = (plant.path.read_bytes(), said.encode(), drive.time.tobytes(), drive.inputs.tobytes())
    return hashlib.sha256(b"".join(hashlib.sha256(part).digest() for part in parts)).hexdigest()
