"""A proposed experiment."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.files import write_atomically
from hovercontrol.base.short_repr import short_repr


@dataclass(frozen=True, eq=False)
class Experiment:
    """A proposed experiment.

    Attributes
    ----------
    name : str
        Name of the manoeuvre: ``"spin"``.
    text : str
        The manoeuvre and its benefit in one sentence.
    time : ndarray, shape (n,)
        [s].
    commands : dict of str to ndarray, shape (n,)
        Values of the plant's inputs, each held until the next row.
    benefit : float
        Expected difference of twice the log likelihood between the rivals; or the factor by which the
        standard error of a poorly known coefficient is reduced.
    sure : float
        Probability that the logs then tell the right rival; NaN where there are no rivals.
    """

    name: str
    text: str
    time: Array
    commands: Mapping[str, Array]
    benefit: float
    sure: float = math.nan

    __repr__ = short_repr

    def save(self, path: str | Path) -> Path:
        """Write the commands to a CSV file with the columns of a log."""
        rows = np.column_stack([self.time, *self.commands.values()])
        head = ",".join(["time", *self.commands])
        return write_atomically(
            Path(path), lambda p: np.savetxt(p, rows, delimiter=",", fmt="%.6g", header=head, comments="")
        )
