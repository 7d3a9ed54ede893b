"""Pictures of a run: what C17's figures 2-8 (11-17) show."""

from __future__ import annotations

import inspect
import math
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from hovercontrol.base.arrays import Array
from hovercontrol.base.figure_style import figure_style
from hovercontrol.control.controllers.references import REFERENCES
from hovercontrol.documents.scenarios.law_figures import law_figures
from hovercontrol.documents.scenarios.real_figures import comparison
from hovercontrol.documents.scenarios.time_axes import in_time, own_loop, time_figure, title

if TYPE_CHECKING:
    from hovercontrol.documents.scenarios.result import Run


#: Legend names of coefficients that share the name of a signal.
CALLED = {name: f"{name} coefficient" for name in ("thrust", "rudder_torque")}


def figures(run: Run) -> dict[str, Figure]:
    """Return the pictures of a run by name: path, errors, estimates, velocities, commands."""
    with figure_style():
        return _drawn(run)


def _drawn(run: Run) -> dict[str, Figure]:
    drawn = {"path": _path(run), "velocities": _velocities(run)}
    if run.scenario.tracks:
        drawn["heading"] = _heading(run)
    if run.scenario.autopilot is not None:
        drawn["comparison"] = comparison(run)
    error = run.tracking_error()
    if error is not None:
        drawn["tracking_error"] = _tracking_error(run, error)
    if run.estimates():
        drawn["estimates"] = _estimates(run)
        drawn["estimation_error"] = _estimates(run, less_truth=True)
    if run.scenario.controller is not None and not run.scenario.tracks:
        drawn |= law_figures(run)
    for signal in (run.scenario.plant.thrust, run.scenario.plant.rudder):
        if signal.name in run.columns:
            drawn[signal.name] = _command(run, signal.name, signal.unit)
    for fan in run.scenario.plant.fans:
        drawn[fan.name] = _command(run, fan.name, "N")
    return drawn


def _path(run: Run) -> Figure:
    figure = Figure(figsize=(6.6, 6.6), layout="constrained")
    axes = figure.subplots()
    c = run.columns
    x, y = (c.get(f"true_{k}", c[k]) for k in "xy")
    label = "craft" if run.scenario.autopilot is None else "real loop"
    if "x_ref" in c:
        once = run.time <= run.time[0] + _lap(run)  # dashes of several laps would fill each other's gaps
        x_ref, y_ref = c["x_ref"][once], c["y_ref"][once]
        axes.plot(x_ref, y_ref, "--", color="0.1", linewidth=1.1, label="reference", zorder=3)
        axes.plot(x_ref[0], y_ref[0], "x", color="C3", markersize=8, label="start of the reference", zorder=4)
        x, y = c["x_ref"] + c["error_x"], c["y_ref"] + c["error_y"]
        label = "control point"
    begin = 0.0
    for phase in run.scenario.phases:
        inside = (run.time >= begin) & (run.time <= phase.until)
        name = f"{label}, {phase.name}" if len(run.scenario.phases) > 1 else label
        axes.plot(x[inside], y[inside], linewidth=1.1, label=name)
        begin = phase.until
    if "ideal_x" in c:
        axes.plot(c["ideal_x"], c["ideal_y"], "C3--", linewidth=1.1, label="ideal loop", zorder=3)
    start = "start of the craft" + (f" ({label})" if label == "control point" else "")
    axes.plot(x[0], y[0], "kx", markersize=8, label=start, zorder=4)
    if "goal_x_ref" in c:
        axes.plot(c["goal_x_ref"][-1], c["goal_y_ref"][-1], "C3+", markersize=11, label="goal", zorder=4)
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(alpha=0.3)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.09), ncols=2, fontsize=8, frameon=False)
    title(run, figure, "path" if run.scenario.autopilot is None else "path of the real and the ideal loop")
    return figure


def _lap(run: Run) -> float:
    """Return how long the reference takes until it closes [s]; infinite if it does not."""
    given = dict(run.scenario.reference or {})
    kind = REFERENCES.get(given.get("kind", ""))
    if kind is None or "rate" not in inspect.signature(kind).parameters:
        return math.inf
    rate = given.get("rate", inspect.signature(kind).parameters["rate"].default)
    return 2 * math.pi / abs(float(rate))


