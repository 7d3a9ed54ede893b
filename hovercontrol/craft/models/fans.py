"""Fans fixed to the hull: place, direction, and the static curve from a fan's signal to its force."""

from __future__ import annotations

import math
import typing
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import finite, number, positive
from hovercontrol.blocks.lookup import linear
from hovercontrol.blocks.signals import Signal


@dataclass(frozen=True)
class Polynomial:
    """A static curve of a fan: ``c1 s + c2 s^2 + ...``, zero at zero.

    Parameters
    ----------
    coefficients : sequence of float
        Force [N] of the first, second... power of the signal.

    Raises
    ------
    InputError
        If there is no coefficient, or one is not finite.

    Examples
    --------
    >>> curve, s = Polynomial([0.1, 0.4]), sp.Symbol("s", real=True)
    >>> curve.force(s, curve.parameters("plant.left", "left"))
    plant.left_curve_1*s + plant.left_curve_2*s**2
    """

    coefficients: tuple[float, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "coefficients", _numbers("curve", self.coefficients, 1))

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest signal; a fan with a polynomial curve does not reverse."""
        return 0.0, math.inf

    def parameters(self, prefix: str, fan: str) -> tuple[Signal, ...]:
        """Return the coefficients as parameters of a plant."""
        return tuple(
            Signal(
                f"{prefix}_curve_{k}",
                "N",
                f"power {k} of the static curve of the fan {fan}",
                c,
                abs(c) or 1.0,
            )
            for k, c in enumerate(self.coefficients, 1)
        )

    def force(self, signal: sp.Expr, parameters: Sequence[Signal]) -> sp.Expr:
        """Return the force [N] of a signal."""
        return sp.Add(*(p.symbol * signal**k for k, p in enumerate(parameters, 1)))

    def forces_at(self, signals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the forces [N] of signals, same shape."""
        return np.polynomial.Polynomial((0.0, *self.coefficients))(signals)


