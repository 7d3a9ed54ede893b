"""How all logs of a command, or of a fleet, are read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.plant_model import PlantModel
from hovercontrol.logs.bench import BenchTable
from hovercontrol.logs.frames import in_z_up
from hovercontrol.logs.gather import Condition, gather
from hovercontrol.logs.log import Log


@dataclass(frozen=True)
class Reader:
    """A function of a log's path, with the options of :func:`.gather`; other processes can call it, too.

    Attributes
    ----------
    frame : str
        Axes of the logs, as for :func:`.frames.in_z_up`; empty: by the log itself.

    Examples
    --------
    >>> from hovercontrol.documents.samples import sample_path
    >>> len(Reader()(str(sample_path())))
    2001
    """

    model: PlantModel | Block | None = None
    columns: Mapping[str, str] = field(default_factory=dict)
    bench: BenchTable | None = None
    only_while: Condition | None = None
    settle: float = 0.0
    missing: tuple[float, ...] = ()
    trial: str = ""
    period: float | None = None
    frame: str = ""

    def __call__(self, files: str) -> Log:
        """Return the log of a path, or of ``POSE+COMMANDS``."""
        log = gather(
            files,
            model=self.model,
            columns=self.columns,
            bench=self.bench,
            only_while=self.only_while,
            settle=self.settle,
            missing=self.missing,
            trial=self.trial,
            period=self.period,
        )
        return in_z_up(log, self.frame) if self.frame else log

    def __str__(self) -> str:
        """Return all that says how a file is read, but the model: the same in every process."""
        said = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in ("model", "bench")}
        bench = self.bench and (self.bench.command.tolist(), self.bench.thrust.tolist(), self.bench.idle)
        return f"{said} {bench}"
