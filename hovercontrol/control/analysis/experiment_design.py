"""Which reference shows which coefficient: the standard errors that an estimator has left after a run.

Along a motion the covariance of C17's estimator does not depend on what is measured, only on where the craft
goes. So the doubt that a run would leave of every coefficient is known before it is run, and references
can be compared. The covariance is that of :func:`~hovercontrol.control.observers.kalman_bucy`, which runs
beside a loop that knows its coefficients. Without disturbances and with no knowledge before the run it is the
noise's intensity times the inverse of the observability Gramian, C17 (6).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.figure_style import COLOUR_MAP
from hovercontrol.base.files import write_atomically
from hovercontrol.base.pyplot import open_in_pyplot, shown_once
from hovercontrol.base.short_repr import short_repr
from hovercontrol.base.tables import positive
from hovercontrol.blocks.block import Block
from hovercontrol.control.analysis.iss import DRAG
from hovercontrol.control.analysis.loops import on_reference
from hovercontrol.control.analysis.reference_runs import RUNS, ReferenceRuns
from hovercontrol.control.analysis.regions import Region, mesh, positive_axis
from hovercontrol.control.controllers.references import ellipse
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.vehicles import c17_experiment, c17_simulation

if TYPE_CHECKING:
    import pyarrow


#: C17's noise of the measured velocities and disturbance of their rates; both per unit of frequency.
MEASUREMENT_NOISE, DISTURBANCE = 1e-5, 1e-4


@checked
@dataclass(frozen=True, eq=False)
class ExpectedErrors:
    """Standard errors of a craft's coefficients after runs along references.

    Attributes
    ----------
    references : tuple of str
        Names, length n.
    coefficients : dict of str to str
        Units by name, length m.
    error : ndarray, shape (n, m)
        Standard error after the run, in the coefficient's unit; it was 1 before. NaN where the craft does
        not get on the reference.
    thrust, rudder : ndarray, shape (n, 2)
        Least and largest command of the run; rudder in rad.
    within_limits : ndarray of bool, shape (n,)
        Whether the actuators can give those.
    duration : float
        Of a run [s].

    Examples
    --------
    >>> import hovercontrol as hc
    >>> found = expected_errors({"circle": hc.circle(1.5)}, coefficients=["surge_linear_drag"])
    >>> found.references, found.error.shape
    (('circle',), (1, 1))
    """

    references: tuple[str, ...]
    coefficients: dict[str, str]
    error: Array
    thrust: Array
    rudder: Array
    within_limits: NDArray[np.bool_]
    duration: float

    __repr__ = short_repr

    def table(self) -> pyarrow.Table:
        """Return one row for each reference."""
        import pyarrow

        columns: dict[str, Any] = {"reference": list(self.references)}
        for (name, unit), values in zip(self.coefficients.items(), self.error.T, strict=True):
            columns[f"{name} [{unit}]"] = values
        for name, unit, values in (("thrust", "1", self.thrust), ("rudder", "rad", self.rudder)):
            columns |= {f"least {name} [{unit}]": values[:, 0], f"largest {name} [{unit}]": values[:, 1]}
        columns["within limits"] = self.within_limits.astype(np.int8)
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

    def plot(self, axes: Axes | None = None) -> Figure:
        """Return a figure: a heat map of references over coefficients, with its numbers.

        References that the actuators cannot follow have a star.

        Parameters
        ----------
        axes : matplotlib.axes.Axes, optional
            Where to draw; default a figure of its own.
        """
        own = axes is None
        if axes is None:
            axes = Figure(figsize=(8.0, 1.5 + 0.4 * len(self.references)), layout="constrained").subplots()
        scale = LogNorm(1e-3 * RUNS.doubt, 0.1 * RUNS.doubt, clip=True)
        drawn = axes.imshow(self.error, cmap=f"{COLOUR_MAP}_r", norm=scale, aspect="auto")
        for (row, column), value in np.ndenumerate(self.error):
            text = f"{value:.2g}" if math.isfinite(value) else "off"
            dark = math.isfinite(value) and scale(value) > 0.55
            axes.text(column, row, text, ha="center", va="center", color="white" if dark else "black")
        names = [
            f"{name}{'' if inside else ' *'}"
            for name, inside in zip(self.references, self.within_limits, strict=True)
        ]
        axes.set_yticks(range(len(names)), names)
        signs = [f"{name.replace('_', ' ')}\n[{unit}]" for name, unit in self.coefficients.items()]
        axes.set_xticks(range(len(signs)), signs, fontsize=8)
        axes.set_title(
            f"standard error left after {self.duration:.3g} s (*: beyond the actuators)", fontsize=10
        )
        figure = axes.get_figure(root=True)
        assert isinstance(figure, Figure)
        figure.colorbar(
            drawn, ax=axes, extend="both", label=f"standard error [SI], {RUNS.doubt:g} before the run"
        )
        return open_in_pyplot(figure) if own else shown_once(figure)


@checked
def expected_errors(
    references: Mapping[str, Block],
    model: Model | None = None,
    coefficients: Sequence[str] = DRAG,
    *,
    actuators: Model | None = None,
    duration: float = 4 * math.pi,
    noise: float = MEASUREMENT_NOISE,
    disturbance: float = DISTURBANCE,
    progress: Callable[[int], None] | None = None,
) -> ExpectedErrors:
    """Return the standard error that a run along each reference leaves of each coefficient.

    Parameters
    ----------
    references : mapping of str to Block
        By the name to show.
    model : Model, optional
        Default the craft of C17's simulation.
    coefficients : sequence of str, optional
        Those that are sought, all at once; default c1 to c6.
    actuators : Model, optional
        The craft whose bounds of thrust and rudder count; default C17's experiment.
    duration : float, optional
        Of each run, once the craft is on the reference [s]; default two laps of C17's ellipse.
    noise : float, optional
        Intensity of the noise of the measured velocities [(m/s)^2 s, (rad/s)^2 s]; default C17's R.
    disturbance : float, optional
        Intensity of the disturbance of their rates [(m/s)^2/s, (rad/s)^2/s], 0 or more; default C17's Q.
    progress : callable, optional
        Called now and then with the number of references done.

    Returns
    -------
    ExpectedErrors

    Raises
    ------
    InputError
        If there is no reference, one stands still at t = 0, a coefficient cannot be estimated, or a number is
        out of range.

    Notes
    -----
    The coefficients are constant (no drift, other than in C17, whose filter forgets), so that this is the
    Cramer-Rao bound of the linear problem.

    Examples
    --------
    >>> from hovercontrol.control.controllers.references import circle
    >>> found = expected_errors({"circle": circle(2.0)}, coefficients=["sway_coulomb", "sway_linear_drag"])
    >>> found.error.round(2).tolist()  # 1 before: only a sum of both is seen at a constant speed
    [[0.82, 0.57]]
    """
    if not references:
        raise InputError("references: expected one or more, found none")
    study = ReferenceRuns(model or c17_simulation(), tuple(coefficients), duration, noise, disturbance)
    runs = []
    for done, reference in enumerate(references.values(), 1):
        start = {name: [value] for name, value in on_reference(reference, study.control_point).items()}
        study.refuse_large(reference, 1)
        runs.append(study.run(reference, start, {}))
        if progress:
            progress(done)
    error, commands = (np.vstack(rows) for rows in zip(*runs, strict=True))
    inside = _within(commands, actuators or c17_experiment())
    thrust, rudder = commands[:, :2], commands[:, 2:]
    return ExpectedErrors(tuple(references), study.units, error, thrust, rudder, inside, duration)


@checked
def ellipse_errors(
    semi_x: tuple[float, float] = (0.5, 4.0),
    semi_y: tuple[float, float] = (0.5, 4.0),
    points: int = 30,
    *,
    rate: float = 1.0,
    model: Model | None = None,
    coefficients: Sequence[str] = DRAG,
    actuators: Model | None = None,
    duration: float = 4 * math.pi,
    noise: float = MEASUREMENT_NOISE,
    disturbance: float = DISTURBANCE,
    progress: Callable[[int], None] | None = None,
) -> Region:
    """Return what ellipses of all sizes, run clockwise as C17's, leave in doubt.

    Parameters
    ----------
    semi_x, semi_y : tuple of float, optional
        Ranges of the semi-axes [m].
    points : int, optional
        Along each axis.
    rate : float, optional
        Angular rate [rad/s], positive.
    model, coefficients, actuators, duration, noise, disturbance
        As for :func:`expected_errors`.
    progress
        As for :meth:`~hovercontrol.blocks.backends.compiled.CompiledBlock.sweep`.

    Returns
    -------
    Region
        Map ``within limits`` (the actuators can follow), ``worst``, the largest standard error of all, and
        one by the name of each coefficient; NaN where the craft does not get on the ellipse.

    Raises
    ------
    InputError
        As for :func:`expected_errors`; if a range is none or the map is too large.

    Examples
    --------
    >>> region = ellipse_errors((1.0, 2.0), (1.0, 2.0), points=2)
    >>> list(region.maps)[:3]
    ['within limits', 'worst', 'surge_coulomb']
    """
    positive("rate", rate)
    x, y = (
        positive_axis(name, "m", span, points, f"semi-axis along {name[-1]}")
        for name, span in (("semi_x", semi_x), ("semi_y", semi_y))
    )
    study = ReferenceRuns(model or c17_simulation(), tuple(coefficients), duration, noise, disturbance)
    clockwise = (-rate, math.pi / 2)
    curve = ellipse(1.0, 1.0, *clockwise)
    study.refuse_large(curve, points**2)
    a, b = mesh(x, y)
    begin = [on_reference(ellipse(*axes, *clockwise), study.control_point) for axes in zip(a, b, strict=True)]
    start = {name: np.array([s[name] for s in begin]) for name in begin[0]}
    params = {"reference.semi_x": a, "reference.semi_y": b}
    error, commands = study.run(curve, start, params, progress=progress)
    maps: dict[str, NDArray[Any]] = {
        "within limits": _within(commands, actuators or c17_experiment()),
        "worst": error.max(axis=1),
        **dict(zip(study.units, error.T, strict=True)),
    }
    return Region(
        f"ellipses at {rate:g} rad/s, {duration:.3g} s",
        x,
        y,
        {name: values.reshape(points, points) for name, values in maps.items()},
        units={"worst": "SI", **study.units},
        labels={"within limits": "actuators can follow", "worst": "largest standard error"},
        marks={"C17 simulation": (1.5, 2.5)} if rate == 1.0 else {},
    )


def _within(commands: Array, actuators: Model) -> NDArray[np.bool_]:
    """Return which runs keep to the bounds of thrust and rudder; those off their reference do not."""
    lower = [actuators.thrust.lower, actuators.rudder.lower]
    upper = [actuators.thrust.upper, actuators.rudder.upper]
    kept = (commands[:, 0::2] >= lower) & (commands[:, 1::2] <= upper)
    return np.asarray(kept.all(axis=1))
