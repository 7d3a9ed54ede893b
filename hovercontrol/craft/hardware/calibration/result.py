"""Result of a calibration: coefficients with standard errors, and residuals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray
from scipy.special import stdtrit

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.base.short_repr import short_repr

Floats = NDArray[np.float64]


@checked
class Axis(NamedTuple):
    """Name and unit of an axis.

    Examples
    --------
    >>> Axis("speed", "RPM").unit
    'RPM'
    """

    name: str
    unit: str

    def __str__(self) -> str:
        return self.name if self.unit == "1" else f"{self.name} [{self.unit}]"


@checked
@dataclass(frozen=True, eq=False)
class Fit:
    """A linear least-squares fit ``y = design @ values``.

    Attributes
    ----------
    title : str
    x_axis, y_axis : Axis
        The quantity that was set and the one that was measured.
    x, y : ndarray (n,)
        The bench data.
    fitted : ndarray (n,)
        Values of the fit at ``x``.
    names, units : tuple of str
        Of the coefficients.
    values : ndarray (k,)
    covariance : ndarray (k, k)
        Covariance of the coefficients from the residuals, for independent errors of equal size.

    Examples
    --------
    >>> from hovercontrol.craft.hardware.calibration import fit_rudder
    >>> fit = fit_rudder([-20.0, 0.0, 20.0], [28.0, 0.5, -27.0])
    >>> fit.names, fit.covariance.shape
    (('slope', 'offset'), (2, 2))
    """

    title: str
    x_axis: Axis
    y_axis: Axis
    x: Floats
    y: Floats
    fitted: Floats
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Floats
    covariance: Floats

    __repr__ = short_repr

    @property
    def residuals(self) -> Floats:
        """Measurement minus fit, in the unit of ``y``."""
        return self.y - self.fitted

    @property
    def freedom(self) -> int:
        """Degrees of freedom: number of measurements minus number of coefficients."""
        return len(self.y) - len(self.values)

    @property
    def sigma(self) -> float:
        """Standard deviation of one measurement, from the residuals."""
        return float(np.sqrt(self.residuals @ self.residuals / self.freedom))

    @property
    def std(self) -> Floats:
        """Standard errors of the coefficients."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    def coefficients(self) -> dict[str, float]:
        """Return the coefficients by name."""
        return dict(zip(self.names, self.values.tolist(), strict=True))

    def intervals(self, level: float = 0.95) -> dict[str, tuple[float, float]]:
        """Return the confidence interval of each coefficient, by Student's t.

        Parameters
        ----------
        level : float, optional
            Between 0 and 1.

        Raises
        ------
        InputError
            If it is not.
        """
        if not 0 < level < 1:
            raise InputError(f"{self.title}: level must be between 0 and 1, found {level!r}")
        half = stdtrit(self.freedom, 0.5 + level / 2) * self.std
        ends = zip((self.values - half).tolist(), (self.values + half).tolist(), strict=True)
        return dict(zip(self.names, ends, strict=True))

    def __str__(self) -> str:
        rows = zip(self.names, self.values, self.std, self.units, strict=True)
        lines = [f"  {name} = {value:.5g} +- {std:.2g} {unit}".rstrip() for name, value, std, unit in rows]
        spread = f"  residuals {self.sigma:.3g} {self.y_axis.unit}, {len(self.y)} measurements"
        return "\n".join([self.title, *lines, spread])

    def plot(self) -> Figure:
        """Draw measurements and fit, and below them the residuals with twice their standard deviation.

        Returns
        -------
        matplotlib.figure.Figure
            ``figure.savefig("fit.png")`` writes it.
        """
        figure = Figure(figsize=(6.4, 5.6), layout="constrained")
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
        order = np.argsort(self.x, kind="stable")
        above.plot(self.x, self.y, "o", color="0.45", ms=4, label="measured")
        above.plot(self.x[order], self.fitted[order], color="tab:blue", label="fit")
        above.set_ylabel(str(self.y_axis))
        above.legend(frameon=False)
        above.set_title(self.title)
        band = {"color": "tab:blue", "alpha": 0.12, "lw": 0, "label": "two standard deviations"}
        below.axhspan(-2 * self.sigma, 2 * self.sigma, **band)
        below.axhline(0.0, color="tab:blue", lw=1)
        below.plot(self.x, self.residuals, "o", color="0.45", ms=4)
        below.set_xlabel(str(self.x_axis))
        below.set_ylabel(str(Axis("residual", self.y_axis.unit)))
        below.legend(frameon=False, fontsize="small", loc="upper right")
        most = max(3 * self.sigma, 1.1 * float(np.abs(self.residuals).max())) or 1.0
        below.set_ylim(-most, most)
        for axis in (above, below):
            axis.grid(alpha=0.3)
        return open_in_pyplot(figure)


def fit_polynomial(
    title: str,
    x: ArrayLike,
    y: ArrayLike,
    axes: tuple[Axis, Axis],
    coefficients: dict[str, str],
    *,
    scale: float = 1.0,
) -> Fit:
    """Fit a polynomial by least squares.

    Parameters
    ----------
    title : str
        Title in messages and figures.
    x, y : array_like, shape (n,)
    coefficients : dict of str to str
        Name and unit, the highest power first.
    scale : float, optional
        The polynomial has the argument ``x/scale``.

    Raises
    ------
    InputError
        If shapes differ, a number is missing, or there are too few different x for the coefficients and their
        errors.
    """
    xs, ys = measured(title, x, y)
    degree = len(coefficients) - 1
    different = len(np.unique(xs))
    if different <= degree or len(xs) <= degree + 1:
        raise InputError(
            f"{title}: expected {degree + 2} or more measurements at {degree + 1} or more "
            f"different {axes[0].name}s, found {len(xs)} at {different}"
        )
    design = np.vander(xs / scale, degree + 1)
    values = np.asarray(np.linalg.lstsq(design, ys)[0], dtype=float)
    fitted = design @ values
    left = ys - fitted
    inverse = np.linalg.pinv(design)
    variance = float(left @ left) / (len(xs) - degree - 1)
    covariance = np.asarray(variance * inverse @ inverse.T, dtype=float)
    names, units = tuple(coefficients), tuple(coefficients.values())
    return Fit(title, *axes, xs, ys, fitted, names, units, values, covariance)


def measured(title: str, *columns: ArrayLike) -> list[Floats]:
    """Return columns of measurements as arrays of equal length, without missing values.

    Raises
    ------
    InputError
        If lengths differ or a number is not finite; the line says where.
    """
    arrays = [np.asarray(c, dtype=float) for c in columns]
    if any(a.ndim != 1 or len(a) != len(arrays[0]) for a in arrays):
        raise InputError(
            f"{title}: expected columns of one length, found shapes {', '.join(str(a.shape) for a in arrays)}"
        )
    for k, array in enumerate(arrays, 1):
        bad = np.flatnonzero(~np.isfinite(array))
        if bad.size:
            raise InputError(
                f"{title}: column {k}, row {bad[0] + 1}: expected a finite number, found {array[bad[0]]}"
            )
    return arrays
