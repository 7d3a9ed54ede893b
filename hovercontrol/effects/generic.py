"""Effects that any machine may lack, made for the equations, inputs and outputs of a Block.

An equation is amended only where it holds a parameter or an input: pure kinematics (``q' = v``) is exact.
Classes made here carry the names of signals (``rate_coulomb``, ``current_lag``) and are not registered, for
two Blocks may use one name for different things. The same signals make the same class.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from functools import cache, lru_cache
from types import MappingProxyType, new_class
from typing import Any, ClassVar

import sympy as sp

from hovercontrol.core.block import Block
from hovercontrol.core.sgn import sgn
from hovercontrol.core.signals import Signal
from hovercontrol.effects.actuator import TAU, play
from hovercontrol.effects.base import TINY, Coefficient, Effect, Shape
from hovercontrol.effects.command import InputDelay
from hovercontrol.effects.drag import Drag, _Coulomb, _Linear, _Quadratic, _Stribeck
from hovercontrol.effects.friction import SOURCE, LuGre
from hovercontrol.effects.measurement import TimeOffset


@lru_cache(maxsize=256)
def generic_effects(block: Block) -> Mapping[str, type[Effect]]:
    """Return the effects that a Block may lack, by name.

    Parameters
    ----------
    block : Block
        Continuous.

    Returns
    -------
    mapping of str to type of Effect
        For each equation that holds a parameter or an input: an offset, linear, quadratic, dry (Coulomb,
        Stribeck, load-dependent, LuGre) friction, and a spring where the Block has the integral of the state
        among its states; for each input a dead zone, play, lag and saturation, for all together a delay; for
        each output a bias and a scale, for all together a late clock.

    Examples
    --------
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
        yield linear_drag(*about)
        yield quadratic_drag(*about)
        yield coulomb(*about, state.nominal)
        yield stribeck(*about, state.nominal)
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
        for make in (deadzone, backlash, lag, saturation):
            yield make(signal.name, signal.unit)
    if block.inputs:
        yield InputDelay


def _of_outputs(block: Block) -> Iterator[type[Effect]]:
    for signal in block.outputs:
        if not signal.modes:
            yield bias(signal.name, signal.unit)
            yield scale(signal.name)
    if block.outputs and block.inputs:
        yield TimeOffset


# ---- how classes are made ------------------------------------------------------------------------


class _Generic(Effect):
    """An effect whose class is made by one of the functions below; it can be pickled by its recipe."""

    recipe: ClassVar[tuple[Any, ...]]

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (self.recipe, self.values)


def _again(recipe: tuple[Any, ...], values: Mapping[str, float]) -> Effect:
    make, *arguments = recipe
    made: Effect = globals()[make](*arguments)(**values)
    return made


def _remembered(make: Callable[..., type[Effect]]) -> Callable[..., type[Effect]]:
    """Make a class once for the same arguments, and note how."""

    def made(*arguments: Any) -> type[Effect]:
        cls = make(*arguments)
        cls.recipe = (make.__name__, *arguments)  # type: ignore[attr-defined]
        return cls

    made.__doc__, made.__name__ = make.__doc__, make.__name__
    return cache(made)


def _made(
    name: str, bases: tuple[type[Effect], ...], sentence: str, source: str, **attributes: Any
) -> type[Effect]:
    title = "".join(part.capitalize() for part in name.split("_"))
    space = {"name": name, "__doc__": sentence, "__module__": __name__, "source": source, **attributes}
    made: type[Effect] = new_class(
        title, (*bases, _Generic), {"register": False}, lambda namespace: namespace.update(space)
    )
    return made


def _word(signal: str) -> str:
    """Return a signal's name as part of an effect's: ``P[0,1]`` becomes ``P_0_1``."""
    return re.sub(r"\W+", "_", signal).strip("_")


def _per_second(unit: str) -> str:
    """Return the unit of a signal's derivative."""
    return f"{unit}^2" if unit.endswith("/s") else f"{unit}/s"


def _inverse(unit: str) -> str:
    """Return the unit of a quadratic drag's coefficient: per second and per signal."""
    bare = unit.removesuffix("/s")
    if unit == "1":
        return "1/s"
    return f"1/{bare}" if unit.endswith("/s") and bare.isalpha() else f"1/(({unit})*s)"


def _integral(unit: str) -> str:
    """Return the unit of a signal's integral over time."""
    if unit == "1":
        return "s"
    bare = unit.removesuffix("/s")
    return bare if unit.endswith("/s") and (bare.isalpha() or bare == "1") else f"({unit})*s"


