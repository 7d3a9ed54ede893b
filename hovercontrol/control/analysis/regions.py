"""Maps over two parameters: where a theorem holds, and what linearisation and simulation say."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import as_user, checked
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.base.figure_style import figure_style
from hovercontrol.base.files import write_atomically
from hovercontrol.base.pyplot import open_in_pyplot, shown_once
from hovercontrol.base.short_repr import short_repr
from hovercontrol.base.tables import number
from hovercontrol.blocks.backends.compiled import CompiledBlock
from hovercontrol.blocks.backends.sweep import Axis as Axis
from hovercontrol.blocks.backends.sweep import SweepResult
from hovercontrol.control.analysis.region_drawing import draw_region

if TYPE_CHECKING:
    import pyarrow


@dataclass(frozen=True)
class SweepLimits:
    """What a sweep of a map may take; more is refused before it begins.

    Set by hand: what a small machine has and a person waits for.

    Attributes
    ----------
    memory : int
        Memory [bytes].
    time : float
        Time on all cores [s].
    """

    memory: int = 2 * 2**30
    time: float = 3600.0


#: The values in use.
SWEEP_LIMITS = SweepLimits()


#: So many numbers are held for each point of a map, at least.
NUMBERS = 20


def as_numbers(name: str, given: ArrayLike) -> Array:
    """Return an array of numbers; raises :class:`InputError` where something is none."""
    try:
        return np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be numbers, found {given!r:.60}") from None


#: Farthest end of an axis: of anything larger the squares are no numbers.
LARGEST = 1e100


@checked
def axis(name: str, unit: str, span: tuple[float, float], points: int, label: str = "") -> Axis:
    """Return an axis of equal steps.

    Parameters
    ----------
    name, unit : str
    span : tuple of float
        First and last value, in the unit.
    points : int
        Two or more.
    label : str, optional
        What pictures call it; default the name.

    Raises
    ------
    InputError
        If the range is no range (empty, reversed, not finite) or there are less than two points.

    Examples
    --------
    >>> axis("k1", "1/s^2", (1.0, 2.0), 3).values.tolist()
    [1.0, 1.5, 2.0]
    """
    if not isinstance(span, tuple | list) or len(span) != 2:
        raise InputError(f"{name}: a range is two numbers, found {span!r}")
    low, high = (number(f"{name}: range", v) for v in span)
    if max(abs(low), abs(high)) > LARGEST:
        raise InputError(f"{name}: expected a range within {LARGEST:g} {unit}, found {low:g} to {high:g}")
    if not low < high:
        found = "is empty" if low == high else "is reversed"
        raise InputError(f"{name}: the range {low:g} to {high:g} {unit} {found}")
    if not isinstance(points, int) or points < 2:
        raise InputError(f"{name}: a range needs 2 or more points, found {points!r}")
    return Axis(name, unit, np.linspace(low, high, points), label)


def positive_axis(name: str, unit: str, span: tuple[float, float], points: int, label: str = "") -> Axis:
    """Return an axis of a parameter that must be positive.

    Raises
    ------
    InputError
        As for :func:`axis`, and if it is not.
    """
    found = axis(name, unit, span, points, label)
    if not found.values[0] > 0:
        raise InputError(f"{name} must be positive, found {found.values[0]:g}")
    return found


@checked
@dataclass(frozen=True, eq=False)
class Region:
    """Maps over two parameters.

    Parameters
    ----------
    title : str
    x, y : Axis
    maps : mapping of str to ndarray, shape (n_y, n_x)
        True and false for a region, numbers for a quantity. The first region is the judge: it is drawn as
        a filled area, the next one hatched, the others as outlines.
    units : mapping of str to str, optional
        Of the quantities.
    labels : mapping of str to str, optional
        What pictures and tables call a map; default its name.
    lines : mapping of str to (ndarray, ndarray), optional
        Curves to draw, each x and y, NaN where they are interrupted.
    marks : mapping of str to (float, float), optional
        Points to mark, such as the gains that a paper takes.

    Examples
    --------
    >>> k1, k2 = Axis("k1", "1/s^2", np.array([1.0, 2.0])), Axis("k2", "1/s", np.array([1.0]))
    >>> region = Region("stable gains", k1, k2, {"stable": np.array([[True, False]])})
    >>> region.maps["stable"].shape
    (1, 2)
    """

    title: str
    x: Axis
    y: Axis
    maps: Mapping[str, NDArray[Any]]
    units: Mapping[str, str] = field(default_factory=dict)
    labels: Mapping[str, str] = field(default_factory=dict)
    lines: Mapping[str, tuple[Array, Array]] = field(default_factory=dict)
    marks: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        shape = (len(self.y.values), len(self.x.values))
        for name, values in self.maps.items():
            if np.shape(values) != shape:
                raise InputError(f"{name}: expected a map of shape {shape}, found {np.shape(values)}")

    def __getitem__(self, name: str) -> NDArray[Any]:
        check_known(name, self.maps, f"no map {name!r}")
        return self.maps[name]

    def label(self, name: str) -> str:
        """Return what a map is called, with its unit.

        Parameters
        ----------
        name : str
            Of the map.
        """
        text = self.labels.get(name, name)
        return f"{text} [{self.units[name]}]" if name in self.units else text

    def share(self, part: str, whole: str) -> float:
        """Return the share of region `whole` that region `part` covers; NaN where `whole` is empty."""
        inside = self[whole].astype(bool)
        return float((self[part] & inside).sum() / inside.sum()) if inside.any() else math.nan

    def outside(self, part: str, whole: str) -> list[tuple[float, float]]:
        """Return the points (x, y) of region `part` that are not in region `whole`: counter-examples."""
        rows, columns = np.nonzero(self[part] & ~self[whole].astype(bool))
        points = zip(self.x.values[columns].tolist(), self.y.values[rows].tolist(), strict=True)
        return list(points)

    def table(self) -> pyarrow.Table:
        """Return one row for each point: the two parameters, then all maps; regions as 0 and 1."""
        import pyarrow

        x, y = mesh(self.x, self.y)
        columns: dict[str, Any] = {f"{self.x.name} [{self.x.unit}]": x, f"{self.y.name} [{self.y.unit}]": y}
        for name, values in self.maps.items():
            flat = values.ravel()
            columns[self.label(name)] = flat.astype(np.int8) if flat.dtype == bool else flat
        return pyarrow.table(columns)

    def save(self, path: str | Path) -> Path:
        """Write the table as CSV; it is written atomically.

        Parameters
        ----------
        path : path
            Of the CSV file.
        """
        import pyarrow.csv

        return write_atomically(path, lambda file: pyarrow.csv.write_csv(self.table(), file))

    def plot(self, *names: str, axes: Axes | None = None) -> Figure:
        """Return a figure: regions as areas and outlines with words in them, a quantity in colours.

        Parameters
        ----------
        *names : str
            Maps to draw; default all.
        axes : matplotlib.axes.Axes, optional
            Draw here; default a new figure.
        """
        with figure_style():
            own = axes is None
            if axes is None:
                figure = Figure(figsize=(7.0, 5.8), layout="constrained")
                axes = figure.subplots()
                figure.suptitle(self.title, fontsize=11)
            else:
                axes.set_title(self.title, fontsize=10)
            draw_region(self, names or self.maps, axes)
        drawn = axes.get_figure(root=True)
        assert isinstance(drawn, Figure)
        return open_in_pyplot(drawn) if own else shown_once(drawn)


@checked
def mesh(x: Axis, y: Axis) -> tuple[Array, Array]:
    """Return both parameters at every point, x running fastest.

    Parameters
    ----------
    x, y : Axis

    Returns
    -------
    x, y : ndarray, shape (n_y * n_x,)
        ``values.reshape(n_y, n_x)`` makes a map of what is computed of them.

    Raises
    ------
    InputError
        If they are so many that a few numbers for each need more than 2 GiB.

    Examples
    --------
    >>> mesh(Axis("k1", "1/s^2", np.array([1.0, 2.0])), Axis("k2", "1/s", np.array([5.0])))
    (array([1., 2.]), array([5., 5.]))
    """
    points = len(x.values) * len(y.values)
    memory = 8.0 * NUMBERS * points
    if memory > SWEEP_LIMITS.memory:
        raise InputError(
            f"a map of {points:.3g} points would take {memory / 2**30:.3g} GiB of memory (the limit: "
            f"{SWEEP_LIMITS.memory / 2**30:g} GiB); take fewer points"
        )
    xs, ys = np.meshgrid(x.values, y.values)
    return xs.ravel(), ys.ravel()


@checked
def sweep_map(
    loop: CompiledBlock,
    x: Axis,
    y: Axis,
    params: Callable[[Array, Array], Mapping[str, ArrayLike]],
    grid: ArrayLike,
    *,
    progress: Callable[[int], None] | None = None,
    **options: Any,
) -> SweepResult:
    """Simulate a loop at every point of a map; the runs are in the order of :func:`mesh`.

    Parameters
    ----------
    loop : CompiledBlock
    x, y : Axis
    params : callable
        Called with both parameters, each shape (n,); returns the loop's parameters by key.
    grid : array_like
        Times [s].
    progress : callable, optional
        Called now and then with the number of runs done.
    **options
        For :meth:`~hovercontrol.blocks.backends.compiled.CompiledBlock.sweep`.

    Returns
    -------
    SweepResult

    Raises
    ------
    InputError
        If it would need more than 2 GiB or an hour, with the estimate of both; the time is taken of a few
        points of the map.

    Examples
    --------
    What is left after 1 s of a decay, over its rate and its start:

    >>> from hovercontrol.blocks.block import Block
    >>> from hovercontrol.blocks.signals import Signal
    >>> units = {"v": "m/s", "k": "1/s", "u": "m/s^2"}
    >>> v, k, u = (Signal(name, unit, start=1.0) for name, unit in units.items())
    >>> decay = Block("decay", [v], [], [v], [k, u], {"v": u.symbol - k.symbol * v.symbol})
    >>> rate, push = axis("k", "1/s", (1.0, 2.0), 2), axis("u", "m/s^2", (0.0, 1.0), 2)
    >>> found = sweep_map(
    ...     decay.compile(), rate, push, lambda k, u: {"decay.k": k, "decay.u": u}, [0.0, 1.0]
    ... )
    >>> found["v"].final.reshape(2, 2).round(3).tolist()
    [[0.368, 0.135], [1.0, 0.568]]
    """
    refuse_large(loop, len(x.values) * len(y.values), _trial(loop, x, y, params, grid, options))
    return as_user(loop.sweep, grid, params=params(*mesh(x, y)), progress=progress, **options)


def refuse_large(loop: CompiledBlock, runs: int, seconds_per_run: float) -> None:
    """Refuse a sweep that would need too much memory or time; the line has the estimates.

    Raises
    ------
    InputError
    """
    block = loop.block
    numbers = len(block.parameters) + 2 * len(block.states) + 5 * len(block.outputs) + 4
    memory, seconds = 8.0 * numbers * runs, seconds_per_run * runs
    if memory > SWEEP_LIMITS.memory or seconds > SWEEP_LIMITS.time:
        raise InputError(
            f"block {block.name!r}: a sweep of {runs:.3g} runs would take {_hours(seconds)} and "
            f"{memory / 2**30:.3g} GiB of memory (the limits: {_hours(SWEEP_LIMITS.time)}, "
            f"{SWEEP_LIMITS.memory / 2**30:g} GiB); take fewer points"
        )


def _trial(
    loop: CompiledBlock, x: Axis, y: Axis, params: Callable[..., Any], grid: ArrayLike, options: Any
) -> float:
    """Return the seconds that a run takes, of 32 runs along the map's diagonal."""
    place = np.linspace(0.0, 1.0, 32)
    few = [np.interp(place, np.linspace(0.0, 1.0, len(a.values)), a.values) for a in (x, y)]
    given = params(few[0], few[1])
    keep = {k: v for k, v in options.items() if k not in ("x0", "band", "executor", "checkpoint")}
    times = np.asarray(grid, dtype=float)
    loop.sweep(times, params=given, **keep)  # builds, if need be
    begin = time.perf_counter()
    loop.sweep(times, params=given, **keep)
    return (time.perf_counter() - begin) / len(place)


def _hours(seconds: float) -> str:
    return f"{seconds / 3600:.3g} h" if seconds >= 3600 else f"{seconds:.3g} s"