def _tracking_error(run: Run, error: Array) -> Figure:
    figure, (axes,) = time_figure(run, "tracking error (distance of the control point from the reference)")
    in_time(run, axes, {"": error}, "distance [m]")
    axes.set_ylim(bottom=0.0)
    return figure


def _velocities(run: Run) -> Figure:
    figure, axes = time_figure(run, f"body velocities{own_loop(run)}", 3, 6.0)
    units = {"u": "surge u [m/s]", "v": "sway v [m/s]", "r": "yaw rate r [rad/s]"}
    told = {"u": "surge_ref", "r": "yaw_rate_ref"}
    for k, (name, unit) in enumerate(units.items()):
        measured = "measured" if run.scenario.autopilot is None else "by its INS"
        curves = {measured: run.columns[name]} if f"true_{name}" in run.columns else {}
        curves["true" if curves else ""] = run.columns.get(f"true_{name}", run.columns[name])
        if told.get(name) in run.columns:
            curves = {"craft" if key == "" else key: values for key, values in curves.items()}
            in_time(run, axes[k], {"wanted": run.columns[told[name]]}, unit, ("k--",))
        in_time(run, axes[k], curves, unit)
    return figure


def _heading(run: Run) -> Figure:
    """Return heading and yaw rate over time [C17 fig 15]."""
    figure, axes = time_figure(run, f"heading and yaw rate{own_loop(run)}", 2, 4.6)
    true = {name: run.columns.get(f"true_{name}", run.columns[name]) for name in ("psi", "r")}
    for k, (name, factor, label) in enumerate(
        (("psi", math.degrees(1.0), "heading psi [deg]"), ("r", 1.0, "yaw rate r [rad/s]"))
    ):
        curves = {"measured": run.columns[name] * factor} if f"true_{name}" in run.columns else {}
        curves["true" if curves else ""] = true[name] * factor
        in_time(run, axes[k], curves, label)
    return figure


def _families(run: Run) -> list[tuple[str, list[str]]]:
    """Return the estimated coefficients in groups of one unit, those of actuators apart from drag."""
    units = {p.name.rpartition(".")[2]: p.unit for p in run.scenario.plant.parameters()}
    groups: dict[tuple[str, str], list[str]] = {}
    for name in run.estimates():
        groups.setdefault((units[name], CALLED.get(name, "drag")), []).append(name)
    return [(unit, names) for (unit, _), names in groups.items()]


def _estimates(run: Run, *, less_truth: bool = False) -> Figure:
    """Return the estimates with the truth dashed, or the estimates less the truth."""
    groups = _families(run)
    what = "estimation error (estimate - truth)" if less_truth else "estimates (truth dashed)"
    figure, axes = time_figure(run, what, len(groups), 1.0 + 1.7 * len(groups))
    estimates, truth = run.estimates(), run.truth()
    for row, (unit, names) in zip(axes, groups, strict=True):
        shown = {n: estimates[n] - truth[n] if less_truth else estimates[n] for n in names}
        label = "error" if less_truth else "estimate"
        in_time(run, row, {CALLED.get(n, n): v for n, v in shown.items()}, f"{label} [{unit}]")
        if not less_truth:
            for line, name in zip(list(row.lines)[-len(names) :], names, strict=True):
                row.plot(run.time, truth[name], linestyle="--", linewidth=0.9, color=line.get_color())
    return figure


def _command(run: Run, name: str, unit: str) -> Figure:
    what = f"{name} command" if run.scenario.autopilot is None else f"{name} that acts{own_loop(run)}"
    figure, (axes,) = time_figure(run, what)
    angle = unit == "rad"
    factor = math.degrees(1.0) if angle else 1.0
    asked = run.columns.get(f"{name}_asked")
    if asked is not None:  # before the limits of the actuator
        axes.step(run.time, asked * factor, where="post", color="0.6", linewidth=0.7, label="asked for")
        signal = next(s for s in (run.scenario.plant.thrust, run.scenario.plant.rudder) if s.name == name)
        for bound in (signal.lower, signal.upper):
            if math.isfinite(bound) and bound:
                axes.axhline(bound * factor, color="C3", linewidth=0.8, linestyle=":")
    axes.step(run.time, run.columns[name] * factor, where="post", linewidth=1.0, label="acts")
    if asked is not None:
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8, frameon=False)
    axes.set_ylabel(f"{name} [{'deg' if angle else unit}]")
    return figure