@dataclass(frozen=True)
class BenchCurve:
    """A static curve of a fan measured on a bench: linear between the points, constant beyond them.

    Parameters
    ----------
    signals : sequence of float
        Two or more, increasing.
    forces : sequence of float
        Force [N] at each.

    Raises
    ------
    InputError
        If lengths differ, signals do not increase, a value is not finite, or all forces are zero.

    Examples
    --------
    >>> curve, s = BenchCurve([0.0, 0.5, 1.0], [0.0, 0.1, 0.4]), sp.Symbol("s", real=True)
    >>> full = curve.parameters("plant.left", "left")
    >>> round(float(curve.force(s, full).subs({s: 0.75, full[0].symbol: full[0].start})), 12)
    0.25
    """

    signals: tuple[float, ...]
    forces: tuple[float, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "signals", _numbers("curve.signal", self.signals, 2))
        object.__setattr__(self, "forces", _numbers("curve.force", self.forces, 2))
        if len(self.signals) != len(self.forces):
            raise InputError(
                f"curve: expected as many signals as forces, found {len(self.signals)} and {len(self.forces)}"
            )
        for before, after in zip(self.signals, self.signals[1:], strict=False):
            if not before < after:
                raise InputError(f"curve.signal must increase, found {after:g} after {before:g}")
        if not any(self.forces):
            raise InputError("curve.force: all forces are zero")

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest signal."""
        return self.signals[0], self.signals[-1]

    @property
    def full(self) -> float:
        """Largest force [N]."""
        return max(map(abs, self.forces))

    def parameters(self, prefix: str, fan: str) -> tuple[Signal, ...]:
        """Return the largest force as a parameter of a plant; the curve's shape is a table of constants."""
        text = f"largest force on the static curve of the fan {fan}"
        return (Signal(f"{prefix}_full", "N", text, start=self.full, nominal=self.full),)

    def force(self, signal: sp.Expr, parameters: Sequence[Signal]) -> sp.Expr:
        """Return the force [N] of a signal."""
        return parameters[0].symbol * linear(signal, self.signals, [f / self.full for f in self.forces])

    def forces_at(self, signals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the forces [N] of signals, same shape."""
        return np.interp(signals, self.signals, self.forces)


@checked
@dataclass(frozen=True)
class Fan:
    """A fan fixed to the hull; its force [N], or the signal of its static curve, is an input of the plant.

    Parameters
    ----------
    name : str
        Name of the input.
    x, y : float
        Place in the body frame [m] from the centre of mass.
    direction : float
        Angle of the force from the bow [rad].
    curve : Polynomial, BenchCurve or sequence of float, optional
        Static curve from signal to force; numbers are the coefficients of a :class:`Polynomial`. Without it
        the input is the force.
    gain : float, optional
        Factor of the force, a coefficient of the model. Default: no such coefficient.
    reverses : bool, optional
        Whether the force may be negative. With a measured curve, its signals decide.
    upper : float, optional
        Largest command, in its unit; with `reverses` in both directions. A measured curve ends at its last
        point.

    Raises
    ------
    InputError
        If the curve, the gain or the bound is not valid, or `reverses` is set for a fan with a curve.

    Examples
    --------
    >>> Fan("left", 0.0, -0.1, 0.0, curve=[0.02, 1.05], gain=1.1).force("plant")
    plant.left_gain*(left**2*plant.left_curve_2 + left*plant.left_curve_1)
    """

    name: str
    x: float
    y: float
    direction: float
    curve: Polynomial | BenchCurve | Sequence[float] | None = None
    gain: float | None = None
    reverses: bool = False
    upper: float | None = None

    def __post_init__(self) -> None:
        for key in ("x", "y", "direction"):
            object.__setattr__(self, key, finite(f"fan {self.name}: {key}", getattr(self, key)))
        if self.gain is not None:
            object.__setattr__(self, "gain", number(f"fan {self.name}: gain", self.gain))
            if not 0 <= self.gain < math.inf:
                raise InputError(f"fan {self.name}: gain must be zero or more, found {self.gain:g}")
        curve: Any = self.curve
        if curve is not None and not isinstance(curve, Polynomial | BenchCurve):
            object.__setattr__(self, "curve", Polynomial(curve))
        if self.reverses and curve is not None:
            raise InputError(
                f"fan {self.name}: a fan with a curve reverses where its curve does: curve = "
                "{signal = [-1, 0, 1], force = [-1, 0, 1]}"
            )
        if self.upper is not None:
            object.__setattr__(self, "upper", positive(f"fan {self.name}: upper", self.upper))
            if isinstance(curve, BenchCurve):
                raise InputError(f"fan {self.name}: its curve ends at {curve.bounds[1]:g}: leave out upper")

    @property
    def _law(self) -> Polynomial | BenchCurve | None:
        """The static curve; given coefficients make a :class:`Polynomial`."""
        return typing.cast("Polynomial | BenchCurve | None", self.curve)

    def command(self) -> Signal:
        """Return the plant's input: the force of this fan [N], or the signal of its curve."""
        most = math.inf if self.upper is None else self.upper
        if self._law is None:
            lower = -most if self.reverses else 0.0
            text = f"force of the fan {self.name}"
            return Signal(self.name, "N", text, nominal=0.1, lower=lower, upper=most)
        lower, upper = self._law.bounds
        upper = min(upper, most)
        return Signal(
            self.name,
            "1",
            f"signal of the fan {self.name}",
            start=min(max(0.0, lower), upper),
            nominal=upper if 0 < upper < math.inf else 1.0,
            lower=lower,
            upper=upper,
        )

    def force(self, owner: str, command: sp.Expr | None = None) -> sp.Expr:
        """Return the force [N] of the command, before any effect that acts on it.

        Parameters
        ----------
        owner : str
            Name of the Block.
        command : sympy.Expr, optional
            Default: the command as it is sent.
        """
        force: sp.Expr = self.command().symbol if command is None else command
        if self._law is not None:
            force = self._law.force(force, self._curve_parameters(owner))
        return force if self.gain is None else self.gain_signal(owner).symbol * force

    def forces(self, command: ArrayLike) -> NDArray[np.float64]:
        """Return the forces [N] of commands, same shape; the numbers of :meth:`force`.

        Parameters
        ----------
        command : array_like, any shape
            In the unit of the fan's command.
        """
        found = np.asarray(command, dtype=float)
        if self._law is not None:
            found = self._law.forces_at(found)
        return found if self.gain is None else self.gain * found

    def lever_arm(self, owner: str) -> Signal:
        """Return the plant's parameter: torque about the centre of mass per force.

        Parameters
        ----------
        owner : str
            Name of the Block.
        """
        arm = self.x * math.sin(self.direction) - self.y * math.cos(self.direction)
        text = f"lever arm of the fan {self.name}"
        return Signal(f"{owner}.{self.name}_arm", "m", text, start=arm, nominal=abs(arm) or 1.0)

    def cross_arm(self, owner: str) -> Signal:
        """Return the plant's parameter: torque per force that is turned by 90 degrees to the left.

        Parameters
        ----------
        owner : str
            Name of the Block.
        """
        arm = self.x * math.cos(self.direction) + self.y * math.sin(self.direction)
        text = f"lever arm of the fan {self.name}, its force turned by 90 degrees"
        return Signal(f"{owner}.{self.name}_cross_arm", "m", text, start=arm, nominal=abs(arm) or 1.0)

    def gain_signal(self, owner: str) -> Signal:
        """Return the plant's parameter: the factor of the force.

        Parameters
        ----------
        owner : str
            Name of the Block.
        """
        start = 1.0 if self.gain is None else self.gain
        text = f"gain of the fan {self.name}"
        return Signal(f"{owner}.{self.name}_gain", "1", text, start=start, lower=0.0)

    def parameters(self, owner: str) -> tuple[Signal, ...]:
        """Return the plant's parameters of this fan: lever arm, static curve, gain.

        Parameters
        ----------
        owner : str
            Name of the Block.
        """
        gain = () if self.gain is None else (self.gain_signal(owner),)
        return (self.lever_arm(owner), *self._curve_parameters(owner), *gain)

    def _curve_parameters(self, owner: str) -> tuple[Signal, ...]:
        return () if self._law is None else self._law.parameters(f"{owner}.{self.name}", self.name)


def _numbers(where: str, given: Any, least: int) -> tuple[float, ...]:
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise InputError(f"{where} must be a list of numbers, found {given!r}")
    found = tuple(number(f"{where}[{i}]", value) for i, value in enumerate(given))
    if len(found) < least or not all(map(math.isfinite, found)):
        raise InputError(f"{where} must be a list of {least} or more finite numbers, found {list(found)!r}")
    return found


def fans_alike(fans: Iterable[Fan]) -> tuple[Fan, ...]:
    """Return the fans with gains of 1: the equations are the same for every gain."""
    return tuple(f if f.gain is None else replace(f, gain=1.0) for f in fans)
