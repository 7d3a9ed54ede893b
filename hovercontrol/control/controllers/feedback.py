"""State feedback as a Block: ``u = u0 - K (x - x_ref) - K_i z + F sgn(v)``, with limits and anti-windup."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.sgn import sgn
from hovercontrol.blocks.signals import Signal, suffixed, within_name
from hovercontrol.blocks.units import simplified
from hovercontrol.control.controllers.design import Design, Measured
from hovercontrol.control.controllers.limits import applied_signal, limited


@dataclass(frozen=True)
class Form:
    """Options of the realisation of a controller.

    Parameters
    ----------
    period : float
        Sample time [s]; 0 for a continuous controller.
    limits : bool
        Whether commands stay within the bounds of the plant's inputs.
    measured : str
        Pattern of the input names, ``{}`` for the state's name: ``"{}_hat"`` reads an estimator.
    name : str
        Of the Block.
    """

    period: float
    limits: bool
    measured: str
    name: str

    def reads(self, m: Measured) -> Signal:
        """Return the input that carries a state or an output; an estimator gives a state by its own name."""
        if not m.estimated or self.measured == "{}":
            return m.signal
        base, bracket, index = (m.state or m.signal.name).partition("[")
        return m.signal.replace(name=self.measured.replace("{}", base) + bracket + index)


@dataclass(frozen=True)
class Gains:
    """Gains of a state feedback.

    Parameters
    ----------
    states : ndarray, shape (n_inputs, n_states)
        K
    integrals : ndarray, shape (n_inputs, n_integrals)
        K_i
    windup : ndarray, shape (n_integrals, n_inputs)
        L of ``z' = e + L (demand - applied)``.
    friction : ndarray, shape (n_inputs, n_frictions)
        F of ``F sgn(v)``.
    """

    states: Array
    integrals: Array
    windup: Array
    friction: Array


def state_feedback(design: Design, gains: Gains, form: Form, *, applied: bool = False) -> Block:
    """Return the controller as a Block.

    Parameters
    ----------
    applied : bool, optional
        Whether the anti-windup reads the applied commands from inputs ``thrust_applied``.

    Returns
    -------
    Block
        Inputs: the states, the integrated outputs, and their setpoints ``y_ref``, which start at the
        operating point. Outputs: the commands. Parameters: gains ``K_rudder_y``, ``rudder_trim``, limits.
    """
    part = _Parts(design, form)
    parameters: list[Signal] = []
    definitions = dict(part.errors)
    for j, command in enumerate(design.inputs):
        level = command.replace(
            name=suffixed(command.name, "trim"), description=f"{command.name} at the operating point"
        )
        own = [
            *part.gains(command, design.states, gains.states[j]),
            *part.gains(command, part.integrals, gains.integrals[j]),
        ]
        demand = level.symbol - sum(
            (k.symbol * value for k, value in zip(own, part.fed_back, strict=True)), start=sp.S.Zero
        )
        forward = part.friction_gains(command, design, gains.friction[j])
        demand += sum((f.symbol * s for f, s in zip(forward, part.signs, strict=True)), start=sp.S.Zero)
        definitions[suffixed(command.name, "demand")] = demand
        definitions[command.name], bounds = limited(
            command, sp.Symbol(suffixed(command.name, "demand"), real=True), form.limits
        )
        parameters += [level, *own, *forward, *bounds]
    z, updates, more, reads = _integrators(design, gains, form, part, applied)
    return Block(
        form.name,
        states=tuple(z),
        inputs=(*part.inputs, *reads),
        outputs=design.inputs,
        parameters=(*parameters, *part.widths, *more),
        derivatives=updates,
        definitions=definitions,
        period=form.period,
    )


class _Parts:
    """The signals of a state feedback, and the errors that are fed back."""

    def __init__(self, design: Design, form: Form) -> None:
        self.inputs: list[Signal] = []
        self.errors: dict[str, sp.Expr] = {}
        setpoints = []
        for m in (*design.states, *design.integrals):
            signal = m.signal
            if _error(signal) in self.errors:
                continue
            read = form.reads(m)
            text = f"setpoint of {signal.name}"
            setpoint = signal.replace(name=suffixed(_plain(signal), "ref"), description=text)
            difference = read.symbol - setpoint.symbol
            if m.angle:
                difference = sp.atan2(sp.sin(difference), sp.cos(difference))
            self.errors[_error(signal)] = difference
            self.inputs.append(read)
            setpoints.append(setpoint)
        self.inputs += setpoints
        self.integrals = tuple(Measured(_integral(m.signal), False) for m in design.integrals)
        self.fed_back: list[sp.Expr] = [
            *(sp.Symbol(_error(m.signal), real=True) for m in design.states),
            *(m.signal.symbol for m in self.integrals),
        ]

        self.widths: list[Signal] = []
        self.signs: list[sp.Expr] = []
        for friction in design.frictions:
            m = design.states[friction.state]
            v = m.signal
            width = v.replace(
                name=suffixed(_plain(v), "width"),
                description=f"width of the friction compensation in {v.name}",
                start=friction.width,
            )
            self.widths.append(width)
            self.signs.append(sgn(form.reads(m).symbol, width.symbol))

    @staticmethod
    def friction_gains(command: Signal, design: Design, row: Array) -> list[Signal]:
        """Return the terms of one command that compensate dry friction."""
        states = [design.states[f.state].signal for f in design.frictions]
        return [
            Signal(
                f"F_{within_name(command.name)}_{within_name(v.name)}",
                command.unit,
                f"compensation in {command.name} of dry friction in {v.name}",
                start=value,
            )
            for v, value in zip(states, row, strict=True)
        ]

    @staticmethod
    def gains(command: Signal, fed_back: Sequence[Measured], row: Array) -> list[Signal]:
        """Return one command's gains on some states or integrals."""
        return [
            Signal(
                f"K_{within_name(command.name)}_{within_name(m.signal.name)}",
                unit_of(command.unit, m.signal.unit),
                f"gain of {command.name} on {m.signal.name}",
                start=value,
            )
            for m, value in zip(fed_back, row, strict=True)
        ]


