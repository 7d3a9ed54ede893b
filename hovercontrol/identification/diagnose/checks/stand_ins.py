"""Check for named effects that may stand for another: they make the model's own effect vanish."""

from __future__ import annotations

from collections.abc import Sequence

from hovercontrol.identification.engine.subject import Subject

#: A coefficient below this fraction of its given value counts as switched off.
OFF = 1e-3


def switched_off(given: Subject, amended: Subject, named: Sequence[str]) -> list[str]:
    """Return a warning for each effect of a model that vanishes once others along its axis are added.

    Parameters
    ----------
    given, amended : Model or BlockModel
        The model before and after.
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
