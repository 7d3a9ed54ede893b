"""Gain scheduling: controllers designed at several operating points, their gains interpolated in between."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.blocks.backends.friction_slopes import Point
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal, suffixed, within_name
from hovercontrol.control.controllers import operating_point

if TYPE_CHECKING:
    import control

    from hovercontrol.blocks.backends.trim import Trim

#: Parameters and setpoints that differ by less, relative to the largest, are one number.
SAME = 1e-12


@checked
def gain_scheduled(
    plant: Block,
    trims: Sequence[Trim | control.OperatingPoint | Mapping[str, float]],
    design: Callable[[Block, Any], Block],
    *,
    schedule: str = "u",
    measured: str = "{}",
    name: str = "controller",
) -> Block:
    """Return one controller from designs at several operating points.

    Each parameter in which the designs differ is interpolated linearly in the scheduling variable, and held
    beyond the first and the last point. Gains follow the measured variable; commands and states of the
    operating point (``thrust_trim``, ``v_ref``) follow its setpoint, so that the linearised loop at an
    operating point is the one that was designed there.

    Parameters
    ----------
    plant : Block
        Continuous or sampled.
    trims : sequence of Trim, control.OperatingPoint or mapping
        Two or more, with different values of the scheduling variable; their order does not matter.
    design : callable
        ``design(plant, trim) -> Block``, the controller at one operating point:
        ``functools.partial(lqr, Q=Q, R=R, states=["u", "v", "r"])``. All must have the same
        signals.
    schedule : str, optional
        The scheduling variable: a state or output of the plant. Where it has a setpoint in the design,
        ``u_ref`` schedules everything by the setpoint.
    measured : str, optional
        The name under which the controller reads it, as for :func:`lqr`.
    name : str, optional

    Returns
    -------
    Block
        As the designs. Parameters: the points ``u_0``, ``u_1``... and the values there, ``K_thrust_u_0``...

    Raises
    ------
    InputError
        If there are fewer than two points, two have one value of the scheduling variable, or the designs have
        different signals or equations.

    References
    ----------
    Astrom & Murray, Feedback Systems, 2nd edition, section 8.5 (gain scheduling).

    Examples
    --------
    >>> from functools import partial
    >>> from hovercontrol.control.controllers.state_feedback import lqr
    >>> from hovercontrol.craft.models.vehicles import c17_simulation
    >>> plant = c17_simulation().plant()
    >>> hold = gain_scheduled(
    ...     plant,
    ...     [plant.trim({"u": u, "r": 0.0}) for u in (0.5, 1.0)],
    ...     partial(lqr, Q={"psi": 1.0, "v": 1.0}, R={"rudder": 1.0}),
    ... )
    >>> [key for key in hold.default_parameters if "rudder_v" in key]
    ['controller.K_rudder_v_0', 'controller.K_rudder_v_1']
    """
    if len(trims) < 2:
        raise InputError(f"gain_scheduled: expected two or more operating points, found {len(trims)}")
    variable = _variable(plant, schedule)
    values = [_value(plant, operating_point.point_of(plant, trim), variable) for trim in trims]
    order = np.argsort(values, kind="stable")
    knots = [float(values[k]) for k in order]
    if min(np.diff(knots)) <= SAME * max(map(abs, knots)):
        shown = ", ".join(f"{v:g}" for v in knots)
        raise InputError(f"gain_scheduled: two operating points have the same {variable}: {shown}")
    blocks = [design(plant, trims[k]) for k in order]
    for block in blocks:
        if not isinstance(block, Block):
            raise InputError(f"gain_scheduled: design must return a Block, found {block!r}")
        _refuse_different(blocks[0], block)
    return _Schedule(plant.signal(variable), knots, blocks, measured, schedule != variable).block(name)


def _variable(plant: Block, schedule: str) -> str:
    known = [s.name for s in (*plant.states, *plant.outputs)]
    for name in (schedule, schedule.removesuffix("_ref")):
        if name in known:
            return name
    raise InputError(
        f"gain_scheduled: schedule: no state or output {schedule!r}{did_you_mean(schedule, known)}"
    )


def _value(plant: Block, point: Point, name: str) -> float:
    states = [s.name for s in plant.states]
    if name in states:
        return float(point.x[states.index(name)])
    return float(operating_point.outputs(plant, point)[[s.name for s in plant.outputs].index(name)])


def _refuse_different(first: Block, other: Block) -> None:
    for kind in ("inputs", "outputs", "states", "parameters"):
        a, b = ([s.name for s in getattr(block, kind)] for block in (first, other))
        if a != b:
            odd = ", ".join(sorted({*a} ^ {*b})) or "their order"
            friction = any(name.startswith("F_") for name in {*a} ^ {*b})
            hint = "compensate_friction=False" if friction else "name the states (states=...)"
            raise InputError(f"gain_scheduled: the designs differ in {kind}: {odd}; {hint}")
    same = all(
        dict(getattr(first, kind)) == dict(getattr(other, kind))
        for kind in ("derivatives", "definitions", "output_expressions")
    )
    if not same or first.period != other.period or first.name != other.name:
        raise InputError("gain_scheduled: the designs have different equations, periods or names")


class _Schedule:
    """The scheduled parameters and setpoints."""

    def __init__(
        self,
        variable: Signal,
        knots: Sequence[float],
        blocks: Sequence[Block],
        measured: str,
        by_setpoint: bool,
    ) -> None:
        self.first, self.blocks = blocks[0], blocks
        stem = within_name(variable.name)
        self.points = [
            variable.replace(name=f"{stem}_{k}", description="operating point", start=v)
            for k, v in enumerate(knots)
        ]
        self.inputs = {s.name: s for s in self.first.inputs}
        base, bracket, index = variable.name.partition("[")
        read = measured.replace("{}", base) + bracket + index
        setpoint = suffixed(variable.name.replace(".", "_"), "ref")
        if setpoint not in self.inputs:
            if by_setpoint:
                raise InputError(f"gain_scheduled: the designs have no setpoint {setpoint!r}")
            setpoint = read
        if by_setpoint:
            read = setpoint
        if read not in self.inputs:
            self.inputs[read] = variable.replace(name=read)
        self.read, self.setpoint = read, setpoint
        self.parameters = list(self.points)
        self.definitions: dict[str, sp.Expr] = {}

    def block(self, name: str) -> Block:
        """Return the scheduled controller."""
        for k, parameter in enumerate(self.first.parameters):
            signals = [block.parameters[k] for block in self.blocks]
            self._take(parameter, signals, self.setpoint if _ends(parameter, "_trim") else self.read)
        inputs = []
        for signal in self.inputs.values():
            signals = [s for block in self.blocks for s in block.inputs if s.name == signal.name]
            varies = _ends(signal, "_ref") and signal.name != self.setpoint and not _same(signals)
            if varies:
                self._take(signal, signals, self.setpoint)
            else:
                inputs.append(signal)
        return Block(
            name,
            states=self.first.states,
            inputs=tuple(inputs),
            outputs=self.first.outputs,
            parameters=tuple(self.parameters),
            derivatives=self.first.derivatives,
            output_expressions=self.first.output_expressions,
            definitions={**self.definitions, **self.first.definitions},
            period=self.first.period,
        )

    def _take(self, signal: Signal, signals: Sequence[Signal], by: str) -> None:
        """Keep one parameter, or replace it with a definition that interpolates its values."""
        if _same(signals):
            self.parameters.append(signal)
            return
        values = [
            s.replace(name=f"{within_name(signal.name)}_{k}", lower=-np.inf, upper=np.inf)
            for k, s in enumerate(signals)
        ]
        self.parameters += values
        shares = self._shares(by)
        total: sp.Expr = values[0].symbol
        for a, b, share in zip(values[:-1], values[1:], shares, strict=True):
            total += (b.symbol - a.symbol) * share
        self.definitions[signal.name] = total

    def _shares(self, by: str) -> list[sp.Symbol]:
        """Return the position of the variable between each point and the next, 0 to 1."""
        found = []
        at = self.inputs[by].symbol
        for k, (a, b) in enumerate(zip(self.points[:-1], self.points[1:], strict=True)):
            key = f"{within_name(by)}_share_{k}"
            ratio = (at - a.symbol) / (b.symbol - a.symbol)
            self.definitions.setdefault(key, sp.Max(0, sp.Min(1, ratio)))
            found.append(sp.Symbol(key, real=True))
        return found


def _ends(signal: Signal, suffix: str) -> bool:
    """Return whether a name ends so, before its index."""
    return signal.name.partition("[")[0].endswith(suffix)


def _same(signals: Sequence[Signal]) -> bool:
    starts = np.array([s.start for s in signals])
    return not len(starts) or bool(np.ptp(starts) <= SAME * np.abs(starts).max())
