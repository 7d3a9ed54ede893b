"""Sweeps: inputs, results and parallel execution of many runs."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known, did_you_mean
from hovercontrol.base.files import write_atomically
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.base.short_repr import cut, listed, short, short_repr
from hovercontrol.base.tables import not_negative
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.simulation.arguments import own_states
from hovercontrol.blocks.simulation.reasons import REASONS

if TYPE_CHECKING:
    import pyarrow
    from matplotlib.figure import Figure

Many = Mapping[str, ArrayLike]

FIGURES = ("final", "maximum", "minimum", "rms", "settling")  # in the order of hc_simulate.h
WORKER_FAILED = len(REASONS) - 1


@checked
@dataclass(frozen=True, eq=False)
class Axis:
    """A parameter that a sweep or a map varies.

    Parameters
    ----------
    name, unit : str
    values : ndarray, shape (n,)
        Increasing values.
    label : str, optional
        Name in figures (default: `name`).

    Examples
    --------
    >>> Axis("k1", "1/s^2", np.linspace(1.0, 3.0, 3)).values.tolist()
    [1.0, 2.0, 3.0]
    """

    name: str
    unit: str
    values: Array
    label: str = ""

    __repr__ = short_repr

    def __str__(self) -> str:
        return f"{self.label or self.name} [{self.unit}]"


@dataclass(frozen=True)
class Failure:
    """A run of a sweep that did not reach its end, with its given values."""

    run: int
    reason: str
    values: Mapping[str, float]

    def __str__(self) -> str:
        given = ", ".join(f"{name} = {value:g}" for name, value in self.values.items())
        return f"run {self.run}: {self.reason}" + (f" ({given})" if given else "")


@dataclass(frozen=True)
class Figures:
    """The figures of one output, each of shape (n_runs,); see :class:`SweepResult`."""

    final: Array
    maximum: Array
    minimum: Array
    rms: Array
    settling: Array

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class SweepResult:
    """The result of a sweep: figures of each run; ``result["error_x"].rms`` selects one output.

    Attributes
    ----------
    outputs, states : tuple of str
        Names, in the order of the columns below.
    parameters, x0 : mapping of str to ndarray (n_runs,)
        The given values.
    units : mapping of str to str
        Units of outputs by name, and of the values in ``given``.
    final, maximum, minimum, rms, settling : ndarray (n_runs, n_outputs)
        Value of each output at the end; largest, smallest and root-mean-square value over the evaluated
        times; time from which on the output stays within its band [s]. NaN in a failed run.
    states_final : ndarray (n_runs, n_states)
        States at the end of a run, or where it failed.
    status : ndarray of int (n_runs,)
        Index into :data:`hovercontrol.blocks.simulation.reasons.REASONS`; 0 for a run without an error.
    errors : dict of int to str
        Error message of each run that failed in its worker.
    """

    outputs: tuple[str, ...]
    states: tuple[str, ...]
    parameters: Mapping[str, Array]
    x0: Mapping[str, Array]
    units: Mapping[str, str]
    final: Array
    maximum: Array
    minimum: Array
    rms: Array
    settling: Array
    states_final: Array
    status: NDArray[np.intc]
    errors: dict[int, str] = field(default_factory=dict, init=False)

    def __repr__(self) -> str:
        units = self.units
        varied = [f"{name} [{units.get(name, '1')}] {short(v)}" for name, v in self.given.items()]
        outputs = listed((f"{name} [{units.get(name, '1')}]" for name in self.outputs), len(self.outputs))
        lines = [f"SweepResult: {len(self)} runs, {np.count_nonzero(self.status)} failed"]
        lines += [f"  varied   {cut(listed(varied, len(varied)))}"] if varied else []
        return "\n".join([*lines, f"  outputs  {cut(outputs)}: final, maximum, minimum, rms, settling"])

    def __len__(self) -> int:
        return len(self.status)

    def __getitem__(self, output: str) -> Figures:
        check_known(output, self.outputs, f"unknown output {output!r}")
        column = self.outputs.index(output)
        return Figures(*(getattr(self, name)[:, column] for name in FIGURES))

    @property
    def failures(self) -> tuple[Failure, ...]:
        """The failed runs, with the reason and the given values."""
        given = self.given
        return tuple(
            Failure(
                k, self.errors.get(k, REASONS[self.status[k]]), {n: float(v[k]) for n, v in given.items()}
            )
            for k in np.flatnonzero(self.status).tolist()
        )

    @property
    def given(self) -> dict[str, Array]:
        """The given values: parameters by key, and initial states as ``STATE.start``."""
        return {**self.parameters, **{f"{name}.start": v for name, v in self.x0.items()}}

    def _repr_html_(self) -> str:
        from hovercontrol.blocks.backends.sweep_display import sweep_html

        return sweep_html(self)

    def plot(self, of: str | None = None, figure: str = "final") -> Figure:
        """Plot a figure (final, maximum, minimum, rms, settling) of an output over the varied values.

        One varied value gives a curve, a grid of two a map. Otherwise the figure is plotted over the run
        number.

        Parameters
        ----------
        of, figure : str, optional
            The output (default: the first) and its figure.

        Raises
        ------
        InputError
            If the output or the figure is unknown.
        """
        from hovercontrol.blocks.backends.sweep_display import sweep_figure

        check_known(figure, FIGURES, f"unknown figure {figure!r}")
        return open_in_pyplot(sweep_figure(self, of, figure))

    def to_table(self, runs: slice = slice(None)) -> pyarrow.Table:
        """Return one row for each run: given values, status, ``OUTPUT.FIGURE``, ``STATE.end``.

        Parameters
        ----------
        runs : slice, optional
            Runs to include (default: all).
        """
        import pyarrow

        columns: dict[str, Any] = {"run": np.arange(len(self)), **self.given}
        columns["status"] = np.array(REASONS)[self.status]
        for name in self.outputs:
            columns |= {f"{name}.{figure}": getattr(self[name], figure) for figure in FIGURES}
        columns |= {f"{name}.end": self.states_final[:, k] for k, name in enumerate(self.states)}
        return pyarrow.table({name: values[runs] for name, values in columns.items()})

    def save(self, path: str | Path) -> Path:
        """Write the table as CSV or Parquet, by the suffix; the file is written atomically."""
        import pyarrow.csv
        import pyarrow.parquet

        writers = {".csv": pyarrow.csv.write_csv, ".parquet": pyarrow.parquet.write_table}
        write = writers.get(Path(path).suffix.lower())
        if write is None:
            raise InputError(f"{path}: a sweep is saved as .csv or .parquet")
        return write_atomically(path, lambda temporary: write(self.to_table(), temporary))


def rows_by_state(block: Block, x0: ArrayLike) -> Many:
    """Convert initial states in rows to a mapping by the states' names."""
    given, names = np.asarray(x0, dtype=float), [s.name for s in block.states]
    own = list(own_states(block).values())
    names = own if given.ndim and given.shape[-1] == len(own) else names
    if given.ndim not in (1, 2) or given.shape[-1] != len(names):
        raise InputError(
            f"block {block.name!r}: x0 must have {len(names)} columns, one for each state, "
            f"found shape {given.shape}"
        )
    return dict(zip(names, np.moveaxis(given, -1, 0), strict=True))