# ---- what an equation may lack -------------------------------------------------------------------


@_remembered
def offset(state: str, unit: str) -> type[Effect]:
    """Return the class of a constant in the equation of a state."""

    def terms(self: Effect, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {state: c.value}

    return _made(
        f"{_word(state)}_offset",
        (),
        f"A constant in the equation of {state}.",
        "Newton",
        value=Coefficient(_per_second(unit)),
        axis=state,
        terms=terms,
    )


@_remembered
def linear_drag(state: str, unit: str) -> type[Effect]:
    """Return the class of a drag in proportion to a state."""
    return _made(
        f"{_word(state)}_linear_drag",
        (_Linear,),
        f"Drag in proportion to {state}.",
        "viscous friction",
        value=Coefficient("1/s", lower=0.0),
        axis=state,
        in_air=False,
    )


@_remembered
def quadratic_drag(state: str, unit: str) -> type[Effect]:
    """Return the class of a drag in proportion to the square of a state."""
    return _made(
        f"{_word(state)}_quadratic_drag",
        (_Quadratic,),
        f"Drag in proportion to the square of {state}.",
        "drag of a blunt body at high Reynolds number",
        value=Coefficient(_inverse(unit), lower=0.0),
        axis=state,
    )


@_remembered
def coulomb(state: str, unit: str, size: float) -> type[Effect]:
    """Return the class of a dry friction of constant size against a state of typical size `size`."""
    return _made(
        f"{_word(state)}_coulomb",
        (_Coulomb,),
        f"Dry friction against {state}, of constant size.",
        "Coulomb",
        value=Coefficient(_per_second(unit), lower=0.0),
        width=Shape(unit, lower=TINY, default=0.01 * size),
        axis=state,
    )


@_remembered
def stribeck(state: str, unit: str, size: float) -> type[Effect]:
    """Return the class of a dry friction that fades as a state of typical size `size` grows."""
    return _made(
        f"{_word(state)}_stribeck",
        (_Stribeck,),
        f"Dry friction against {state} that is larger at small {state} and fades at about ``speed``.",
        "Armstrong-Helouvry et al., Automatica 30 (1994)",
        value=Coefficient(_per_second(unit), lower=0.0),
        speed=Shape(unit, lower=TINY, default=0.2 * size, search=(0.05, 0.12, 0.3, 0.8), of="speed"),
        width=Shape(unit, lower=TINY, default=0.01 * size),
        axis=state,
    )


@_remembered
def load_friction(state: str, unit: str, size: float, drive: sp.Expr) -> type[Effect]:
    """Return the class of a dry friction in proportion to what the inputs add to the equation of a state."""

    def terms(self: Effect, c: Any, s: Any) -> dict[str, sp.Expr]:
        now = {symbol: getattr(s, symbol.name, symbol) for symbol in drive.free_symbols}
        return {state: -c.value * sp.Abs(drive.xreplace(now)) * sgn(getattr(s, state), c.width)}

    return _made(
        f"{_word(state)}_load_friction",
        (Drag,),
        f"Dry friction against {state} in proportion to what drives it: -c abs(drive) sgn({state}).",
        "Coulomb; the normal force grows with the drive",
        value=Coefficient("1", lower=0.0),
        width=Shape(unit, lower=TINY, default=0.01 * size),
        axis=state,
        terms=terms,
    )


@_remembered
def lugre(state: str, unit: str, size: float) -> type[Effect]:
    """Return the class of a LuGre friction against a state of typical size `size`."""
    force = _per_second(unit)
    return _made(
        f"{_word(state)}_lugre",
        (LuGre,),
        f"LuGre friction against {state}: bristles that bend before it slides, stick-slip.",
        SOURCE,
        stiffness=Shape("1/s^2", lower=0.0, search=(100.0, 1000.0)),
        damping=Shape("1/s", lower=0.0, default=10.0),
        coulomb=Shape(force, lower=TINY, search=(0.1 * size, 0.4 * size)),
        static=Shape(force, lower=TINY, search=(0.5 * size,)),
        speed=Shape(unit, lower=TINY, default=0.05 * size),
        axis=state,
        deflection=_integral(unit),
    )


@_remembered
def spring(state: str, unit: str, place: str) -> type[Effect]:
    """Return the class of a spring: -k q in the equation of a state that is the derivative of q, `place`."""

    def terms(self: Effect, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {state: -c.value * getattr(s, place)}

    return _made(
        f"{_word(state)}_spring",
        (),
        f"A spring that pulls {place} back to zero: -k {place} in the equation of {state}.",
        "Hooke",
        value=Coefficient("1/s^2", lower=0.0),
        axis=state,
        terms=terms,
    )


# ---- what may lie between an input and what it drives --------------------------------------------


@_remembered
def deadzone(signal: str, unit: str) -> type[Effect]:
    """Return the class of a dead zone of an input."""

    def commands(self: Effect, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        u = s.thrusts[signal]
        s.thrusts[signal] = sp.Max(0, u - c.width) - sp.Max(0, -u - c.width)
        return {}

    return _made(
        f"{_word(signal)}_deadzone",
        (),
        f"Small values of {signal} that do nothing: max(0, {signal} - d), odd.",
        "static friction of an actuator",
        signal=signal,
        order=6,
        width=Shape(unit, lower=0.0, neutral=0.0, search=(0.05, 0.1, 0.2, 0.3), of="input"),
        commands=commands,
    )


@_remembered
def backlash(signal: str, unit: str) -> type[Effect]:
    """Return the class of a play between an input and what it drives."""
    state = Signal(f"{_word(signal)}_played", unit, f"{signal} behind its play")

    def commands(self: Effect, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        slope = play(s.thrusts[signal], c.width, c.tau, state.symbol)
        s.thrusts[signal] = state.symbol
        return {state: slope}

    return _made(
        f"{_word(signal)}_backlash",
        (),
        f"Play between {signal} and what it drives (hysteresis).",
        "Nordin and Gutman, Automatica 38 (2002)",
        signal=signal,
        order=5,
        width=Shape(unit, lower=0.0, neutral=0.0, search=(0.05, 0.1, 0.2, 0.4), of="input"),
        tau=Shape("s", lower=TINY, default=TAU, fixed=True),
        commands=commands,
    )


@_remembered
def lag(signal: str, unit: str) -> type[Effect]:
    """Return the class of a lag of first order of an input."""
    state = Signal(f"{_word(signal)}_lagged", unit, f"{signal} behind its lag")

    def commands(self: Effect, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        slope = (s.thrusts[signal] - state.symbol) / c.seconds
        s.thrusts[signal] = state.symbol
        return {state: slope}

    return _made(
        f"{_word(signal)}_lag",
        (),
        f"What {signal} drives follows it with a lag of first order, from rest.",
        "first order of an actuator",
        signal=signal,
        order=3,
        seconds=Shape("s", lower=TINY, neutral=0.0, search=(1.0, 4.0, 15.0), of="step"),
        commands=commands,
    )


@_remembered
def saturation(signal: str, unit: str) -> type[Effect]:
    """Return the class of a limit of an input."""

    def commands(self: Effect, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        s.thrusts[signal] = sp.Max(sp.Min(s.thrusts[signal], c.limit), -c.limit)
        return {}

    return _made(
        f"{_word(signal)}_saturation",
        (),
        f"What {signal} drives does not grow beyond a limit: min({signal}, s), odd.",
        "limit of an actuator",
        signal=signal,
        order=7,
        limit=Shape(unit, lower=TINY, search=(0.5, 0.65, 0.8, 0.9), of="input"),
        commands=commands,
    )


# ---- what may lie between an output and its log --------------------------------------------------


@_remembered
def bias(signal: str, unit: str) -> type[Effect]:
    """Return the class of a constant error of an output's sensor."""

    def measured(self: Effect, c: Any, s: Any) -> None:
        setattr(s, signal, getattr(s, signal) + c.value)

    return _made(
        f"{_word(signal)}_bias",
        (),
        f"A sensor of {signal} that is off by a constant.",
        "calibration",
        order=3,
        value=Coefficient(unit),
        measured=measured,
    )


@_remembered
def scale(signal: str) -> type[Effect]:
    """Return the class of a wrong scale of an output's sensor."""

    def measured(self: Effect, c: Any, s: Any) -> None:
        setattr(s, signal, getattr(s, signal) + c.value * getattr(s.true, signal))

    return _made(
        f"{_word(signal)}_scale",
        (),
        f"A sensor of {signal} with a wrong scale: (1 + c) {signal}.",
        "calibration",
        order=3,
        value=Coefficient("1"),
        measured=measured,
    )
