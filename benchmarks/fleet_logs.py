"""Logs of a simulated fleet of rudder craft with known faults, and of carts; no code of the package."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Coefficients of the model file; their scatter between craft, and from log to log of a craft (relative).
NOMINAL = {
    "surge_linear_drag": 0.60, "sway_linear_drag": 1.20, "yaw_linear_drag": 0.90,
    "thrust": 0.75, "rudder_torque": 3.66,
}  # fmt: skip
SCATTER, DAILY = 0.05, 0.02

#: Noise of x and y [m], and of psi [rad].
NOISE = (2e-3, 2e-3, 4e-3)

MODEL = "\n".join(['[plant]\nname = "carrier"\n\n[effects]', *(f"{k} = {v}" for k, v in NOMINAL.items())])


@dataclass(frozen=True)
class Craft:
    """The truth of one craft: coefficients and what the model does not have.

    Attributes
    ----------
    lag : float
        Time constant of the rudder servo [s].
    offset : float
        Angle of the rudder at command zero [rad].
    arm : float
        Distance of the tracked point ahead of the centre of mass [m].
    drift : (str, float, float)
        Coefficient that changes by a part a day from a day on.
    """

    name: str
    values: dict[str, float]
    lag: float = 0.0
    offset: float = 0.0
    arm: float = 0.0
    drift: tuple[str, float, float] = ("", 0.0, 0.0)
    fault: str = field(default="")

    def on(self, day: float) -> dict[str, float]:
        """Return the coefficients on a day."""
        name, rate, since = self.drift
        return {k: v * (1.0 + rate * max(day - since, 0.0) * (k == name)) for k, v in self.values.items()}


def fleet(count: int, rng: np.random.Generator, lag: float = 0.12, faults: bool = True) -> list[Craft]:
    """Return craft with a rudder lag in all, and one fault each in three and a drift in one of them."""
    craft = []
    for k in range(count):
        values = {n: v * (1.0 + SCATTER * rng.normal()) for n, v in NOMINAL.items()}
        more: dict[str, object] = {}
        if faults and k == 3:
            more = {"offset": 0.03, "fault": "rudder_offset"}
        if faults and k == 5:
            values["thrust"], more = 0.75 * NOMINAL["thrust"], {"fault": "thrust"}
        if faults and k == 8:
            more = {"arm": 0.03, "fault": "pose_lever_arm"}
        if faults and k == 6:
            more = {"drift": ("yaw_linear_drag", 0.02, 4.0), "fault": "yaw_linear_drag"}
        craft.append(Craft(f"craft{k:02d}", values, lag, **more))  # type: ignore[arg-type]
    return craft


def log(
    craft: Craft, day: float, rng: np.random.Generator, seconds: float = 12.0, rate: float = 20.0
) -> Array:
    """Return the rows time, x, y, psi, thrust, rudder of one log: steps of the commands, from rest."""
    c = {k: v * (1.0 + DAILY * rng.normal()) for k, v in craft.on(day).items()}
    t = np.arange(0.0, seconds, 1.0 / rate)
    held = int(rate)  # a new command each second
    parts = -(-t.size // held)
    T = np.repeat(rng.uniform(0.5, 4.0, parts), held)[: t.size]
    th = np.repeat(rng.uniform(-0.45, 0.45, parts), held)[: t.size]

    def f(s: Array, T: float, th: float) -> Array:
        _, _, psi, u, v, r, actual = s
        a = actual + craft.offset
        return np.array([
            u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi), r,
            -c["surge_linear_drag"] * u + c["thrust"] * T * np.cos(a) + v * r,
            -c["sway_linear_drag"] * v + c["thrust"] * T * np.sin(a) - u * r,
            -c["yaw_linear_drag"] * r - c["rudder_torque"] * T * np.sin(a),
            (th - actual) / craft.lag,
        ])  # fmt: skip

    s, h, path = np.zeros(7), 0.25 / rate, []
    for k in range(t.size):
        path.append(s)
        for _ in range(4):  # Runge-Kutta of order 4
            k1 = f(s, T[k], th[k])
            k2 = f(s + 0.5 * h * k1, T[k], th[k])
            k3 = f(s + 0.5 * h * k2, T[k], th[k])
            s = s + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + f(s + h * k3, T[k], th[k]))
    x, y, psi = np.array(path)[:, :3].T
    x, y = x + craft.arm * np.cos(psi), y + craft.arm * np.sin(psi)
    seen = np.stack([x, y, psi]) + np.array(NOISE)[:, None] * rng.normal(size=(3, t.size))
    return np.stack([t, *seen, T, th], axis=1)


def write(folder: Path, craft: list[Craft], days: int, seed: int = 0, seconds: float = 12.0) -> list[Path]:
    """Write ``CRAFT/dayDD.csv`` for each craft and day, and ``craft.toml``; return the logs."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "craft.toml").write_text(MODEL + "\n", encoding="utf-8")
    files = []
    for k, one in enumerate(craft):
        (folder / one.name).mkdir(exist_ok=True)
        for day in range(days):
            rows = log(one, day, np.random.default_rng([seed, k, day]), seconds)
            file = folder / one.name / f"2026-11-{day + 1:02d}.csv"
            with file.open("w", newline="", encoding="utf-8") as stream:
                csv.writer(stream).writerows([["time", "x", "y", "psi", "thrust", "rudder"]])
                np.savetxt(stream, rows, fmt="%.6g", delimiter=",")
            files.append(file)
    return files


#: A cart, a machine of one state whose logs are identified in a tenth of a second.
CART = """
import hovercontrol as hc
V, K, F = hc.Signal("v", "m/s"), hc.Signal("k", "1/s", start=1.0), hc.Signal("f", "m/s^2")
CART = hc.Block("cart", [V], [F], [V], [K], {"v": F.symbol - K.symbol * V.symbol})
"""


def write_carts(folder: Path, rng: np.random.Generator, rates: Mapping[str, float], logs: int) -> None:
    """Write logs of carts with these rates of decay [1/s]: exact steps of 0.05 s, noise of 5 mm/s."""
    t = 0.05 * np.arange(60)
    for cart, rate in rates.items():
        (folder / cart).mkdir(parents=True)
        for day in range(logs):
            f, v = np.repeat(rng.normal(size=6), 10), np.zeros(60)
            for k in range(59):
                v[k + 1] = f[k] / rate + (v[k] - f[k] / rate) * np.exp(-0.05 * rate)
            rows = np.stack([t, v + 5e-3 * rng.normal(size=60), f], axis=1)
            path = folder / cart / f"2026-11-{day + 1:02d}.csv"
            np.savetxt(path, rows, fmt="%.6g", delimiter=",", header="time,v,f", comments="")
