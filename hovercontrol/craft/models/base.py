"""Interface of all models: a craft as a list of effects, or a Block with added effects."""

from __future__ import annotations

import math
import textwrap
from abc import ABC, abstractmethod
from collections.abc import Collection, Hashable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, Self, cast

import sympy as sp
from numpy.typing import ArrayLike

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known, did_you_mean
from hovercontrol.base.short_repr import WIDTH, listed
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.effects import Effect, Shape, effect_class, effect_names
from hovercontrol.craft.effects.law import is_law, law_class

#: What the output is called that shows a quantity as its sensor sees it, behind the quantity's name.
_MEASURED = "_measured"


def effect_lines(effects: Sequence[Effect]) -> list[str]:
    """Return effects and their values as lines of text."""
    text = listed(map(repr, effects), len(effects))
    return textwrap.wrap(text, WIDTH, initial_indent="  ", subsequent_indent="  ")


class EffectModel(ABC):
    """A list of effects and the resulting plant; estimation and the search for effects use this interface.

    Attributes
    ----------
    is_craft : bool
        Whether the model is a planar craft with pose and body velocities, so that its logs have a frame.
    """

    is_craft: ClassVar[bool] = False

    @property
    def period(self) -> float:
        """Sampling period of a model that holds next values [s]; 0 for a continuous one."""
        return 0.0

    def periods(self) -> tuple[str, ...]:
        """Return the names of the parameters that are the sampling period; they are known."""
        return ()

    @property
    def pushed(self) -> tuple[str, ...]:
        """States whose equations an effect may extend though no effect of the model acts there yet."""
        return ()

    def outside(self) -> tuple[type[Effect], ...]:
        """Return the effects that are tried only in place of others, which may be mistaken for them."""
        every = (effect_class(name) for name in effect_names())
        return tuple(cls for cls in every if cls.mistaken_for and self.accepts(cls))

    if TYPE_CHECKING:

        @property
        def name(self) -> str:
            """Name used in files and messages."""

        @property
        def effects(self) -> tuple[Effect, ...]:
            """The effects of the model."""

    @property
    @abstractmethod
    def signature(self) -> tuple[Hashable, ...]:
        """Everything that determines the plant's equations except the values of coefficients."""

    @property
    @abstractmethod
    def motion(self) -> tuple[str, ...]:
        """States of the motion, without the states that effects add."""

    @abstractmethod
    def accepts(self, cls: type[Effect]) -> bool:
        """Return whether the model can take the effect."""

    @abstractmethod
    def candidates(self) -> tuple[type[Effect], ...]:
        """Return the effects that could be added to the model."""

    @abstractmethod
    def coefficients(self) -> dict[str, float]:
        """Return all coefficients by parameter name."""

    @abstractmethod
    def with_coefficients(self, values: Mapping[str, float]) -> Self:
        """Return the model with other values, by parameter name."""

    @abstractmethod
    def linear_coefficients(self) -> tuple[str, ...]:
        """Return the names of the coefficients in which the plant is linear."""

    def free_coefficients(self) -> tuple[str, ...]:
        """Return the names of the coefficients that a fit estimates by default."""
        return self.linear_coefficients()

    def sign_keeping(self) -> frozenset[str]:
        """Return the coefficients that keep their sign, since the equations are not defined at zero."""
        return frozenset()

    @abstractmethod
    def input_units(self) -> dict[str, str]:
        """Return the unit of each input."""

    @abstractmethod
    def input_size(self, cls: type[Effect], inputs: Mapping[str, ArrayLike]) -> float:
        """Return the largest magnitude of the input on which an input effect acts."""

    @abstractmethod
    def timing(self) -> tuple[str, ...]:
        """Return the parameter names of the input delay and the measurement delay; ``""`` for none."""

    @abstractmethod
    def plant(
        self, *, late: bool = False, fastest: float | None = None, limited: bool | None = None
    ) -> Block:
        """Return the plant.

        With `late` it has no delays; the caller shifts commands and clock. `fastest` [1/s], if given, bounds
        the rate of the states of effects. With `limited` (default: the model's own setting) inputs saturate
        at their bounds.
        """

    # ---- the same for all ----------------------------------------------------------------------------

    def effect_class(self, name: str) -> type[Effect]:
        """Return the class of an effect by its name.

        Raises
        ------
        InputError
            If no effect has that name; the message names the nearest one.
        """
        return law_class(name, self.law_units()) if is_law(name) else effect_class(name)

    @abstractmethod
    def law_units(self) -> dict[str, str]:
        """Return the unit of each signal that a law may use: states, commands as they act, time."""

    @checked
    def effect(self, name: str) -> Effect:
        """Return the effect of that name.

        Raises
        ------
        InputError
            If the model has no such effect; the message names the nearest one.
        """
        for effect in self.effects:
            if effect.name == name:
                return effect
        hint = did_you_mean(name, [e.name for e in self.effects])
        raise InputError(f"model {self.name!r} has no effect {name!r}{hint}")

    @checked
    def with_effects(self, effects: Iterable[Effect]) -> Self:
        """Return the model with these effects added; effects of the same name are replaced."""
        new = {e.name: e for e in self.effects} | {e.name: e for e in effects}
        return cast(Self, replace(cast(Any, self), effects=tuple(new.values())))

    def without_effects(self, *names: str) -> Self:
        """Return the model without the named effects."""
        left = tuple(e for e in self.effects if e.name not in names)
        return cast(Self, replace(cast(Any, self), effects=left))

    def force_scales(self) -> dict[str, tuple[float, str]]:
        """Return, by coefficient, the mass or inertia that turns it into a force, and the force's unit."""
        return {}

    def coefficient_name(self, name: str) -> str:
        """Return the name of a coefficient, given with or without the plant's name in front."""
        return name.rpartition(".")[2]

    def nominal_sizes(self) -> dict[str, float]:
        """Return the nominal size of each coefficient, the scale of its error."""
        return {name: abs(value) or 1.0 for name, value in self.coefficients().items()}

    def _refuse_twice(self) -> None:
        names = [e.name for e in self.effects]
        for name in names:
            if names.count(name) > 1:
                raise InputError(f"model {self.name!r}: the effect {name!r} is listed twice")

    def _refuse_unknown(self, names: Iterable[str]) -> None:
        known = self.coefficients()
        for name in names:
            check_known(name, known, f"model {self.name!r} has no coefficient {name!r}")

    def _effect_coefficients(self) -> dict[str, float]:
        return {e.parameter(k): v for e in self.effects for k, v in e.values.items()}

    def _linear_in_effects(self) -> tuple[str, ...]:
        numbers = ((e.parameter(k), n) for e in self.effects for k, n in e.numbers.items())
        return tuple(name for name, n in numbers if not isinstance(n, Shape))

    def _renumbered_effects(self, values: Mapping[str, float]) -> tuple[Effect, ...]:
        return tuple(
            type(e)(**{k: values.get(e.parameter(k), v) for k, v in e.values.items()}) for e in self.effects
        )