def _plain(signal: Signal) -> str:
    return signal.name.replace(".", "_")


def _error(signal: Signal) -> str:
    return f"error_{_plain(signal)}"


def _integral(signal: Signal) -> Signal:
    unit = simplified(f"({signal.unit})*s")
    return Signal(f"integral_{_plain(signal)}", unit, f"integral of the error of {signal.name}")


def unit_of(above: str, below: str) -> str:
    """Return the unit of a gain: the quotient of two units.

    Examples
    --------
    >>> unit_of("rad", "m"), unit_of("A", "m/s")
    ('rad/m', 'A*s/m')
    """
    return simplified(f"({above})/({below})")


def _integrators(
    design: Design, gains: Gains, form: Form, part: _Parts, applied: bool
) -> tuple[list[Signal], dict[str, sp.Expr], list[Signal], list[Signal]]:
    """Return the integrals, their derivatives (next values), parameters, and the inputs they read.

    ``z' = e + L (demand - applied)``, or ``z+ = z + h (...)``: while a command is limited, its integrals
    follow the applied command (back-calculation).
    """
    able = [
        (j, s)
        for j, s in enumerate(design.inputs)
        if applied or (form.limits and np.isfinite([s.lower, s.upper]).any())
    ]
    parameters: list[Signal] = []
    updates: dict[str, sp.Expr] = {}
    for i, (m, z) in enumerate(zip(design.integrals, part.integrals, strict=True)):
        rate = sp.Symbol(_error(m.signal), real=True)
        for j, command in able:
            gain = Signal(
                f"L_{within_name(z.signal.name)}_{within_name(command.name)}",
                unit_of(m.signal.unit, command.unit),
                f"back-calculation of {z.signal.name} from {command.name}",
                start=gains.windup[i, j],
            )
            put_out = applied_signal(command).symbol if applied else command.symbol
            rate += gain.symbol * (sp.Symbol(suffixed(command.name, "demand"), real=True) - put_out)
            parameters.append(gain)
        updates[z.signal.name] = rate
    if form.period and updates:
        step = Signal("period", "s", "sampling period", start=form.period)
        parameters.append(step)
        updates = {name: sp.Symbol(name, real=True) + step.symbol * rate for name, rate in updates.items()}
    known = {s.name for s in part.inputs}
    reads = [applied_signal(s) for _, s in able] if applied and design.integrals else []
    reads = [s for s in reads if s.name not in known]
    return [m.signal for m in part.integrals], updates, parameters, reads
