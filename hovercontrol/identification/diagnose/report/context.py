"""The data that all sections of a report use."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from hovercontrol.identification.diagnose.evidence.holdout import Ahead, ahead
from hovercontrol.identification.engine.fit import Fit

if TYPE_CHECKING:
    from hovercontrol.identification.diagnose.diagnosis import Diagnosis, Found


@dataclass(frozen=True, eq=False)
class Context:
    """A diagnosis, and the fits to the log on which its models are shown.

    Attributes
    ----------
    diagnosis : Diagnosis
    before, after : Fit
        Fits of the given and the amended model to that log; the same fit if nothing was added.
    held_out : bool
        Whether the log is the held-out one; else the training logs are used.
    ahead : tuple of Ahead
        Errors of both at several horizons.
    command : str
        Command that reproduces the report; empty if a script made it.
    """

    diagnosis: Diagnosis
    before: Fit
    after: Fit
    held_out: bool
    ahead: tuple[Ahead, ...]
    command: str = ""

    @property
    def changed(self) -> bool:
        """Whether an effect was added to the given model."""
        return bool(self.diagnosis.effects)

    @property
    def noise(self) -> dict[str, float]:
        """The measurement noise of each channel, in its unit."""
        levels = self.before.noise.measured.tolist()
        return dict(zip(self.before.problem.rows.channels, levels, strict=True))

    @property
    def shown_on(self) -> str:
        """The logs on which errors are shown, as text."""
        return held_out_words(self.diagnosis) if self.held_out else "training logs (none was held out)"


def held_out_words(d: Diagnosis) -> str:
    """Return "held-out log" or, for several, "held-out logs"."""
    several = d.held_before is not None and len(d.held_before.problem.logs) > 1
    return "held-out logs" if several else "held-out log"


def numbers_by_effect(d: Diagnosis) -> dict[str, list[Found]]:
    """Return the parameters of each named effect."""
    return {e.effect: [n for n in d.effects if n.effect == e.effect] for e in d.effects}


def collect(d: Diagnosis, command: str = "") -> Context:
    """Return the data of a report."""
    if d.held_before is not None and d.held_after is not None:
        return Context(d, d.held_before, d.held_after, True, d.ahead, command)
    base, final = d.selection.base, d.selection.final
    return Context(d, base, final, False, d.ahead or ahead(base, final).each, command)
