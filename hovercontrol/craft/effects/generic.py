"""Generic effects, made for the equations, inputs and outputs of any Block.

An equation is amended only where it holds a parameter or an input: pure kinematics (``q' = v``) is exact.
Classes made here carry the names of signals (``rate_coulomb``, ``current_lag``) and are not registered, for
two Blocks may use one name for different things. The same signals make the same class.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache
from types import MappingProxyType

import sympy as sp

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import time
from hovercontrol.craft.effects.base import Effect
from hovercontrol.craft.effects.command import InputDelay
from hovercontrol.craft.effects.generic_classes import word
from hovercontrol.craft.effects.generic_commands import (
    asymmetry,
    backlash,
    command_offset,
    deadzone,
    hysteresis,
    lag,
    saturation,
    second_order_lag,
)
from hovercontrol.craft.effects.generic_forces import (
    asymmetric_drag,
    drag,
    load_friction,
    lugre,
    offset,
    spring,
)
from hovercontrol.craft.effects.generic_measurements import bias, scale
from hovercontrol.craft.effects.measurement import TimeOffset

#: What acts at each input.
INPUTS = (
    deadzone, backlash, hysteresis, lag, second_order_lag, saturation, asymmetry,
)  # fmt: skip


@lru_cache(maxsize=256)
def generic_effects(block: Block) -> Mapping[str, type[Effect]]:
    """Return the effects that could be added to a Block, by name.

    Parameters
    ----------
    block : Block
        Continuous.

    Returns
    -------
    mapping of str to type of Effect
        For each equation that holds a parameter or an input: an offset, linear, quadratic, asymmetric and dry
        (Coulomb, Stribeck, load-dependent, LuGre) friction, cubic drag (tried only in place of others), and a
        spring where the Block has the integral of the state among its states; for each input an offset, a
        dead zone, play, hysteresis, lags of first and second order, saturation and a gain for each sign, for
        all together a delay; for each output a bias and a scale, for all together a late clock.

    Examples
    --------
    >>> from hovercontrol.blocks.signals import Signal
    >>> v, k = Signal("v", "m/s"), Signal("k", "1/s", start=1.0)
    >>> cart = Block("cart", [v], [], [v], [k], {"v": -k.symbol * v.symbol})
    >>> list(generic_effects(cart))[:3]
    ['v_offset', 'v_linear_drag', 'v_quadratic_drag']
    """
    found = [*_of_equations(block), *_of_inputs(block), *_of_outputs(block)]
    return MappingProxyType({cls.name: cls for cls in found})


def _of_equations(block: Block) -> Iterator[type[Effect]]:
    causes = {s.symbol for s in (*block.inputs, *block.parameters)}
    every = {s.name: block.expand(block.derivatives[s.name]) for s in block.states}
    at_rest = {s.symbol: sp.S.Zero for s in block.inputs}
    for state in block.states:
        e = every[state.name]
        if state.modes or not e.free_symbols & causes:
            continue
        about = (state.name, state.unit)
        yield offset(*about)
        for law in ("linear_drag", "quadratic_drag", "coulomb", "stribeck", "cubic_drag"):
            yield drag(law, *about, state.nominal)
        yield asymmetric_drag(*about)
        drive = e - e.subs(at_rest)
        if drive != 0 and drive.is_finite is not False and not drive.has(sp.nan):
            yield load_friction(*about, state.nominal, drive)
        yield lugre(*about, state.nominal)
        for place, slope in every.items():
            if slope == state.symbol:
                yield spring(*about, place)


def _of_inputs(block: Block) -> Iterator[type[Effect]]:
    for signal in block.inputs:
        if signal.modes:
            continue
        yield command_offset(signal.name, signal.unit, _same_offset(block, signal.symbol))
        for make in INPUTS:
            yield make(signal.name, signal.unit)
    if block.inputs:
        yield InputDelay


def _same_offset(block: Block, symbol: sp.Symbol) -> str:
    """Return the offset of an equation that acts as one of an input does; empty if a log tells them apart.

    An offset d of the input u adds (df/du) d to f. It is a constant where df/du depends on parameters alone,
    and stands in one equation only if no other equation and no output contains u.
    """
    slopes = {s.name: sp.diff(block.expand(block.derivatives[s.name]), symbol) for s in block.states}
    acting = [name for name, slope in slopes.items() if slope != 0]
    shown = any(symbol in block.expand(e).free_symbols for e in block.output_expressions.values())
    changing = {s.symbol for s in (*block.states, *block.inputs)} | {time}
    if len(acting) != 1 or shown or slopes[acting[0]].free_symbols & changing:
        return ""
    return f"{word(acting[0])}_offset"


def _of_outputs(block: Block) -> Iterator[type[Effect]]:
    for signal in block.outputs:
        if not signal.modes:
            yield bias(signal.name, signal.unit)
            yield scale(signal.name)
    if block.outputs and block.inputs:
        yield TimeOffset
