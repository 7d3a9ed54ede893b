"""What the model of a machine of your own lacks: a trolley on a rail, closed-loop logs (own_machine.md)."""

# ruff: noqa: D102  (an effect's class says what its terms add)

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp

import hovercontrol as hc
from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.identification.diagnose import Diagnosis, diagnose
from hovercontrol.identification.diagnose.report import write_report
from hovercontrol.logs import Log

# ---- 1. The machine: a Block, its equations written once ---------------------------------------------------

position, velocity = hc.Signal("position", "m"), hc.Signal("velocity", "m/s")
force = hc.Signal("force", "N", "commanded to the motor", lower=-150.0, upper=150.0)
mass = hc.Signal("mass", "kg", "of the trolley", start=50.0)
rolling = hc.Signal("rolling", "1/s", "drag in proportion to velocity", start=0.4, lower=0.0)

TROLLEY = hc.Block(
    "trolley",
    states=[position, velocity],
    inputs=[force],
    outputs=[position],  # a laser sees nothing else
    parameters=[mass, rolling],
    derivatives={
        "position": velocity.symbol,
        "velocity": force.symbol / mass.symbol - rolling.symbol * velocity.symbol,
    },
)

# ---- 2. Effects: friction, which the model has, and two that it may lack -----------------------------------


class RailFriction(hc.Effect):
    """Dry friction of the wheels."""

    name = "rail_friction"
    value = hc.Coefficient("m/s^2", lower=0.0)
    width = hc.Shape("m/s", lower=1e-9, default=0.01)

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {"velocity": -c.value * hc.sgn(s.velocity, c.width)}


class CableSpring(hc.Effect):
    """A cable that pulls back once the trolley is farther out than a point."""

    name = "cable_spring"
    value = hc.Coefficient("1/s^2", lower=0.0)
    beyond = hc.Shape("m", search=(0.0, 0.4, 0.8))

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {"velocity": -c.value * sp.Max(0, s.position - c.beyond)}


class RailSlope(hc.Effect):
    """A rail that is not level."""

    name = "rail_slope"
    value = hc.Coefficient("m/s^2")

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {"velocity": c.value}


MODEL = BlockModel(
    TROLLEY,
    catalogue=["cable_spring", "rail_slope", "thrust_lag", "input_delay"],
    effects=[hc.effect("rail_friction", 0.3)],
)


# ---- 3. Logs: a real machine gives them; here one with a cable ---------------------------------------------


def trial(machine: BlockModel, name: str, seed: int, seconds: float = 40.0, dt: float = 0.02) -> Log:
    """Return a closed-loop log: a controller moves the trolley from point to point by what the laser says."""
    rng = np.random.default_rng(seed)
    block = machine.plant()
    plant = block.compile(friction="smooth")
    times = np.arange(0.0, seconds, dt)
    goals = np.repeat(rng.uniform(-1.5, 1.5, times.size), round(2.0 / dt))
    state, last, rows = np.zeros(len(block.states)), 0.0, []
    for time, goal in zip(times, goals, strict=False):
        seen = state[0] + 1e-3 * rng.normal()
        wanted = 250.0 * (goal - seen) - 120.0 * (seen - last) / dt
        command, last = float(np.clip(wanted, -100.0, 100.0)), seen
        rows.append((seen, command))
        state = plant.simulate([time, time + dt], [command, command], x0=state).states[:, -1]
    distances, commands = np.transpose(rows)
    return Log(name, times, {"position": distances, "force": commands})


def real_machine() -> BlockModel:
    """Return what nobody knows: coefficients a little off, and a cable."""
    other = MODEL.with_coefficients(
        {"mass": 48.8, "rolling": 0.38, "rail_friction": 0.29, "rail_friction_width": 0.03}
    )
    return other.with_effects([hc.effect("cable_spring", 0.8, beyond=0.5)])


# ---- 4. The diagnosis --------------------------------------------------------------------------------------


def main(out: Path) -> Diagnosis:
    """Make logs, diagnose the model, print what it lacks, write logs and report."""
    machine = real_machine()
    logs = [trial(machine, f"trial {seed}", seed) for seed in (1, 2)]
    holdout = trial(machine, "hold-out trial", 3)
    out.mkdir(parents=True, exist_ok=True)
    for number, log in enumerate([*logs, holdout], 1):
        log.save(out / f"trial{number}.csv")
    found = diagnose(MODEL, logs, holdout)
    print(f"verdict: {found.verdict}")
    for number in found.effects:
        low, high = number.interval
        print(f"{number.parameter} = {number.value:.4g} {number.unit}, 95 %: {low:.4g} to {high:.4g}")
    if found.before and found.after:
        before, after = (1e3 * gap.rms["position"] for gap in (found.before, found.after))
        print(f"error of the position on the hold-out log: {before:.2f} mm before, {after:.2f} mm after")
    print(f"look at {write_report(found, out / 'report.html')}")
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out") / "own_machine", help="folder of the report")
    main(parser.parse_args().out)