def number_of_runs(given: Many) -> int:
    """Return the number of runs: the common length of all arrays, 1 if there are none."""
    shapes = {name: np.shape(values) for name, values in given.items() if np.shape(values)}
    for name, shape in shapes.items():
        first = next(iter(shapes))
        if len(shape) != 1 or shape != shapes[first]:
            raise InputError(
                f"a sweep needs single values or arrays of one length: {first!r} has shape {shapes[first]}, "
                f"{name!r} has {shape}"
            )
    return next(iter(shapes.values()))[0] if shapes else 1


def values_of_runs(
    block: Block, signals: Mapping[str, Signal], given: Many | None, runs: int, kind: str
) -> tuple[Array, dict[str, Array]]:
    """Return the values of all signals, shape (runs, n_signals), and the given ones by name."""
    every = np.tile([s.start for s in signals.values()], (runs, 1))
    columns = dict(zip(signals, every.T, strict=True))
    for name, values in (given or {}).items():
        check_known(name, signals, f"block {block.name!r}: unknown {kind} {name!r}")
        try:
            columns[name][:] = values
        except (TypeError, ValueError):
            raise InputError(
                f"block {block.name!r}: {kind} {name!r} must be numbers, found {values!r}"
            ) from None
        signal, column = signals[name], columns[name]
        out = ~((signal.lower <= column) & (column <= signal.upper))
        for run in np.flatnonzero(out).tolist() if kind == "parameter" else ():
            try:
                column[run] = signal.check(float(column[run]), name)
            except InputError as error:
                raise InputError(f"block {block.name!r}: {error} (run {run})") from None
    return every, {name: columns[name] for name in given or {}}


def units_of_runs(block: Block) -> dict[str, str]:
    """Return the units of a Block's outputs, parameters and initial states, by their names in sweeps."""
    starts = {f"{s.name}.start": s.unit for s in block.states}
    given = starts | {block.parameter_key(s.name): s.unit for s in block.parameters}
    return given | {s.name: s.unit for s in block.outputs}


def settling_bands(block: Block, band: float | Mapping[str, float]) -> Array:
    """Return the settling band of each output, in its unit; 0.02 if not given."""
    names = [s.name for s in block.outputs]
    bands = dict.fromkeys(names, 0.02)
    for name, value in (band if isinstance(band, Mapping) else dict.fromkeys(names, band)).items():
        if name not in bands:
            raise InputError(f"band: unknown output {name!r}{did_you_mean(name, names)}")
        not_negative(f"band of {name!r}", value)
        bands[name] = float(value)
    return np.array(list(bands.values()))


def number_of_threads(threads: int | None) -> int:
    """Return the number of threads: as given, or one for each core."""
    if threads is not None and threads < 1:
        raise InputError(f"threads must be 1 or more, found {threads}")
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return threads or cores


def in_threads(
    work: Callable[[int], int],
    firsts: range,
    threads: int | None,
    progress: Callable[[int], None] | None,
) -> None:
    """Call `work` for each of `firsts` in threads; an error or Ctrl-C cancels the calls not yet started."""
    with ThreadPoolExecutor(number_of_threads(threads)) as pool:
        futures = [pool.submit(work, first) for first in firsts]
        try:
            done = 0
            for future in as_completed(futures):
                done += future.result()
                if progress is not None:
                    progress(done)
        except BaseException:  # also after Ctrl-C: calls that have not started are cancelled
            pool.shutdown(wait=False, cancel_futures=True)
            raise
