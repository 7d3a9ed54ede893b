"""The INS on the bench by its aid, magnetometer or Cricket: table 6.7, figures 6.13, 6.14, 6.18 and 6.19."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hovercontrol.control.analysis.output import save
from hovercontrol.documents.k06.bench.runs import (
    COLUMNS,
    GUESSED,
    LACKS,
    RATES,
    SEEDS,
    Rms,
    Settings,
    errors,
    rms,
    rows,
    time_course,
)
from hovercontrol.documents.printed import Measure, printed, rebuilds

PRINTED = printed("k06", "table 6.7")
#: Length of a run, and the time from which errors count [s]; K06's plots begin in the run.
SECONDS = {"magnetometer": 12.0, "cricket": 45.0}
SETTLED = {"magnetometer": 3.0, "cricket": 5.0}
MARKS = ("^", "o", "s", "D")

Table = Mapping[str, Rms]


def aided_settings(aid: str, *, inline: bool = False) -> dict[str, float]:
    """Return the parameters of table 6.7's test with an aid.

    As K06 did, `inline` puts the IMU in line with the spin axis, and leaves Cricket's heading raw (section
    6.2.1.2); otherwise it is on the beam, and Cricket's heading has the INS's help (section 6.2.1.4). The
    gyro is not compensated: that came after.
    """
    own = {
        "command.rate": RATES[aid],
        "gyro_compensation.dynamics": 0.0,
        "aiding.cricket": float(aid == "cricket"),
    }
    return own | ({"turntable.arm": 0.0, "aiding.assisted": 0.0} if inline else {})


def aided(aid: str, settings: Settings, *, seeds: int = 16) -> dict[str, Rms]:
    """Return a row of table 6.7.

    Parameters
    ----------
    aid : {"magnetometer", "cricket"}
    settings : mapping
        Sensors' errors, one of :data:`~hovercontrol.documents.k06.bench.runs.COLUMNS`.
    seeds : int, optional

    Returns
    -------
    dict of str to Rms
        By the entries of the table, such as ``cricket: rate`` [deg/s] of an IMU in line with the axis, and
        ``cricket: velocity`` [cm/s] of one on the beam.
    """
    inline, beam = (
        errors({**settings, **aided_settings(aid, inline=centred)}, seeds, SECONDS[aid], SETTLED[aid])
        for centred in (True, False)
    )
    found = {}
    for entry, number in PRINTED.items():
        row, _, quantity = entry.partition(": ")
        if row == aid:
            turning = quantity in ("rate", "heading")
            runs = np.degrees(inline[f"{quantity}_error"]) if turning else 100 * beam[f"{quantity}_error"]
            found[entry] = Rms(runs, number)
    return found


def table(column: str, seeds: int) -> dict[str, Rms]:
    """Return table 6.7 with one of the assumed sensor errors."""
    return {entry: r for aid in SECONDS for entry, r in aided(aid, COLUMNS[column], seeds=seeds).items()}


@rebuilds(
    "k06",
    "table 6.7",
    lacks=LACKS,
    why="with K06's stated noise the reference is too clean; with an axis that leans by 0.5 deg, 3.4 deg/s "
    "of noise of the tachometer and fixes 85 ms old all entries are within 30 %",
)
def table_6_7(folder: Path) -> Mapping[str, float]:
    """Errors of the INS by aid, sensors as K06 states them [K06 table 6.7]."""
    stated, guessed = (table(column, SEEDS) for column in ("stated", GUESSED))
    return {name: r.mean for name, r in stated.items()} | {
        f"{name}, bench errors guessed": r.mean for name, r in guessed.items()
    }


def _heading_filter(aid: str) -> Measure:
    """Return what draws yaw rate and heading of the heading filter, and measures their rms errors.

    [K06 fig 6.13, 6.14]
    """

    def measure(folder: Path) -> Mapping[str, float]:
        run = time_course({**COLUMNS[GUESSED], **aided_settings(aid, inline=True)}, SECONDS[aid])
        true, seen = (np.mod(a, 2 * np.pi) for a in (run["psi"], run["psi"] + run["heading_error"]))
        figure = Figure(figsize=(8.0, 8.0), layout="constrained")
        axes = figure.subplots(4, 1, sharex=True)
        curves = (
            ("yaw rate", "rad/s", run["r"], run["r_hat"], run["rate_error"]),
            ("heading", "rad", true, seen, run["heading_error"]),
        )
        for k, (name, unit, truth, ins, error) in enumerate(curves):
            axes[2 * k].plot(run["time"], ins, ".", ms=1.5, color="C1", label="INS")
            axes[2 * k].plot(run["time"], truth, ".", ms=1.0, color="C0", label="true")
            axes[2 * k].set_ylabel(f"{name} [{unit}]")
            axes[2 * k].legend(frameon=False, loc="upper right", fontsize=8, markerscale=6)
            axes[2 * k + 1].plot(run["time"], np.abs(error), lw=0.8)
            axes[2 * k + 1].set_ylabel(f"error [{unit}]")
        axes[-1].set_xlabel("time [s]")
        figure.savefig(folder / "heading_filter.png", dpi=130)
        late = run["time"] > 3.0
        return {
            "r, rms error": rms(run["rate_error"][late]),
            "psi, rms error": rms(run["heading_error"][late]),
        }

    return measure


def _motion_filter(aid: str) -> Measure:
    """Return what draws errors of the velocity/position filter, and measures their rms.

    [K06 fig 6.18, 6.19]
    """

    def measure(folder: Path) -> Mapping[str, float]:
        run = time_course({**COLUMNS[GUESSED], **aided_settings(aid)}, SECONDS[aid])
        late = run["time"] > SETTLED[aid]
        figure = Figure(figsize=(8.0, 7.0), layout="constrained")
        position, velocity = figure.subplots(2, 1, sharex=True)
        found = {}
        for axes, name, unit in ((position, "position", "cm"), (velocity, "velocity", "cm/s")):
            error = 100 * run[f"{name}_error"]
            found[f"{name}, rms error"] = rms(error[late])
            axes.plot(run["time"], np.abs(error), lw=0.8, label="error")
            axes.axhline(rms(error[late]), color="C3", ls="--", label="root mean square")
            axes.set_ylabel(f"{name} error [{unit}]")
            axes.legend(frameon=False, loc="upper right", fontsize=8)
        velocity.set_xlabel("time [s]")
        figure.savefig(folder / "motion_filter.png", dpi=130)
        return found

    return measure


fig_6_13 = rebuilds("k06", "fig 6.13", lacks=LACKS)(_heading_filter("magnetometer"))
fig_6_14 = rebuilds("k06", "fig 6.14", lacks=LACKS)(_heading_filter("cricket"))
fig_6_18 = rebuilds("k06", "fig 6.18", lacks=LACKS)(_motion_filter("magnetometer"))
fig_6_19 = rebuilds("k06", "fig 6.19", lacks=LACKS)(_motion_filter("cricket"))


# ---- by the sensors' errors -------------------------------------------------------------------------


def save_aids(out: Path, seeds: int) -> list[Path]:
    """Draw table 6.7 over the sensors' errors, and a position error by time; write the table."""
    found = {column: table(column, seeds) for column in COLUMNS}
    figure = Figure(figsize=(17.0, 6.5), layout="constrained")
    ratios, course = figure.subplots(1, 2, width_ratios=(3, 2))
    _draw_ratios(ratios, found, seeds)
    _draw_course(course)
    entries = {column: list(row.values()) for column, row in found.items()}
    name = "k06_bench_errors"
    return save(out, name, figure, {name: rows(entries)}, _findings(found, seeds))


