"""Results of an identification: to print, to save, and to simulate with."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.arguments import at_least
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import check_known
from hovercontrol.base.files import write_atomically
from hovercontrol.base.percent import percent
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.base.short_repr import short_repr
from hovercontrol.base.text_table import aligned
from hovercontrol.blocks.block import Block
from hovercontrol.craft.effects import Effect
from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.physical import BODY, carried_by
from hovercontrol.identification.diagnose.coefficients import Reading
from hovercontrol.identification.diagnose.unknown.function import FittedFunction
from hovercontrol.identification.engine.fit import Fit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hovercontrol.identification.identify.residuals import Residuals


@dataclass(frozen=True)
class MisfitCriteria:
    """Thresholds for a fitted model that explains its logs poorly.

    No published source: set by hand, tested in tests/identification/identify/test_fit.py.

    Attributes
    ----------
    little : float
        Ratio of process noise to acceleration above which the model explains little.
    nothing : float
        The same ratio above which the model does not predict the motion.
    better : float
        Ratio of the prediction error to that of constant velocities above which the model is no better.
    apart : float
        Difference of two readings of a coefficient above which they contradict each other, in standard errors
        of the difference.
    """

    little: float = 0.3
    nothing: float = 0.7
    better: float = 0.95
    apart: float = 3.0


#: The values in use.
MISFIT = MisfitCriteria()


@checked
@dataclass(frozen=True)
class Fitted:
    """One coefficient.

    Attributes
    ----------
    name : str
    value, std : float
        Estimate and standard error; the latter is infinite if the log has no information. It covers the
        other `readings`: the square root of `noise_std` squared plus the largest difference squared.
    unit : str
    start : float
        Value before the fit.
    bound : str
        ``"lower"`` or ``"upper"`` if the estimate is at that bound, else empty. The standard error at a
        bound is that without the bound: it shows how far inside the true value may be.
    reason : str
        Why the log does not excite the coefficient; empty if it does.
    noise_std : float
        Standard error due to noise, valid if the model is complete. 0: not known separately from `std`.
    readings : tuple of Reading
        Estimates that differ by more than `noise_std`: with a missing effect, or over a longer time.
    kept : str
        Why the fit kept the value: ``"by you"``; empty if it estimated it.

    Examples
    --------
    >>> drag = Fitted("surge_linear_drag", value=0.41, std=0.02, unit="1/s", start=0.3)
    >>> drag.excited
    True
    """

    name: str
    value: float
    std: float
    unit: str
    start: float
    bound: str = ""
    reason: str = ""
    noise_std: float = 0.0
    readings: tuple[Reading, ...] = ()
    kept: str = ""

    __repr__ = short_repr

    @property
    def excited(self) -> bool:
        """Whether the log excites the coefficient."""
        return not self.reason

    @property
    def trusted(self) -> bool:
        """Whether no reading differs by more than three standard errors of the difference."""
        return all(
            abs(r.value - self.value) <= MISFIT.apart * math.hypot(self.noise_std, r.std)
            for r in self.readings
        )


@checked
@dataclass(frozen=True)
class Remaining:
    """The unexplained part of one equation: its process noise, averaged over some time.

    Attributes
    ----------
    equation : str
        ``"u'"``
    rms, seen : float
        Root mean square of the missing acceleration, and of the observed acceleration minus the part that
        needs no force (rotation of the body); both are means over the time `over`.
    over : float
        Averaging time [s].
    unit : str
        Unit of `rms` and `seen`.

    Examples
    --------
    >>> Remaining("u'", rms=0.02, seen=0.5, over=0.5, unit="m/s^2").share
    0.04
    """

    equation: str
    rms: float
    seen: float
    over: float
    unit: str

    __repr__ = short_repr

    @property
    def share(self) -> float:
        """Ratio of the missing to the observed acceleration."""
        return self.rms / self.seen if self.seen > 0 else 0.0

    @property
    def state(self) -> str:
        """The state of the equation."""
        return self.equation.removesuffix("'")


@checked
@dataclass(frozen=True, eq=False)
class Identified:
    """The result of :func:`~hovercontrol.identification.identify.fit.identify`.

    Attributes
    ----------
    model : Model or BlockModel
        The model with the new coefficients; for a Block the corresponding BlockModel.
    block : Block
        The plant of the model; for a Block without effects, that Block with the new values.
    coefficients : tuple of Fitted
    covariance : ndarray, shape (P, P)
        Covariance of the coefficients if the model is complete: the square roots of its diagonal are their
        ``noise_std``.
    unexcited : tuple of mapping
        Directions without excitation: steps of coefficients that together do not change any measured channel.
        Along them the initial values are kept.
    remaining : tuple of Remaining
        The unexplained part of each equation on which forces act.
    ahead : mapping
        For each channel, the prediction error over the averaging time of the accelerations
        (``remaining[0].over``), divided by that of constant velocities.
    units : mapping
        Unit of each channel.
    residual, noise : mapping
        Measurement noise of each channel: as fitted together with the process noise, and as estimated from
        third differences.
    chi2_per_dof : float
        Mean square of `residual` over `noise`. It tests only the measurement noise, and is about 1 even if
        process noise compensates an incomplete model; :attr:`remaining` gives the size of that noise.
    rows, rows_total : int
        Rows with a measurement that was used, and rows of the logs.
    outliers, rejected : int
        Rows with a sample left out as an isolated outlier, and rows left out as implausible motion.
    down_weighted : int
        Rows with an isolated sample of reduced weight, not far enough off to be left out.
    logs : tuple of str
        Their names.
    converged : bool
    fit : Fit
        Path, noise levels and information of the fit.
    missing : tuple of Effect
        Effects of the catalogue that increase the likelihood of the logs, the best first, as fitted.
    gain : float
        Reduction of twice the negative log likelihood by the best model with missing effects.
    groups : tuple of Fitted
        Products and sums of coefficients that the logs determine though they determine no member alone.
    kept : tuple of Fitted
        Coefficients that the fit did not estimate, each with the reason.
    functions : tuple of FittedFunction
        The unknown functions of the model (:func:`hovercontrol.unknown`), as tables.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> import numpy as np
    >>> from hovercontrol.identification.identify import identify
    >>> from hovercontrol.logs import Log
    >>> v, k = hc.Signal("v", "m/s"), hc.Signal("k", "1/s", start=1.0)
    >>> decay = Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol})
    >>> t = np.linspace(0, 2, 101)
    >>> found = identify(decay, [Log("demo", t, {"v": np.exp(-0.7 * t)})])
    >>> found.converged, found.rows, found.covariance.shape
    (True, 101, (1, 1))
    """

    model: Model | BlockModel
    block: Block
    coefficients: tuple[Fitted, ...]
    covariance: NDArray[np.float64]
    unexcited: tuple[Mapping[str, float], ...]
    remaining: tuple[Remaining, ...]
    ahead: Mapping[str, float]
    units: Mapping[str, str]
    residual: Mapping[str, float]
    noise: Mapping[str, float]
    chi2_per_dof: float
    rows: int
    rows_total: int
    outliers: int
    rejected: int
    down_weighted: int
    logs: tuple[str, ...]
    converged: bool
    fit: Fit
    missing: tuple[Effect, ...] = ()
    gain: float = 0.0
    groups: tuple[Fitted, ...] = ()
    kept: tuple[Fitted, ...] = ()
    functions: tuple[FittedFunction, ...] = ()

    def __getitem__(self, name: str) -> Fitted:
        every = {row.name: row for row in (*self.groups, *self.kept, *self.coefficients)}
        check_known(name, every, f"no coefficient {name!r} was identified")
        return every[name]

    @property
    def misfit(self) -> str:
        """Message on a fit that leaves much unexplained; empty if it does not."""
        poor = [r for r in self.remaining if r.share > MISFIT.little]
        if not poor:
            return ""
        over = f"{poor[0].over:.2g} s"
        sizes = ", ".join(f"{r.rms:.2g} of {r.seen:.2g} {r.unit} in {r.equation}" for r in poor)
        remains = f"unexplained acceleration (means over {over}): {sizes}"
        blind = [r for r in poor if r.share > MISFIT.nothing and self._ahead(r) > MISFIT.better]
        if len(blind) == len(self.remaining):
            said = f"this model does not predict the motion: {remains}"
            said += f"; {over} ahead no better than assuming constant velocity"
        else:
            said = f"the model does not explain the logs: {remains}"
            said += f"; it does not predict {', '.join(r.state for r in blind)}" if blind else ""
        return f"{said}; something is missing or wrong in the model or the logs"

    @property
    def not_converged(self) -> str:
        """Message on a fit that did not converge; empty if it did."""
        said = "not converged: the logs determine these coefficients to no better than their standard errors"
        return "" if self.converged else said

    @property
    def bent(self) -> str:
        """Message on coefficients that other readings contradict; empty if there are none."""
        doubtful = [f.name for f in self.coefficients if not f.trusted]
        if not doubtful:
            return ""
        causes = dict.fromkeys(r.cause for f in self.coefficients for r in f.readings)
        said = f"not to be trusted: {', '.join(doubtful)}; they differ {', or '.join(causes)}"
        sizes = [f"{e.name} ({_numbers(e)})" for e in self.missing]
        more = f"; the model may lack {' or '.join(sizes)}" if sizes else ""
        return said + more

    def _ahead(self, remaining: Remaining) -> float:
        """Return the relative prediction error of an equation's state; if unmeasured, of the best channel."""
        best = min(self.ahead.values(), default=1.0)
        return self.ahead.get(remaining.state, best)

    def forces(self) -> tuple[Fitted, ...]:
        """Return the fitted coefficients in newtons, for the model's mass and inertia; none without them."""
        scales = self.model.force_scales()
        return tuple(
            replace(f, value=size * f.value, std=size * f.std, start=size * f.start, unit=unit)
            for f in self.coefficients
            for size, unit in [scales.get(f.name, (0.0, ""))]
            if unit
        )

    def bodies(self) -> tuple[Fitted, ...]:
        """Return mass and inertia as the logs determine them: where a command is itself the force.

        There the coefficient is 1/m or 1/J, and m = 1/c has the standard error of c over c^2.
        """
        found = []
        for f in self.forces():
            c = self[f.name]
            if f.unit == "1" and c.excited and c.value > 0 and math.isfinite(c.std):
                part = carried_by(self.model.effect_class(f.name))
                size, _ = self.model.force_scales()[f.name]
                found.append(Fitted(part, 1 / c.value, c.std / c.value**2, BODY[part][0], size))
        return tuple(found)

    def _in_newtons(self) -> list[str]:
        """Return the lines of the table on forces."""
        rows = [(f.name, f"{f.value:.4g}", f"{f.std:.2g}", f.unit) for f in self.forces()]
        if not rows or not isinstance(self.model, Model):
            return []
        given = " and ".join(f"{p} {v:g} {BODY[p][0]}" for p, v in self.model.body.items() if v is not None)
        seen = [f"{b.name} {b.value:.4g} ± {b.std:.2g} {b.unit}" for b in self.bodies()]
        said = "a log alone determines forces up to a common factor: twice the mass, twice the forces"
        if seen:
            said = f"if the commands are exact forces, the logs determine {' and '.join(seen)}"
        return ["", *aligned([(f"with {given} as given", "value", "std", "unit"), *rows]), said]

    def rows_of_table(self) -> list[tuple[str, str, str, str, str]]:
        """Return name, value, standard error, unit and remark of each coefficient and group, as text."""
        table = []
        for f in self.coefficients:
            remarks = [f"at its {f.bound} bound"] if f.bound else []
            remarks += [f"not excited: {f.reason}"] if f.reason else []
            remarks += [str(reading) for reading in f.readings]
            std = f"{f.std:.2g}" if np.isfinite(f.std) else "inf"
            table.append((f.name, f"{f.value:.4g}", std, f.unit, "; ".join(remarks)))
        table += [(g.name, f"{g.value:.4g}", f"{g.std:.2g}", g.unit, "") for g in self.groups]
        table += [(f.name, f"{f.value:.4g}", "kept", f.unit, f.kept) for f in self.kept]
        return table

    def table(self) -> str:
        """Return the result as text: coefficients, channels, unexplained accelerations, rows used."""
        lines = aligned([("coefficient", "value", "std", "unit", ""), *self.rows_of_table()])
        channels = [(c, f"{self.residual[c]:.3g}", f"{self.noise[c]:.3g}", u) for c, u in self.units.items()]
        equations = [
            (r.equation, f"{r.rms:.3g}", f"{r.seen:.3g}", r.unit, percent(r.share)) for r in self.remaining
        ]
        for function in self.functions:
            lines += ["", *function.lines()]
        lines += self._in_newtons()
        lines += ["", *aligned([("channel", "residual", "noise", "unit"), *channels])]
        if equations:
            lines += ["", *aligned([("equation", "remains", "seen", "unit", "share"), *equations])]
        left = [f"{self.outliers} with an outlier"] if self.outliers else []
        left += [f"{self.rejected} with implausible motion"] if self.rejected else []
        used = f"{self.rows} of {self.rows_total} rows of {', '.join(self.logs)}"
        used += f"; left out: {', '.join(left)}" if left else ""
        used += f"; down-weighted: {self.down_weighted} with a doubtful sample" if self.down_weighted else ""
        lines += ["", f"{used}; chi2/dof {self.chi2_per_dof:.3g} of the measurement noise alone"]
        if self.misfit:
            lines.append(self.misfit)
        lines += [said for said in (self.bent, self.not_converged) if said]
        return "\n".join(lines)

    def __repr__(self) -> str:
        return self.table()

    def _repr_html_(self) -> str:
        from hovercontrol.identification.identify.display import identified_html

        return identified_html(self)

    @checked
    def residuals(self, lags: int = 25) -> Residuals:
        """Return whether the errors of predictions from row to row are noise: their correlations, to plot.

        Parameters
        ----------
        lags : int, optional
            Rows.
        """
        from hovercontrol.identification.identify.residuals import residuals_of

        return residuals_of(self.fit, at_least("residuals: lags", lags, 1))

    def plot(self) -> Figure:
        """Return a figure of the coefficients and their errors, with their values before the fit."""
        from hovercontrol.identification.identify.display import identified_figure

        return open_in_pyplot(identified_figure(self))

    def save_csv(self, path: str | Path) -> Path:
        """Write the coefficients, one row each, with all digits.

        Parameters
        ----------
        path : path
            Path of the CSV file.
        """

        def write(temporary: Path) -> None:
            with temporary.open("w", newline="", encoding="utf-8") as stream:
                rows = [_row(f) for f in (*self.coefficients, *self.groups, *self.kept)]
                out = csv.DictWriter(stream, list(rows[0]))
                out.writeheader()
                out.writerows(rows)

        return write_atomically(path, write)


def groups_for_json(groups: Sequence[Fitted], kept: Sequence[Fitted]) -> dict[str, list[dict[str, object]]]:
    """Return groups and kept coefficients for JSON."""
    return {
        "groups": [{"name": g.name, "value": g.value, "std": g.std, "unit": g.unit} for g in groups],
        "kept": [{"name": c.name, "value": c.value, "unit": c.unit, "reason": c.kept} for c in kept],
    }


def _row(f: Fitted) -> dict[str, object]:
    readings = "; ".join(str(reading) for reading in f.readings)
    return {**asdict(f), "readings": readings, "excited": f.excited, "trusted": f.trusted}


def _numbers(e: Effect) -> str:
    """Return an effect's parameters as text, with units."""
    numbers = type(e).numbers
    return ", ".join(f"{k} = {v:.3g} {numbers[k].unit}".rstrip(" 1") for k, v in e.values.items())
