"""Families of machines for ``own_machines``, each written twice: as a Block, and by hand for the simulation.

The simulation (classical Runge-Kutta, process noise as an acceleration that is drawn anew for each sub-step)
shares no code with the package.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import sympy as sp
from numpy.typing import NDArray

import hovercontrol as hc

Array = NDArray[np.float64]
Values = Mapping[str, float]
#: Feedback ``law(y, memory, r)`` of measured values and the reference; returns the input and the new memory.
Law = Callable[[Array, Array, float], tuple[Array, Array]]

#: Number of sub-steps of the simulation from row to row.
PARTS = 10


@dataclass(frozen=True)
class Family:
    """A kind of machine.

    Attributes
    ----------
    states, inputs, measured : mapping of str to str
        Names and units.
    parameters : mapping of str to (float, str)
        Usual value and unit; the true one is within a factor of 1.3.
    equations : callable
        Derivatives (or next values) as SymPy expressions of the symbols by name.
    slopes : callable
        The same by hand, ``slopes(x, u, p)``.
    step : float
        Time from row to row [s].
    size : float
        Size of the input.
    noise : float
        Measurement noise relative to the spread of each channel.
    pushed : dict of str to float
        Process noise of states [unit of the rate times root of s].
    start : tuple of float
    law : callable, optional
        Feedback.
    period : bool
        Whether the equations are next values.
    offset : float
        Mean of the input.
    stable : bool
        Whether the machine is stable without its law.
    known : mapping of str to (float, str)
        Value and unit of parameters that are not fitted.
    """

    name: str
    states: Mapping[str, str]
    inputs: Mapping[str, str]
    measured: tuple[str, ...]
    parameters: Mapping[str, tuple[float, str]]
    equations: Callable[..., dict[str, sp.Expr]]
    slopes: Callable[[Array, Array, Values], Array]
    step: float
    size: float
    noise: float = 0.01
    pushed: Mapping[str, float] = field(default_factory=dict)
    start: tuple[float, ...] = ()
    law: Law | None = None
    period: bool = False
    offset: float = 0.0
    stable: bool = True
    known: Mapping[str, tuple[float, str]] = field(default_factory=dict)

    def rate(self, x: Array, u: Array, p: Values) -> Array:
        """Return the derivatives, or the mean ones over a period."""
        found = self.slopes(x, u, p)
        return (found - x) / self.step if self.period else found

    def under(self, law: Law, size: float, **more: object) -> Family:
        """Return the family under feedback; `size` is that of the reference."""
        new = {"name": f"{self.name} under feedback", "law": law, "size": size, "offset": 0.0, **more}
        return replace(self, **new)  # type: ignore[arg-type]

    @property
    def sampled(self) -> Family:
        """The family with next values ``x + period f(x, u)``."""
        names, f, slopes = list(self.states), self.equations, self.slopes

        def following(period: sp.Symbol, **of: sp.Symbol) -> dict[str, sp.Expr]:
            return {name: of[name] + period * e for name, e in f(**of).items()}

        return replace(
            self, name=f"sampled {self.name}", equations=following, period=True,
            known={**self.known, "period": (self.step, "s")},
            slopes=lambda x, u, p: x + self.step * slopes(x, u, p),
            pushed={name: self.step**0.5 * self.pushed[name] for name in names if name in self.pushed},
        )  # fmt: skip

    def block(self, values: Values) -> hc.Block:
        """Return the Block with these values of its parameters."""
        signals = {name: hc.Signal(name, unit) for name, unit in (*self.states.items(), *self.inputs.items())}
        parameters = [
            hc.Signal(name, unit, start=values[name], lower=0.0)
            for name, (_, unit) in self.parameters.items()
        ]
        parameters += [hc.Signal(name, unit, start=value) for name, (value, unit) in self.known.items()]
        symbols = {s.name: s.symbol for s in (*signals.values(), *parameters)}
        own = [signals[name] for name in self.states]
        return hc.Block(
            self.name.replace(" ", "_").replace("-", "_"), own, [signals[name] for name in self.inputs],
            [signals[name] for name in self.measured], parameters,
            self.equations(**symbols), **({"period": self.step} if self.period else {}),
        )  # fmt: skip


def _pi(kp: float, ki: float, step: float, at: int) -> Law:
    def law(y: Array, memory: Array, r: float) -> tuple[Array, Array]:
        error = r - y[at]
        total = memory + step * error if memory.size else np.array([step * error])
        return np.array([kp * error + ki * total[0]]), total

    return law


def _pd(kp: float, kd: float, step: float, at: int = 0, sign: float = -1.0, about: float = 0.0) -> Law:
    """Return a law on a noisy position and its difference over one row."""

    def law(y: Array, memory: Array, r: float) -> tuple[Array, Array]:
        error = y[at] - about
        rate = (error - memory[0]) / step if memory.size else 0.0
        return np.array([sign * (kp * error + kd * rate) + r]), np.array([error])

    return law


def _cart(v, F, m, c):  # type: ignore[no-untyped-def]
    return {"v": (F - c * v) / m}


def _pendulum(q, w, M, J, b, k):  # type: ignore[no-untyped-def]
    return {"q": w, "w": (M - b * w - k * sp.sin(q)) / J}


def _motor(i, w, U, L, R, k, J, b):  # type: ignore[no-untyped-def]
    return {"i": (U - R * i - k * w) / L, "w": (k * i - b * w) / J}


def _drive(d, w, W, M, J, K, s, b):  # type: ignore[no-untyped-def]
    twist = s * d + b * (w - W)
    return {"d": w - W, "w": (M - twist) / J, "W": twist / K}


def _car(x, v, y, z, h, m, c, k, K):  # type: ignore[no-untyped-def]
    strut = k * (y - x) + c * (z - v)  # all per unsprung mass
    return {"x": v, "v": strut / m, "y": z, "z": K * (h - y) - strut}


def _tank(h, Q, A, s):  # type: ignore[no-untyped-def]
    return {"h": (Q - s * sp.sqrt(h)) / A}


def _thermal(T, S, P, C, D, g, e):  # type: ignore[no-untyped-def]
    return {"T": (P - g * (T - S)) / C, "S": (g * (T - S) - e * S) / D}


def _boat(u, r, F, N, m, d, q, I, e):  # type: ignore[no-untyped-def]  # noqa: E741
    return {"u": (F - d * u - q * u * sp.Abs(u)) / m, "r": (N - e * r) / I}


def _levitation(x, v, I, g, k, c):  # type: ignore[no-untyped-def]  # noqa: E741
    return {"x": v, "v": g - k * (I / x) ** 2 - c * v}


def _balance(q, w, a, g, l, c):  # type: ignore[no-untyped-def]  # noqa: E741
    return {"q": w, "w": (g * sp.sin(q) - a * sp.cos(q)) / l - c * w}


def _robot(q, w, u, a, b, c):  # type: ignore[no-untyped-def]
    return {"q": w, "w": a * sp.sin(q) + b * u - c * w}


def _ship(p, r, D, T, K, n):  # type: ignore[no-untyped-def]
    return {"p": r, "r": (K * D + r - n * r**3) / T}


def _sampled(v, i, U, a, b, g, e):  # type: ignore[no-untyped-def]
    return {"v": a * v + b * i, "i": g * i + e * U}


def _length(q, w, M, m, l, b, g):  # type: ignore[no-untyped-def]  # noqa: E741
    return {"q": w, "w": (M - b * w - m * g * l * sp.sin(q)) / (m * l**2)}


MOTOR = {
    "states": {"i": "A", "w": "rad/s"}, "inputs": {"U": "V"}, "measured": ("i", "w"),
    "parameters": {"L": (0.05, "H"), "R": (1.0, "ohm"), "k": (0.1, "V*s/rad"), "J": (2e-3, "kg*m^2"),
                   "b": (2e-3, "N*m*s")},
    "equations": _motor, "step": 0.01,
    "slopes": lambda x, u, p: np.array([
        (u[0] - p["R"] * x[0] - p["k"] * x[1]) / p["L"], (p["k"] * x[0] - p["b"] * x[1]) / p["J"]]),
}  # fmt: skip

BASIC = (
    Family("cart", {"v": "m/s"}, {"F": "N"}, ("v",), {"m": (2.0, "kg"), "c": (1.0, "kg/s")}, _cart,
           lambda x, u, p: np.array([(u[0] - p["c"] * x[0]) / p["m"]]), 0.02, 3.0),
    Family("pendulum", {"q": "rad", "w": "rad/s"}, {"M": "N*m"}, ("q",),
           {"J": (0.2, "kg*m^2"), "b": (0.1, "N*m*s"), "k": (2.0, "N*m")}, _pendulum,
           lambda x, u, p: np.array([x[1], (u[0] - p["b"] * x[1] - p["k"] * np.sin(x[0])) / p["J"]]), 0.02,
           1.0, pushed={"w": 0.1}),
    Family("motor", size=6.0, **MOTOR),  # type: ignore[arg-type]
    Family("two-mass drive", {"d": "rad", "w": "rad/s", "W": "rad/s"}, {"M": "N*m"}, ("w", "W"),
           {"J": (0.02, "kg*m^2"), "K": (0.05, "kg*m^2"), "s": (20.0, "N*m"), "b": (0.05, "N*m*s")}, _drive,
           lambda x, u, p: np.array([
               x[1] - x[2], (u[0] - p["s"] * x[0] - p["b"] * (x[1] - x[2])) / p["J"],
               (p["s"] * x[0] + p["b"] * (x[1] - x[2])) / p["K"]]), 0.005, 1.0, pushed={"W": 0.2}),
    Family("quarter car", {"x": "m", "v": "m/s", "y": "m", "z": "m/s"}, {"h": "m"}, ("x", "y"),
           {"m": (7.5, "1"), "c": (37.5, "1/s"), "k": (500.0, "1/s^2"), "K": (4e3, "1/s^2")}, _car,
           lambda x, u, p: np.array([
               x[1], (p["k"] * (x[2] - x[0]) + p["c"] * (x[3] - x[1])) / p["m"], x[3],
               p["K"] * (u[0] - x[2]) - p["k"] * (x[2] - x[0]) - p["c"] * (x[3] - x[1])]), 0.01, 0.03),
    Family("tank", {"h": "m"}, {"Q": "m^3/s"}, ("h",), {"A": (0.5, "m^2"), "s": (0.1, "m^(5/2)/s")}, _tank,
           lambda x, u, p: np.array([(u[0] - p["s"] * np.sqrt(np.maximum(x[0], 0.0))) / p["A"]]), 0.5, 0.05,
           pushed={"h": 2e-3}, start=(1.0,), offset=0.1),
    Family("thermal chain", {"T": "K", "S": "K"}, {"P": "W"}, ("T", "S"),
           {"C": (50.0, "J/K"), "D": (120.0, "J/K"), "g": (2.0, "W/K"), "e": (0.8, "W/K")}, _thermal,
           lambda x, u, p: np.array([
               (u[0] - p["g"] * (x[0] - x[1])) / p["C"], (p["g"] * (x[0] - x[1]) - p["e"] * x[1]) / p["D"]]),
           2.0, 20.0, pushed={"T": 0.05}),
    Family("boat", {"u": "m/s", "r": "rad/s"}, {"F": "N", "N": "N*m"}, ("u", "r"),
           {"m": (30.0, "kg"), "d": (5.0, "kg/s"), "q": (15.0, "kg/m"), "I": (3.0, "kg*m^2"),
            "e": (4.0, "N*m*s")}, _boat,
           lambda x, u, p: np.array([
               (u[0] - p["d"] * x[0] - p["q"] * x[0] * abs(x[0])) / p["m"], (u[1] - p["e"] * x[1]) / p["I"]]),
           0.05, 20.0, pushed={"u": 0.02}),
    Family("robot held by feedback", {"q": "rad", "w": "rad/s"}, {"u": "V"}, ("q",),
           {"a": (60.0, "rad/s^2"), "b": (8.0, "rad/s^2/V"), "c": (1.0, "1/s")}, _robot,
           lambda x, u, p: np.array([x[1], p["a"] * np.sin(x[0]) + p["b"] * u[0] - p["c"] * x[1]]), 0.01, 1.0,
           pushed={"w": 0.1}, start=(0.05, 0.0), law=_pd(18.0, 1.5, 0.01), noise=2e-3, stable=False),
    Family("levitation", {"x": "m", "v": "m/s"}, {"I": "A"}, ("x",),
           {"g": (9.81, "m/s^2"), "k": (9.81e-4, "m^3/s^2/A^2"), "c": (2.0, "1/s")}, _levitation,
           lambda x, u, p: np.array([x[1], p["g"] - p["k"] * (u[0] / x[0]) ** 2 - p["c"] * x[1]]), 0.002, 0.1,
           pushed={"v": 0.02}, start=(0.01, 0.0), law=_pd(300.0, 8.0, 0.002, sign=1.0, about=0.01),
           noise=1e-5, offset=1.0, stable=False),
    Family("balanced rod", {"q": "rad", "w": "rad/s"}, {"a": "m/s^2"}, ("q", "w"),
           {"g": (9.81, "m/s^2"), "l": (0.5, "m"), "c": (0.5, "1/s")}, _balance,
           lambda x, u, p: np.array([x[1], (p["g"] * np.sin(x[0]) - u[0] * np.cos(x[0])) / p["l"]
                                     - p["c"] * x[1]]), 0.01, 0.6, pushed={"w": 0.1}, start=(0.05, 0.0),
           law=lambda y, memory, r: (np.array([25.0 * y[0] + 5.0 * y[1] + r]), memory), noise=5e-3,
           stable=False),
    Family("course-unstable ship", {"p": "rad", "r": "rad/s"}, {"D": "rad"}, ("p", "r"),
           {"T": (20.0, "s"), "K": (0.1, "1/s"), "n": (2e3, "s^2/rad^2")}, _ship,
           lambda x, u, p: np.array([x[1], (p["K"] * u[0] + x[1] - p["n"] * x[1] ** 3) / p["T"]]), 1.0, 0.15,
           pushed={"r": 1e-3}, start=(0.0, 0.0), noise=2e-3,
           law=lambda y, memory, r: (np.array([-1.0 * (y[0] - r) - 25.0 * y[1]]), memory), stable=False),
    Family("motor under PI", size=10.0, law=_pi(0.3, 1.0, 0.01, 1), pushed={"w": 1.0}, noise=0.02,
           **MOTOR),  # type: ignore[arg-type]
    Family("sampled chain", {"v": "m/s", "i": "A"}, {"U": "V"}, ("v", "i"),
           {"a": (0.9, "1"), "b": (0.2, "m/s/A"), "g": (0.7, "1"), "e": (0.3, "A/V")}, _sampled,
           lambda x, u, p: np.array([p["a"] * x[0] + p["b"] * x[1], p["g"] * x[1] + p["e"] * u[0]]), 0.1, 2.0,
           pushed={"v": 0.03}, period=True),
    Family("sampled chain under PI", {"v": "m/s", "i": "A"}, {"U": "V"}, ("v", "i"),
           {"a": (0.9, "1"), "b": (0.2, "m/s/A"), "g": (0.7, "1"), "e": (0.3, "A/V")}, _sampled,
           lambda x, u, p: np.array([p["a"] * x[0] + p["b"] * x[1], p["g"] * x[1] + p["e"] * u[0]]), 0.1, 1.0,
           pushed={"v": 0.03}, period=True, law=_pi(0.3, 0.5, 0.1, 0)),
)  # fmt: skip

_CART, _PENDULUM, _MOTOR, _DRIVE, _CAR, _TANK, _CHAIN, _BOAT, _ROBOT = BASIC[:9]

#: Feedback of a tank's level and a temperature about where they are.
_LEVEL, _HEAT = _pi(0.1, 0.01, 0.5, 0), _pi(8.0, 0.05, 2.0, 1)

FAMILIES = (
    *BASIC,
    replace(_PENDULUM, name="pendulum with a length", equations=_length,
            parameters={"m": (0.8, "kg"), "l": (0.5, "m"), "b": (0.1, "N*m*s")},
            known={"g": (9.81, "m/s^2")},
            slopes=lambda x, u, p: np.array([x[1], (u[0] - p["b"] * x[1]) / (p["m"] * p["l"] ** 2)
                                             - 9.81 / p["l"] * np.sin(x[0])])),
    _CART.under(_pi(4.0, 2.0, 0.02, 0), 1.0, noise=0.02, pushed={"v": 0.1}),
    _PENDULUM.under(_pd(2.0, 0.3, 0.02), 1.0, noise=2e-3),
    _DRIVE.under(_pi(0.05, 0.2, 0.005, 1), 10.0, noise=0.05),
    _TANK.under(lambda y, memory, r: _LEVEL(y, memory, 1.0 + r), 0.3, noise=0.005),
    _CHAIN.under(_HEAT, 5.0, noise=0.05),
    _BOAT.under(lambda y, memory, r: (np.array([60.0 * (0.5 + r - y[0]), 20.0 * (r - y[1])]), memory), 0.4,
                noise=0.01, pushed={"u": 0.02, "r": 0.02}),
    *(f.sampled for f in (_CART, _PENDULUM, _MOTOR, _TANK, _CHAIN, _BOAT)),
    _CART.under(_pi(4.0, 2.0, 0.02, 0), 1.0, noise=0.02, pushed={"v": 0.1}).sampled,
    _ROBOT.sampled,
)  # fmt: skip
