"""What a report is made of, computed once: simulations, the missing force, the scores of candidates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from hovercontrol.discrepancy.candidates import Scores, Signatures, candidates
from hovercontrol.discrepancy.compare import HORIZON, Comparison, compared
from hovercontrol.discrepancy.data import Data, gather
from hovercontrol.discrepancy.diagnosis import Diagnosis, Found
from hovercontrol.discrepancy.fit import fit
from hovercontrol.discrepancy.localize import Missing
from hovercontrol.discrepancy.noise import Noise
from hovercontrol.discrepancy.subject import Subject
from hovercontrol.discrepancy.traces import Trace, traces
from hovercontrol.logs import Log

#: How long simulations shown beside measurements run from one start [s].
SHOWN = 10.0


@dataclass(frozen=True, eq=False)
class Side:
    """A model beside the log on which it is shown."""

    comparison: Comparison
    trace: Trace


@dataclass(frozen=True, eq=False)
class Material:
    """What all sections of a report draw from.

    Attributes
    ----------
    diagnosis : Diagnosis
    held_out : bool
        Whether the log that is shown took no part.
    before, after : Side
    missing_after : tuple of Missing
    scores : Scores
        Of all effects that were considered, at the given model.
    over : float
        Length of the windows in which they were scored [s].
    warnings : tuple of str
    command : str
        That makes the report again; empty if it was made by a script.
    """

    diagnosis: Diagnosis
    held_out: bool
    before: Side
    after: Side
    missing_after: tuple[Missing, ...]
    scores: Scores
    over: float
    warnings: tuple[str, ...]
    command: str

    @property
    def changed(self) -> bool:
        """Whether there is an amended model to be shown beside the given one."""
        return self.diagnosis.verdict in ("effect", "ambiguous")

    @property
    def named(self) -> dict[str, list[Found]]:
        """The numbers of each effect that is named."""
        effects = self.diagnosis.effects
        return {e.effect: [n for n in effects if n.effect == e.effect] for e in effects}


def collect(
    diagnosis: Diagnosis,
    holdout: Log | None,
    names: Sequence[str] | None = None,
    warnings: Sequence[str] = (),
    command: str = "",
) -> Material:
    """Compute what a report shows.

    Parameters
    ----------
    diagnosis : Diagnosis
    holdout : Log or None
        As given to the diagnosis; without it the first training log is shown.
    names : sequence of str, optional
        Effects that were considered; default: all.
    warnings : sequence of str, optional
        About the logs.
    command : str, optional
    """
    d, selection = diagnosis, diagnosis.selection
    training = selection.final.windowed.data
    if holdout is not None:
        shown = d.held or gather(d.refitted, [holdout])
    else:
        shown = replace(training, logs=training.logs[:1])
    noise = selection.final.noise if selection.final.noise.has_process else None
    noise = noise if shown.channels == training.channels else None
    changed = d.verdict in ("effect", "ambiguous")
    at = selection.final if d.verdict == "none" else selection.base
    tried = Signatures(at, candidates(at, names))
    before = _side(d.refitted, shown, noise)
    return Material(
        d,
        holdout is not None,
        before,
        _side(d.amended, shown, noise) if changed else before,
        d.missing_after() if changed else d.missing,
        Scores(at, tried),
        at.windowed.length,
        tuple(warnings),
        command,
    )


def _side(model: Subject, data: Data, noise: Noise | None) -> Side:
    near = fit(model, data, HORIZON, noise, frozen=True)
    return Side(compared(near), traces(near, SHOWN)[0])