def as_measured(signal: Signal) -> Signal:
    """Return the plant's output for a quantity as its sensor measures it."""
    return signal.replace(name=signal.name + _MEASURED, description=f"{signal.description}, measured")


def output_for_channel(outputs: Collection[str], channel: str) -> str:
    """Return the output that corresponds to a channel of a log: the measured one where a sensor has an error.

    Examples
    --------
    >>> output_for_channel(["u", "r", "r_measured"], "r"), output_for_channel(["u", "r", "r_measured"], "u")
    ('r_measured', 'u')
    """
    measured = channel + _MEASURED
    return measured if measured in outputs else channel


def quantity_of(output: str) -> tuple[str, bool]:
    """Return the quantity of an output, and whether it is the measured one.

    Examples
    --------
    >>> quantity_of("r_measured"), quantity_of("u")
    (('r', True), ('u', False))
    """
    return output.removesuffix(_MEASURED), output.endswith(_MEASURED)


def rate_limit(owner: str, fastest: float | None) -> Signal | None:
    """Return the parameter for the largest rate of the states of effects.

    Raises
    ------
    InputError
        If the rate is not positive.
    """
    if fastest is None:
        return None
    if not 0.0 < fastest < math.inf:
        raise InputError(f"fastest: expected a positive rate in 1/s, found {fastest:g}")
    return Signal(f"{owner}.fastest", "1/s", start=fastest)


def delays_of(
    timing: tuple[str, ...], inputs: Iterable[Signal], values: Mapping[str, float]
) -> dict[str, sp.Expr]:
    """Return the total delay from command to measurement: input delay plus delay of the measurements' clock.

    Parameters
    ----------
    timing : tuple of str
        As of :meth:`EffectModel.timing`.
    values : mapping
        Of the coefficients, as :meth:`EffectModel.coefficients`.

    Raises
    ------
    InputError
        If it is negative.
    """
    names = [name for name in timing if name]
    total = sum(values[name.rpartition(".")[2]] for name in names)
    if total < 0:
        raise InputError(
            f"{' + '.join(names)} = {total:g} s: measurements would react to commands before they are "
            "sent, which cannot be simulated; shift the log's commands and leave the effect out"
        )
    delay = sp.Add(*(sp.Symbol(name, real=True) for name in names))
    return {s.name: delay for s in inputs} if names else {}
