"""A proposed experiment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hovercontrol.io.files import write_atomically
from hovercontrol.io.short_repr import short_repr

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Experiment:
    """A proposal.

    Attributes
    ----------
    name : str
        Of the manoeuvre: ``"spin"``.
    text : str
        One sentence: what to drive, and why.
    time : ndarray, shape (n,)
        [s].
    commands : dict of str to ndarray, shape (n,)
        By the plant's inputs, each held until the next row.
    benefit : float
        Expected fall of minus twice the log likelihood between the rivals; or the factor by which the
        standard error of a badly known coefficient falls.
    """

    name: str
    text: str
    time: Array
    commands: Mapping[str, Array]
    benefit: float

    __repr__ = short_repr

    def save(self, path: str | Path) -> Path:
        """Write the commands to a CSV file with the columns of a log."""
        rows = np.column_stack([self.time, *self.commands.values()])
        head = ",".join(["time", *self.commands])
        return write_atomically(
            Path(path), lambda p: np.savetxt(p, rows, delimiter=",", fmt="%.6g", header=head, comments="")
        )
