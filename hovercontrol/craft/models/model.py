"""A model: a craft as a list of effects.

Planar rigid-body motion plus that list is the plant.

Body frame: surge u forward, sway v to the left, yaw rate r counter-clockwise; earth frame x, y, heading psi.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.units import UnitError
from hovercontrol.craft.effects import Effect, effect_class, effect_names
from hovercontrol.craft.effects.base import resolved_unit
from hovercontrol.craft.effects.fan_classes import fan_effects
from hovercontrol.craft.models.actuated import saturated
from hovercontrol.craft.models.base import EffectModel, as_measured, delays_of, effect_lines, rate_limit
from hovercontrol.craft.models.effect_equations import (
    accelerations,
    apply_to_commands,
    measured_motion,
    own_states,
)
from hovercontrol.craft.models.fans import Fan as Fan
from hovercontrol.craft.models.fans import fans_alike
from hovercontrol.craft.models.motion import MOTION, RUDDER, THRUST, craft_units, motion_symbols
from hovercontrol.craft.models.physical import BODY, carried_by, coefficient_of, force_unit


@checked
@dataclass(frozen=True)
class Model(EffectModel):
    """A craft: its name, its effects, and where its commands enter.

    Parameters
    ----------
    name : str
        Name used in figures and files.
    effects : sequence of Effect
        Each name at most once.
    thrust, rudder : Signal, optional
        Commands of the rudder craft, if unit or bounds differ from the default.
    fans : sequence of Fan, optional
        The fans of a fan craft.
    limited : bool, optional
        Whether the plant's commands saturate at their bounds, before any effect acts on them.
    mass : float, optional
        m [kg]. With it, forces may be given in newton and are shown in newton, too.
    inertia : float, optional
        J about the vertical axis [kg m^2]; the same for torques.

    Raises
    ------
    InputError
        If an effect is listed twice, an effect needs fans and there are none, or mass or inertia is not
        positive.

    Examples
    --------
    >>> from hovercontrol.craft.effects import effect
    >>> craft = Model("puck", [effect("surge_linear_drag", 0.4), effect("thrust", 2.0)])
    >>> print(craft.with_effects([]).plant().equations().splitlines()[5])
    r' = 0
    """

    is_craft: ClassVar[bool] = True

    name: str
    effects: tuple[Effect, ...] = ()
    thrust: Signal = THRUST
    rudder: Signal = RUDDER
    fans: tuple[Fan, ...] = field(default=())
    limited: bool = False
    mass: float | None = None
    inertia: float | None = None

    def __repr__(self) -> str:
        fans = [f"{len(self.fans)} fans"] if self.fans else []
        body = [f"{part} {size:g} {BODY[part][0]}" for part, size in self.body.items() if size is not None]
        head = ", ".join([f"Model {self.name!r}: {len(self.effects)} effects", *fans, *body])
        return "\n".join([head, *effect_lines(self.effects)])

    def __post_init__(self) -> None:
        object.__setattr__(self, "effects", tuple(self.effects))
        object.__setattr__(self, "fans", tuple(self.fans))
        self._refuse_twice()
        for part, size in self.body.items():
            if size is not None:
                object.__setattr__(self, part, positive(f"model {self.name!r}: {part}", size))
        names = [e.name for e in self.effects]
        inputs = [THRUST.name, RUDDER.name, *(f.name for f in self.fans)]
        for name in inputs:
            if inputs.count(name) > 1 or name in {s.name for s in MOTION}:
                raise InputError(f"model {self.name!r}: the name of the fan {name!r} is taken")
        if self.rudder.dimension != RUDDER.dimension:
            raise InputError(
                f"model {self.name!r}: the rudder's unit is {RUDDER.unit}, not {self.rudder.unit}"
            )
        for e in self.effects:
            if e.craft == "fan" and not self.fans:
                raise InputError(f"model {self.name!r}: the effect {e.name!r} needs fans, there are none")
            if e.instead_of in names:
                raise InputError(
                    f"model {self.name!r}: the effects {e.instead_of!r} and {e.name!r} are the same: keep one"
                )

    @property
    def body(self) -> dict[str, float | None]:
        """Mass [kg] and inertia [kg m^2], each None where it is not given."""
        return {"mass": self.mass, "inertia": self.inertia}

    @property
    def motion(self) -> tuple[str, ...]:
        """Pose and body velocities."""
        return tuple(s.name for s in MOTION)

    @property
    def pushed(self) -> tuple[str, ...]:
        """The body velocities."""
        return tuple(s.name for s in MOTION[3:])

    @property
    def signature(self) -> tuple[Hashable, ...]:
        """Everything that determines the plant's equations except the values of coefficients."""
        inputs = (self.thrust, self.rudder, fans_alike(self.fans), self.limited)
        return (self.name, *inputs, *(type(e) for e in self.effects))

    def _repr_html_(self) -> str:
        from hovercontrol.craft.models.display import model_html

        return model_html(self)

    def accepts(self, cls: type[Effect]) -> bool:
        """Return whether the model can take the effect: the craft has the equation or input on which it acts.

        Of two effects that are the same on different craft (``thrust_lag``, ``fan_lag``), a model takes only
        the one of its own craft, and neither if it already has the other.
        """
        names = {e.name for e in self.effects}
        if cls.instead_of in names:
            return False
        driven = {e.craft for e in self.effects if e.drives}
        has_rudder, uses_fans = "rudder" in driven, "fan" in driven
        if cls.craft == "fan":
            if cls.before_curve and all(f.curve is None for f in self.fans):
                return False  # the same as the effect on the force
            return (uses_fans and self._takes(cls)) or (bool(self.fans) and cls.drives)
        if cls.craft == "rudder":
            return has_rudder
        return cls.kind() != "input" or has_rudder or uses_fans

    def _takes(self, cls: type[Effect]) -> bool:
        """Return whether an effect of one fan is of a fan of this model; True for all other effects."""
        return not cls.signal or self._of_fans().get(cls.name) is cls

    def _of_fans(self) -> dict[str, type[Effect]]:
        """Return the effects of single fans; a fan with a gain has that one as a coefficient already."""
        each = {name: cls for f in self.fans for name, cls in fan_effects(f.name).items()}
        given = {f"{f.name}_gain" for f in self.fans if f.gain is not None}
        return {name: cls for name, cls in each.items() if name not in given}

    def effect_class(self, name: str) -> type[Effect]:
        """Return the class of an effect: a known one, or one of a single fan (``left_gain``).

        Raises
        ------
        InputError
            If no effect has that name; the message names the nearest one.
        """
        own = self._of_fans()
        return own[name] if name in own else super().effect_class(name)

    def candidates(self) -> tuple[type[Effect], ...]:
        """Return all known effects that could be added to the model.

        Effects that a search considers only on request (``mass_drift``) are left out.

        Examples
        --------
        >>> names = [cls.name for cls in Model("puck", [effect_class("thrust")(1.0)]).candidates()]
        >>> "input_delay" in names, "fan_delay" in names, "thrust" in names
        (True, False, False)
        """
        have = {e.name for e in self.effects}
        named = (effect_class(name) for name in effect_names())
        known = (cls for cls in (*named, *self._of_fans().values()) if cls.name not in have)
        return tuple(cls for cls in known if self.accepts(cls) and not (cls.mistaken_for or cls.by_name))

    def coefficients(self) -> dict[str, float]:
        """Return all coefficients of the effects, and given gains of fans, by parameter name."""
        gains = {f"{f.name}_gain": f.gain for f in self.fans if f.gain is not None}
        return self._effect_coefficients() | gains

    @checked
    def with_coefficients(self, values: Mapping[str, float]) -> Model:
        """Return the model with other values, by parameter name (``yaw_coulomb``, ``yaw_coulomb_width``).

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
        fans = (
            f if f.gain is None else replace(f, gain=values.get(f"{f.name}_gain", f.gain)) for f in self.fans
        )
        return replace(self, effects=self._renumbered_effects(values), fans=tuple(fans))

    @checked
    def with_forces(self, values: Mapping[str, tuple[float, str]]) -> Model:
        """Return the model with effects whose coefficients are given with their units, newtons for instance.

        The coefficient is the force divided by the mass, the torque divided by the inertia [C17 eq 9, 10].

        Parameters
        ----------
        values : mapping of str to (float, str)
            By effect: value and unit.

        Raises
        ------
        InputError
            If an effect is unknown, or a unit is one of a force and the model has no mass.

        Examples
        --------
        >>> boat = Model("boat", mass=4.0).with_forces({"surge_linear_drag": (1.2, "N*s/m")})
        >>> boat.coefficients(), boat.forces()
        ({'surge_linear_drag': 0.3}, {'surge_linear_drag': (1.2, 'N*s/m')})
        """
        return self.with_effects(self._given(name, *value) for name, value in values.items())

    def _given(self, name: str, value: float, unit: str) -> Effect:
        cls = self.effect_class(name)
        if "value" not in cls.numbers:
            raise InputError(f"effect {name}: has no coefficient, its numbers are {', '.join(cls.numbers)}")
        wanted = resolved_unit(cls.numbers["value"].unit, self.units_seen_by(cls))
        try:
            return cls(coefficient_of(cls, value, unit, wanted, self.body))
        except UnitError as error:
            raise UnitError(f"effect {name}: {error}") from None

    def force_scales(self) -> dict[str, tuple[float, str]]:
        """Return what turns each coefficient into a force: the mass or the inertia, and the force's unit.

        Effects that are no forces, and those whose mass or inertia is not given, are left out.
        """
        found = {}
        for cls in (type(e) for e in self.effects):
            size = self.body.get(carried_by(cls))
            if size is not None:
                unit = resolved_unit(cls.numbers["value"].unit, self.units_seen_by(cls))
                found[cls.name] = size, force_unit(carried_by(cls), unit)
        return found

    def forces(self) -> dict[str, tuple[float, str]]:
        """Return coefficients times mass or inertia, with their units, as :meth:`with_forces` takes them."""
        known = self.coefficients()
        return {name: (size * known[name], unit) for name, (size, unit) in self.force_scales().items()}

    def input_units(self) -> dict[str, str]:
        """Return the unit of each command."""
        fans = {f.name: f.command().unit for f in self.fans}
        return {"thrust": self.thrust.unit, "rudder": self.rudder.unit} | fans

    def law_units(self) -> dict[str, str]:
        """Return the unit of each signal that a law may use: the motion, commands as they act, time."""
        return craft_units(self.thrust.unit, self.rudder.unit, bool(self.fans))

    def units_seen_by(self, cls: type[Effect]) -> dict[str, str]:
        """Return the units that replace ``{thrust}`` and the like in an effect's units."""
        if not self.fans or cls.kind() != "input":
            return self.input_units()
        return {"thrust": "N", "rudder": self.rudder.unit} | {f.name: "N" for f in self.fans}

    def input_size(self, cls: type[Effect], inputs: Mapping[str, ArrayLike]) -> float:
        """Return the largest magnitude of an input effect's input: the thrust, or the fans' forces.

        Parameters
        ----------
        cls : type of Effect
            A class with a shape parameter in multiples of the input (``of="input"``).
        inputs : mapping of str to array_like
            Commands of logs by name.
        """
        fans = [f for f in self.fans if f.name in inputs and cls.signal in ("", f.name)]
        acting = [f.forces(inputs[f.name]) for f in fans]
        if not self.fans and THRUST.name in inputs:
            acting = [np.asarray(inputs[THRUST.name])]
        return max((float(np.abs(a).max(initial=0.0)) for a in acting), default=0.0)

    def parameters(self, owner: str = "plant") -> tuple[Signal, ...]:
        """Return the coefficients of all effects and the numbers of the fans as parameters of a Block.

        Parameters
        ----------
        owner : str, optional
            Name of the Block.
        """
        effects = tuple(s for e in self.effects for s in e.signals(owner, self.units_seen_by(type(e))))
        fans = tuple(p for f in self.fans for p in f.parameters(owner))
        turned = any(e.turns_fans for e in self.effects)
        return effects + fans + (tuple(f.cross_arm(owner) for f in self.fans) if turned else ())

    def linear_coefficients(self) -> tuple[str, ...]:
        """Return the names of the coefficients in which the plant is linear; an estimator can estimate these.

        They include given gains of fans. Only ratios of these gains are determined.
        """
        return (*self._linear_in_effects(), *(f"{f.name}_gain" for f in self.fans if f.gain is not None))

    def measurements(self, owner: str = "plant") -> dict[str, sp.Expr]:
        """Return the measured quantities that differ from the motion, by ``u, v, r``...

        Expressions in the plant's states and parameters; empty if the model has no measurement effect.

        Parameters
        ----------
        owner : str, optional
            Name of the Block.
        """
        seen = measured_motion(self.effects, owner)
        every = {s.name: getattr(seen, s.name) for s in MOTION}
        return {name: e for name, e in every.items() if e != getattr(seen.true, name)}

    def timing(self, owner: str = "plant") -> tuple[str, ...]:
        """Return the parameter names of the input delay and the measurement delay; ``""`` for none.

        No equation of the plant contains them: its inputs have delays (:attr:`Block.delays`), and readers of
        logs shift the time.

        Parameters
        ----------
        owner : str, optional
            Name of the Block.
        """
        s = motion_symbols(self.fans, owner)
        _, sent = apply_to_commands(self.effects, self.fans, self.input_units(), owner, s)
        return str(sent.delay or ""), str(measured_motion(self.effects, owner).late or "")

    def plant(
        self,
        name: str = "plant",
        *,
        late: bool = False,
        fastest: float | None = None,
        limited: bool | None = None,
    ) -> Block:
        """Return the plant: rigid-body motion [C17 eq 8, 11] with the model's effects.

        Parameters
        ----------
        name : str, optional
            Name of the Block, the prefix of its parameter keys.
        late : bool, optional
            Whether the caller shifts commands and clock itself (:meth:`timing`); the plant then has no
            delays.
        fastest : float, optional
            Largest rate of the states of effects [1/s], for coarse steps.
        limited : bool, optional
            Saturate each command at its bounds before any effect acts on it, in every backend; the outputs
            ``thrust_applied``... are the saturated commands
            (:func:`~hovercontrol.craft.models.actuated.actuated`). Default: the model's own setting.

        Returns
        -------
        Block
            States ``x, y, psi, u, v, r``, states of input effects (``thrust_lagged``) and of force effects
            (``lugre_u``). Outputs: the motion, and measured quantities that differ from it (``r_measured``).
            Inputs: the commands that an effect uses. With late measurements, all signals and the time are
            those of the log's clock: the motion follows the commands with that delay.

        Raises
        ------
        InputError
            If the delays make commands act before they are sent, or `fastest` is not positive.
        """
        s = motion_symbols(self.fans, name)
        limit = rate_limit(name, fastest)
        s.fastest = limit.symbol if limit else None
        lags, _ = apply_to_commands(self.effects, self.fans, self.input_units(), name, s)
        force = accelerations(self.effects, name, s)
        states = lags | own_states(self.effects, name, s)
        used = set().union(*(f.free_symbols for f in (*force.values(), *states.values())))
        limits = (limit,) if limit and limit.symbol in used else ()
        changed = self.measurements(name)
        seen = {as_measured(s): changed[s.name] for s in MOTION if s.name in changed}
        commands = (self.thrust, self.rudder, *(f.command() for f in self.fans))
        inputs = tuple(c for c in commands if c.symbol in used)
        block = Block(
            name,
            states=(*MOTION, *states),
            inputs=inputs,
            delays={} if late else delays_of(self.timing(name), inputs, self.coefficients()),
            outputs=(*MOTION, *seen),
            parameters=(*self.parameters(name), *limits),
            output_expressions={signal.name: e for signal, e in seen.items()},
            derivatives={
                "x": s.u * sp.cos(s.psi) - s.v * sp.sin(s.psi),
                "y": s.u * sp.sin(s.psi) + s.v * sp.cos(s.psi),
                "psi": s.r,
                "u": s.v * s.r + force["u"],
                "v": -s.u * s.r + force["v"],
                "r": force["r"],
                **{state.name: slope for state, slope in states.items()},
            },
        )
        return saturated(block) if (self.limited if limited is None else limited) else block
