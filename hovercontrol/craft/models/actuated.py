"""Actuators in front of a plant: dead zone, saturation, rate limit and lag of each command.

Every input c of the plant becomes the applied command c_applied, in this order:

    dead zone     c1 = max(0, c - d) - max(0, -c - d)
    saturation    c2 = max(lower, min(upper, c1))
    rate limit    c3' = max(-rate, min(rate, (c2 - c3) / tau))
    lag           c4' = (c3 - c4) / tau

With a rate limit and a lag, one state serves both: a first-order servo with limited rate. Then tau in the
third line is the lag's time constant, and the fourth line is left out. The equations are those of
:mod:`hovercontrol.craft.effects`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.base.tables import positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.signals import Signal, suffixed, time
from hovercontrol.craft.effects import Effect
from hovercontrol.craft.effects.actuator import clipped
from hovercontrol.craft.effects.generic_commands import deadzone as deadzone_class
from hovercontrol.craft.effects.generic_commands import lag as lag_class
from hovercontrol.craft.effects.generic_commands import rate_limit as rate_class
from hovercontrol.craft.models.base import EffectModel

#: What the output is called that shows the applied command, behind the input's name.
APPLIED = "applied"

Numbers = float | Mapping[str, float] | None


@checked
def actuated(
    model: EffectModel | Block,
    *,
    bounds: bool | Mapping[str, tuple[float, float]] = True,
    deadzone: float | Mapping[str, float] | None = None,
    rate: float | Mapping[str, float] | None = None,
    lag: float | Mapping[str, float] | None = None,
) -> Block:
    """Return a plant with actuators at its inputs: dead zone, saturation, rate limit and lag, in this order.

    The result is a Block, so NumPy, C, python-control and FMUs all apply the same limits. The actuators rest
    at the inputs' start values. Each input with an actuator gets an output ``NAME_applied``, the command that
    acts on the plant. Plots and the anti-windup of controllers use it.

    Parameters
    ----------
    model : Model, BlockModel or Block
        The plant, or a model with the method ``plant()``.
    bounds : bool or mapping of str to (float, float), optional
        Saturate each input at the bounds of its Signal, or at these (lower, upper) in the input's unit; the
        bounds become parameters ``PLANT.NAME_lower`` and ``PLANT.NAME_upper``.
    deadzone : float or mapping of str to float, optional
        Half width of the dead zone, in the input's unit. A single number applies to all inputs, which must
        then have the same unit.
    rate : float or mapping of str to float, optional
        Largest rate of the actuator, in the input's unit per second. A single number applies to all inputs.
    lag : float or mapping of str to float, optional
        Time constant of a first-order lag [s]. A single number applies to all inputs.

    Returns
    -------
    Block
        With the plant's name, inputs, outputs and states, and behind these the outputs ``NAME_applied`` and
        the states ``NAME_rate_limited`` and ``NAME_lagged``.

    Raises
    ------
    InputError
        If a name is not an input, a number is not positive, lower is above upper, an input already has an
        actuator, or a sampled Block is given a rate limit or a lag.

    Examples
    --------
    >>> v, F, m = Signal("v", "m/s"), Signal("F", "N", lower=0.0, upper=4.0), Signal("m", "kg", start=2.0)
    >>> cart = Block("cart", [v], [F], [v], [m], {"v": F.symbol / m.symbol})
    >>> print(actuated(cart, lag=0.1).equations())
    F_applied = F_lagged
    v' = F_applied/m
    F_lagged' = (-F_lagged + Max(cart.F_lower, Min(F, cart.F_upper)))/cart.F_lag_seconds
    >>> actuated(cart).to_numpy().outputs(0.0, [0.0], [899.0]).tolist()
    [0.0, 4.0]
    """
    block = model if isinstance(model, Block) else model.plant(limited=False)
    inputs = {s.name: s for s in block.inputs if not s.modes}
    given = {
        "deadzone": _by_input(block, "deadzone", deadzone),
        "rate": _by_input(block, "rate", rate),
        "lag": _by_input(block, "lag", lag),
    }
    if given["rate"] or given["lag"]:
        block.need_continuous("rate limit or lag of an actuator")
    ways = []
    for name, signal in _bounded(block, bounds).items():
        way = _Way(block.name, signal)
        own = {kind: numbers.get(name) for kind, numbers in given.items()}
        way.pass_through(bounds is not False, **own)
        if way.acts:
            if inputs[name].saturates or suffixed(name, APPLIED) in {s.name for s in block.outputs}:
                raise InputError(block.where(f"the input {name!r} already has an actuator"))
            ways.append(way)
    return _with_ways(block, ways)


def saturated(block: Block) -> Block:
    """Return a Block whose inputs saturate at the bounds of their Signals; see :func:`actuated`.

    Examples
    --------
    >>> v, F = Signal("v", "m/s"), Signal("F", "m/s^2", lower=0.0, upper=4.0)
    >>> print(saturated(Block("cart", [v], [F], [v], derivatives={"v": F.symbol})).equations())
    F_applied = Max(cart.F_lower, Min(F, cart.F_upper))
    v' = F_applied
    """
    return actuated(block)


@dataclass
class _Way:
    """A command at one stage of its actuator."""

    owner: str
    signal: Signal
    command: sp.Expr = field(init=False)
    parameters: list[Signal] = field(default_factory=list)
    states: dict[Signal, sp.Expr] = field(default_factory=dict)
    saturates: bool = False

    def __post_init__(self) -> None:
        self.command = self.signal.symbol

    @property
    def acts(self) -> bool:
        """Whether the actuator changes the command."""
        return self.command != self.signal.symbol

    def pass_through(
        self, saturated: bool, deadzone: float | None, rate: float | None, lag: float | None
    ) -> None:
        """Apply the actuator's parts to the command, in the order of this module."""
        of = (self.signal.name, self.signal.unit)
        if deadzone is not None:
            self._let(deadzone_class(*of)(width=deadzone))
        if saturated:
            self._saturate()
        if rate is not None:
            tau = {} if lag is None else {"tau": lag}
            self._let(rate_class(*of)(limit=rate, **tau))
        elif lag is not None:
            self._let(lag_class(*of)(seconds=lag))

    def _saturate(self) -> None:
        s = self.signal
        symbols: list[sp.Symbol | None] = []
        for value, text in ((s.lower, "lower"), (s.upper, "upper")):
            if math.isinf(value):
                symbols.append(None)
                continue
            bound = Signal(
                f"{self.owner}.{suffixed(s.name, text)}",
                s.unit,
                f"{text} limit of {s.name}",
                start=value,
                nominal=abs(value) or s.nominal,
            )
            self.parameters.append(bound)
            symbols.append(bound.symbol)
        self.command = clipped(self.command, *symbols)
        self.saturates = any(b is not None for b in symbols)

    def _let(self, effect: Effect) -> None:
        """Apply an effect to the command; its state, if any, starts at rest."""
        name = self.signal.name
        rest = self._at_start()
        way = SimpleNamespace(
            thrusts={name: self.command}, time=time, units={name: self.signal.unit}, delay=None
        )
        states = effect.commands(effect.symbols(self.owner), way)
        self.states |= {s.replace(start=rest, nominal=self.signal.nominal): e for s, e in states.items()}
        self.command = way.thrusts[name]
        self.parameters += effect.signals(self.owner, way.units)

    def _at_start(self) -> float:
        known = (self.signal, *self.parameters, *self.states)
        return float(self.command.subs({s.symbol: s.start for s in known}))


