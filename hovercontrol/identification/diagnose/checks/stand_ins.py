"""Checks for named effects that may stand for another, or mean something else than their name says."""

from __future__ import annotations

from collections.abc import Sequence

from hovercontrol.craft.effects.generic_classes import word
from hovercontrol.identification.engine.subject import Subject, structure

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


def origins(given: Subject, named: Sequence[str]) -> list[str]:
    """Return a warning for each bias of a position on which no equation of the given model depends.

    That model is the same wherever the position is counted from, so it cannot show such a bias. Beside
    another effect the bias says from where that effect counts the position, ``sin(psi - a)``, and nothing of
    the sensor.

    Parameters
    ----------
    given : Model or BlockModel
    named : sequence of str
        The new effects.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> x, v, F = (hc.Signal(name, unit) for name, unit in (("x", "m"), ("v", "m/s"), ("F", "m/s^2")))
    >>> cart = hc.Block("cart", [x, v], [F], [x, v], [], {"x": v.symbol, "v": F.symbol})
    >>> origins(hc.BlockModel(cart), ["v_spring", "x_bias"])
    ['x_bias says from where v_spring counts x, nothing of the sensor: no equation of the model depends on x']
    """
    block = structure(given)
    used = {s for e in block.derivatives.values() for s in block.expand(e).free_symbols}
    free = {s.symbol for s in block.states} - used
    shown = {f"{word(o.name)}_bias": block.expand(block.output_expressions[o.name]) for o in block.outputs}
    said = []
    for name in named:
        others = " and ".join(n for n in named if n != name)
        if shown.get(name) in free and others:
            said.append(
                f"{name} says from where {others} counts {shown[name]}, nothing of the sensor: no equation "
                f"of the model depends on {shown[name]}"
            )
    return said
