"""A name that only works because what the model had is switched off stands, perhaps, for something else."""

from __future__ import annotations

from collections.abc import Sequence

from hovercontrol.estimation.subject import Subject

#: Part of what a coefficient was, below which it is off.
OFF = 1e-3


def switched_off(given: Subject, amended: Subject, named: Sequence[str]) -> list[str]:
    """Return a warning for each effect of a model that falls to nothing beside new ones along its axis.

    Parameters
    ----------
    given, amended : Model or BlockModel
        Before and after.
    named : sequence of str
        The new effects.
    """
    after = {e.name: e for e in amended.effects}
    said = []
    for e in given.effects:
        beside = [n for n in named if e.axis and n in after and after[n].axis == e.axis]
        was, now = (m.values.get("value", 0.0) for m in (e, after.get(e.name, e)))
        if beside and was and abs(now) < OFF * abs(was):
            said.append(
                f"{e.name} falls from {was:.3g} to {now:.3g} beside {' and '.join(beside)}: they may stand "
                f"for another law of {e.axis}"
            )
    return said
