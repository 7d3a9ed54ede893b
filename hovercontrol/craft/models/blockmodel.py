"""A model made of any Block and added effects: a servo with friction, a ship, an own plant."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known, did_you_mean
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delays import undelayed
from hovercontrol.blocks.derivatives import linear_parameters, nonzero_parameters
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.blocks.summary import block_line
from hovercontrol.craft.effects import Effect, effect_class
from hovercontrol.craft.effects.actuator import clipped
from hovercontrol.craft.effects.command import InputDelay
from hovercontrol.craft.effects.generic import generic_effects
from hovercontrol.craft.effects.law import is_law, law_class
from hovercontrol.craft.effects.measurement import TimeOffset
from hovercontrol.craft.models.actuated import saturated
from hovercontrol.craft.models.base import EffectModel, as_measured, delays_of, effect_lines, rate_limit
from hovercontrol.craft.models.functions import KnownFunction
from hovercontrol.craft.models.rates import equals_period, late_inputs, next_value, rate_form

#: Names that a signal may not have, and why.
TAKEN = {
    "time": "effects use this name for the time",
    "true": "effects use this name for the true quantities",
    "late": "effects use this name for the delay of measurements",
}


@checked
@dataclass(frozen=True)
class BlockModel(EffectModel):
    """A Block with added effects.

    In ``terms(c, s)`` of an effect, ``s`` has the Block's states and inputs by name, and ``time``; the result
    is keyed by state. In ``commands``, ``s.thrusts`` has all inputs.

    Parameters
    ----------
    block : Block
        Its parameters may enter in any way; a fit estimates all of them.
    catalogue : sequence of str, optional
        Names of the effects that could be added; default: all effects of
        :func:`~hovercontrol.craft.effects.generic.generic_effects` of the Block.
    effects : sequence of Effect, optional
        Effects of the model.
    limited : bool, optional
        Whether the plant's inputs saturate at their bounds, before any effect acts on them.
    period_parameter : str, optional
        Name of the parameter that is the sampling period, ``""`` if none is. Default: the parameter in
        seconds with the value of the period, if there is only one.
    functions : tuple of TableFunction or FormFunction
        What stands in the Block in place of its unknown functions (:meth:`with_functions`).

    Raises
    ------
    InputError
        If an effect is unknown, listed twice, or acts on a state that the Block does not have, or if a signal
        has a reserved name.

    Examples
    --------
    >>> from hovercontrol.craft.effects import effect
    >>> v, k = Signal("v", "m/s"), Signal("k", "1/s", start=1.0)
    >>> cart = Block("cart", [v], [], [v], [k], {"v": -k.symbol * v.symbol})
    >>> model = BlockModel(cart, ["input_delay"])
    >>> model.linear_coefficients(), model.coefficients()
    (('k',), {'k': 1.0})

    A single-axis drive, angle q and rate v, of which nothing more is said, and what it may lack:

    >>> q, v, u = Signal("q", "rad"), Signal("v", "rad/s"), Signal("u", "A")
    >>> k, b = Signal("k", "N*m/A", start=0.1), Signal("b", "N*m*s", start=0.02)
    >>> J = Signal("J", "kg*m^2", start=0.01, lower=1e-9)
    >>> slope = (k.symbol * u.symbol - b.symbol * v.symbol) / J.symbol
    >>> drive = BlockModel(Block("drive", [q, v], [u], [q], [k, b, J], {"q": v.symbol, "v": slope}))
    >>> [cls.name for cls in drive.candidates()][:9]  # doctest: +NORMALIZE_WHITESPACE
    ['v_offset', 'v_linear_drag', 'v_quadratic_drag', 'v_coulomb', 'v_stribeck', 'v_asymmetric_drag',
     'v_load_friction', 'v_lugre', 'v_spring']
    >>> [cls.name for cls in drive.candidates()][9:]  # doctest: +NORMALIZE_WHITESPACE
    ['u_offset', 'u_deadzone', 'u_backlash', 'u_hysteresis', 'u_lag', 'u_second_order_lag', 'u_saturation',
     'u_asymmetry', 'input_delay', 'q_bias', 'q_scale', 'time_offset']
    >>> sticky = drive.with_effects([drive.effect_class("v_coulomb")(0.5)])
    >>> sticky.plant().to_numpy().derivatives(0.0, [0.0, 1.0], [1.0]).round(6).tolist()
    [1.0, 7.5]
    """

    block: Block
    catalogue: tuple[str, ...] | None = None
    effects: tuple[Effect, ...] = field(default=())
    limited: bool = False
    period_parameter: str | None = None
    functions: tuple[KnownFunction, ...] = field(default=(), repr=False)

    def __repr__(self) -> str:
        return "\n".join([f"BlockModel of {block_line(self.block)}", *effect_lines(self.effects)])

    def __post_init__(self) -> None:
        object.__setattr__(self, "effects", tuple(self.effects))
        if self.catalogue is not None:
            object.__setattr__(self, "catalogue", tuple(self.catalogue))
            for name in self.catalogue:
                self.effect_class(name)
        self._refuse_delays()
        for s in (*self.block.states, *self.block.inputs, *self.block.parameters, *self.block.outputs):
            if s.name in TAKEN:
                raise InputError(self.block.where(f"reserved signal name {s.name!r}: {TAKEN[s.name]}"))
        if self.period_parameter:
            object.__setattr__(self, "period_parameter", self.coefficient_name(self.period_parameter))
        self._refuse_twice()
        if self.block.period:
            self._refuse_modes()

    def _refuse_delays(self) -> None:
        """Raise :class:`InputError` if the inputs are not all late by one parameter."""
        block, found = self.block, set(self.block.delays.values())
        if not found:
            return
        alike = len(found) == 1 and len(block.delays) == len(block.inputs)
        if not alike or not found <= {p.symbol for p in block.parameters}:
            block.need_prompt_inputs("a model whose inputs are not all late by one parameter")

    @property
    def _own_delay(self) -> str:
        """Name of the Block's parameter by which all inputs are late; ``""`` for none."""
        return next((str(delay) for delay in self.block.delays.values()), "")

    def _refuse_modes(self) -> None:
        for s in (*self.block.states, *self.block.inputs):
            if s.modes:
                raise InputError(
                    self.block.where(f"{s.name!r} is a mode: the states of a sampled model are real numbers")
                )

    def _repr_html_(self) -> str:
        from hovercontrol.craft.models.display import blockmodel_html

        return blockmodel_html(self)

    @property
    def name(self) -> str:
        """The Block's name."""
        return self.block.name

    @property
    def period(self) -> float:
        """Sampling period of a Block that holds next values [s]; 0 for a continuous one."""
        return self.block.period

    def equal_to_period(self) -> tuple[str, ...]:
        """Return the names of the parameters in seconds with the value of the sampling period."""
        return tuple(name for name, p in self._parameters.items() if equals_period(self.block, p))

    def periods(self) -> tuple[str, ...]:
        """Return the name of the parameter that is the sampling period, if one is; it is known."""
        equal = self.equal_to_period()
        if self.period_parameter is None:
            return equal if len(equal) == 1 else ()
        return tuple(name for name in equal if name == self.period_parameter)

    def _rate_form(self) -> Block:
        return rate_form(self.block, [self._parameters[name] for name in self.periods()])

    @property
    def motion(self) -> tuple[str, ...]:
        """The Block's own states."""
        return tuple(s.name for s in self.block.states)

    @cached_property
    def pushed(self) -> tuple[str, ...]:
        """States on which an effect of the catalogue acts."""
        if self.catalogue is None:
            return ()
        motion = self._motion({s.name: s.symbol for s in self.block.inputs})
        found: set[str] = set()
        for cls in self.candidates():
            with contextlib.suppress(AttributeError, InputError):  # it cannot act in this Block
                e = cls.small()
                found.update(e.terms(e.symbols(self.name), motion))
        return tuple(s.name for s in self.block.states if s.name in found)

    @property
    def signature(self) -> tuple[Hashable, ...]:
        """Everything that determines the plant except the values of coefficients other than the period."""
        block = self.block
        parameters = ((s.name, s.unit, s.nominal, s.lower, s.upper) for s in block.parameters)
        expressions = (block.derivatives, block.output_expressions, block.definitions, block.delays)
        return (
            self.name,
            (block.states, block.inputs, block.outputs, tuple(parameters), self.limited, block.period),
            self.periods(),
            *(tuple(e.items()) for e in expressions),
            *(type(e) for e in self.effects),
        )

    @cached_property
    def _generic(self) -> Mapping[str, type[Effect]]:
        """The effects made for the Block's own equations, inputs and outputs."""
        if not self.period:
            found = generic_effects(undelayed(self.block))
            return {n: c for n, c in found.items() if not (self._own_delay and c is InputDelay)}
        found = generic_effects(self._rate_form())
        return {name: cls for name, cls in found.items() if _fits_steps(cls)}

    def accepts(self, cls: type[Effect]) -> bool:
        """Return whether the model can take the effect."""
        if self.catalogue is None:
            return self._generic.get(cls.name) is cls
        return cls.name in self.catalogue

    def candidates(self) -> tuple[type[Effect], ...]:
        """Return the effects that could be added to the model."""
        names = self._generic if self.catalogue is None else self.catalogue
        have = {e.name for e in self.effects}
        return tuple(self.effect_class(name) for name in names if name not in have)

    def effect_class(self, name: str) -> type[Effect]:
        """Return the class of an effect: a known one, or a generic one of the Block.

        Raises
        ------
        InputError
            If no effect has that name; the message names the nearest one.
        """
        if is_law(name):
            return law_class(name, self.law_units())
        if self.catalogue is not None and name in Effect.known:
            return effect_class(name)
        generic = self._generic
        if name not in {**generic, **Effect.known}:
            raise InputError(f"unknown effect {name!r}{did_you_mean(name, [*Effect.known, *generic])}")
        return generic.get(name) or effect_class(name)

    def linear_coefficients(self) -> tuple[str, ...]:
        """Return the names of the coefficients in which the plant is linear, the Block's and the effects'."""
        linear = linear_parameters(self.block)
        known = {*self.periods(), *(n for n, p in self._parameters.items() if p.name == self._own_delay)}
        own = (name for name, p in self._parameters.items() if p.name in linear and name not in known)
        return (*own, *self._linear_in_effects())

    def free_coefficients(self) -> tuple[str, ...]:
        """Return the Block's parameters, linear or not, and the effects' linear coefficients.

        A parameter that is the sampling period, or whose bounds leave one value, is not among them.
        """
        known = self.periods()
        own = (n for n, p in self._parameters.items() if n not in known and p.lower < p.upper)
        return (*own, *self._linear_in_effects())

    def sign_keeping(self) -> frozenset[str]:
        """Return the Block's parameters that are not zero, by their bounds or for the equations."""
        nonzero = nonzero_parameters(self.block)
        own = self._parameters.items()
        return frozenset(name for name, p in own if p.name in nonzero or p.lower > 0.0 or p.upper < 0.0)

    def coefficients(self) -> dict[str, float]:
        """Return the values of the Block's parameters and of the effects' coefficients."""
        return {name: p.start for name, p in self._parameters.items()} | self._effect_coefficients()

    def coefficient_name(self, name: str) -> str:
        """Return the name of a coefficient, given with or without the Block's name in front."""
        added, last = self._effect_coefficients(), name.rpartition(".")[2]
        if last in added and name in (last, f"{self.name}.{last}"):
            return last
        wanted = self.block.parameter(name)
        return next(own for own, p in self._parameters.items() if p is wanted)

    def nominal_sizes(self) -> dict[str, float]:
        """Return the sizes of the Block's parameters (nominal, for one that is zero) and of the effects."""
        own = {name: abs(p.start) or p.nominal for name, p in self._parameters.items()}
        return own | {name: abs(value) or 1.0 for name, value in self._effect_coefficients().items()}

    @cached_property
    def _parameters(self) -> dict[str, Signal]:
        """The Block's parameters by the last part of their keys, or by the key where two share that."""
        keys = {self.block.parameter_key(p.name): p for p in self.block.parameters}
        last = [key.rpartition(".")[2] for key in keys]
        return {
            key if last.count(short) > 1 else short: p
            for short, (key, p) in zip(last, keys.items(), strict=True)
        }

    def with_coefficients(self, values: Mapping[str, float]) -> BlockModel:
        """Return the model with other values of its coefficients.

        Parameters
        ----------
        values : mapping of str to float
            In the units of the coefficients.

        Raises
        ------
        InputError
            If a name is unknown or a value is out of bounds.
        """
        self._refuse_unknown(values)
        added = self._effect_coefficients()
        own = {name: value for name, value in values.items() if name not in added}
        effects = self._renumbered_effects(values)
        return replace(self, block=self.block.with_values(own), effects=effects)

    def with_functions(self, functions: Sequence[KnownFunction]) -> BlockModel:
        """Return the model with tables or forms in place of its unknown functions."""
        block = self.block
        for function in functions:
            block = function.filled(block)
        return replace(self, block=block, functions=(*self.functions, *functions))

    def fitted_functions(self) -> tuple[KnownFunction, ...]:
        """Return what stands in place of unknown functions, with the model's values."""
        values = self.coefficients()
        return tuple(f.with_numbers(values) for f in self.functions)

    def input_units(self) -> dict[str, str]:
        """Return the unit of each input."""
        return {s.name: s.unit for s in self.block.inputs}

    def law_units(self) -> dict[str, str]:
        """Return the unit of each signal that a law may use: states, inputs as they act, time."""
        signals = (*self.block.states, *self.block.inputs)
        return {s.name: s.unit for s in signals if not s.modes} | {"time": "s"}

    def input_size(self, cls: type[Effect], inputs: Mapping[str, ArrayLike]) -> float:
        """Return the largest magnitude of an input effect's input: its own input, or all inputs.

        Parameters
        ----------
        cls : type of Effect
        inputs : mapping of str to array_like, shape (n,)
            By name, in their units.
        """
        names = [cls.signal] if cls.signal else [s.name for s in self.block.inputs]
        sizes = (float(np.abs(inputs[name]).max(initial=0.0)) for name in names if name in inputs)
        return max(sizes, default=0.0)

    def _units(self) -> dict[str, str]:
        """Return the units of the inputs; ``thrust`` is the unit that all inputs share."""
        units = self.input_units()
        shared = set(units.values())
        return {"thrust": shared.pop(), **units} if len(shared) == 1 else units

    def timing(self, owner: str = "") -> tuple[str, ...]:
        """Return the parameter names of the input delay, the measurement delay and the Block's; ``""``: none.

        Parameters
        ----------
        owner : str, optional
            Name of the Block.
        """
        _, way = self._way()
        return str(way.delay or ""), str(self._seen().late or ""), self._own_delay

    def _way(self, limited: bool = False) -> tuple[dict[Signal, sp.Expr], SimpleNamespace]:
        way = SimpleNamespace(
            thrusts={s.name: _limited(s) if limited else s.symbol for s in self.block.inputs},
            rudder=sp.Symbol("rudder", real=True),
            time=time,
            inputs={s.name: s.symbol for s in self.block.inputs},
            units=self.input_units(),
            delay=None,
        )
        states: dict[Signal, sp.Expr] = {}
        for e in sorted(self.effects, key=lambda e: e.order):
            states |= e.commands(e.symbols(self.name), way)
        return states, way

    def _seen(self) -> SimpleNamespace:
        every: dict[str, Any] = {s.name: s.symbol for s in self.block.states}
        every |= {s.name: self.block.output_expressions[s.name] for s in self.block.outputs}
        seen = SimpleNamespace(**every, true=SimpleNamespace(**every), late=None)
        for e in sorted(self.effects, key=lambda e: e.order):
            e.measured(e.symbols(self.name), seen)
        return seen

    def _motion(self, inputs: Mapping[str, sp.Expr], limit: Signal | None = None) -> SimpleNamespace:
        """Return the symbols that effects use in ``terms`` and ``states``."""
        return SimpleNamespace(
            **{
                # unless the Block has a signal of that name
                "fastest": limit.symbol if limit else None,
                "inputs": {s.name: s.symbol for s in self.block.inputs},
                "thrusts": dict(inputs),
                **{s.name: s.symbol for s in (*self.block.states, *self.block.parameters)},
                **inputs,
                "time": time,
            }
        )

    def plant(
        self, *, late: bool = False, fastest: float | None = None, limited: bool | None = None
    ) -> Block:
        """Return the Block with the effects; as of a :class:`~hovercontrol.craft.models.model.Model`.

        Parameters
        ----------
        late : bool, optional
            Whether the caller shifts inputs and clock itself (:meth:`timing`); the Block then has no delays.
        fastest : float, optional
            Largest rate of the states of effects [1/s], for coarse steps.
        limited : bool, optional
            Saturate each input at its bounds before any effect acts on it. Default: the model's own setting.

        Raises
        ------
        InputError
            If an effect acts on a state that does not exist, inputs would act before they are sent, or
            `fastest` is not positive.
        """
        plain = undelayed(self.block) if late else self.block
        block = self._amended(late, fastest) if self.effects else plain
        return saturated(block) if (self.limited if limited is None else limited) else block

    def rates(self, fastest: float) -> Block:
        """Return the continuous Block with the rates of a sampled model, for an engine that shifts inputs.

        Euler's method with steps of the period gives the next values
        (:mod:`hovercontrol.craft.models.rates`).

        Parameters
        ----------
        fastest : float
            As for :meth:`plant`.

        Examples
        --------
        >>> y, c, a = Signal("y", "V"), Signal("c", "V"), Signal("a", "1", start=0.2)
        >>> steps = {"y": (1 - a.symbol) * y.symbol + a.symbol * c.symbol}
        >>> filtered = BlockModel(Block("filter", [y], [c], [y], [a], steps, period=0.05))
        >>> print(filtered.with_effects([filtered.effect_class("y_offset")(0.1)]).rates(1e3).equations())
        y' = 20*a*c - 20*a*y + filter.y_offset
        """
        return self._amended(True, fastest, rates=True)

    def _amended(self, late: bool, fastest: float | None, *, rates: bool = False) -> Block:
        """Return the Block with the effects, or, of a sampled Block, its rates with the effects."""
        block = self._rate_form() if rates else undelayed(self.block)
        step = Signal("period", "s", "sampling period", start=block.period) if block.period else None
        lags, way = self._way(limited=rates and self.limited)
        memory = self._remembered(way, lags, step) if step and not late else {}
        swap = {s.symbol: way.thrusts[s.name] for s in block.inputs}
        derivatives = {name: e.xreplace(swap) for name, e in block.derivatives.items()}
        limit = rate_limit(self.name, fastest)
        motion = self._motion(way.thrusts, limit)
        own = self._add_terms(derivatives, lags, motion, step)
        used = set().union(
            *(e.free_symbols for e in (*derivatives.values(), *own.values(), *memory.values()))
        )
        derivatives |= {s.name: e for s, e in (own | memory).items()}
        measured = self._changed_outputs(block)
        shown = {
            s.name: block.output_expressions[s.name].xreplace(swap)
            for s in block.outputs
            if rates or s.name not in block.derivatives
        }
        parts: dict[str, Any] = {
            "states": (*block.states, *own, *memory),
            "outputs": (*block.outputs, *measured),
            "parameters": (
                *block.parameters,
                *(p for e in self.effects for p in e.signals(self.name, self._units())),
                *(s for s in (limit, step) if s and s.symbol in used),
            ),
            "derivatives": Expressions(derivatives),
            "output_expressions": Expressions({**shown, **{s.name: e for s, e in measured.items()}}),
            "definitions": Expressions({name: e.xreplace(swap) for name, e in block.definitions.items()}),
        }
        if rates:
            return block.unchecked(**parts)
        delays = {} if late or step else delays_of(self.timing(), block.inputs, self.coefficients())
        return Block(block.name, inputs=block.inputs, delays=delays, period=block.period, **parts)

    def _add_terms(
        self,
        derivatives: dict[str, sp.Expr],
        lags: Mapping[Signal, sp.Expr],
        motion: SimpleNamespace,
        step: Signal | None,
    ) -> dict[Signal, sp.Expr]:
        """Add the effects' terms to the derivatives; return the equations of the effects' own states."""
        own = dict(lags)
        for e in self.effects:
            own |= e.states(e.symbols(self.name), motion)
            for state, term in e.terms(e.symbols(self.name), motion).items():
                check_known(state, derivatives, f"effect {e.name}: {self.name!r} has no state {state!r}")
                derivatives[state] += step.symbol * term if step else term
        return {s: next_value(s, rate, step.symbol) for s, rate in own.items()} if step else own

    def _changed_outputs(self, block: Block) -> dict[Signal, sp.Expr]:
        """Return the outputs that effects of sensors change, as measured."""
        seen = self._seen()
        pairs = [(s, getattr(seen, s.name)) for s in block.outputs]
        return {as_measured(s): e for s, e in pairs if e != getattr(seen.true, s.name)}

    def _remembered(
        self, way: SimpleNamespace, lags: dict[Signal, sp.Expr], step: Signal
    ) -> dict[Signal, sp.Expr]:
        """Let the inputs of a sampled plant arrive late; return the memories of their past values."""
        arriving = delays_of(self.timing(), self.block.inputs, self.coefficients())
        if not arriving:
            return {}
        names = [name for name in self.timing() if name]
        delay = sum(self.coefficients()[name.rpartition(".")[2]] for name in names)
        swap: dict[sp.Symbol, sp.Expr] = {}
        memory: dict[Signal, sp.Expr] = {}
        for s, past in late_inputs(self.block.inputs, delay, step.start).items():
            values = [s.symbol, *(m.symbol for m in past)]
            # d = (n + r) T, 0 <= r < 1:  u arrives as (1 - r) u(k-n) + r u(k-n-1)
            n = len(past) - 1
            r = arriving[s.name] / step.symbol - n
            swap[s.symbol] = values[n] + r * (values[n + 1] - values[n])
            memory |= dict(zip(past, values, strict=False))
        for name, e in way.thrusts.items():
            way.thrusts[name] = e.xreplace(swap)
        lags.update({state: e.xreplace(swap) for state, e in lags.items()})
        return memory


def _limited(s: Signal) -> sp.Expr:
    """Return an input between its bounds."""
    low, high = (sp.Float(b) if math.isfinite(b) else None for b in (s.lower, s.upper))
    return clipped(s.symbol, low, high)


def _fits_steps(cls: type[Effect]) -> bool:
    """Return whether a sampled model can have an effect: nothing in it acts between two steps.

    The bristles of LuGre friction and a second-order lag do; a late clock is there the same as a late input.
    """
    return not (cls.name.endswith(("_lugre", "_second_order_lag")) or cls is TimeOffset)
