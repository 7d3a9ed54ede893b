"""Gyro compensation in the heading filter under a square wave of the rate: table 6.6, figure 6.17."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hovercontrol.base.arrays import Array
from hovercontrol.control.analysis.output import Table, save
from hovercontrol.control.observers.ins import IMU_PERIOD, K06_NOISE
from hovercontrol.documents.k06.bench.aids import aided
from hovercontrol.documents.k06.bench.runs import (
    COLUMNS,
    LACKS,
    SEEDS,
    Rms,
    Settings,
    errors,
    rms,
    rows,
    time_course,
)
from hovercontrol.documents.printed import printed, rebuilds

PRINTED = printed("k06", "table 6.6")
#: Heading filter for table 6.6: Q1 as the model integrates it, the gyro's variance times dt^2, and a bias
#: that walks 1e-3 rad/s a tick. With Q1 as printed the filter copies its magnetometer.
INTEGRATED_Q1: Settings = {"heading.Q1[0,0]": K06_NOISE.Q1[0] * IMU_PERIOD**2, "heading.Q1[1,1]": 1e-6}
#: The square wave [rad/s]: as fast as the gyro, whose gain is 1.046, reads it within 300 deg/s with room for
#: noise and bias; K06's words are "a high rate", the axis of figure 6.17 ends at 6 rad/s.
SQUARE = 4.7
#: Settings of the square wave's test that K06 does not print, varied one at a time.
VARIED: Mapping[str, Mapping[str, Sequence[float]]] = {
    "rate 4, 5 rad/s": {"command.rate": (4.0, 5.0)},
    "motor's lag 0.05, 0.2, 0.4 s": {"turntable.lag": (0.05, 0.2, 0.4)},
    "rest 0.3, 1 s": {"command.rest": (0.3, 1.0)},
    "gyro's delay 0, 1 samples": {"gyro_delay.samples": (0.0, 1.0)},
    "gyro's noise 0, 0.5 deg/s": {"imu.yaw_rate_noise": (0.0, float(np.radians(0.5)))},
    "tachometer's noise 0": {"tachometer.noise": (0.0,)},
}
#: The two quantities of the table, with the style of their lines.
STYLES = {"heading": "-", "rate": "--"}

Errors = Mapping[str, Rms]


def square_settings(settings: Settings | None = None) -> dict[str, float]:
    """Return the parameters of the square wave's test, the IMU in line with the spin axis."""
    own = INTEGRATED_Q1 if settings is None else settings
    square = {"command.motion": 1.0, "command.rate": SQUARE, "turntable.arm": 0.0}
    return {**COLUMNS["bench errors"], **square, **own}


def square_wave(settings: Settings | None = None, *, seeds: int = 16) -> dict[str, Rms]:
    """Return table 6.6: errors with and without compensation while the rate is a square wave.

    K06 spins for 3 s each way for 25 s (section 6.2.1.3). It does not print the rate
    (:data:`SQUARE` here), how fast the motor follows (0.1 s here), nor with which Q1 the filter ran.

    Parameters
    ----------
    settings : mapping, optional
        Over those of the test; default: :data:`INTEGRATED_Q1`.
    seeds : int, optional

    Returns
    -------
    dict of str to Rms
        By the entries of the table: ``rate, compensated`` [rad/s] and so on.
    """
    both = {
        kind: errors(square_settings(settings) | {"gyro_compensation.dynamics": on}, seeds, 25.0, 0.5)
        for kind, on in (("compensated", 1.0), ("uncompensated", 0.0))
    }
    found = {}
    for entry, number in PRINTED.items():
        quantity, _, kind = entry.partition(", ")
        found[entry] = Rms(both[kind][f"{quantity}_error"], number)
    return found


@rebuilds(
    "k06",
    "table 6.6",
    lacks=LACKS,
    why="K06 does not print the rate of the wave, the motor's lag and the filter's Q1",
)
def table_6_6(folder: Path) -> Mapping[str, float]:
    """Heading filter under a square wave of the rate [K06 table 6.6]."""
    return {name: r.mean for name, r in square_wave(seeds=SEEDS).items()}


