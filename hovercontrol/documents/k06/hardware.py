"""K06's craft, link and positioning: tables 4.1 to 5.2, figures 4.2 to 4.6, 5.4, 5.7, 5.8."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import sympy as sp
from matplotlib.figure import Figure

from hovercontrol.craft.hardware.actuators import (
    fan_tables,
    force_angle_of_rudder,
    reverse_ratio,
    servo_table,
)
from hovercontrol.craft.hardware.calibration import fit_inertia, mean_inertia
from hovercontrol.craft.hardware.links import TABLE_5_1, bluetooth_delays
from hovercontrol.craft.hardware.sensors import corrected_range, k06_cricket
from hovercontrol.craft.hardware.sensors.cone import K06_CONE
from hovercontrol.craft.models.vehicles import HOVERDEMON_BODY, hoverdemon
from hovercontrol.documents.printed import rebuilds

#: Table 4.2: rudder, hovercraft angle [deg], force, F_Y [N], yaw acceleration [rad/s^2], inertia [kg*m^2].
TABLE_4_2 = ((-20.0, 14.6, 1.1, -0.28, 0.9412, 0.0952), (25.0, -17.4, 1.05, 0.31, -1.026, 0.0967))

#: Table 5.2: cone angle [deg], true and measured range [cm], their ratio.
TABLE_5_2 = np.array(
    [
        [0, 270.48, 270.48, 1.0],
        [10, 274.65, 274.83, 0.99935],
        [20, 287.84, 288.83, 0.99657],
        [30, 312.32, 315.07, 0.99127],
        [35, 330.20, 334.25, 0.98788],
    ]
)
DRAWS = 20_001
POUND = 0.45359237


@rebuilds(
    "k06",
    "table 4.1",
    why="5.7 lb are 2.6 kg, as K06's text has it and tables 6.2 and 6.3 need; 1.6 is an erratum",
)
def table_4_1(folder: Path) -> Mapping[str, float]:
    """Mass, arm and inertia of the craft [K06 table 4.1]."""
    body = HOVERDEMON_BODY
    return {"mass": body.mass, "mass in pounds": body.mass / POUND, "arm": body.arm, "inertia": body.inertia}


@rebuilds("k06", "table 4.2")
def table_4_2(folder: Path) -> Mapping[str, float]:
    """Inertia of two release tests and their mean [K06 table 4.2]."""
    time = np.linspace(0.0, 1.5, 31)
    found = [
        fit_inertia(time, rate * time, side_force=side, arm=HOVERDEMON_BODY.arm).values[0]
        for _, _, _, side, rate, _ in TABLE_4_2
    ]
    values = {f"trial {k}": float(J) for k, J in enumerate(found, 1)}
    return values | {"mean": float(mean_inertia(found).values[0])}


@rebuilds("k06", "table 5.1")
def table_5_1(folder: Path) -> Mapping[str, float]:
    """Delays as the links draw them: mean and spread of each row [K06 table 5.1]."""
    shares = (np.arange(DRAWS) + 0.5) / DRAWS
    u = sp.Symbol("u", real=True)
    off_mean, off_sd, rows = 0.0, 0.0, ["row,printed mean,ours,printed sd,ours\n"]
    for name, (mean, sd, _, _) in TABLE_5_1.items():
        drawn = 1000 * np.asarray(sp.lambdify(u, bluetooth_delays(name).quantile(u), "numpy")(shares))
        off_mean, off_sd = max(off_mean, abs(drawn.mean() - mean)), max(off_sd, abs(drawn.std() - sd))
        rows.append(f"{name},{mean},{drawn.mean():.3f},{sd},{drawn.std():.3f}\n")
    (folder / "delays.csv").write_text("".join(rows), encoding="utf-8")
    return {"mean, largest difference": off_mean, "standard deviation, largest difference": off_sd}


@rebuilds("k06", "table 5.2")
def table_5_2(folder: Path) -> Mapping[str, float]:
    """Measured ranges corrected for their cone angle [K06 table 5.2]."""
    _, true, measured, _ = TABLE_5_2.T
    ours = 100 * corrected_range(measured / 100, TABLE_5_2[0, 1] / 100)
    return {"corrected less true range, largest": float(np.abs(ours - true).max())}


@rebuilds("k06", "fig 4.2", lacks="the curve; a stand-in is used")
def fig_4_2(folder: Path) -> Mapping[str, float]:
    """Rudder over the servo's pulse, a stand-in [K06 fig 4.2]."""
    table = servo_table()
    figure, axes = _axes("servo command [ms]", "rudder angle [deg]")
    axes.plot(table.pulse, table.angle, "ko-", mfc="white", ms=5)
    figure.savefig(folder / "servo.png", dpi=130)
    return {"largest angle [deg]": float(np.abs(table.angle).max())}


