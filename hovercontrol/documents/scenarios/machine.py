"""A run of a user's Block, driven by steps of its inputs or by the inputs of a log."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hovercontrol.base.boundary import checked
from hovercontrol.base.folders import write_folder
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.base.short_repr import short_repr
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.documents.scenarios.drive import STEP, played, run_length
from hovercontrol.documents.scenarios.phases import held, phase_grid
from hovercontrol.logs import Log

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@checked
@dataclass(frozen=True, eq=False)
class MachineRun:
    """Result of a machine's run.

    Attributes
    ----------
    log : Log
        Log of outputs and inputs, readable by ``check`` and ``diagnose``.
    units : mapping of str to str
        Of its columns.
    """

    log: Log
    units: Mapping[str, str]

    __repr__ = short_repr

    def plot(self) -> Figure:
        """Return a figure of outputs and inputs over time."""
        from hovercontrol.logs.display import log_figure

        return open_in_pyplot(log_figure(self.log, self.units))

    def save(self, folder: str | Path) -> list[Path]:
        """Write ``log.csv`` and ``signals.png``, atomically.

        Parameters
        ----------
        folder : path
            Created if missing.
        """
        from hovercontrol.logs.display import log_figure

        def write(temporary: Path) -> None:
            self.log.save(temporary / "log.csv")
            log_figure(self.log, self.units).savefig(temporary / "signals.png", dpi=130)

        return write_folder(folder, write)


@checked
def run_machine(
    block: Block,
    *,
    seconds: float | None = None,
    commands: Log | None = None,
    progress: Callable[[float], None] | None = None,
) -> MachineRun:
    """Drive a Block from its start values, by the inputs of a log or by steps.

    Parameters
    ----------
    seconds : float, optional
        Length [s]; default: 20, or the length of the log.
    commands : Log, optional
        Log with the Block's inputs, held from row to row. Default: random steps, as for a model file.
    progress : callable, optional
        Called from time to time with the simulated time [s].

    Raises
    ------
    InputError
        If the length is too small, the log lacks an input or is shorter, or the simulation fails.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> v, a = hc.Signal("v", "m/s"), hc.Signal("a", "m/s^2", lower=-1.0, upper=1.0)
    >>> run = run_machine(hc.Block("cart", [v], [a], [v], derivatives={"v": a.symbol}), seconds=3.0)
    >>> list(run.log.columns), len(run.log), run.units["v"]
    (['v', 'a'], 151, 'm/s')
    """
    length = run_length(seconds, commands)
    time = phase_grid(0.0, length, STEP)
    inputs = held(played(block.inputs, length, commands), time)
    run = simulate(block, time, inputs, progress=progress)
    seen = dict(zip(run.output_labels, np.reshape(run.outputs, (-1, time.size)), strict=True))
    units = {s.name: s.unit for s in (*block.outputs, *block.inputs)}
    return MachineRun(Log(block.name, time, {**seen, **inputs}), units)
