"""The fan's lookup tables from bench measurements, by K06's method (4.3.2)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from hovercontrol.base.arguments import as_row
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.base.short_repr import short_repr
from hovercontrol.craft.hardware.actuators.k06 import (
    FORCE_COLUMNS,
    HIGHEST_SPEED,
    LOWEST_SPEED,
    RUDDER_ROWS,
    SPEED_STEP,
    fan_tables,
)
from hovercontrol.craft.hardware.actuators.tables import FanTable
from hovercontrol.craft.hardware.calibration.fits import fit_reverse_ratio, fit_thrust
from hovercontrol.craft.hardware.calibration.result import Fit, Floats, measured
from hovercontrol.logs.check import check_finite
from hovercontrol.logs.source import open_source

COLUMNS = ("rudder_deg", "speed_rpm", "force_N")


@checked
@dataclass(frozen=True, eq=False)
class FanCalibration:
    """Lookup tables from bench measurements, and the fits behind them.

    Attributes
    ----------
    thrust : dict of float to Fit
        Quadratic of the forward thrust, by rudder angle [degree].
    ratio : Fit
        Cubic of the ratio of reverse to forward thrust.
    lookup, reverse : FanTable
        Speeds [RPM] over forces, and forces [N] over speeds.

    Examples
    --------
    >>> from hovercontrol.craft.hardware.actuators import fan_force
    >>> speeds = np.array([-9e3, -8e3, -7e3, -6e3, -5e3, 5e3, 6e3, 7e3, 8e3, 9e3])
    >>> rudder, speed = np.meshgrid([-40.0, 0.0, 40.0], speeds)
    >>> keep = (speed > 0) | (rudder == 0)
    >>> found = thrust_table_from_bench(rudder[keep], speed[keep], fan_force(speed[keep], rudder[keep]))
    >>> found.ratio.names
    ('c3', 'c2', 'c1', 'c0')
    """

    thrust: dict[float, Fit]
    ratio: Fit
    lookup: FanTable
    reverse: FanTable

    __repr__ = short_repr

    @property
    def tables(self) -> tuple[FanTable, FanTable]:
        """Both tables, the argument of :func:`~hovercontrol.craft.hardware.actuators.actuators`."""
        return self.lookup, self.reverse

    def to_csv(self, folder: str | Path) -> tuple[Path, Path]:
        """Write ``speed_over_force.csv`` and ``force_over_speed.csv``; ``read_fan_table`` reads them.

        Parameters
        ----------
        folder : path
            Created if missing.
        """
        where = Path(folder)
        return (
            self.lookup.to_csv(where / "speed_over_force.csv"),
            self.reverse.to_csv(where / "force_over_speed.csv"),
        )

    def plot(self) -> Figure:
        """Draw thrust and fit for each rudder angle, and the residuals below.

        Returns
        -------
        matplotlib.figure.Figure
        """
        figure = Figure(figsize=(7.2, 6.0), layout="constrained")
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
        colours = mpl.colormaps["viridis"](np.linspace(0.0, 0.9, len(self.thrust)))
        for (angle, fit), colour in zip(sorted(self.thrust.items()), colours, strict=True):
            n = np.linspace(fit.x.min(), fit.x.max(), 100)
            above.plot(n, np.polyval(fit.values, n / 1e3), color=colour, lw=1, label=f"{angle:g} deg")
            above.plot(fit.x, fit.y, "o", color=colour, ms=3)
            below.plot(fit.x, fit.residuals, "o", color=colour, ms=3)
        above.set_ylabel("thrust [N]")
        above.set_title("forward thrust, quadratic for each rudder angle")
        above.legend(title="rudder", frameon=False, ncols=2, fontsize="small")
        below.axhline(0.0, color="0.4", lw=1)
        below.set_xlabel("speed [RPM]")
        below.set_ylabel("residual [N]")
        for axis in (above, below):
            axis.grid(alpha=0.3)
        return open_in_pyplot(figure)


@checked
def read_fan_bench(path: str | Path) -> tuple[Floats, Floats, Floats]:
    r"""Read bench measurements.

    Parameters
    ----------
    path : path
        CSV with the columns ``rudder_deg``, ``speed_rpm``, ``force_N``, one row a measurement; speed and
        force are negative in reverse.

    Returns
    -------
    tuple of three ndarray (n,)
        Rudder angles [degree], speeds [RPM], forces [N].

    Raises
    ------
    InputError
        If the file does not exist, a column is missing or a cell is not a number.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "bench.csv"
    ...     _ = file.write_text("rudder_deg,speed_rpm,force_N\n0,5000,0.36\n0,10000,1.45\n")
    ...     rudder, speed, force = read_fan_bench(file)
    >>> force.tolist()
    [0.36, 1.45]
    """
    file = Path(path)
    source = open_source(file)
    for name in COLUMNS:
        check_known(name, source.header, f"{file}: no column {name!r}")
    batches = [
        np.column_stack([batch.column(k).to_numpy(zero_copy_only=False) for k in range(3)])
        for batch in source.batches(list(COLUMNS))
    ]
    table = np.concatenate([np.empty((0, 3)), *batches]).astype(float)
    for name, column in zip(COLUMNS, table.T, strict=True):
        check_finite(str(file), source, name, column)
    return table[:, 0], table[:, 1], table[:, 2]


@checked
def thrust_table_from_bench(
    rudder: ArrayLike,
    speed: ArrayLike,
    force: ArrayLike,
    *,
    name: str = "bench",
    rows: ArrayLike = RUDDER_ROWS,
    columns: ArrayLike = FORCE_COLUMNS,
    lowest: float = LOWEST_SPEED,
    highest: float = HIGHEST_SPEED,
    step: float = SPEED_STEP,
) -> FanCalibration:
    """Return both lookup tables from bench measurements, by K06's method.

    Forward thrust is fitted by a quadratic for each rudder angle; between two angles the coefficients are
    interpolated, outside the measured angles they are constant. Reverse thrust, measured at rudder 0 only, is
    a cubic ratio times the forward thrust (4.4); outside the measured speeds the ratio is constant.
    Below the lowest speed the force falls with the square of the speed.

    Parameters
    ----------
    rudder, speed, force : array_like, shape (n,)
        Rudder angle [degree], fan speed [RPM] and force [N]; speed and force negative in reverse.
    name : str, optional
        Name of the bench in messages.
    rows, columns : array_like, optional
        The table's rudder angles [degree] and forces [N].
    lowest, highest, step : float, optional
        Range of the speed, and step of the reverse table [RPM].

    Returns
    -------
    FanCalibration

    Raises
    ------
    InputError
        If there are too few measurements at an angle or in reverse, forward thrust was not measured at rudder
        0, a fitted force does not grow with the speed, or an axis is not a row of numbers. The message says
        where.

    Examples
    --------
    >>> from hovercontrol.craft.hardware.actuators import fan_force
    >>> speeds = np.array([-9e3, -8e3, -7e3, -6e3, -5e3, 5e3, 6e3, 7e3, 8e3, 9e3])
    >>> rudder, speed = np.meshgrid([-40.0, 0.0, 40.0], speeds)
    >>> keep = (speed > 0) | (rudder == 0)
    >>> found = thrust_table_from_bench(rudder[keep], speed[keep], fan_force(speed[keep], rudder[keep]))
    >>> sorted(found.thrust), found.lookup.values.shape
    ([-40.0, 0.0, 40.0], (14, 161))
    """
    angle, n, f = measured(name, rudder, speed, force)
    rows, columns = (as_row(f"{name}: {k}", a) for k, a in (("rows", rows), ("columns", columns)))
    ahead = n > 0
    thrust = {
        float(a): fit_thrust(n[here], f[here], title=f"{name}: thrust at rudder {a:g} deg")
        for a in np.unique(angle[ahead])
        if (here := ahead & (angle == a)).any()
    }
    if 0.0 not in thrust:
        raise InputError(f"{name}: expected forward thrust at rudder 0, the reference of reverse thrust")
    _need_growth(name, thrust, lowest, highest)
    astern = (n < 0) & (angle == 0.0)
    forward = np.polyval(thrust[0.0].values, -n[astern] / 1e3)
    ratio = fit_reverse_ratio(-n[astern], -f[astern] / forward)
    angles = np.array(sorted(thrust))
    quadratics = np.array([thrust[a].values for a in angles])

    def model(speeds: Floats, angle: float) -> Any:
        size = np.abs(speeds)
        own = [np.interp(angle, angles, q) for q in quadratics.T]
        found = np.polyval(own, np.maximum(size, lowest) / 1e3) * np.minimum(size / lowest, 1.0) ** 2
        back = np.polyval(ratio.values, np.clip(size, ratio.x.min(), ratio.x.max()) / 1e3)
        return np.where(speeds < 0, -back, 1.0) * found

    lookup, reverse = fan_tables(
        model, name=name, rudder=rows, columns=columns, lowest=lowest, highest=highest, step=step
    )
    return FanCalibration(thrust, ratio, lookup, reverse)


def _need_growth(name: str, thrust: dict[float, Fit], lowest: float, highest: float) -> None:
    for angle, fit in thrust.items():
        a, b, _ = fit.values
        least = np.polyval(fit.values, lowest / 1e3)
        slopes = [2 * a * n / 1e3 + b for n in (lowest, highest)]
        if least <= 0 or min(slopes) <= 0:
            raise InputError(
                f"{name}: rudder {angle:g} deg: expected a thrust that is positive and grows from {lowest:g} "
                f"to {highest:g} RPM, found {least:.3g} N and slopes of {slopes[0]:.3g} and {slopes[1]:.3g} "
                "N per 1000 RPM"
            )
