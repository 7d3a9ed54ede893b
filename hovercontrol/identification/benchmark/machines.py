"""The machines of the benchmark: textbook models, what drives them, and how large their signals are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import sympy as sp

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.effects import effect
from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.vehicles import four_fan

Range = tuple[float, float]


@dataclass(frozen=True)
class Machine:
    """One machine.

    Attributes
    ----------
    model : callable
        Returns the model at its nominal coefficients.
    source : str
        Where its equations come from.
    commands : mapping of str to (float, float)
        Range of each input, in its unit. Inputs are random steps.
    hold : (float, float)
        Shortest and longest time between two steps [s].
    noise : mapping of str to float
        Standard deviation of each measured state, in its unit.
    gusts : mapping of str to float
        Standard deviation of the random acceleration in each equation under the condition ``gusts``, in the
        unit of the equation.
    effects : mapping of str to mapping of str to (float, float)
        Effects of the catalogue that may be missing: the range of each number, in its unit.
    laws : mapping of (str, str) to (float, float)
        Laws that may be missing: equation and expression, and the range of c in ``- c expression``.
    dt : float
        Time between rows [s].
    """

    model: Callable[[], Model | BlockModel]
    source: str
    commands: Mapping[str, Range]
    hold: Range
    noise: Mapping[str, float]
    gusts: Mapping[str, float]
    effects: Mapping[str, Mapping[str, Range]]
    laws: Mapping[tuple[str, str], Range]
    dt: float = 0.02


def _block(name: str, states: list[Signal], inputs: list[Signal], parameters: Mapping[str, Signal],
           rates: Mapping[str, sp.Expr]) -> BlockModel:  # fmt: skip
    return BlockModel(
        Block(name, tuple(states), tuple(inputs), tuple(states), tuple(parameters.values()), dict(rates))
    )


def _parameters(**given: tuple[float, str]) -> dict[str, Signal]:
    return {name: Signal(name, unit, start=value) for name, (value, unit) in given.items()}


def rudder_craft() -> Model:
    """Return a craft with a propeller and a rudder [C17 (10)]."""
    typical = {
        "surge_coulomb": 0.35,
        "surge_linear_drag": 0.4,
        "sway_coulomb": 0.3,
        "sway_linear_drag": 0.9,
        "yaw_coulomb": 0.6,
        "yaw_linear_drag": 0.5,
        "thrust": 0.75,
        "rudder_torque": 2.5,
    }
    return Model("rudder", tuple(effect(name, value) for name, value in typical.items()))


def ship() -> BlockModel:
    """Return the sway and yaw of a model ship at constant speed, linear in v, r and the rudder.

    ::

        v' = -yv v - yr r + yd delta,    r' = -nv v - nr r + nd delta

    """
    psi, v, r, delta = Signal("psi", "rad"), Signal("v", "m/s"), Signal("r", "rad/s"), Signal("rudder", "rad")
    p = _parameters(
        yv=(0.6, "1/s"), yr=(0.3, "m/s"), yd=(0.15, "m/s^2"),
        nv=(0.8, "1/(m*s)"), nr=(1.2, "1/s"), nd=(1.5, "1/s^2"),
    )  # fmt: skip
    c = {k: s.symbol for k, s in p.items()}
    rates = {
        "psi": r.symbol,
        "v": -c["yv"] * v.symbol - c["yr"] * r.symbol + c["yd"] * delta.symbol,
        "r": -c["nv"] * v.symbol - c["nr"] * r.symbol + c["nd"] * delta.symbol,
    }
    return _block("ship", [psi, v, r], [delta], p, rates)


def rover() -> BlockModel:
    """Return a skid-steered rover: speed V and yaw rate R follow throttle and steering by first order.

    ::

        psi' = R,    V' = a throttle - d V,    R' = b steer - e R

    """
    psi, V, R = Signal("psi", "rad"), Signal("speed", "m/s"), Signal("turn", "rad/s")
    throttle, steer = Signal("throttle", "1"), Signal("steer", "1")
    p = _parameters(a=(2.0, "m/s^2"), d=(1.2, "1/s"), b=(4.0, "rad/s^2"), e=(2.5, "1/s"))
    c = {k: s.symbol for k, s in p.items()}
    rates = {
        "psi": R.symbol,
        "speed": c["a"] * throttle.symbol - c["d"] * V.symbol,
        "turn": c["b"] * steer.symbol - c["e"] * R.symbol,
    }
    return _block("rover", [psi, V, R], [throttle, steer], p, rates)


def motor() -> BlockModel:
    """Return a direct-current motor, current i and speed w.

    ::

        i' = (V - R i - k w) / L,    w' = (k i - b w) / J

    """
    i, w, V = Signal("current", "A"), Signal("speed", "rad/s"), Signal("voltage", "V")
    p = _parameters(
        per_inductance=(20.0, "1/H"), resistance=(16.0, "1/s"), emf=(1.0, "A/rad"),
        torque=(12.0, "rad/(A*s^2)"), damping=(0.8, "1/s"),
    )  # fmt: skip
    c = {k: s.symbol for k, s in p.items()}
    rates = {
        "current": c["per_inductance"] * V.symbol - c["resistance"] * i.symbol - c["emf"] * w.symbol,
        "speed": c["torque"] * i.symbol - c["damping"] * w.symbol,
    }
    return _block("motor", [i, w], [V], p, rates)


def pendulum() -> BlockModel:
    """Return a driven pendulum, angle q and rate w.

    ::

        q' = w,    w' = a torque - g sin(q) - b w

    """
    q, w, tau = Signal("angle", "rad"), Signal("rate", "rad/s"), Signal("torque", "N*m")
    p = _parameters(a=(6.5, "1/(kg*m^2)"), gravity=(19.0, "1/s^2"), viscous=(0.3, "1/s"))
    c = {k: s.symbol for k, s in p.items()}
    pull = c["a"] * tau.symbol - c["gravity"] * sp.sin(q.symbol) - c["viscous"] * w.symbol
    return _block("pendulum", [q, w], [tau], p, {"angle": w.symbol, "rate": pull})


_POSE = {"x": 1e-3, "y": 1e-3, "psi": 2e-3}
_FANS = ("rear_left", "rear_right", "front_left", "front_right")

MACHINES: dict[str, Machine] = {
    "rudder": Machine(
        rudder_craft,
        "Cabecinhas et al., IEEE TCST (C17), (10)",
        {"thrust": (-1.5, 3.5), "rudder": (-0.45, 0.45)},
        (0.4, 1.8),
        {**_POSE, "u": 5e-3, "v": 5e-3, "r": 1e-2},
        {"u": 0.05, "v": 0.05, "r": 0.15},
        {
            "yaw_quadratic_drag": {"value": (0.1, 0.3)},
            "thrust_yaw_torque": {"value": (0.1, 0.3)},
            "munk_moment": {"value": (0.5, 1.0)},
            "rudder_lag": {"seconds": (0.1, 0.25)},
        },
        {
            ("r", "Abs(v)*r"): (0.5, 1.0),
            ("v", "u*v"): (0.3, 0.6),
            ("u", "thrust*u"): (0.08, 0.15),
            ("u", "sin(2*psi)"): (0.1, 0.2),
        },
    ),
    "fans": Machine(
        four_fan,
        "four fixed fans: hovercontrol.craft.models.vehicles.four_fan",
        dict.fromkeys(_FANS, (0.0, 0.08)),
        (0.3, 1.2),
        {**_POSE, "u": 5e-3, "v": 5e-3, "r": 1e-2},
        {"u": 0.05, "v": 0.05, "r": 0.3},
        {
            "sway_quadratic_drag": {"value": (0.3, 0.6)},
            "slope": {"x": (0.08, 0.15), "y": (0.08, 0.15)},
            "fan_lag": {"seconds": (0.05, 0.15)},
            "fan_misalignment": {"value": (0.05, 0.15)},
        },
        {
            ("r", "Abs(u)*r"): (0.4, 0.8),
            ("v", "u*v"): (0.4, 0.8),
            ("u", "Abs(r)*u"): (0.05, 0.15),
            ("v", "v**3"): (0.2, 0.5),
        },
    ),
    "ship": Machine(
        ship,
        "Davidson and Schiff (1946); Fossen, Handbook of Marine Craft, 2nd ed., 7.1",
        {"rudder": (-0.6, 0.6)},
        (1.0, 5.0),
        {"psi": 3e-3, "v": 5e-3, "r": 5e-3},
        {"v": 0.02, "r": 0.06},
        {
            "r_quadratic_drag": {"value": (0.5, 1.2)},
            "v_quadratic_drag": {"value": (1.0, 2.5)},
            "r_offset": {"value": (0.05, 0.15)},
            "rudder_lag": {"seconds": (0.2, 0.5)},
        },
        {
            ("r", "Abs(v)*r"): (1.5, 3.0),
            ("v", "Abs(r)*v"): (0.5, 1.0),
            ("v", "v**3"): (4.0, 8.0),
            ("r", "v**2*r"): (6.0, 12.0),
        },
        dt=0.05,
    ),
    "rover": Machine(
        rover,
        "Siegwart, Nourbakhsh, Scaramuzza, Autonomous Mobile Robots, 2nd ed., 3.2, with first-order drives",
        {"throttle": (-1.0, 1.0), "steer": (-1.0, 1.0)},
        (0.5, 2.0),
        {"psi": 3e-3, "speed": 5e-3, "turn": 1e-2},
        {"speed": 0.08, "turn": 0.2},
        {
            "speed_quadratic_drag": {"value": (0.3, 0.8)},
            "turn_coulomb": {"value": (0.3, 0.8)},
            "throttle_lag": {"seconds": (0.1, 0.3)},
            "steer_deadzone": {"width": (0.08, 0.2)},
        },
        {
            ("speed", "Abs(turn)*speed"): (0.3, 0.7),
            ("speed", "sin(2*psi)"): (0.15, 0.4),
            ("speed", "throttle*speed"): (0.3, 0.6),
            ("turn", "Abs(speed)*turn"): (0.5, 1.0),
        },
    ),
    "motor": Machine(
        motor,
        "Franklin, Powell, Emami-Naeini, Feedback Control of Dynamic Systems, 7th ed., 2.3.2",
        {"voltage": (-6.0, 6.0)},
        (0.3, 1.5),
        {"current": 2e-2, "speed": 5e-2},
        {"current": 0.5, "speed": 1.0},
        {
            "speed_coulomb": {"value": (2.0, 5.0)},
            "speed_quadratic_drag": {"value": (0.02, 0.06)},
            "speed_offset": {"value": (2.0, 5.0)},
            "voltage_deadzone": {"width": (0.3, 0.8)},
        },
        {
            ("speed", "speed**3"): (0.0008, 0.002),
            ("speed", "Abs(current)*current"): (0.8, 1.6),
            ("current", "Abs(speed)*current"): (0.1, 0.3),
            ("speed", "voltage*Abs(speed)"): (0.03, 0.08),
        },
        dt=0.01,
    ),
    "pendulum": Machine(
        pendulum,
        "Khalil, Nonlinear Systems, 3rd ed., 1.2.1",
        {"torque": (-2.0, 2.0)},
        (0.3, 1.0),
        {"angle": 2e-3, "rate": 1e-2},
        {"rate": 0.4},
        {
            "rate_coulomb": {"value": (0.5, 1.2)},
            "rate_quadratic_drag": {"value": (0.05, 0.15)},
            "rate_offset": {"value": (0.5, 1.2)},
            "torque_lag": {"seconds": (0.04, 0.1)},
        },
        {
            ("rate", "rate**3"): (0.01, 0.03),
            ("rate", "sin(2*angle)"): (1.0, 2.5),
            ("rate", "Abs(angle)*rate"): (0.2, 0.5),
            ("rate", "torque*Abs(rate)"): (0.15, 0.4),
        },
        dt=0.01,
    ),
}  # fmt: skip
