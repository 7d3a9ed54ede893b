"""Candidates of a monitor: what each possible change adds to the plant's derivatives and measurements.

A change of amplitude theta adds ``theta a`` to the derivatives of the states and ``theta b`` to the measured
values. For a coefficient c, such as a mass, a = df/dc and b = dh/dc at its present value. A number of an
effect that may have either sign (an offset of the rudder, within a sine) has its slopes at the neutral value.
A number of one sign (a lag, a dead zone) has no slope there: a is the secant from the neutral value to a
trial value, ``a = f(s_trial) - f(s_neutral)``. theta is the part of the trial's distance from the neutral
value. A coefficient's bounds are bounds of theta: a friction coefficient of 0.5 falls by 0.5 at most.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import sympy as sp

from hovercontrol.base.errors import InputError, did_you_mean, shown
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.units import simplified
from hovercontrol.control.observers.observed import owned
from hovercontrol.craft.effects import Coefficient, Effect, Shape
from hovercontrol.craft.models.base import output_for_channel
from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.craft.models.model import Model

Craft = Model | BlockModel

#: Key of the sampling period among the sizes; no signal has it as its name.
STEP = "sampling period"


@dataclass(frozen=True)
class Candidate:
    """One possible change.

    Attributes
    ----------
    name : str
        Of the effect, of the model's own coefficient, or ``NAME_bias``.
    unit : str
        Of its coefficient.
    neutral : sympy.Expr
        Coefficient without the change: 0, or the symbol of the model's own coefficient.
    scale : float
        Change of the coefficient for theta = 1.
    lower, upper : sympy.Expr
        Bounds of theta, ``lower <= 0 <= upper``.
    rates : dict of str to sympy.Expr
        a, by the name of the state.
    seen : dict of str to sympy.Expr
        b, by the name of the measured channel.
    memory : dict of Signal to sympy.Expr
        The effect's own states and their derivatives.
    delay : float
        Time by which the commands in `rates` are late [s]: ``rates`` is f of the late commands minus f of the
        present ones. Late commands have the symbols ``NAME_late``.
    parameters : tuple of Signal
        Parameters in the expressions that the model does not have.
    number : sympy.Symbol, optional
        The coefficient at its trial value, if theta is a part of a trial.
    law : dict of str to sympy.Expr
        Changes of the derivatives by the name of the state, as functions of `number`, if they are not
        proportional to it. Not of a delay, whose slope at another time takes other late commands, and not of
        changes of the measured values.
    """

    name: str
    unit: str
    neutral: sp.Expr
    scale: float
    lower: sp.Expr = sp.S.NegativeInfinity
    upper: sp.Expr = sp.S.Infinity
    rates: dict[str, sp.Expr] = field(default_factory=dict)
    seen: dict[str, sp.Expr] = field(default_factory=dict)
    memory: dict[Signal, sp.Expr] = field(default_factory=dict)
    delay: float = 0.0
    parameters: tuple[Signal, ...] = ()
    number: sp.Symbol | None = None
    law: dict[str, sp.Expr] = field(default_factory=dict)

    def like(self, other: Candidate) -> bool:
        """Return whether this is a constant change where the other one is."""
        mine, its = ({"rates": c.rates.keys(), "seen": c.seen.keys()} for c in (self, other))
        own = {p.symbol for p in self.parameters} | ({self.number} if self.number else set())
        held = all(e.free_symbols <= own for e in (*self.rates.values(), *self.seen.values()))
        return held and not self.memory and not self.delay and mine == its

    @property
    def signed(self) -> bool:
        """Whether the coefficient may be on either side of its neutral value."""
        return bool(self.lower < 0) and bool(self.upper > 0)


def candidates_of(
    model: Craft,
    wanted: Sequence[str | Effect] | None,
    measured: Sequence[str],
    sizes: Mapping[str, float],
    name: str,
    period: float,
) -> list[Candidate]:
    """Return the candidates of a monitor, in the given order.

    Parameters
    ----------
    wanted : sequence of str or Effect, or None
        None: each coefficient that a fit estimates and that shows, and a bias of each measured channel.
    sizes : mapping of str to float
        Typical size of each input and state along the motion, by name.
    name : str
        Of the monitor.
    period : float
        Of its samples [s].

    Raises
    ------
    InputError
        If a name is unknown or given twice, or a candidate changes neither a derivative nor a measured
        channel.
    """
    plant = model.plant()
    every = [*model.free_coefficients(), *(f"{channel}_bias" for channel in measured)]
    found: list[Candidate] = []
    for one in every if wanted is None else wanted:
        found += _made(model, plant, one, measured, {**sizes, STEP: period}, name)
    if wanted is None:
        found = [c for c in found if c.rates or c.seen]
    names = [c.name for c in found]
    if not names:
        raise InputError(f"{name}: candidates: expected at least one")
    for key in names:
        if names.count(key) > 1:
            raise InputError(f"{name}: candidates: {key!r} is listed twice")
    for c in found:
        if not c.rates and not c.seen:
            raise InputError(
                f"{name}: candidate {c.name!r} changes neither a derivative of the model nor one of the "
                f"measured channels {', '.join(measured)}"
            )
    return found


def unknowns_of(
    plant: Block, driven: Sequence[str], measured: Sequence[str], candidates: Sequence[Candidate]
) -> list[Candidate]:
    """Return changes of any cause: accelerations in the equations of driven states, then offsets of sensors.

    An offset that is a candidate is left out.
    """
    per, found = "" if plant.period else "/s", []
    for name in driven:
        key, unit = f"unknown_{name}", simplified(f"({plant.signal(name).unit}){per}")
        scale = unit_change(f"scale_{key}", unit, 1.0)
        found.append(Candidate(key, unit, sp.S.Zero, 1.0, rates={name: scale.symbol}, parameters=(scale,)))
    known = {c.name for c in candidates}
    biases = (_bias(plant, channel, "unknown_") for channel in measured if f"{channel}_bias" not in known)
    return [*found, *biases]


def _bias(plant: Block, channel: str, prefix: str = "") -> Candidate:
    """Return the change of a sensor's offset."""
    name, unit = (
        f"{prefix}{channel}_bias",
        plant.signal(output_for_channel([s.name for s in plant.outputs], channel)).unit,
    )
    scale = unit_change(f"scale_{name}", unit, 1.0)
    return Candidate(name, unit, sp.S.Zero, 1.0, seen={channel: scale.symbol}, parameters=(scale,))


