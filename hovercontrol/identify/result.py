"""What an identification found: to print, save, and simulate on."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hovercontrol.block import Block
from hovercontrol.errors import InputError, did_you_mean
from hovercontrol.files import write_whole
from hovercontrol.model import Model

#: Above this chi2/dof a model does not explain the logs.
POOR = 2.0


@dataclass(frozen=True)
class Fitted:
    """One coefficient.

    Attributes
    ----------
    name : str
    value, std : float
        Estimate and standard error; infinite where the log says nothing.
    unit : str
    start : float
        Value before.
    bound : str
        ``"lower"`` or ``"upper"`` where the estimate sits at that bound, else empty. Its standard
        error is then that without the bound: how far inside the truth may well lie.
    reason : str
        Why the log does not excite it; empty if it does.
    """

    name: str
    value: float
    std: float
    unit: str
    start: float
    bound: str = ""
    reason: str = ""

    @property
    def excited(self) -> bool:
        """Whether the log tells its value."""
        return not self.reason


@dataclass(frozen=True, eq=False)
class Identified:
    """The result of :func:`~hovercontrol.identify.fit.identify`.

    Attributes
    ----------
    model : Model or None
        The model with the new coefficients; None if a Block was identified.
    block : Block
        The plant, or the Block given, with the new values.
    coefficients : tuple of Fitted
    covariance : ndarray, shape (P, P)
        Of the coefficients; the roots of its diagonal are the standard errors.
    unexcited : tuple of mapping
        Directions without excitation: steps of coefficients that together change nothing measured.
        Along them the start values are kept.
    units : mapping
        Of each channel.
    residual, noise : mapping
        Standard deviation of each channel's residuals over the windows, and its measurement noise.
    chi2_per_dof : float
        Squared residuals in units of the measurement noise, per degree of freedom: 1 for a model
        that lacks nothing, more for one that does.
    windows, rows, rows_total : int
        Windows used, rows with a measurement in them, rows of the logs.
    logs : tuple of str
        Their names.
    iterations : int
    converged : bool
    """

    model: Model | None
    block: Block
    coefficients: tuple[Fitted, ...]
    covariance: NDArray[np.float64]
    unexcited: tuple[Mapping[str, float], ...]
    units: Mapping[str, str]
    residual: Mapping[str, float]
    noise: Mapping[str, float]
    chi2_per_dof: float
    windows: int
    rows: int
    rows_total: int
    logs: tuple[str, ...]
    iterations: int
    converged: bool

    def __getitem__(self, name: str) -> Fitted:
        for found in self.coefficients:
            if found.name == name:
                return found
        hint = did_you_mean(name, [f.name for f in self.coefficients])
        raise InputError(f"no coefficient {name!r} was identified{hint}")

    @property
    def misfit(self) -> str:
        """What to make of a fit that residuals say is bad; empty if it is good."""
        if self.chi2_per_dof <= POOR:
            return ""
        return (
            f"the model does not explain the logs: residuals are {np.sqrt(self.chi2_per_dof):.3g} times the "
            f"noise (chi2/dof {self.chi2_per_dof:.3g}); something is missing or wrong in the model or the log"
        )

    def rows_of_table(self) -> list[tuple[str, str, str, str, str]]:
        """Return name, value, standard error, unit and remark of each coefficient, as text."""
        table = []
        for f in self.coefficients:
            remarks = [f"at its {f.bound} bound"] if f.bound else []
            remarks += [f"not excited: {f.reason}"] if f.reason else []
            std = f"{f.std:.2g}" if np.isfinite(f.std) else "inf"
            table.append((f.name, f"{f.value:.4g}", std, f.unit, "; ".join(remarks)))
        return table

    def table(self) -> str:
        """Return the result as plain text: coefficients, then channels, then what was used."""
        lines = aligned([("coefficient", "value", "std", "unit", ""), *self.rows_of_table()])
        lines += [
            "",
            *aligned(
                [
                    ("channel", "residual", "noise", "unit"),
                    *(
                        (c, f"{self.residual[c]:.3g}", f"{self.noise[c]:.3g}", unit)
                        for c, unit in self.units.items()
                    ),
                ]
            ),
        ]
        used = f"{self.rows} of {self.rows_total} rows in {self.windows} windows"
        lines += ["", f"chi2/dof {self.chi2_per_dof:.3g}; {used} of {', '.join(self.logs)}"]
        if self.misfit:
            lines.append(self.misfit)
        if not self.converged:
            lines.append(f"not converged after {self.iterations} iterations")
        return "\n".join(lines)

    def save_csv(self, path: str | Path) -> Path:
        """Write the coefficients, one row each, all numbers in full."""

        def write(temporary: Path) -> None:
            with temporary.open("w", newline="", encoding="utf-8") as stream:
                out = csv.DictWriter(stream, [*asdict(self.coefficients[0]), "excited"])
                out.writeheader()
                out.writerows({**asdict(f), "excited": f.excited} for f in self.coefficients)

        return write_whole(path, write)


def aligned(rows: Sequence[tuple[str, ...]]) -> list[str]:
    """Return rows of cells as lines whose columns stand one below the other."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows]
