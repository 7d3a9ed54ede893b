"""Repeated runs of a scenario or a machine with one or two varied numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.base.folders import write_folder
from hovercontrol.base.pyplot import open_in_pyplot, shown_once
from hovercontrol.base.short_repr import short_repr
from hovercontrol.blocks.backends.sweep import FIGURES, Axis, SweepResult
from hovercontrol.blocks.backends.sweep_display import draw_grid
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.documents.scenarios.definition import Scenario
from hovercontrol.documents.scenarios.drive import STEP, played, run_length
from hovercontrol.documents.scenarios.parts import loop_parts, phase_parameters
from hovercontrol.documents.scenarios.phases import EARLY, held, held_commands, phase_grid
from hovercontrol.documents.scenarios.sampling import sampled_loop
from hovercontrol.logs import Log

#: Most runs: a picture with more points shows no more.
MAX_RUNS = 1_000_000
#: Folder of a checkpoint for runs without phases.
PART = "runs"


@dataclass(frozen=True, eq=False)
class GridResult:
    """The figures of many runs of a scenario or a machine.

    Attributes
    ----------
    name, title : str
        Of what was run.
    axes : tuple of one or two Axis
        The varied numbers; the first varies slowest.
    of, figure : str
        The signal and the figure that are drawn.
    unit : str
    result : SweepResult
        Result of the last phase, including runs that failed in an earlier one.
    """

    name: str
    title: str
    axes: tuple[Axis, ...]
    of: str
    figure: str
    unit: str
    result: SweepResult

    __repr__ = short_repr

    @property
    def values(self) -> Array:
        """The figure over the grid, shape (n,) or (n, m); NaN where a run failed."""
        found: Array = getattr(self.result[self.of], self.figure)
        return found.reshape([len(axis.values) for axis in self.axes])

    def plot(self, axes: Axes | None = None) -> Figure:
        """Draw the figure as a curve over one number, or as a map over two.

        Parameters
        ----------
        axes : matplotlib.axes.Axes, optional
            Draw here; default a new figure.
        """
        own = Figure(figsize=(7, 4.5), layout="constrained") if axes is None else None
        axes = own.subplots() if own else axes
        assert axes is not None
        axes.set_title(self.title)
        label = f"{self.figure} of {self.of} [{self.unit}]"
        draw_grid(axes, [(str(axis), axis.values) for axis in self.axes], self.values, label)
        drawn = axes.get_figure(root=True)
        assert isinstance(drawn, Figure)
        return open_in_pyplot(drawn) if own else shown_once(drawn)

    def _repr_html_(self) -> str:
        from hovercontrol.documents.scenarios.display import varied_html

        return varied_html(self)

    def save(self, folder: str | Path) -> list[Path]:
        """Write ``sweep.csv`` (all figures of all outputs), ``sweep.png`` and ``sweep.svg``, atomically."""

        def write(place: Path) -> None:
            import pyarrow.csv

            pyarrow.csv.write_csv(self.result.to_table(), place / "sweep.csv")
            picture = Figure(figsize=(7, 4.5), layout="constrained")
            self.plot(picture.subplots())
            for kind in ("png", "svg"):
                picture.savefig(place / f"sweep.{kind}", dpi=150)

        return write_folder(folder, write)


@checked
def vary(
    scenario: Scenario,
    ranges: Mapping[str, Array],
    of: str = "",
    figure: str = "rms",
    *,
    progress: Callable[[float], None] | None = None,
    checkpoint: str | Path | None = None,
) -> GridResult:
    """Run a scenario at every point of a grid, compiled and on all cores.

    Parameters
    ----------
    scenario : Scenario
        Its commands are the same in all runs.
    ranges : mapping of str to ndarray
        One or two parameters by key (``controller.k1``), or states to start from (``plant.u``), each with its
        values, increasing.
    of : str, optional
        The output that is asked about; default ``error_x`` of a tracking loop, else ``u``, else the first.
    figure : str, optional
        final, maximum, minimum, rms or settling of the last phase.
    progress : callable, optional
        Called with the completed fraction, 0 to 1.
    checkpoint : path, optional
        Folder that keeps the results as they come; the same call with the same folder goes on where it was
        stopped, with the same results to the last bit.

    Raises
    ------
    InputError
        If a name or a range is wrong.
    """
    parts = loop_parts(scenario)
    loop = sampled_loop(scenario, parts) if scenario.sampling else interconnect([*parts.values()], "loop")

    def runs(given: Mapping[str, Array]) -> SweepResult:
        return swept_phases(scenario, loop, given, progress, checkpoint)

    where = scenario.file or scenario.name
    outputs = {s.name: s.unit for s in loop.outputs}
    return run_grid(scenario.name, scenario.title, where, outputs, known_of(loop), ranges, of, figure, runs)


@checked
def vary_machine(
    block: Block,
    ranges: Mapping[str, Array],
    of: str = "",
    figure: str = "rms",
    *,
    commands: Log | None = None,
    progress: Callable[[float], None] | None = None,
    checkpoint: str | Path | None = None,
) -> GridResult:
    """Drive a Block as ``hovercontrol simulate`` does, at every point of a grid.

    Parameters
    ----------
    ranges : mapping of str to ndarray
        As of :func:`vary`: parameters by key (``motor.gain``), or states to start from.
    of : str, optional
        The output that is asked about; default: the first.
    commands : Log, optional
        Log with the Block's inputs, held from row to row.
    figure, progress, checkpoint
        As of :func:`vary`.

    Raises
    ------
    InputError
        If a name or a range is wrong.
    """
    length = run_length(None, commands)
    time = phase_grid(0.0, length, STEP)
    inputs = held(played(block.inputs, length, commands), time) if block.inputs else None
    keys = set(block.default_parameters)

    def told(done: int, total: int) -> None:
        if progress is not None:
            progress(done / total)

    def runs(given: Mapping[str, Array]) -> SweepResult:
        total = len(next(iter(given.values())))
        return block.compile(friction="smooth").sweep(
            time,
            params={name: values for name, values in given.items() if name in keys},
            x0={name: values for name, values in given.items() if name not in keys},
            inputs=inputs,
            progress=lambda done: told(done, total),
            checkpoint=None if checkpoint is None else Path(checkpoint) / PART,
        )

    title = f"{block.name}: {'steps of its commands' if commands is None else f'commands of {commands.name}'}"
    outputs = {s.name: s.unit for s in block.outputs}
    return run_grid(block.name, title, block.name, outputs, known_of(block), ranges, of, figure, runs)


class Variable(Protocol):
    """A number that can be varied."""

    @property
    def unit(self) -> str:
        """Its unit."""

    def check(self, value: float, name: str = "") -> float:
        """Return a value within its bounds, else raise an InputError."""


def known_of(block: Block) -> dict[str, Variable]:
    """Return the parameters of a Block by key, and its states."""
    parameters = dict(zip(block.default_parameters, block.parameters, strict=True))
    return {**parameters, **{s.name: s for s in block.states}}


def run_grid(
    name: str,
    title: str,
    where: str,
    outputs: Mapping[str, str],
    known: Mapping[str, Variable],
    ranges: Mapping[str, Array],
    of: str,
    figure: str,
    runs: Callable[[Mapping[str, Array]], SweepResult],
) -> GridResult:
    """Return what runs at every point of a grid give, by what is asked about.

    Parameters
    ----------
    name, title, where : str
        Of what is run, of the picture, and for error lines.
    outputs : mapping of str to str
        Their units.
    known : mapping of str to Variable
        What can be varied.
    ranges, of, figure
        As of :func:`vary`.
    runs : callable
        Of the values of each run by name: their results.

    Raises
    ------
    InputError
        If a name or a range is wrong.
    """
    if not 1 <= len(ranges) <= 2:
        raise InputError(f"{where}: expected one or two parameters to vary, found {len(ranges)}")
    check_known(figure, FIGURES, f"unknown figure {figure!r}")
    of = of or next((usual for usual in ("error_x", "u") if usual in outputs), next(iter(outputs), ""))
    check_known(of, outputs, f"{where}: no output {of!r}")
    axes = tuple(_axis(known, name, values, where) for name, values in ranges.items())
    if np.prod([len(axis.values) for axis in axes]) > MAX_RUNS:
        raise InputError(f"{where}: more than {MAX_RUNS} runs: take fewer points")
    grid = np.meshgrid(*(axis.values for axis in axes), indexing="ij")
    result = runs({axis.name: values.ravel() for axis, values in zip(axes, grid, strict=True)})
    unit = "s" if figure == "settling" else outputs[of]
    return GridResult(name, title, axes, of, figure, unit, result)


def swept_phases(
    scenario: Scenario,
    loop: Block,
    given: Mapping[str, Array],
    progress: Callable[[float], None] | None = None,
    checkpoint: str | Path | None = None,
) -> SweepResult:
    """Run a loop many times through a scenario's phases, each from where the one before ended.

    Parameters
    ----------
    loop : Block
        Of its parts.
    given : mapping of str to ndarray (n_runs,)
        Parameters by key and states to start from, each of all runs.
    progress : callable, optional
        Called with the completed fraction, 0 to 1.
    checkpoint : path, optional
        As of :func:`vary`.

    Returns
    -------
    SweepResult
        Result of the last phase, including runs that failed in an earlier one.
    """
    keys = set(loop.default_parameters)
    own = {name: values for name, values in given.items() if name in keys}
    runs = len(next(iter(given.values())))
    x0 = {s.name: np.full(runs, s.start) for s in loop.states}
    x0 |= {name: values for name, values in given.items() if name not in keys}
    compiled = loop.compile(friction="smooth")  # as one run of the scenario has it
    failed = np.zeros(runs, dtype=np.intc)
    kept = None if checkpoint is None else Path(checkpoint)
    bounds = [0.0, *(phase.until - (EARLY if loop.ticks else 0.0) for phase in scenario.phases)]
    bounds[-1] = scenario.end
    for k, (phase, (begin, end)) in enumerate(zip(scenario.phases, pairwise(bounds), strict=True), 1):
        times = phase_grid(begin, end, scenario.step)

        def told(done: int, begin: float = begin, end: float = end) -> None:
            if progress is not None:
                progress((begin + (end - begin) * done / runs) / scenario.end)

        params = phase_parameters(scenario, phase) | own
        folder = None if kept is None else kept / f"phase-{k}"
        inputs = held_commands(scenario, times)
        result = compiled.sweep(times, params=params, x0=x0, inputs=inputs, progress=told, checkpoint=folder)
        failed = np.where(failed, failed, result.status)
        x0 = dict(zip(result.states, result.states_final.T, strict=True))
        x0 = {name: np.where(failed, 0.0, values) for name, values in x0.items()}
    result.status[:] = failed
    for name in FIGURES:
        getattr(result, name)[failed != 0] = np.nan
    return result


def _axis(known: Mapping[str, Variable], name: str, values: Array, where: str) -> Axis:
    check_known(name, known, f"{where}: no parameter or state {name!r}")
    values = np.asarray(values, dtype=float)
    if values.ndim != 1 or not values.size or not (np.diff(values) > 0).all():
        raise InputError(f"{where}: the values of {name!r} must be a row of increasing numbers")
    for value in (values[0], values[-1]):
        known[name].check(float(value), name)
    return Axis(name, known[name].unit, values)