def _made(
    model: Craft,
    plant: Block,
    one: str | Effect,
    measured: Sequence[str],
    sizes: Mapping[str, float],
    name: str,
) -> list[Candidate]:
    if isinstance(one, Effect):
        return _of_effect(model, plant, type(one), one, measured, name)
    own = {model.coefficient_name(key): key for key in model.coefficients()}
    if one in own:
        return [_of_coefficient(plant, one, measured, name)]
    channel = one.removesuffix("_bias")
    if one.endswith("_bias") and channel in measured:
        return [_bias(plant, channel)]
    try:
        cls = model.effect_class(one)
    except InputError:
        known = dict.fromkeys([*own, *(f"{c}_bias" for c in measured), *(c.name for c in model.candidates())])
        raise InputError(f"{name}: candidates: unknown name {shown(one)}{did_you_mean(one, known)}") from None
    return _of_effect(model, plant, cls, _trial(cls, model, sizes), measured, name)


def _trial(cls: type[Effect], model: Craft, sizes: Mapping[str, float]) -> Effect:
    """Return an effect at trial values: the middle of those from which a search for it starts."""
    values = {}
    for key, number in cls.numbers.items():
        if isinstance(number, Shape) and number.search:
            scale = 1.0
            if number.of == "input":
                scale = max((sizes[n] for n in model.input_units() if n in sizes), default=1.0)
            elif number.of == "speed":
                scale = sizes.get(cls.axis, 1.0)
            elif number.of == "step":
                scale = sizes[STEP]
            values[key] = number.search[len(number.search) // 2] * scale
        elif math.isfinite(number.neutral):
            values[key] = number.neutral + 1.0
        else:
            values[key] = number.default if number.default is not None else 0.01
    return cls.within_bounds(**values)


def _of_coefficient(plant: Block, key: str, measured: Sequence[str], name: str) -> Candidate:
    """Return the change of a coefficient that the model has."""
    block = owned(plant, name)
    own = block.parameter(key)
    symbol, unit = own.symbol, own.unit
    scale = unit_change(f"scale_{key}", unit, 1.0)

    def slope(e: sp.Expr) -> sp.Expr:
        return scale.symbol * sp.diff(block.expand(e), symbol)

    rates = {s.name: slope(block.derivatives[s.name]) for s in block.states}
    seen = {c: slope(_shown(block, c)) for c in measured}
    lower, upper = (
        sp.Float(b) - symbol / scale.symbol if math.isfinite(b) else sp.sympify(b)
        for b in (own.lower, own.upper)
    )
    return Candidate(
        key, unit, symbol, 1.0, lower, upper, _nonzero(rates), _nonzero(seen), parameters=(scale,)
    )


def _of_effect(
    model: Craft, plant: Block, cls: type[Effect], trial: Effect, measured: Sequence[str], name: str
) -> list[Candidate]:
    """Return the candidates of an effect that the model lacks, one for each number that scales it."""
    if any(e.name == cls.name for e in model.effects):
        raise InputError(
            f"{name}: candidates: the model has the effect {cls.name!r}: name the coefficient that may change"
        )
    if trial.moment():
        raise InputError(
            f"{name}: candidate {cls.name!r} is a change at one time: name the coefficients that may change"
        )
    scaling = [k for k, n in cls.numbers.items() if not math.isnan(n.neutral)]
    if not scaling and trial == trial.neutral():
        return [_against(model, plant, trial, "", measured, name)]
    return [_against(model, plant, trial, key, measured, name) for key in scaling]


def _against(
    model: Craft, plant: Block, trial: Effect, key: str, measured: Sequence[str], name: str
) -> Candidate:
    """Return the candidate whose amplitude is one number of a trial, the other amplitudes neutral."""
    cls = type(trial)
    if key:
        trial = trial.within_bounds(**{**trial.neutral().values, key: trial.values[key]})
    number = cls.numbers.get(key)
    neutral, scale = (number.neutral, trial.values[key] - number.neutral) if number else (0.0, 1.0)
    without, extended = owned(plant, name), owned(model.with_effects([trial]).plant(), name)
    own = {k: extended.parameter(trial.parameter(k)) for k in trial.values}
    numbers = _fixed(trial, key, own, without, extended)
    kept = [p.replace(lower=p.start, upper=p.start) for p in own.values() if p.symbol not in numbers]
    delay = _delay(extended)
    late = _late(extended) if delay else {}

    def change(after: sp.Expr, before: sp.Expr) -> sp.Expr:
        return sp.sympify(extended.expand(after).xreplace(numbers).xreplace(late) - without.expand(before))

    rates = {
        s.name: change(extended.derivatives[s.name], without.derivatives[s.name]) for s in without.states
    }
    memory = {
        s: extended.expand(extended.derivatives[s.name]).xreplace(numbers)
        for s in extended.states
        if s.name not in without.derivatives
    }
    seen = {c: change(_shown(extended, c), _shown(without, c)) for c in measured}
    lower, upper = _bounds(number, scale)
    lone = sum(not math.isnan(n.neutral) for n in cls.numbers.values()) <= 1
    rates, seen, law = _nonzero(rates), _nonzero(seen), {}
    q, unit = (own[key].symbol, own[key].unit) if key else (None, "1")
    if q is not None and not delay:
        law = rates if not seen and not neutral and _curved(rates, memory, q) else {}
        if lower < 0 < upper and not memory:
            rates, seen = ({k: _slope(e, q, neutral) for k, e in some.items()} for some in (rates, seen))
    return Candidate(
        cls.name if lone else cls.parameter(key),
        unit,
        sp.Float(neutral),
        scale,
        lower,
        upper,
        rates,
        seen,
        memory,
        delay,
        tuple(kept),
        q,
        law,
    )


def _fixed(
    trial: Effect, key: str, own: Mapping[str, Signal], without: Block, extended: Block
) -> dict[sp.Symbol, sp.Expr]:
    """Return the values of an effect's other numbers."""
    numbers = {
        own[k].symbol: sp.Float(v)
        for k, v in trial.values.items()
        if k != key and not math.isnan(trial.numbers[k].neutral)
    }
    # effects in a sampled model bring its period, which is the monitor's
    known, period = {p.name for p in without.parameters}, f"{extended.name}.period"
    new = [p for p in extended.parameters if p.name == period and p.name not in known]
    return numbers | {p.symbol: sp.Symbol("period", real=True) for p in new}


def _delay(block: Block) -> float:
    """Return the delay of a Block's inputs at its start values [s]."""
    values = {p.symbol: p.start for p in block.parameters}
    delays = {float(e.subs(values)) for e in block.delays.values()}
    return delays.pop() if delays else 0.0


def _late(block: Block) -> dict[sp.Symbol, sp.Symbol]:
    """Return the symbols of inputs that act late."""
    return {s.symbol: sp.Symbol(f"{s.name}_late", real=True) for s in block.inputs}


def _curved(rates: Mapping[str, sp.Expr], memory: Mapping[Signal, sp.Expr], q: sp.Symbol) -> bool:
    """Return whether the rates, or the effect's own states, are not linear in q."""
    slopes = [sp.diff(e, q) for e in rates.values()]
    return any(q in e.free_symbols for e in (*slopes, *memory.values()))


def _bounds(number: Coefficient | None, scale: float) -> tuple[sp.Expr, sp.Expr]:
    """Return the bounds of theta."""
    if number is None:
        return sp.S.NegativeInfinity, sp.S.Infinity
    # the least value of a lag is a little above its neutral value
    below = min(number.lower - number.neutral, 0.0) / scale
    above = max(number.upper - number.neutral, 0.0) / scale
    return _number(min(below, above)), _number(max(below, above))


def _shown(block: Block, channel: str) -> sp.Expr:
    """Return the expression of a measured channel: an output, or a state."""
    values = {s.name: s.symbol for s in block.states} | dict(block.output_expressions)
    return values[output_for_channel([s.name for s in block.outputs], channel)]


def _slope(e: sp.Expr, q: sp.Symbol, neutral: float) -> sp.Expr:
    """Return (q - q_0) de/dq, with the slope at the neutral value q_0."""
    return sp.sympify((q - neutral) * sp.diff(e, q).subs(q, neutral))


def _number(value: float) -> sp.Expr:
    return sp.sympify(value) if value else sp.S.Zero


def _nonzero(changes: Mapping[str, sp.Expr]) -> dict[str, sp.Expr]:
    return {key: e for key, e in changes.items() if sp.expand(e) != 0}


def unit_change(name: str, unit: str, value: float) -> Signal:
    """Return the parameter with the change for theta = 1."""
    return Signal(name, unit, "change for theta = 1; fixed", start=value, lower=value, upper=value)
