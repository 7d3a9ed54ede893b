"""A model: a craft as a list of effects (over 500 lines: one public class, half of it docstrings).

Planar rigid-body motion plus that list is the plant.

Body frame: surge u forward, sway v to the left, yaw rate r counter-clockwise; earth frame x, y, heading psi.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike

from hovercontrol.core.block import Block
from hovercontrol.core.boundary import checked
from hovercontrol.core.signals import Signal, time
from hovercontrol.effects import Effect, effect_class, effect_names
from hovercontrol.effects.fan_classes import fan_effects
from hovercontrol.errors import InputError
from hovercontrol.models.actuated import saturated
from hovercontrol.models.base import EffectModel, as_measured, delays_of, effect_lines, rate_limit
from hovercontrol.models.fans import Fan as Fan

#: What effects make of commands, by all that it depends on.
_WAYS: dict[tuple[Hashable, ...], tuple[dict[Signal, sp.Expr], SimpleNamespace]] = {}

#: The six states of every plant [C17 eq 8] [K06 eq 2.2, 2.5].
MOTION = (
    Signal("x", "m", "position, earth frame"),
    Signal("y", "m", "position, earth frame"),
    Signal("psi", "rad", "heading"),
    Signal("u", "m/s", "surge velocity"),
    Signal("v", "m/s", "sway velocity"),
    Signal("r", "rad/s", "yaw rate"),
)

#: The commands of a craft with one propeller and a rudder (T and theta in C17).
THRUST = Signal("thrust", "1", "thrust command")
RUDDER = Signal("rudder", "rad", "rudder angle", nominal=0.5)


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

    Raises
    ------
    InputError
        If an effect is listed twice, or an effect needs fans and there are none.

    Examples
    --------
    >>> from hovercontrol.effects import effect
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

    def __repr__(self) -> str:
        fans = [f"{len(self.fans)} fans"] if self.fans else []
        head = ", ".join([f"Model {self.name!r}: {len(self.effects)} effects", *fans])
        return "\n".join([head, *effect_lines(self.effects)])

    def __post_init__(self) -> None:
        object.__setattr__(self, "effects", tuple(self.effects))
        object.__setattr__(self, "fans", tuple(self.fans))
        self._refuse_twice()
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
        inputs = (self.thrust, self.rudder, self._fans_alike(), self.limited)
        return (self.name, *inputs, *(type(e) for e in self.effects))

    def _fans_alike(self) -> tuple[Fan, ...]:
        """Return the fans with gains of 1."""
        return tuple(f if f.gain is None else replace(f, gain=1.0) for f in self.fans)

    def _repr_html_(self) -> str:
        from hovercontrol.models.display import model_html

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

    def accelerations(self, owner: str, motion: SimpleNamespace) -> dict[str, sp.Expr]:
        """Return the sum of all effects' terms, by equation ``u``, ``v``, ``r``.

        Parameters
        ----------
        owner : str
            Name of the Block; its parameters are the coefficients.
        motion : namespace
            As :func:`motion_symbols` gives it, or with other expressions in its place.

        Raises
        ------
        InputError
            If the terms of an effect are not a dict with these keys.
        """
        total = dict.fromkeys(("u", "v", "r"), sp.S.Zero)
        seen = self._motion_seen(owner, motion)
        factors: dict[str, sp.Expr] = {}
        for e in self.effects:
            for name, factor in e.factors(e.symbols(owner), seen).items():
                factors[name] = factors.get(name, sp.S.One) * factor
        masses: dict[str, dict[str, sp.Expr]] = {axis: {} for axis in total}
        for e in self.effects:
            for axis, factor in e.inertia(e.symbols(owner), seen).items():
                masses[axis][e.name] = factor
        for e in self.effects:
            terms = e.terms(e.symbols(owner), seen)
            if not isinstance(terms, dict) or not set(terms) <= set(total):
                raise InputError(
                    f"effect {e.name}: terms() must return a dict with keys u, v, r, not {terms!r}"
                )
            for axis, term in terms.items():
                mass = sp.Mul(*(m for name, m in masses[axis].items() if name != e.name))
                total[axis] += factors.get(e.name, sp.S.One) * mass * term
        return total

    def _motion_seen(self, owner: str, motion: SimpleNamespace) -> SimpleNamespace:
        """Apply the effects that change the motion seen by all effects."""
        seen = SimpleNamespace(**vars(motion))
        for e in self.effects:
            e.motion(e.symbols(owner), seen)
        return seen

    def own_states(self, owner: str, motion: SimpleNamespace) -> dict[Signal, sp.Expr]:
        """Return the states that effects add to the motion, with their derivatives.

        Parameters
        ----------
        owner, motion
            As of :meth:`accelerations`.
        """
        seen = self._motion_seen(owner, motion)
        return {k: d for e in self.effects for k, d in e.states(e.symbols(owner), seen).items()}

    def _command_way(
        self, owner: str, motion: SimpleNamespace
    ) -> tuple[dict[Signal, sp.Expr], SimpleNamespace]:
        """Apply the input effects to the commands; return the derivatives of their states, and the commands.

        The result is kept, because SymPy is slow on nested limits and dead zones.
        """
        changing = sorted((e for e in self.effects if e.kind() == "input"), key=lambda e: e.order)
        key = (owner, self.thrust, self.rudder, self._fans_alike(), *(type(e) for e in changing))
        if key not in _WAYS:
            if len(_WAYS) > 500:
                _WAYS.clear()
            sent = {f.name: f.command().symbol for f in self.fans} or {THRUST.name: motion.thrust}
            way = SimpleNamespace(
                thrusts=sent,
                rudder=motion.rudder,
                inputs=dict(motion.inputs),
                time=time,
                units=self.input_units(),
                delay=None,
            )
            states: dict[Signal, sp.Expr] = {}
            for e in (e for e in changing if e.before_curve):
                states |= e.commands(e.symbols(owner), way)
            way.thrusts |= {f.name: f.force(owner, way.thrusts[f.name]) for f in self.fans}
            way.units |= {f.name: "N" for f in self.fans}
            for e in (e for e in changing if not e.before_curve):
                states |= e.commands(e.symbols(owner), way)
            _WAYS[key] = states, way
        states, way = _WAYS[key]
        motion.thrust, motion.rudder = way.thrusts.get(THRUST.name, motion.thrust), way.rudder
        _add_forces(motion, self.fans, owner, way.thrusts)
        return dict(states), way

    def _seen(self, owner: str) -> SimpleNamespace:
        """Apply the measurement effects to the motion."""
        symbols = {signal.name: signal.symbol for signal in MOTION}
        seen = SimpleNamespace(**symbols, true=SimpleNamespace(**symbols), late=None)
        for e in sorted(self.effects, key=lambda e: e.order):
            e.measured(e.symbols(owner), seen)
        return seen

    def measurements(self, owner: str = "plant") -> dict[str, sp.Expr]:
        """Return the measured quantities that differ from the motion, by ``u, v, r``...

        Expressions in the plant's states and parameters; empty if the model has no measurement effect.

        Parameters
        ----------
        owner : str, optional
            Name of the Block.
        """
        seen = self._seen(owner)
        every = {s.name: getattr(seen, s.name) for s in MOTION}
        return {name: e for name, e in every.items() if e != getattr(seen.true, name)}

    def timing(self, owner: str = "plant") -> tuple[str, str]:
        """Return the parameter names of the input delay and the measurement delay; ``""`` for none.

        No equation of the plant contains them: its inputs have delays (:attr:`Block.delays`), and readers of
        logs shift the time.

        Parameters
        ----------
        owner : str, optional
            Name of the Block.
        """
        s = motion_symbols(self.fans, owner)
        delay = self._command_way(owner, s)[1].delay
        seen = self._seen(owner)
        return str(delay or ""), str(seen.late or "")

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
            ``thrust_applied``... are the saturated commands (:func:`~hovercontrol.models.actuated.actuated`).
            Default: the model's own setting.

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
        lags, _ = self._command_way(name, s)
        force = self.accelerations(name, s)
        states = lags | self.own_states(name, s)
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


def craft_units(thrust: str, rudder: str, fans: bool) -> dict[str, str]:
    """Return the unit of each signal of a craft that a law may use.

    Examples
    --------
    >>> craft_units("N", "rad", fans=False)["r"], craft_units("N", "rad", fans=True)["fan_torque"]
    ('rad/s', 'N*m')
    """
    commands = (
        {"fan_x": "N", "fan_y": "N", "fan_torque": "N*m"} if fans else {"thrust": thrust, "rudder": rudder}
    )
    return {s.name: s.unit for s in MOTION} | commands | {"time": "s"}


def motion_symbols(fans: Iterable[Fan] = (), owner: str = "plant") -> SimpleNamespace:
    """Return the symbols of the effects' equations: motion, commands, and the fans' wrench."""
    symbols: dict[str, Any] = {signal.name: signal.symbol for signal in (*MOTION, THRUST, RUDDER)}
    s = SimpleNamespace(**symbols, time=time)
    s.air_u, s.air_v = s.u, s.v
    s.inputs = {c.name: c.symbol for c in (THRUST, RUDDER, *(f.command() for f in fans))}
    _add_forces(s, fans, owner, {f.name: f.force(owner) for f in fans})
    return s


def _add_forces(s: SimpleNamespace, fans: Iterable[Fan], owner: str, forces: Mapping[str, sp.Expr]) -> None:
    """Set the force vector of the rudder craft's commands, and the wrench of the fans' forces."""
    s.thrusts = dict(forces) or {THRUST.name: s.thrust}
    s.thrust_x = s.thrust * sp.cos(s.rudder)
    s.thrust_y = s.thrust * sp.sin(s.rudder)
    s.fan_x = s.fan_y = s.fan_torque = s.fan_cross_torque = sp.S.Zero
    for fan in fans:
        force = forces[fan.name]
        s.fan_x += _exact(math.cos(fan.direction)) * force
        s.fan_y += _exact(math.sin(fan.direction)) * force
        s.fan_torque += fan.lever_arm(owner).symbol * force
        s.fan_cross_torque += fan.cross_arm(owner).symbol * force


def _exact(value: float) -> sp.Number:
    """Return 0 or +-1 for a fan along an axis: with six digits, the cosine is 1 to twelve."""
    near = round(value)
    return sp.Integer(near) if abs(value - near) < (1e-12 if near else 1e-6) else sp.Float(value)