@rebuilds("k06", "fig 6.17", lacks=LACKS)
def fig_6_17(folder: Path) -> Mapping[str, float]:
    """Yaw rate under a square wave, with and without the gyro's compensation [K06 fig 6.17]."""
    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    ratio = draw_courses(*figure.subplots(2, 1, sharex=True))
    figure.savefig(folder / "square_wave.png", dpi=130)
    return {"compensated over uncompensated": ratio}


def draw_courses(rate: Axes, error: Axes) -> float:
    """Draw figure 6.17; return the rms error of the rate, compensated over uncompensated."""
    off = []
    for on, name, style in ((0.0, "uncompensated", "C3--"), (1.0, "compensated", "C2-")):
        settings = {**square_settings(), "tachometer.noise": 0.0, "gyro_compensation.dynamics": on}
        run = time_course(settings, 15.0)
        late = run["time"] > 9.0
        if not on:
            rate.plot(run["time"][late], run["r"][late], "C0", lw=3.0, alpha=0.5, label="true")
        rate.plot(run["time"][late], run["r_hat"][late], style, lw=1.0, label=name)
        error.plot(run["time"][late], np.abs(run["rate_error"][late]), style, lw=1.0, label=name)
        off.append(rms(run["rate_error"][late]))
    rate.set(ylabel="yaw rate [rad/s]")
    error.set(xlabel="time [s]", ylabel="error of the yaw rate [rad/s]", ylim=(0.0, None))
    for axes in (rate, error):
        axes.legend(frameon=False, fontsize=9, loc="center right")
    return off[1] / off[0]


# ---- what K06 does not print ------------------------------------------------------------------------


