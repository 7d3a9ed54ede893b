"""What all sections of a report draw from."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hovercontrol.discrepancy.diagnosis import Diagnosis, Found
from hovercontrol.discrepancy.evidence.holdout import Ahead, ahead
from hovercontrol.discrepancy.evidence.missing import Missing
from hovercontrol.estimation.fit import Fit

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Context:
    """A diagnosis, and the log on which its models are shown.

    Attributes
    ----------
    diagnosis : Diagnosis
    before, after : Fit
        The given and the amended model on that log; the same where nothing was added.
    held_out : bool
        Whether that is the held-out log, or the training logs.
    ahead : tuple of Ahead
        Errors of both at several horizons.
    command : str
        That makes the report again; empty if a script made it.
    """

    diagnosis: Diagnosis
    before: Fit
    after: Fit
    held_out: bool
    ahead: tuple[Ahead, ...]
    command: str = ""

    @property
    def changed(self) -> bool:
        """Whether there is an amended model beside the given one."""
        return bool(self.diagnosis.effects)

    @property
    def noise(self) -> dict[str, float]:
        """The noise of each channel's measurement, in its unit."""
        levels = self.before.noise.measured.tolist()
        return dict(zip(self.before.problem.rows.channels, levels, strict=True))

    @property
    def shown_on(self) -> str:
        """On which logs errors are shown, in words."""
        return "held-out log" if self.held_out else "training logs (none was held out)"


def numbers_by_effect(d: Diagnosis) -> dict[str, list[Found]]:
    """Return the numbers of each named effect."""
    return {e.effect: [n for n in d.effects if n.effect == e.effect] for e in d.effects}


def collect(d: Diagnosis, command: str = "") -> Context:
    """Return what a report shows."""
    if d.held_before is not None and d.held_after is not None:
        return Context(d, d.held_before, d.held_after, True, d.ahead, command)
    base, final = d.selection.base, d.selection.final
    return Context(d, base, final, False, d.ahead or ahead(base, final).each, command)


def averaged_forces(d: Diagnosis, forces: tuple[Missing, ...]) -> tuple[Missing, ...]:
    """Return missing forces averaged over the time over which remainders are told.

    The band of a mean is that of an error as correlated in time as the force itself.
    """
    by_equation = {r.equation: r for r in d.remainders}
    found = []
    for m in forces:
        r = by_equation[m.equation]
        s = r.over / max(r.seconds, 1e-9)
        narrower = float(np.sqrt(2.0 * (s + np.expm1(-s)))) / s
        force = running_mean(m.time, m.force, r.over)
        found.append(replace(m, force=force, band=m.band * narrower))
    return tuple(found)


def running_mean(time: Array, values: Array, over: float) -> Array:
    """Return the mean of rows about each row, over so many seconds; NaN where there is none."""
    known = np.isfinite(values)
    total = np.concatenate([[0.0], np.cumsum(np.where(known, values, 0.0))])
    count = np.concatenate([[0], np.cumsum(known)])
    first = np.searchsorted(time, time - 0.5 * over, side="left")
    stop = np.searchsorted(time, time + 0.5 * over, side="right")
    with np.errstate(all="ignore"):
        mean = (total[stop] - total[first]) / (count[stop] - count[first])
    return np.asarray(np.where(known, mean, np.nan))