@rebuilds("k06", "fig 4.3")
def fig_4_3(folder: Path) -> Mapping[str, float]:
    """Rudder over hovercraft angle: (4.3) and the trials of table 4.2 [K06 fig 4.3]."""
    rudder = np.linspace(-35.0, 30.0, 66)
    angle = -np.degrees([float(force_angle_of_rudder(math.radians(r))) for r in rudder])
    figure, axes = _axes("hovercraft angle [deg]", "rudder angle [deg]")
    axes.plot(angle, rudder, "k-", label="(4.3)")
    axes.plot([t[1] for t in TABLE_4_2], [t[0] for t in TABLE_4_2], "s", color="C3", label="table 4.2")
    axes.legend(frameon=False)
    figure.savefig(folder / "rudder.png", dpi=130)
    ours = [-math.degrees(float(force_angle_of_rudder(math.radians(t[0])))) for t in TABLE_4_2]
    return {f"trial {k}": a for k, a in enumerate(ours, 1)}


@rebuilds("k06", "fig 4.4", lacks="the measured points")
def fig_4_4(folder: Path) -> Mapping[str, float]:
    """Reverse over forward thrust, (4.4) [K06 fig 4.4]."""
    speed = np.linspace(6000.0, 12000.0, 61)
    ratio = reverse_ratio(speed)
    figure, axes = _axes("fan speed [1000 RPM]", "reverse over forward thrust")
    axes.plot(speed / 1000, ratio, "k-")
    figure.savefig(folder / "reverse_ratio.png", dpi=130)
    return {"at 6000 RPM": float(ratio[0]), "at 12000 RPM": float(ratio[-1])}


@rebuilds("k06", "fig 4.5", lacks="the entries of the table")
def fig_4_5(folder: Path) -> Mapping[str, float]:
    """Force over rudder angle and fan speed, the reverse lookup table [K06 fig 4.5]."""
    table = fan_tables()[1]
    figure = Figure(figsize=(6.5, 5.0), layout="constrained")
    axes = figure.add_subplot(projection="3d")
    x, y = np.meshgrid(table.columns / 1000, table.rudder)
    axes.plot_wireframe(x, y, table.values, rcount=14, ccount=40, lw=0.6)
    axes.set(xlabel="fan speed [1000 RPM]", ylabel="rudder angle [deg]", zlabel="force [N]")
    figure.savefig(folder / "force.png", dpi=130)
    straight = int(np.argmin(np.abs(table.rudder)))
    return {
        f"at {speed:g} RPM, rudder straight": float(np.interp(speed, table.columns, table.values[straight]))
        for speed in (12000.0, -12000.0)
    }


