"""From bench data to lookup tables and to numbers with errors: fan, rudder, inertia (calibration.md)."""

from __future__ import annotations

import argparse
import csv
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.craft.hardware.actuators import actuators, fan_force, read_fan_table
from hovercontrol.craft.hardware.calibration import (
    FanCalibration,
    Fit,
    fit_inertia,
    fit_rudder,
    fit_thrust,
    mean_inertia,
    read_fan_bench,
    thrust_table_from_bench,
)
from hovercontrol.logs import BenchTable

Floats = NDArray[np.float64]

ARM = 0.32  # the rudder behind the centre of mass [m]

# ---- 1. Benches: a real one gives these files; here they are drawn with noise ------------------------------


def simulate_fan_bench(path: Path, rng: np.random.Generator) -> Path:
    """Write what K06's stand-in fan gives: 14 rudder angles forward; in reverse rudder 0, five times each."""
    forward, reverse = np.arange(3000.0, 12001.0, 1000.0), -np.repeat(np.arange(6000.0, 12001.0, 1000.0), 5)
    angles = [(angle, forward) for angle in np.arange(-35.0, 31.0, 5.0)]
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["rudder_deg", "speed_rpm", "force_N"])
        for angle, speeds in [*angles, (0.0, reverse)]:
            gauge = fan_force(speeds, angle) + rng.normal(0.0, 0.01, speeds.size)
            rows.writerows([angle, speed, f"{f:.4f}"] for speed, f in zip(speeds, gauge, strict=True))
    return path


def simulate_rudder_bench(rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Return angles of the force and of the rudder [degree]: the craft on a tether, read by eye."""
    rudder = np.arange(-35.0, 31.0, 5.0)
    return (0.566 - rudder) / 1.40 + rng.normal(0.0, 0.5, rudder.size), rudder


def simulate_release(side_force: float, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Return times [s] and yaw rates [rad/s] of a craft let go under a side force; friction ends the line."""
    time = np.arange(0.0, 2.0, 0.0065536)
    return time, -ARM * side_force / 0.096 * np.minimum(time, 1.2) + rng.normal(0.0, 0.05, time.size)


# ---- 2. From the bench to both tables ----------------------------------------------------------------------


def calibrate_fan(bench: Path, out: Path) -> FanCalibration:
    """Fit the bench, write both tables and the picture of what the fits leave."""
    found = thrust_table_from_bench(*read_fan_bench(bench))
    found.to_csv(out)
    found.plot().savefig(out / "thrust.png", dpi=150)
    found.ratio.plot().savefig(out / "reverse_ratio.png", dpi=150)
    return found


# ---- 3. Rudder and inertia ---------------------------------------------------------------------------------


def calibrate_craft(rng: np.random.Generator) -> tuple[Fit, Fit]:
    """Return the rudder's regression (4.3) and the mean moment of inertia of six release tests (4.5)."""
    rudder = fit_rudder(*simulate_rudder_bench(rng))
    trials = []
    for side_force in (-0.28, 0.31, -0.25, 0.28, -0.31, 0.25):
        time, rate = simulate_release(side_force, rng)
        trial = fit_inertia(time, rate, side_force=side_force, arm=ARM, between=(0.0, 1.2))
        trials.append(trial.coefficients()["inertia"])
    return rudder, mean_inertia(trials)


# ---- 4. A bench that knows no speed: pulse widths and gram-force -------------------------------------------


def calibrate_pulses(path: Path, out: Path) -> Fit:
    """Fit the thrust of one of two equal fans over the pulse width, trials averaged."""
    bench = BenchTable.from_csv(path, fans=2)
    fit = fit_thrust(bench.command, bench.thrust, unit="us")
    fit.plot().savefig(out / "thrust_over_pulse.png", dpi=150)
    return fit


# ---- 5. The tables at work ---------------------------------------------------------------------------------


def worst_force(folder: Path) -> float:
    """Return by how much what the fan makes differs at most from what the law asks of the tables [N]."""
    tables = read_fan_table(folder / "speed_over_force.csv"), read_fan_table(folder / "force_over_speed.csv")
    lookup = Ticking(actuators(tables=tables).pilot[2])
    worst = 0.0
    for rudder in (-30.0, -15.0, 0.0, 15.0, 30.0):
        for force in (-0.2, 0.2, 0.5, 1.0):
            asked = {"thrust_command": force, "rudder_angle_command": math.radians(rudder)}
            speed = lookup.tick(0.0, asked)["fan_speed_command"] * 30 / math.pi  # RPM
            worst = max(worst, abs(float(fan_force(speed, rudder)) - force))
    return worst


def main(out: Path, pulses: Path | None) -> None:
    """Simulate the benches, calibrate, print what was found, run the loop with the tables."""
    out.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(1)
    fan = calibrate_fan(simulate_fan_bench(out / "bench.csv", rng), out)
    print(f"tables: {fan.lookup.shape} speeds over forces, {fan.reverse.shape} forces over speeds")
    print(*[fan.thrust[0.0], fan.ratio, *calibrate_craft(rng)], sep="\n")
    if pulses:
        print(calibrate_pulses(pulses, out))

    print(f"worst force that the tables get wrong: {1e3 * worst_force(out):.0f} mN")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out") / "calibration", help="folder of the results")
    parser.add_argument("--pulses", type=Path, help="a bench as CSV: pulse width [us], trials in gram-force")
    given = parser.parse_args()
    main(given.out, given.pulses)