def _bounded(block: Block, bounds: bool | Mapping[str, tuple[float, float]]) -> dict[str, Signal]:
    """Return the inputs by name, with the requested bounds."""
    inputs = {s.name: s for s in block.inputs if not s.modes}
    for name, pair in {}.items() if isinstance(bounds, bool) else bounds.items():
        check_known(name, inputs, block.where(f"bounds: no input {name!r}"))
        lower, upper = pair
        if not lower <= upper:
            raise InputError(block.where(f"bounds of {name!r}: lower = {lower:g} is above upper = {upper:g}"))
        start = min(max(inputs[name].start, lower), upper)
        inputs[name] = inputs[name].replace(lower=lower, upper=upper, start=start)
    return inputs


def _by_input(block: Block, what: str, given: Numbers) -> dict[str, float]:
    """Return the given positive number of each input."""
    inputs = {s.name: s for s in block.inputs if not s.modes}
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        units = {s.unit for s in inputs.values()}
        if len(units) > 1 and what != "lag":
            raise InputError(
                block.where(
                    f"{what}: the inputs have different units ({', '.join(sorted(units))}); give one number "
                    f"for each by name, as {what}={{{next(iter(inputs))!r}: {given:g}}}"
                )
            )
        given = dict.fromkeys(inputs, given)
    for name, value in given.items():
        check_known(name, inputs, block.where(f"{what}: no input {name!r}"))
        positive(f"{what} of {name!r}", value)
    return dict(given)


def _with_ways(block: Block, ways: list[_Way]) -> Block:
    """Return the Block with each command replaced by the output of its actuator."""
    if not ways:
        return block
    applied = {
        w.signal.name: Signal(
            suffixed(w.signal.name, APPLIED),
            w.signal.unit,
            f"{w.signal.name} applied by the actuator",
            nominal=w.signal.nominal,
        )
        for w in ways
    }
    swap = {w.signal.symbol: applied[w.signal.name].symbol for w in ways}
    parts = block.swapped(swap)
    shown = {name: e for name, e in block.output_expressions.items() if name in applied}  # the input itself
    n = block.n_continuous
    added = {s: e for w in ways for s, e in w.states.items()}
    marked = {w.signal.name: w.signal.replace(saturates=w.saturates) for w in ways}
    return Block(
        block.name,
        states=(*block.states[:n], *added, *block.states[n:]),
        inputs=tuple(marked.get(s.name, s) for s in block.inputs),
        outputs=(*block.outputs, *applied.values()),
        parameters=(*block.parameters, *(p for w in ways for p in w.parameters)),
        derivatives={**parts["derivatives"], **{s.name: e for s, e in added.items()}},
        output_expressions=Expressions({**parts["output_expressions"], **shown}),
        definitions={
            **{applied[w.signal.name].name: w.command for w in ways},
            **parts["definitions"],
        },
        definition_signals=(*applied.values(), *block.definition_signals),
        period=block.period,
        ticks=parts["ticks"],
        delays=block.delays,
    )
