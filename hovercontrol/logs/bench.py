"""Thrust of a fan from a test bench: thrust [N] as a function of pulse width."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.base.short_repr import short_repr
from hovercontrol.logs.check import check_finite
from hovercontrol.logs.log import Floats, Log
from hovercontrol.logs.source import open_source

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STANDARD_GRAVITY = 9.80665
"""m/s^2, exact by definition (3rd CGPM, 1901); a gram-force is this many millinewton."""


@checked
@dataclass(frozen=True, eq=False)
class BenchTable:
    """Steady thrust of one fan as a function of its command.

    Attributes
    ----------
    name : str
        Name of the table in error messages.
    command : ndarray (n,)
        Commands of the bench rows (pulse width [us]), increasing and above ``idle``.
    thrust : ndarray (n,)
        Thrust of one fan [N], mean of the trials.
    idle : float
        Command at and below which the fan does not turn.

    Examples
    --------
    >>> table = BenchTable("demo", np.array([1100.0, 1200.0]), np.array([0.01, 0.03]), idle=1000.0)
    >>> table.force([900.0, 1000.0, 1200.0])
    array([0.  , 0.  , 0.03])
    """

    name: str
    command: Floats
    thrust: Floats
    idle: float

    __repr__ = short_repr

    def plot(self) -> Figure:
        """Return a figure of thrust over command."""
        from hovercontrol.logs.display import curve_figure

        labels = "command [us]", "thrust of one fan [N]"
        return open_in_pyplot(curve_figure(self.name, self.command, self.thrust, *labels))

    @classmethod
    def from_csv(cls, path: str | Path, *, fans: int = 2, idle: float = 1000.0) -> BenchTable:
        """Read a table: the command in the first column, then one column per trial in the unit gram-force.

        Parameters
        ----------
        path : str or Path
            CSV with header.
        fans : int
            Number of fans that pushed together on the bench; thrust is divided equally among them.
        idle : float
            Command at and below which a fan does not turn.

        Raises
        ------
        InputError
            If a cell is text or blank (the message names line and column), a command does not increase or is
            not above ``idle``, there are fewer than two rows or no trial, or a mean thrust is negative.
        """
        # Thrust of one fan [N] = 9.80665 m/s^2 * 1e-3 * (mean of the trials [gf]) / fans.
        file = Path(path)
        source = open_source(file)
        if len(source.header) < 2:
            raise InputError(f"{file}: expected a command column and at least one trial, found one column")
        rows = [
            np.column_stack([column.to_numpy(zero_copy_only=False) for column in batch.columns])
            for batch in source.batches(source.header)
        ]
        table = np.concatenate([np.empty((0, len(source.header))), *rows]).astype(float)
        if len(table) < 2:
            raise InputError(f"{file}: expected at least two bench rows, found {len(table)}")
        for name, column in zip(source.header, table.T, strict=True):
            check_finite(str(file), source, name, column)
        command, grams = table[:, 0], table[:, 1:].mean(axis=1)
        first = source.header[0]
        for row, low in enumerate([idle, *command[:-1]]):
            if command[row] <= low:
                where, text = source.place(row, first)
                raise InputError(
                    f"{file}: {where}, column {first!r}: expected more than {low:g}, found {text}"
                )
        if grams.min() < 0:
            where, _ = source.place(int(grams.argmin()), first)
            raise InputError(
                f"{file}: {where}: expected thrust of zero or more, found {grams.min():g} gram-force"
            )
        return cls(file.name, command, grams * 1e-3 * STANDARD_GRAVITY / fans, idle)

    def force(self, command: ArrayLike) -> Floats:
        """Return the thrust of one fan [N] at each command, same shape.

        Monotone cubic (PCHIP) interpolation with zero thrust at ``idle``. Above the table the last bench
        thrust is used.
        """
        curve = PchipInterpolator(
            np.concatenate([[self.idle], self.command]), np.concatenate([[0.0], self.thrust])
        )
        inside = np.clip(np.asarray(command, dtype=float), self.idle, self.command[-1])
        return np.asarray(curve(inside))

    def apply(self, log: Log, forces: Mapping[str, str]) -> Log:
        """Add the force [N] of each fan to a log.

        Parameters
        ----------
        log : Log
            With a command column for each fan.
        forces : mapping
            Command column to the name of the new force column, ``{"pwm_rear_left": "rear_left"}``.

        Warns
        -----
        UserWarning
            If commands are above the table; the message gives their number and the column.

        Raises
        ------
        InputError
            If a command column does not exist.
        """
        added = {}
        for source, target in forces.items():
            command = log[source]
            above = int(np.count_nonzero(command > self.command[-1]))
            if above:
                warnings.warn(
                    f"{log.name}: {above} of {command.size} values of {source!r} are above "
                    f"{self.command[-1]:g}, the end of {self.name}; its last thrust is used",
                    stacklevel=2,
                )
            added[target] = self.force(command)
        return log.with_columns(added)
