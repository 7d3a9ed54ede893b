"""Where effects act: ranges of a signal."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

import sympy as sp

from hovercontrol.craft.effects import Effect
from hovercontrol.craft.effects.law import OPERATIONS, WINDOWS, Factor, Law, TableLaw
from hovercontrol.identification.engine.subject import Subject

#: A range of a signal: its name, and the limits, None without one.
Range: TypeAlias = dict[str, float | str | None]

#: A table or a bell acts where it exceeds this part of its largest value.
FLOOR = 0.1


def region_of(e: Effect) -> list[Range]:
    """Return where an effect acts: ranges of a signal, in any of which it does; empty if everywhere.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> craft = hc.vehicle("c17_experiment")
    >>> region_of(craft.effect_class("law_r__over_r")(-1.2, at=1.5))
    [{'signal': 'r', 'low': 1.5, 'high': None}]
    >>> [(one["low"], one["high"]) for one in region_of(craft.effect_class("law_r__beyond_r")(-1.2, at=1.5))]
    [(None, -1.5), (1.5, None)]
    """
    own = e.curve() if isinstance(e, Law) else None
    if own is None:
        return []
    if own.operation in WINDOWS:
        return window_ranges(own, own.operation, [e.values[n] for n in OPERATIONS[own.operation].numbers])
    if isinstance(e, TableLaw):
        _, at, values = e.table()
        large = [abs(v) > FLOOR * max(map(abs, values)) for v in values]
        if not any(large):
            return []
        first, last = large.index(True), len(large) - 1 - large[::-1].index(True)
        low = None if first == 0 else at[first - 1]
        return ranges(own, low, None if last == len(large) - 1 else at[last + 1])
    if own.operation == "bell":
        half = e.values["wide"] * math.sqrt(-math.log(FLOOR))
        return ranges(own, e.values["at"] - half, e.values["at"] + half)
    if own.operation in ("over", "beyond", "logistic"):
        return ranges(own, e.values["at"], None)
    return ranges(own, None, e.values["at"]) if own.operation == "under" else []


def window_ranges(of: Factor, kind: str, ends: Sequence[float]) -> list[Range]:
    """Return the ranges of a window: its limits are in the middle of where it changes."""
    first, last = 0.5 * (ends[0] + ends[1]), 0.5 * (ends[-2] + ends[-1])
    return ranges(of, None if kind == "below" else first, None if kind == "above" else last)


def ranges(of: Factor, low: float | None, high: float | None) -> list[Range]:
    """Return the ranges of a signal in which it, or its size, lies between two limits; None for no limit."""
    ahead: Range = {"signal": of.signal, "low": low, "high": high}
    if not of.of_abs and of.operation != "beyond":
        return [ahead]
    if not low:
        return [ahead | {"low": None if high is None else -high}]
    return [ahead | {"low": None if high is None else -high, "high": -low}, ahead]


def acting_side(given: Subject, amended: Subject, e: Effect) -> list[Range]:
    """Return the sign of a signal for which an effect makes a coefficient of the given model differ most.

    A drag ``d a`` and an effect ``k abs(a)`` are a drag d + k ahead and d - k astern. The given model has one
    drag for both; the effect acts on the side whose drag is farther from it. Empty for any other effect.

    Parameters
    ----------
    given, amended : Model or BlockModel
    e : Effect
        Of the amended model.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> craft = hc.vehicle("c17_simulation")
    >>> law = craft.effect_class("law_u__abs_u")(0.1)
    >>> drag = craft.coefficients()["surge_linear_drag"]
    >>> other = craft.with_coefficients({"surge_linear_drag": drag + 0.1})
    >>> acting_side(craft, other.with_effects([law]), law)
    [{'signal': 'u', 'low': None, 'high': 0.0}]
    """
    if e.place() != "force":
        return []
    block, before = amended.plant(), given.plant()
    own = {block.parameter(e.parameter(k)).symbol for k in e.numbers}
    values = {s.symbol: v for s, v in zip(block.parameters, block.parameter_values(), strict=True)}
    known = {s.symbol: v for s, v in zip(before.parameters, before.parameter_values(), strict=True)}
    found: list[Range] = []
    for state in amended.motion:
        terms = sp.Add.make_args(block.expand(block.derivatives[state]).expand())
        mine = sp.Add(*(term for term in terms if term.free_symbols & own))
        for s in (*block.states, *block.inputs):
            k, a = mine.coeff(sp.Abs(s.symbol)), s.symbol
            drags = [term / a for term in terms if (term / a).free_symbols <= set(known)]
            alone = k.free_symbols <= set(values) and mine == (k * sp.Abs(a)).expand()
            if not k or not alone or not drags:
                continue
            drag = sp.Add(*drags)
            moved = float(drag.xreplace(values)) - float(drag.xreplace(known))
            both = float(k.xreplace(values))
            is_ahead = abs(moved + both) > abs(moved - both)
            found += ranges(Factor("", s.name), 0.0 if is_ahead else None, None if is_ahead else 0.0)
    return found
