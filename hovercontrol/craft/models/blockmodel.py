"""A model made of any Block and added effects: a servo with friction, a ship, an own plant."""

from __future__ import annotations

import contextlib
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delays import undelayed
from hovercontrol.blocks.derivatives import linear_parameters, nonzero_parameters
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.summary import block_line
from hovercontrol.craft.effects import Effect, effect_class
from hovercontrol.craft.effects.command import InputDelay
from hovercontrol.craft.effects.generic import generic_effects
from hovercontrol.craft.effects.law import is_law, law_class
from hovercontrol.craft.effects.measurement import TimeOffset
from hovercontrol.craft.models.actuated import saturated
from hovercontrol.craft.models.base import EffectModel, effect_lines
from hovercontrol.craft.models.block_equations import BlockEquations
from hovercontrol.craft.models.functions import KnownFunction
from hovercontrol.craft.models.rates import equals_period, rate_form

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

    def rate_form(self) -> Block:
        """Return the continuous Block with the rates of a sampled one."""
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
        motion = BlockEquations(self).motion({s.name: s.symbol for s in self.block.inputs})
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
        found = generic_effects(self.rate_form())
        return {name: cls for name, cls in found.items() if _fits_steps(cls)}

    def accepts(self, cls: type[Effect]) -> bool:
        """Return whether the model can take the effect."""
        if self.catalogue is None:
            return self._generic.get(cls.name) is cls
        return cls.name in self.catalogue

    def candidates(self) -> tuple[type[Effect], ...]:
        """Return the effects that could be added to the model."""
        have = {e.name for e in self.effects}
        if self.catalogue is not None:
            return tuple(self.effect_class(name) for name in self.catalogue if name not in have)
        return tuple(c for name, c in self._generic.items() if name not in have and not c.mistaken_for)

    def outside(self) -> tuple[type[Effect], ...]:
        """Return the effects that are tried only in place of others, which may be mistaken for them."""
        own = (cls for cls in self._generic.values() if cls.mistaken_for and self.accepts(cls))
        return (*super().outside(), *own)

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

    def shared_units(self) -> dict[str, str]:
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
        _, way = BlockEquations(self).commands()
        return str(way.delay or ""), str(BlockEquations(self).measurements().late or ""), self._own_delay

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
        block = BlockEquations(self).amended(late, fastest) if self.effects else plain
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
        return BlockEquations(self).amended(True, fastest, rates=True)


def _fits_steps(cls: type[Effect]) -> bool:
    """Return whether a sampled model can have an effect: nothing in it acts between two steps.

    The bristles of LuGre friction and a second-order lag do; a late clock is there the same as a late input.
    """
    return not (cls.name.endswith(("_lugre", "_second_order_lag")) or cls is TimeOffset)
