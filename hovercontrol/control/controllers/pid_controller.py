"""The PID controller with setpoint weights, a filtered derivative and anti-windup, continuous and sampled."""

from __future__ import annotations

import math
from dataclasses import dataclass

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import finite, positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal, suffixed
from hovercontrol.control.controllers.feedback import unit_of
from hovercontrol.control.controllers.limits import applied_signal, limited


@checked
def pid(
    measured: Signal,
    command: Signal,
    *,
    kp: float,
    ki: float = 0.0,
    kd: float = 0.0,
    derivative_filter: float | None = None,
    b: float = 1.0,
    c: float = 0.0,
    offset: float = 0.0,
    tracking_time: float | None = None,
    bounds: tuple[float, float] | None = None,
    applied: bool = False,
    angle: bool = False,
    period: float | None = None,
    name: str = "controller",
) -> Block:
    """Return a PID controller of one quantity by one command.

    With y the measured quantity, r its setpoint and v the command before the limits::

        v = offset + kp (b r - y) + I + D
        I' = ki (r - y) + (applied - v) / tracking_time
        D = kd / (1 + s derivative_filter) * d/dt (c r - y)

    A sampled one, h its period, takes forward differences of the integral and backward differences of the
    derivative, T = derivative_filter::

        I+ = I + h (ki (r - y) + (applied - v) / tracking_time)
        D = T / (T + h) D- + kd / (T + h) (c r - y - (c r - y)-)

    Parameters
    ----------
    measured, command : Signal
        What is read and what is driven: ``plant.signal("psi")``, ``plant.signal("rudder")``. The gains have
        their units.
    kp : float
        Proportional gain [command/measured]; negative where a positive command lowers the measured quantity,
        as a rudder does with the heading.
    ki, kd : float, optional
        Integral and derivative gain [command/(measured s)], [command s/measured]; of the sign of `kp`.
    derivative_filter : float, optional
        Time constant of the derivative's filter [s] (default: a tenth of kd/kp).
    b, c : float, optional
        Weights of the setpoint in the proportional and the derivative part, dimensionless.
    offset : float, optional
        The command at zero error, in its unit: that of the operating point.
    tracking_time : float, optional
        Time constant of the anti-windup [s] (default: sqrt(Ti Td), without derivative Ti; Ti = kp/ki,
        Td = kd/kp).
    bounds : tuple of two float, optional
        Limits of the command in its unit (default: the bounds of `command`).
    applied : bool, optional
        Whether the anti-windup reads what the actuator applies from an input ``rudder_applied`` rather than
        taking the command within its limits for it.
    angle : bool, optional
        Whether errors are wrapped to (-pi, pi]; b must be 1 and c 0 or 1.
    period : float, optional
        Of a sampled controller [s].
    name : str, optional

    Returns
    -------
    Block
        Inputs ``psi``, ``psi_ref``; output ``rudder``; states ``integral`` and ``filtered`` (sampled:
        ``derivative`` and ``last``) where there are such parts. The gains and times are parameters.
        ``filtered`` (``last``) starts at c r - y of the signals' start values; give it the value of the first
        measurement where a derivative kick matters.

    Raises
    ------
    InputError
        If a number is not finite, a time is not positive, or b and c do not suit an angle.

    References
    ----------
    Astrom & Murray, Feedback Systems, 2nd edition, section 11.1, 11.4 and 11.5.

    Examples
    --------
    >>> rudder = Signal("rudder", "rad", lower=-0.45, upper=0.45)
    >>> hold = pid(Signal("psi", "rad"), rudder, kp=-0.8, kd=-0.5, angle=True)
    >>> print(hold.equations())
    error = atan2(-sin(psi - psi_ref), cos(psi - psi_ref))
    slope = atan2(-sin(filtered + psi), cos(filtered + psi))/derivative_filter
    demand = error*kp + kd*slope + offset
    rudder = Max(rudder_lower, Min(demand, rudder_upper))
    filtered' = slope
    """
    lower, upper = (command.lower, command.upper) if bounds is None else bounds
    numbers = {"kp": kp, "ki": ki, "kd": kd, "b": b, "c": c, "offset": offset}
    for key, value in numbers.items():
        finite(f"pid: {key}", value)
    if not lower <= offset <= upper:
        raise InputError(
            f"pid: offset = {offset:g} {command.unit} is out of the command's bounds [{lower:g}, {upper:g}]"
        )
    command = command.replace(start=offset, lower=lower, upper=upper)
    if angle and (b != 1.0 or c not in (0.0, 1.0)):
        raise InputError(
            f"pid: the setpoint weights of an angle are b = 1 and c = 0 or 1, found {b:g} and {c:g}"
        )
    if period is not None:
        positive("pid: period", period)
    able = applied or bool(limited(command, sp.S.Zero)[1])
    law = _Law(measured, command, kp, ki, kd, b, c, angle, period)
    law.proportional(offset)
    if kd:
        law.derivative(_filter_time(kp, kd, derivative_filter))
    if ki:
        law.integral(_tracking_time(kp, ki, kd, tracking_time) if able else None, applied)
    return law.block(name)