def _draw_ratios(axes: Axes, found: Mapping[str, Table], seeds: int) -> None:
    axes.axhspan(0.7, 1.3, color="0.9", label="within 30 %")
    axes.axhline(1.0, color="0.6", lw=1.0)
    for k, (column, row) in enumerate(found.items()):
        axes.errorbar(
            np.arange(len(row)) + 0.16 * (k - 1.5), [r.ratio for r in row.values()],
            [r.spread / r.printed.value for r in row.values()],
            fmt=MARKS[k], color="black", mfc=str(0.3 * k), ms=7, capsize=3, lw=1.0, label=column,
        )  # fmt: skip
    axes.set(ylabel="rms error reproduced over table 6.7 [1]", yscale="log", ylim=(0.05, 2.0))
    shown = ("0.05", "0.1", "0.2", "0.5", "0.7", "1", "1.3", "2")
    axes.set_yticks([float(text) for text in shown], shown)
    axes.set_title(f"Table 6.7: mean and spread over {seeds} seeds", fontsize=11)
    axes.minorticks_off()
    axes.set_xticks(range(len(PRINTED)), [entry.replace(": ", ":\n") for entry in PRINTED], fontsize=8)
    axes.legend(frameon=False, fontsize=9, title="sensors")


def _draw_course(axes: Axes) -> None:
    for aid, style, colour in (("magnetometer", "-", "black"), ("cricket", "--", "0.5")):
        run = time_course({**COLUMNS["bench errors"], **aided_settings(aid)}, 30.0)
        late = run["time"] > 22.0
        label = f"by {aid.replace('cricket', 'Cricket')}, bench errors"
        axes.plot(run["time"][late], 100 * run["position_error"][late], color=colour, ls=style, label=label)
    axes.set(xlabel="time [s]", ylabel="position error [cm]", ylim=(0.0, 20.0))
    axes.set_title("Position by the INS on the beam (figures 6.18a, 6.19a)", fontsize=11)
    axes.legend(frameon=False, fontsize=9)


def _findings(found: Mapping[str, Table], seeds: int) -> list[str]:
    far = {
        column: ", ".join(entry for entry, r in row.items() if abs(r.ratio - 1) > 0.3)
        for column, row in found.items()
    }
    return [
        f"Table 6.7, rms over {seeds} seeds. Sensors: simulated = errors of section 6.1.1; stated = with "
        "the noise of a sample as K06 measured it at rest (Q1, Q2 of 5.4.5: gyro 1.27 deg/s, "
        "accelerometers 17 cm/s^2); bench errors = also the spin axis 0.5 deg out of the vertical and 3.4 "
        "deg/s of noise in the tachometer, K06's reference of rate and velocity (assumed); the last = also "
        "a Cricket place that arrives 85 ms after it was ranged, not 100 ms.",
        *(
            f"{column}: " + "; ".join(f"{entry} {r.words(2)}" for entry, r in row.items()) + "."
            for column, row in found.items()
        ),
        *(f"{column}: beyond 30 %: {entries or 'none'}." for column, entries in far.items()),
        "Each bench error is set by one entry, the magnetometer's rate and velocity; the others follow. Both "
        "are plausible: K06 names the platform's wobble, and says that the tachometer's output varies more "
        "than the INS'; the tilt's g sin(0.5 deg) = 8.6 cm/s^2 turns in the craft's axes, where the filter "
        "looks for a constant bias.",
    ]
