"""The base class of effects: one physical cause, its coefficients, and its terms in a model.

To add an effect, write one class in one file of this package (or anywhere in a script): a ``name``, the
coefficients, and one of ``terms`` (a force, with ``states`` where it has a memory of the motion),
``commands`` (between command and force) and ``measured`` (between state and log). Model files, plants,
estimators and the search for missing effects then know it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any, ClassVar, Self

import sympy as sp

from hovercontrol.base import tables
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known, did_you_mean
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.effects.coefficient import Coefficient, Shape
from hovercontrol.craft.effects.own import explain

#: A number of which nothing is known.
SMALL = 0.01


@checked
class Effect:
    """One physical cause in a model; subclasses declare it, instances carry its numbers.

    A subclass sets ``name``, ``source``, a docstring that explains it in one sentence, its numbers as class
    attributes of type :class:`Coefficient` or :class:`Shape`, and one of the methods below. The number called
    ``value`` is the effect's coefficient and carries its name among the plant's parameters
    (``plant.yaw_coulomb``); others are ``name_attribute`` (``plant.yaw_coulomb_width``).

    ``order`` sorts effects that change commands or measurements; ``craft`` is the kind of craft on which a
    search tries the effect (``"any"``, ``"rudder"`` with a propeller and a rudder, ``"fan"``); ``instead_of``
    names an effect that is the same on another craft: a model has one of the two; ``signal`` is the input on
    which the effect acts, on a machine with its own inputs; ``axis`` the velocity in whose equation alone it
    acts; ``equation`` the state to whose derivative it adds its coefficient times a form and nothing else, so
    that the forms of many are computed together. ``by_name`` says that a search considers it only where it is
    named. ``drives`` marks an effect that turns its craft's actuators into accelerations, ``turns_fans`` that
    it needs the fans' torque with their forces turned, ``shifts_time`` that it only says how late commands or
    measurements are, which no log tells apart; ``contains`` the kinds of effect that it becomes in a limit of
    its numbers; ``flexible`` that its many numbers also fit part of other effects, so that a search names it
    only where it leaves nothing but noise. ``mistaken_for`` names effects that a search might take it for: it
    is fitted in their place, and where it is surely likelier they are not named. It is itself named only
    where a search is asked for it. ``before_curve`` marks an effect that changes a command as it is sent,
    before the static curve of a fan; ``same_as`` names an effect in another place that no log of the machine
    tells apart.

    A named subclass is known by its name everywhere; with ``register=False`` only to who holds the class.

    Examples
    --------
    >>> from hovercontrol.craft.effects import effect
    >>> effect("yaw_coulomb", 0.83)
    yaw_coulomb(value=0.83, width=0.01)
    """

    name: ClassVar[str] = ""
    source: ClassVar[str] = ""
    numbers: ClassVar[dict[str, Coefficient]] = {}
    known: ClassVar[dict[str, type[Effect]]] = {}
    order: ClassVar[int] = 0
    craft: ClassVar[str] = "any"
    signal: ClassVar[str] = ""
    instead_of: ClassVar[str] = ""
    axis: ClassVar[str] = ""
    equation: ClassVar[str] = ""
    drives: ClassVar[bool] = False
    turns_fans: ClassVar[bool] = False
    shifts_time: ClassVar[bool] = False
    contains: ClassVar[tuple[type[Effect], ...]] = ()
    flexible: ClassVar[bool] = False
    mistaken_for: ClassVar[tuple[str, ...]] = ()
    before_curve: ClassVar[bool] = False
    by_name: ClassVar[bool] = False
    same_as: ClassVar[str] = ""

    def __init_subclass__(cls, *, register: bool = True, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        found = {
            k: v
            for base in reversed(cls.__mro__)
            for k, v in vars(base).items()
            if isinstance(v, Coefficient)
        }
        cls.numbers = found
        if not cls.name:
            return
        other = Effect.known.get(cls.name) if register else None
        if other and (other.__module__, other.__qualname__) != (cls.__module__, cls.__qualname__):
            raise InputError(f"an effect named {cls.name!r} is already in {other.__module__}")
        if not cls.in_package():
            explain(cls, Effect)
        if register:
            Effect.known[cls.name] = cls

    def __init__(self, value: float | None = None, **values: float) -> None:
        if value is not None:
            first = "value" if "value" in self.numbers else next(iter(self.numbers), "value")
            values = {first: value, **values}
        for key in values:
            check_known(key, self.numbers, f"effect {self.name}: unknown number {key!r}")
        self.values: dict[str, float] = {}
        for key, number in self.numbers.items():
            given: Any = values.get(key, number.default)
            if given is None:
                raise InputError(f"effect {self.name}: {key!r} is missing (unit {number.unit})")
            found = tables.finite(f"effect {self.name}: {key}", given)
            if not number.lower <= found <= number.upper:
                raise InputError(
                    f"effect {self.name}: {key} = {found:g} is out of its bounds "
                    f"[{number.lower:g}, {number.upper:g}]"
                )
            self.values[key] = found

    def __repr__(self) -> str:
        inside = ", ".join(f"{k}={v:g}" for k, v in self.values.items())
        return f"{self.name}({inside})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Effect) and (self.name, self.values) == (other.name, other.values)

    def __hash__(self) -> int:
        return hash((self.name, tuple(self.values.items())))

    @classmethod
    def within_bounds(cls, **values: float) -> Self:
        """Return the effect with proposed numbers, each clipped to its bounds.

        Parameters
        ----------
        **values : float
            By number, in its unit.

        Raises
        ------
        InputError
            If a value is not a number, or the effect has no such number.

        Examples
        --------
        >>> from hovercontrol.craft.effects import effect_class
        >>> effect_class("yaw_coulomb").within_bounds(value=-0.1, width=0.0)
        yaw_coulomb(value=0, width=1e-09)
        """
        found = {k: tables.number(f"effect {cls.name}: {k}", v) for k, v in values.items()}
        for key, bounds in cls.numbers.items():
            if key in found:
                found[key] = min(max(found[key], bounds.lower), bounds.upper)
        return cls(**found)

    @classmethod
    def small(cls) -> Self:
        """Return the effect at its neutral values; a number without a finite neutral value is small.

        Examples
        --------
        >>> from hovercontrol.craft.effects import effect_class
        >>> effect_class("yaw_coulomb").small()
        yaw_coulomb(value=0, width=0.01)
        """
        neutral = {k: n.neutral for k, n in cls.numbers.items()}
        return cls.within_bounds(**{k: v if math.isfinite(v) else SMALL for k, v in neutral.items()})

    def neutral(self) -> Self:
        """Return the effect with the numbers that scale it at their neutral values; the others are kept.

        Examples
        --------
        >>> from hovercontrol.craft.effects import effect
        >>> effect("yaw_coulomb", 0.83, width=0.02).neutral()
        yaw_coulomb(value=0, width=0.02)
        """
        neutral = {k: n.neutral for k, n in self.numbers.items() if not math.isnan(n.neutral)}
        return self.within_bounds(**{**self.values, **neutral})

    def begins(self, trial: Self) -> list[Self]:
        """Return the values at which a fit that ended too high is started again.

        A sensor error begins at its neutral value, since the path was fitted to the sensor's readings. An
        effect that one shape parameter scales, a lag for instance, is far from linear: it begins as estimated
        and at three values about the trial's. Any other effect begins as estimated.

        Parameters
        ----------
        trial : Effect
            The effect as it was tried; this one is what the trial's linear response estimates.

        Examples
        --------
        >>> from hovercontrol.craft.effects import effect
        >>> effect("gyro_bias", 0.1).begins(effect("gyro_bias", 0.01))
        [gyro_bias(value=0)]
        >>> lag = effect("thrust_lag", seconds=0.3)
        >>> [e.values["seconds"] for e in lag.begins(effect("thrust_lag", seconds=0.5))]
        [0.3, 0.2, 0.5, 1.25]
        """
        if self.kind() == "measurement":
            return [self.neutral()]
        scaling = [k for k, n in self.numbers.items() if not math.isnan(n.neutral)]
        if len(scaling) != 1 or not isinstance(self.numbers[scaling[0]], Shape):
            return [self]
        key, size = scaling[0], trial.values[scaling[0]]
        return [
            self,
            *(trial.within_bounds(**{**trial.values, key: size * part}) for part in (0.4, 1.0, 2.5)),
        ]

    def moment(self) -> str:
        """Return the number that says at what time of a log the effect sets in, ``""`` without one.

        Examples
        --------
        >>> from hovercontrol.craft.effects import effect
        >>> effect("parameter_jump", factor=1.2, seconds=20.0).moment(), effect("slope", x=0.1).moment()
        ('seconds', '')
        """
        return next((k for k, n in self.numbers.items() if isinstance(n, Shape) and n.of == "time"), "")

    def fades(self) -> bool:
        """Return whether the effect fades with speed, so that no linear response shows it near standstill.

        Examples
        --------
        >>> from hovercontrol.craft.effects import effect
        >>> effect("yaw_stribeck", 0.1, speed=0.2).fades(), effect("yaw_quadratic_drag", 0.1).fades()
        (True, False)
        """
        return any(isinstance(n, Shape) and n.of == "speed" for n in self.numbers.values())

    def kin(self, other: Effect) -> bool:
        """Return whether both act along the same axis, where widths of friction make them hard to tell apart.

        Parameters
        ----------
        other : Effect

        Examples
        --------
        >>> from hovercontrol.craft.effects import effect
        >>> effect("yaw_stribeck", 0.1, speed=0.2).kin(effect("yaw_quadratic_drag", 0.1))
        True
        """
        return self.axis == other.axis != ""

    def twin(self, other: Effect) -> bool:
        """Return whether no log can tell the two apart: shifts in time, or one cause in two places.

        Parameters
        ----------
        other : Effect

        Examples
        --------
        >>> from hovercontrol.craft.effects import effect
        >>> effect("input_delay", 0.1).twin(effect("time_offset", 0.1))
        True
        """
        if self.name == other.name:
            return False
        alike = self.same_as == other.name or other.same_as == self.name
        return alike or (self.shifts_time and other.shifts_time)

    def becomes(self, other: Effect) -> bool:
        """Return whether this effect becomes the other in a limit of its numbers.

        Parameters
        ----------
        other : Effect

        Examples
        --------
        >>> from hovercontrol.craft.effects import effect
        >>> effect("yaw_stribeck", 0.1, speed=0.2).becomes(effect("yaw_coulomb", 0.1))
        True
        """
        return self.kin(other) and isinstance(other, self.contains)

    @classmethod
    def parameter(cls, number: str) -> str:
        """Return the plant's parameter name of one of the effect's numbers.

        Parameters
        ----------
        number : str
            Name of the class attribute: ``"value"``, ``"width"``.
        """
        return cls.name if number == "value" else f"{cls.name}_{number}"

    @classmethod
    def friction_width(cls) -> str:
        """Return the parameter name of the width over which dry friction changes sign, ``""`` without one.

        A width whose neutral value removes the effect (a dead zone's) does not count.
        """
        width = cls.numbers.get("width")
        return cls.parameter("width") if width is not None and math.isnan(width.neutral) else ""

    def signals(self, owner: str, units: Mapping[str, str]) -> tuple[Signal, ...]:
        """Return the effect's numbers as parameter signals.

        Parameters
        ----------
        owner : str
            Name of the Block to which they belong.
        units : mapping of str to str
            Unit of each input, by name, for coefficients that are per unit of an input.
        """
        sentence = (type(self).__doc__ or "").strip().split("\n")[0]
        return tuple(
            Signal(
                f"{owner}.{self.parameter(key)}",
                resolved_unit(number.unit, units),
                sentence if key == "value" else f"{key} of {self.name}",
                start=self.values[key],
                nominal=abs(self.values[key]) or 1.0,
                lower=number.lower,
                upper=number.upper,
            )
            for key, number in self.numbers.items()
        )

    def symbols(self, owner: str) -> SimpleNamespace:
        """Return the symbols of the effect's numbers in a Block, by number.

        Parameters
        ----------
        owner : str
            Name of the Block.
        """
        names = {k: f"{owner}.{self.parameter(k)}" for k in self.numbers}
        return SimpleNamespace(**{k: sp.Symbol(name, real=True) for k, name in names.items()})

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        """Return the effect's terms in the derivatives of the body velocities.

        Parameters
        ----------
        c : namespace
            Symbols of the effect's own numbers.
        s : namespace
            Symbols of the motion: ``x, y, psi, u, v, r`` and ``time``; the velocity relative to the air,
            ``air_u, air_v``; of the rudder craft's commands ``thrust, rudder`` and their force vector
            ``thrust_x, thrust_y``; of a fan craft's wrench ``fan_x, fan_y, fan_torque`` and, with all forces
            turned by 90 degrees to the left, ``fan_cross_torque``. Two dicts have every input by name:
            ``inputs`` the commands as they are sent, ``thrusts`` what input effects make of them (of a fan
            its force [N]). The effect's own :meth:`states` are known by their signals.

        Returns
        -------
        dict of str to sympy.Expr
            Keys ``"u"``, ``"v"``, ``"r"``; accelerations [m/s^2, m/s^2, rad/s^2].
        """
        return {}

    def motion(self, c: Any, s: Any) -> None:
        """Change the motion used by other effects, in place: ``s.air_u`` in a wind, ``s.thrust_x``.

        Parameters
        ----------
        c, s : namespace
            As for :meth:`terms`.
        """

    def commands(self, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        """Change the commands before they become forces, in place.

        Parameters
        ----------
        c : namespace
            Symbols of the effect's own numbers.
        s : namespace
            ``thrusts``, a dict of the thrust command (or the fans' forces) by name, ``rudder``, ``time``,
            ``inputs``, a dict of all commands as they are sent, and ``units`` of the commands by name. With
            ``before_curve``, ``thrusts`` has the signals of the fans instead of their forces.

        Returns
        -------
        dict of Signal to sympy.Expr
            The effect's states and their derivatives, functions of the commands only.
        """
        return {}

    def states(self, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        """Return the effect's own states, which its terms use, and their derivatives.

        Parameters
        ----------
        c, s : namespace
            As for :meth:`terms`; ``s.fastest`` is the largest rate of the states [1/s], or None. A fit needs
            it: a state that is faster than its sub-step makes it unstable.

        Returns
        -------
        dict of Signal to sympy.Expr
            Derivatives may depend on the motion, on commands and on the states themselves.
        """
        return {}

    def measured(self, c: Any, s: Any) -> None:
        """Change the measured values, in place: ``s.x, s.y, s.psi, s.u, s.v, s.r``; ``s.true`` is the motion.

        Parameters
        ----------
        c : namespace
            Symbols of the effect's own numbers.
        s : namespace
            Symbols of the measured values.
        """

    def factors(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        """Return factors on other effects' coefficients, by effect name.

        Parameters
        ----------
        c, s : namespace
            As for :meth:`terms`.
        """
        return {}

    def inertia(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        """Return factors on the terms of all other effects, by equation ``u``, ``v``, ``r``.

        Parameters
        ----------
        c, s : namespace
            As for :meth:`terms`.
        """
        return {}

    @classmethod
    def in_package(cls) -> bool:
        """Return whether the effect belongs to the package."""
        return cls.__module__.startswith("hovercontrol.")

    @classmethod
    def place(cls) -> str:
        """Return where in the loop the effect acts; derived from what the class defines.

        Returns
        -------
        {"command", "actuator", "force", "sensor", "clock"}
            The command as it is sent, what an actuator makes of it, the forces, one sensor, or the clock of
            all measurements.

        Examples
        --------
        >>> from hovercontrol.craft.effects import effect_class
        >>> [effect_class(n).place() for n in ("input_delay", "thrust_lag", "slope", "gyro_bias")]
        ['command', 'actuator', 'force', 'sensor']
        """
        if cls.kind() == "measurement":
            return "clock" if cls.shifts_time else "sensor"
        if cls.kind() == "input":
            return "command" if cls.shifts_time or cls.before_curve else "actuator"
        return "force"

    @classmethod
    def kind(cls) -> str:
        """Return ``"input"``, ``"measurement"`` or ``"force"``: where the effect acts."""
        if cls.commands is not Effect.commands:
            return "input"
        return "measurement" if cls.measured is not Effect.measured else "force"


def resolved_unit(unit: str, inputs: Mapping[str, str]) -> str:
    """Return a unit with the units of inputs inserted; a dimensionless input's unit is omitted."""
    braced = {name: f"({u})" if set(u) & set("*/^ ") else u for name, u in inputs.items()}
    try:
        return unit.format(**braced).replace("/1", "")
    except KeyError as error:
        hint = did_you_mean(str(error.args[0]), inputs)
        raise InputError(f"unit {unit!r}: unknown input {error.args[0]!r}{hint}") from None