def _filter_time(kp: float, kd: float, given: float | None) -> float:
    if given is None and kp == 0.0:
        raise InputError("pid: derivative_filter must be given where kp is 0")
    return positive("pid: derivative_filter", abs(kd / kp) / 10 if given is None else given)


def _tracking_time(kp: float, ki: float, kd: float, given: float | None) -> float:
    if given is None and kp == 0.0:
        raise InputError("pid: tracking_time must be given where kp is 0")
    if given is not None:
        return positive("pid: tracking_time", given)
    return math.sqrt(abs(kd / ki)) if kd else abs(kp / ki)  # Ti Td = kd/ki


@dataclass
class _Law:
    """The terms of a PID controller."""

    measured: Signal
    command: Signal
    kp: float
    ki: float
    kd: float
    b: float
    c: float
    angle: bool
    period: float | None

    def __post_init__(self) -> None:
        self.setpoint = self.measured.replace(
            name=suffixed(self.measured.name, "ref"), description=f"setpoint of {self.measured.name}"
        )
        self.error = sp.Symbol("error", real=True)
        self.demand = sp.Symbol("demand", real=True)
        self.y, self.r = self.measured.symbol, self.setpoint.symbol
        self.inputs = [self.measured, self.setpoint]
        self.parameters: list[Signal] = []
        self.states: list[Signal] = []
        self.updates: dict[str, sp.Expr] = {}
        self.definitions: dict[str, sp.Expr] = {"error": self.wrapped(self.r - self.y)}
        self.total: sp.Expr = sp.S.Zero
        if self.period is not None:
            self.h = self.parameter("period", "s", "sampling period", self.period)

    def wrapped(self, difference: sp.Expr) -> sp.Expr:
        return sp.atan2(sp.sin(difference), sp.cos(difference)) if self.angle else difference

    def parameter(self, name: str, unit: str, description: str, start: float) -> sp.Symbol:
        signal = Signal(name, unit, description, start=start)
        self.parameters.append(signal)
        return signal.symbol

    def gain(self, name: str, description: str, start: float, per: str) -> sp.Symbol:
        unit = unit_of(unit_of(self.command.unit, self.measured.unit), per)
        return self.parameter(name, unit, f"{description} gain", start)

    def proportional(self, offset: float) -> None:
        """Add ``offset + kp (b r - y)``."""
        kp = self.gain("kp", "proportional", self.kp, "1")
        level = self.parameter("offset", self.command.unit, "command at zero error", offset)
        if self.angle:
            self.total += level + kp * self.error
        else:
            weight = self.parameter("b", "1", "setpoint weight, proportional", self.b)
            self.total += level + kp * (weight * self.r - self.y)

    def derivative(self, filter_time: float) -> None:
        """Add ``kd/(1 + s T) d/dt (c r - y)``."""
        kd = self.gain("kd", "derivative", self.kd, "1/s")
        T = self.parameter("derivative_filter", "s", "time constant of the derivative's filter", filter_time)
        weight = sp.Integer(int(self.c)) if self.angle else None
        if weight is None:
            weight = self.parameter("c", "1", "setpoint weight, derivative", self.c)
        seen = weight * self.r - self.y
        start = self.c * self.setpoint.start - self.measured.start
        if self.period is None:
            w = Signal("filtered", self.measured.unit, "filtered c r - y", start=start)
            self.definitions["slope"] = self.wrapped(seen - w.symbol) / T
            self.states.append(w)
            self.updates["filtered"] = sp.Symbol("slope", real=True)
        else:
            unit = unit_of(self.measured.unit, "s")
            last = Signal("last", self.measured.unit, "c r - y at the last sample", start=start)
            rate = Signal("derivative", unit, "filtered derivative of c r - y")
            step = self.wrapped(seen - last.symbol)
            self.definitions["slope"] = (T * rate.symbol + step) / (T + self.h)
            self.states += [rate, last]
            self.updates |= {"derivative": sp.Symbol("slope", real=True), "last": seen}
        self.total += kd * sp.Symbol("slope", real=True)

    def integral(self, tracking_time: float | None, applied: bool) -> None:
        """Add ``I' = ki (r - y) + (applied - v)/tracking_time``."""
        ki = self.gain("ki", "integral", self.ki, "s")
        z = Signal("integral", self.command.unit, "integral part of the command")
        rate = ki * self.error
        if tracking_time is not None:
            Tt = self.parameter("tracking_time", "s", "time constant of the anti-windup", tracking_time)
            put_out = applied_signal(self.command) if applied else self.command
            if applied:
                self.inputs.append(put_out)
            rate += (put_out.symbol - self.demand) / Tt
        self.states.insert(0, z)
        self.updates = {"integral": rate if self.period is None else z.symbol + self.h * rate, **self.updates}
        self.total += z.symbol

    def block(self, name: str) -> Block:
        """Return the controller."""
        clipped, limits = limited(self.command, self.demand)
        return Block(
            name,
            states=tuple(self.states),
            inputs=tuple(self.inputs),
            outputs=(self.command,),
            parameters=(*self.parameters, *limits),
            derivatives=self.updates,
            definitions=self.definitions | {"demand": self.total, self.command.name: clipped},
            period=self.period or 0.0,
        )
