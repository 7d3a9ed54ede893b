"""Runs of an FMU driven by the inputs of a log or by steps, compared with what the log measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.base.text_table import aligned
from hovercontrol.blocks.signals import Signal
from hovercontrol.documents.scenarios.drive import STEP, played, run_length
from hovercontrol.documents.scenarios.machine import MachineRun
from hovercontrol.documents.scenarios.phases import held, phase_grid
from hovercontrol.fmi.importer.interface import REALS
from hovercontrol.fmi.replay.output_error import refine
from hovercontrol.fmi.replay.parameters import bounds_of
from hovercontrol.fmi.replay.plant import FmuPlant
from hovercontrol.fmi.replay.rows import Rows, filled, rows_of
from hovercontrol.fmi.replay.runs import RunFailed
from hovercontrol.fmi.replay.step_length import accurate
from hovercontrol.fmi.replay.unknowns import Unknowns
from hovercontrol.logs.log import Log

#: Iterations in which the states at the first row are estimated.
ITERATIONS = 10


@dataclass(frozen=True)
class Apart:
    """Measured minus computed values of one channel.

    Attributes
    ----------
    rms : float
        Root mean square of the difference.
    spread : float
        Standard deviation of the measured values.
    unit : str
    """

    rms: float
    spread: float
    unit: str


@dataclass(frozen=True, eq=False, repr=False)
class FmuRun(MachineRun):
    """The result of an FMU's run.

    Attributes
    ----------
    log : Log
        Outputs, continuous states and inputs; the measured values of a channel as ``NAME_measured``.
    units : mapping of str to str
        Of its columns.
    apart : mapping of str to Apart
        By channel that was measured.
    start : mapping of str to float
        Continuous states at the first row.
    """

    apart: Mapping[str, Apart]
    start: Mapping[str, float]

    def text(self) -> str:
        """Return the errors as a table; empty if nothing was measured."""
        if not self.apart:
            return ""
        rows = [(c, f"{a.rms:.3g}", f"{a.spread:.3g}", a.unit) for c, a in self.apart.items()]
        lines = aligned([("channel", "error (rms)", "spread", "unit"), *rows])
        if self.start:
            lines.append(f"at the first row: {', '.join(f'{k} = {v:.5g}' for k, v in self.start.items())}")
        return "\n".join(lines)


@dataclass(frozen=True, eq=False)
class Drive:
    """Inputs of an FMU at the rows of a run.

    Attributes
    ----------
    name : str
    time : ndarray, shape (K,)
        From the first row [s].
    inputs : ndarray, shape (K, n_inputs)
        Held from row to row.
    """

    name: str
    time: Array
    inputs: Array


def drive_of(plant: FmuPlant, seconds: float | None = None, commands: Log | None = None) -> Drive:
    """Return the inputs of a log at its rows, or else reproducible steps within the inputs' bounds.

    Parameters
    ----------
    plant : FmuPlant
    seconds : float, optional
        Length [s]; default: 20, or the length of the log.
    commands : Log, optional

    Raises
    ------
    InputError
        If the log lacks an input of the FMU or a value of it, or is shorter.
    """
    length = run_length(seconds, commands)
    if commands is not None:
        for s in plant.inputs:
            if not commands.has(s.name):
                hint = did_you_mean(s.name, commands.columns)
                raise InputError(f"{commands.name}: no column for the input {s.name!r}{hint}")
    steps = played(_bounded(plant), length, commands)
    time = phase_grid(0.0, length, STEP)
    if commands is not None:
        time = np.array(steps["time"])
        time = time[time <= length * (1.0 + 1e-12)]
    found = held(steps, time)
    u = np.stack([found[s.name] for s in plant.inputs], axis=1) if plant.inputs else np.zeros((len(time), 0))
    if commands is None:  # steps of integers and Booleans are whole
        kinds = [v.kind for v in plant.interface.inputs for _ in v.labels]
        u = np.where([kind in REALS for kind in kinds], u, np.round(u))
    return Drive("steps" if commands is None else commands.name, time, u)


def simulate_fmu(
    plant: FmuPlant,
    *,
    seconds: float | None = None,
    commands: Log | None = None,
    match_start: bool = False,
    progress: Callable[[float], None] | None = None,
) -> FmuRun:
    """Drive an FMU from its start, by the inputs of a log or by steps.

    Parameters
    ----------
    plant : FmuPlant
    seconds : float, optional
        Length [s]; default: 20, or the length of the log.
    commands : Log, optional
        Log with the FMU's inputs, held from row to row. Where it has outputs, errors are computed.
    match_start : bool, optional
        Whether the continuous states at the first row are estimated from the log's outputs (Model Exchange).
    progress : callable, optional
        Called from time to time with the simulated time [s].

    Raises
    ------
    InputError
        If the log lacks an input or is shorter, or the FMU fails.
    """
    drive = drive_of(plant, seconds, commands)
    plant = ready(plant, drive)
    states = _matched(plant, commands) if match_start else None
    try:
        if plant.free_start and states is None:
            states = plant.initial(drive.inputs[0])
        seen = run_over(plant, drive, states)
    except RunFailed as fault:
        raise InputError(f"FMU {plant.name!r} failed on {drive.name}: {fault}") from None
    if progress is not None:
        progress(float(drive.time[-1]))
    inputs = {s.name for s in plant.inputs}
    signals = {s.name: s for s in (*plant.states, *plant.outputs) if s.name not in inputs}
    names = [s.name for s in (*plant.outputs, *plant.states)]
    columns = {n: seen[:, names.index(n)] for n in sorted(signals, key=names.index)}
    columns |= {s.name: drive.inputs[:, i] for i, s in enumerate(plant.inputs)}
    units = {s.name: s.unit for s in (*plant.states, *plant.outputs, *plant.inputs)}
    apart, count = {}, len(drive.time)
    for name in [n for n in signals if commands is not None and commands.has(n)]:
        assert commands is not None
        measured = commands[name][:count]
        columns[f"{name}_measured"], units[f"{name}_measured"] = measured, units[name]
        if np.isfinite(measured).any():
            rms = float(np.sqrt(np.nanmean((measured - columns[name]) ** 2)))
            apart[name] = Apart(rms, float(np.nanstd(measured)), units[name])
    start = dict(zip((s.name for s in plant.states), states or (), strict=False))
    return FmuRun(Log(plant.name, drive.time, columns), units, apart, start)


def ready(plant: FmuPlant, drive: Drive) -> FmuPlant:
    """Return the FMU with steps short enough for a drive (Model Exchange).

    Raises
    ------
    InputError
        If the FMU cannot be run with its present values.
    """
    every = tuple(range(len(plant.outputs) + len(plant.states)))
    nothing = np.full((len(drive.time), len(every)), np.nan)
    rows = Rows(drive.name, *filled(drive.time, drive.inputs, nothing)[:2], every, nothing)
    if len(rows.time) < 2 or not every:
        return plant
    found = accurate(replace(plant, free_start=False), [rows])
    return replace(found, free_start=plant.free_start)


def run_over(plant: FmuPlant, drive: Drive, states: list[float] | None) -> Array:
    """Return outputs and continuous states at the rows of a drive, shape (K, n_outputs + n_states).

    Raises
    ------
    RunFailed
    """
    nothing = np.zeros((len(drive.time), 0))
    time, inputs, _ = filled(drive.time, drive.inputs, nothing)
    return np.asarray(plant.at(time, inputs, states)[np.searchsorted(time, drive.time)])


def _matched(plant: FmuPlant, commands: Log | None) -> list[float] | None:
    """Return the continuous states at the first row of a log, estimated from its outputs."""
    if commands is None:
        raise InputError("the states at the first row are estimated from a log; expected one with outputs")
    if not plant.free_start:
        raise InputError(
            f"{plant.path}: the states of a Co-Simulation FMU cannot be set; expected Model Exchange"
        )
    rows = rows_of(plant, commands)[0][:1]
    unknowns = Unknowns(plant, rows, starts_only=True)
    try:
        found = refine(unknowns, unknowns.start(), ITERATIONS).values
    except RunFailed as fault:
        raise InputError(f"FMU {plant.name!r} failed on {commands.name}: {fault}") from None
    return [float(x) for x in found]


def _bounded(plant: FmuPlant) -> list[Signal]:
    """Return the inputs with the bounds of the model description."""
    bounds = bounds_of(plant.source.unpacked.folder / "modelDescription.xml")
    limits = [bounds.get(v.reference, (-np.inf, np.inf)) for v in plant.interface.inputs for _ in v.labels]
    return [s.replace(lower=a, upper=b) for s, (a, b) in zip(plant.inputs, limits, strict=True)]
