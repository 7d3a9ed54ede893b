"""What acts on a craft and stands in no catalogue: equations, and places where the craft meets it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.identification.benchmark.cases import with_rates

from .generator import with_gusts

Array = NDArray[np.float64]
Random = np.random.Generator


class Drive(NamedTuple):
    """What one log is made from: times, commands, and what is random in the disturbance."""

    name: str
    time: Array
    commands: dict[str, Array]
    pushes: dict[str, Array]  # of bumps and gusts, by the inputs' names
    phase: float


class Motion(NamedTuple):
    """A motion without noise, by name: the states, and what sensors see of it."""

    drive: Drive
    states: dict[str, Array]
    seen: dict[str, Array]


@dataclass(frozen=True)
class Disturbance:
    """Something that no effect says, with its numbers; its phase differs from log to log."""

    kind: str
    values: Mapping[str, float]
    gain: float = 1.0

    def added(self, plant: Block, phase: float) -> Block:
        """Return the plant with the disturbance."""
        return ADDED[self.kind](plant, {**self.values, "phase": phase}, self.gain)


def _numbers(values: Mapping[str, float], strength: float, **units: str) -> dict[str, Signal]:
    """Return the gain and other numbers, with their units, as parameters of a Block."""
    named = {**values, "gain": strength}
    return {k: Signal(f"hidden_{k}", unit, start=float(named[k])) for k, unit in units.items()}


def _patch(block: Block, values: Mapping[str, float], strength: float) -> Block:
    """A rough patch of floor: more drag within a disc."""
    n = _numbers(values, strength, x="m", y="m", radius="m", gain="1/s")
    x, y = (sp.Symbol(s, real=True) for s in ("x", "y"))
    inside = (x - n["x"].symbol) ** 2 + (y - n["y"].symbol) ** 2 < n["radius"].symbol ** 2
    drag = n["gain"].symbol * sp.Piecewise((1, inside), (0, True))
    d = dict(block.derivatives)
    for axis in ("u", "v", "r"):
        d[axis] = d[axis] - drag * sp.Symbol(axis, real=True)
    return with_rates(block, d, parameters=tuple(n.values()))


def _resonance(block: Block, values: Mapping[str, float], strength: float) -> Block:
    """A load on a spring, lightly damped, shaken along one axis: it pushes back on the hull."""
    n = _numbers(values, strength, rate="1/s", damping="1", gain="1")
    axis = "v" if values["sideways"] else "u"
    place, speed = Signal("load", "m"), Signal("load_rate", "m/s")
    w, z, q, dq = n["rate"].symbol, n["damping"].symbol, place.symbol, speed.symbol
    d = dict(block.derivatives)
    u, v, r = (sp.Symbol(s, real=True) for s in ("u", "v", "r"))
    turning = -u * r if axis == "v" else v * r  # of the axes, no acceleration of the hull
    pull = w**2 * q + 2 * z * w * dq
    d |= {"load": dq, "load_rate": -pull - (d[axis] - turning), axis: d[axis] + n["gain"].symbol * pull}
    return with_rates(block, d, states=(place, speed), parameters=tuple(n.values()))


def _cable(block: Block, values: Mapping[str, float], strength: float) -> Block:
    """A cable to a point of the floor: beyond its slack length it pulls like a spring."""
    n = _numbers(values, strength, x="m", y="m", slack="m", gain="m/s^2/m")
    x, y, psi = (sp.Symbol(s, real=True) for s in ("x", "y", "psi"))
    dx, dy = n["x"].symbol - x, n["y"].symbol - y
    slack = n["slack"].symbol
    pull = n["gain"].symbol * (1 - slack / sp.Max(slack, sp.sqrt(dx**2 + dy**2)))  # per metre
    d = dict(block.derivatives)
    d["u"] = d["u"] + pull * (sp.cos(psi) * dx + sp.sin(psi) * dy)
    d["v"] = d["v"] + pull * (-sp.sin(psi) * dx + sp.cos(psi) * dy)
    return with_rates(block, d, parameters=tuple(n.values()))


def _torque(block: Block, values: Mapping[str, float], strength: float) -> Block:
    """A yaw torque that oscillates at 0.7 Hz."""
    n = _numbers(values, strength, rate="rad/s", phase="rad", gain="rad/s^2")
    wave = sp.sin(n["rate"].symbol * time + n["phase"].symbol)
    d = {**block.derivatives, "r": block.derivatives["r"] + n["gain"].symbol * wave}
    return with_rates(block, d, parameters=tuple(n.values()))


def _bumps(block: Block, values: Mapping[str, float], strength: float) -> Block:
    """Short impulses at random times, along all axes."""
    n = _numbers(values, strength, gain="1")
    pushes = {a: Signal(f"bump_{a}", "rad/s^2" if a == "r" else "m/s^2") for a in ("u", "v", "r")}
    d = {a: block.derivatives[a] + n["gain"].symbol * s.symbol for a, s in pushes.items()}
    inputs = tuple(pushes.values())
    return with_rates(block, {**block.derivatives, **d}, inputs=inputs, parameters=tuple(n.values()))


ADDED: dict[str, Callable[[Block, Mapping[str, float], float], Block]] = {
    "patch": _patch,
    "resonance": _resonance,
    "cable": _cable,
    "torque": _torque,
    "bumps": _bumps,
    "gusts": lambda block, values, strength: with_gusts(block),
}


def placed(kind: str, rng: Random, motions: Sequence[Motion]) -> dict[str, float]:
    """Return the numbers of a disturbance; places so that the undisturbed craft meets it."""
    if kind == "resonance":
        rate = 2 * np.pi * rng.uniform(1.0, 2.0)
        return {"rate": rate, "damping": rng.uniform(0.03, 0.08), "sideways": float(rng.integers(2))}
    if kind == "torque":
        return {"rate": 2 * np.pi * 0.7}
    if kind not in ("patch", "cable"):
        return {}
    wanted, best, found = rng.uniform(0.25, 0.45), np.inf, {}
    for _ in range(300):  # each log shall meet it: those that are made from these motions begin alike
        motion = motions[int(rng.integers(len(motions)))]
        k = rng.integers(motion.drive.time.size)
        x, y = float(motion.states["x"][k]), float(motion.states["y"][k])
        away = [np.hypot(m.states["x"] - x, m.states["y"] - y) for m in motions]
        radius = float(np.quantile(away[0], rng.uniform(0.2, 0.7)))
        inside = np.array([np.mean(a < radius) for a in away])
        off = np.abs((inside if kind == "patch" else 1 - inside) - wanted).max()
        off += 0.2 * (kind == "patch" and np.hypot(x, y) < radius)  # a craft that starts in it may stay
        if off < best:
            best, found = off, {"x": x, "y": y, "radius" if kind == "patch" else "slack": radius}
    return found


def unmet(of: Disturbance, motions: Sequence[Motion]) -> float:
    """Return by how much a patch holds, or does not meet, the craft in any log; 0 if it does neither."""
    if of.kind != "patch":
        return 0.0
    x, y, radius = (of.values[k] for k in ("x", "y", "radius"))
    inside = [np.mean(np.hypot(m.states["x"] - x, m.states["y"] - y) < radius) for m in motions]
    return float(sum(max(0.0, 0.1 - part) + max(0.0, part - 0.8) for part in inside)) * 10.0