@rebuilds("k06", "fig 4.6", lacks="the curves' numbers and the friction in them")
def fig_4_6(folder: Path) -> Mapping[str, float]:
    """Release test: yaw rate under 1 N at a rudder of -30 degrees, and the inertia of it [K06 fig 4.6]."""
    angle = float(force_angle_of_rudder(math.radians(-30.0)))
    time = np.linspace(0.0, 2.0, 101)
    craft = hoverdemon().plant().compile()
    run = craft.simulate(time, [np.full(len(time), 1.0), np.full(len(time), angle)])
    rate = np.asarray(run.outputs)[run.output_labels.index("r")]
    found = fit_inertia(time, rate, side_force=math.sin(angle), arm=HOVERDEMON_BODY.arm)
    figure, axes = _axes("time since the release [s]", "yaw rate [rad/s]")
    axes.plot(time, rate, "k-", label="1.0 N, rudder at -30 deg, no friction")
    axes.legend(frameon=False)
    figure.savefig(folder / "release.png", dpi=130)
    return {"inertia": float(found.values[0]), "yaw acceleration [rad/s^2]": float(rate[-1] / time[-1])}


@rebuilds("k06", "fig 5.4")
def fig_5_4(folder: Path) -> Mapping[str, float]:
    """Round trip over the downlink's rate [K06 fig 5.4]."""
    rates = (16.2, 22.0, 41.0)
    delays = [1000 * bluetooth_delays(f"linksys_{rate}_round_trip").mean for rate in rates]
    figure, axes = _axes("downlink rate [kbit/s]", "mean round trip [ms]")
    axes.plot(rates, delays, "ko-", mfc="white")
    figure.savefig(folder / "round_trip.png", dpi=130)
    return {f"at {rate:g} kbit/s": delay for rate, delay in zip(rates, delays, strict=True)}


@rebuilds("k06", "fig 5.7")
def fig_5_7(folder: Path) -> Mapping[str, float]:
    """Ratio of true to measured range by the cone angle: (5.7) and table 5.2 [K06 fig 5.7]."""
    linear, quadratic = K06_CONE
    curve = np.linspace(0.0, 0.7, 71)
    figure, axes = _axes("cone angle [rad]", "true over measured range")
    axes.plot(curve, 1 + linear * curve + quadratic * curve**2, "k-", label="(5.7)")
    angle, ratio = np.radians(TABLE_5_2[:, 0]), TABLE_5_2[:, 3]
    axes.plot(angle, ratio, "s", color="C3", label="table 5.2")
    axes.legend(frameon=False)
    figure.savefig(folder / "cone.png", dpi=130)
    return {
        "ratio, largest difference": float(np.abs(1 + linear * angle + quadratic * angle**2 - ratio).max())
    }


@rebuilds("k06", "fig 5.8", lacks="noise of the ranges, the beacons")
def fig_5_8(folder: Path) -> Mapping[str, float]:
    """Where a unit at rest is fixed, and the circle in which half of them lie [K06 fig 5.8]."""
    at = {"x": 1.22, "y": 1.22, "psi": 0.0}
    cricket = k06_cricket(latency=False)
    time = 0.1 * np.arange(6001)
    held = [np.full(len(time), at[s.name]) for s in cricket.inputs]
    run = cricket.compile().simulate(time, held)
    rows = dict(zip(run.output_labels, np.asarray(run.outputs), strict=True))
    new = rows["fix_valid"] > 0
    x, y = (100 * (rows[f"fix_{axis}"][new] - at[axis]) for axis in "xy")
    cep = float(np.median(np.hypot(x, y)))
    figure = Figure(figsize=(5.0, 5.0), layout="constrained")
    axes = figure.subplots()
    axes.plot(x, y, ".", ms=3)
    turn = np.linspace(0.0, 2 * np.pi, 181)
    axes.plot(cep * np.cos(turn), cep * np.sin(turn), "k-", label=f"half of {new.sum()} fixes, {cep:.2f} cm")
    axes.set(xlabel="x error [cm]", ylabel="y error [cm]", aspect="equal")
    axes.legend(frameon=False, loc="upper right")
    figure.savefig(folder / "fixes.png", dpi=130)
    return {"circular error probable": cep}


def _axes(x: str, y: str):  # type: ignore[no-untyped-def]
    figure = Figure(figsize=(6.0, 4.2), layout="constrained")
    axes = figure.subplots()
    axes.set(xlabel=x, ylabel=y)
    axes.grid(alpha=0.3)
    return figure, axes