def save_square_wave(out: Path, seeds: int, walks: int) -> list[Path]:
    """Draw figure 6.17, and table 6.6 over the settings that K06 does not print; write the table."""
    found, printed_q = square_wave(seeds=seeds), square_wave({}, seeds=seeds)
    few = max(2, seeds // 4)
    steps = np.geomspace(1e-9, 5e-4, walks)
    q1 = INTEGRATED_Q1["heading.Q1[0,0]"]
    by_walk = [square_wave({"heading.Q1[0,0]": q1, "heading.Q1[1,1]": s}, seeds=few) for s in steps.tolist()]
    varied = {
        text: [
            square_wave({**INTEGRATED_Q1, key: value}, seeds=few)
            for key, values in change.items()
            for value in values
        ]
        for text, change in VARIED.items()
    }
    figure = Figure(figsize=(15.0, 10.0), layout="constrained")
    (course, walk), (error, other) = figure.subplots(2, 2)
    draw_courses(course, error)
    course.set(xlabel="time [s]")
    course.set_title("Square wave: yaw rate by the INS (figure 6.17)", fontsize=11)
    error.set_title("Its error", fontsize=11)
    _draw_walks(walk, steps, by_walk, printed_q)
    _draw_varied(other, found, varied)
    name = "k06_bench_square"
    tables: dict[str, Table] = {
        name: rows({"table 6.6": list(found.values())}),
        f"{name}_walk": {"Q1[1,1] [rad^2/s^2]": steps}
        | {f"{n} ratio": np.array([_ratio(f, n) for f in by_walk]) for n in STYLES},
    }
    return save(out, name, figure, tables, _findings(found, printed_q, varied, seeds))


def _findings(
    found: Errors, printed_q: Errors, varied: Mapping[str, Sequence[Errors]], seeds: int
) -> list[str]:
    settings = {**COLUMNS["bench errors"], **INTEGRATED_Q1}
    other_q = aided("magnetometer", settings, seeds=max(2, seeds // 4))["magnetometer: heading"]
    ratios = {
        text: ", ".join(f"{n} " + " ".join(f"{_ratio(run, n):.2f}" for run in runs) for n in STYLES)
        for text, runs in varied.items()
    }
    return [
        "Table 6.6, square wave of 4.7 rad/s (assumed; 3 s each way for 25 s, K06), motor's lag 0.1 s "
        f"(assumed), gyro of (6.2) and two samples, {seeds} seeds: "
        + "; ".join(f"{entry} {r.words(3)}" for entry, r in found.items())
        + ".",
        f"Compensated over uncompensated: heading {_ratio(found, 'heading'):.2f} (printed "
        f"{_printed_ratio('heading'):.2f}), rate {_ratio(found, 'rate'):.2f} (printed "
        f"{_printed_ratio('rate'):.2f}).",
        "This is with the gyro's variance in Q1 times dt^2, as the model needs it, and a bias that walks "
        "1e-3 rad/s a tick (assumed). With Q1 as printed the rate's ratio is "
        f"{_ratio(printed_q, 'rate'):.2f}, but the heading's {_ratio(printed_q, 'heading'):.2f}, both at "
        f"{printed_q['heading, compensated'].mean:.3f} rad: the filter copies its magnetometer, and no gyro "
        "could give K06's two headings; its filter must have run with another Q1.",
        "The two tables do not go together: by this Q1 the magnetometer's heading of table 6.7 is off by "
        f"{other_q.mean:.2f} {other_q.printed.unit}, not {other_q.printed.value:g}.",
        "What K06 does not print moves the ratios so: "
        + "; ".join(f"{text}: {ratio}" for text, ratio in ratios.items())
        + ".",
    ]


def _ratio(found: Errors, name: str) -> float:
    return found[f"{name}, compensated"].mean / found[f"{name}, uncompensated"].mean


def _printed_ratio(name: str) -> float:
    return PRINTED[f"{name}, compensated"].value / PRINTED[f"{name}, uncompensated"].value


def _draw_walks(axes: Axes, steps: Array, by_walk: Sequence[Errors], printed_q: Errors) -> None:
    for name, style in STYLES.items():
        axes.semilogx(steps, [_ratio(f, name) for f in by_walk], "k" + style, label=name)
        axes.axhline(_printed_ratio(name), color="0.6", ls=style, label=f"{name}, table 6.6")
    axes.plot([5e-4], [_ratio(printed_q, "heading")], "k*", ms=12, label="heading, all of Q1 as printed")
    axes.axvline(INTEGRATED_Q1["heading.Q1[1,1]"], color="0.6", lw=0.8, ls=":", label="taken here")
    axes.set(
        xlabel="variance by which the filter lets the bias walk each tick, Q1[1,1] [rad^2/s^2]",
        ylabel="error compensated over uncompensated [1]", ylim=(0.0, 1.05),
    )  # fmt: skip
    axes.set_title("Table 6.6 by the filter's Q1: [0,0] times dt^2, [1,1] varied", fontsize=11)
    axes.legend(frameon=False, fontsize=9)


def _draw_varied(axes: Axes, found: Errors, varied: Mapping[str, Sequence[Errors]]) -> None:
    for k, runs in enumerate(varied.values()):
        for name, mark, fill in (("heading", "o", "black"), ("rate", "s", "white")):
            values = [_ratio(run, name) for run in runs]
            axes.plot(values, [k] * len(runs), "k" + mark, mfc=fill, ms=8, label=None if k else name)
    for name, style in STYLES.items():
        axes.axvline(_ratio(found, name), color="black", ls=style, lw=1.0, label=f"{name}, as taken here")
        axes.axvline(_printed_ratio(name), color="0.6", ls=style, label=f"{name}, table 6.6")
    axes.set(xlabel="error compensated over uncompensated [1]", xlim=(0.0, 1.05), yticks=range(len(varied)))
    axes.set_yticklabels(list(varied))
    axes.set_title("Table 6.6 by what K06 does not print", fontsize=11)
    axes.invert_yaxis()
    axes.legend(frameon=False, fontsize=9)
