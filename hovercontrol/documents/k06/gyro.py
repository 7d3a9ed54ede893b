"""K06's gyro and its compensation over frequency: table 6.5, figures 6.15 and 6.16."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.backends.compiled import CompiledBlock
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.control.analysis.output import Progress, quiet, save
from hovercontrol.control.observers.ins import IMU_PERIOD
from hovercontrol.craft.hardware.sensors import gyro_compensation, gyro_dynamics
from hovercontrol.documents.k06.bench.blocks import gyro_chain
from hovercontrol.documents.k06.bench.runs import ticks
from hovercontrol.documents.printed import rebuilds

#: Table 6.5: frequency [Hz], uncompensated gain and phase [rad], compensated gain and phase, dt [ms].
TABLE_6_5 = np.array(
    [
        [5, 1.05, -0.65, 1.03, -0.38, -8.59], [10, 0.98, -1.05, 1.06, -0.51, -8.59],
        [15, 0.93, -1.95, 1.20, -1.17, -8.28], [20, 0.90, -2.39, 1.48, -1.45, -7.48],
        [30, 0.67, -3.55, 1.80, -2.52, -5.46], [40, 0.47, -4.61, 1.87, -3.70, -3.62],
        [50, 0.33, -5.29, 1.74, -4.58, -2.26],
    ]
)  # fmt: skip
#: Pure delay of the real gyro, which (6.2) leaves out [samples].
PURE_DELAY = 2


def gyro_transfer(frequency: ArrayLike, *, digits: int | None = 2) -> tuple[Array, Array, Array]:
    """Return the gyro's response, its compensation's, and the time that this gains (table 6.5).

    Parameters
    ----------
    frequency : array_like, shape (n,)
        [Hz]
    digits : int, optional
        To which K06 rounds phases [rad] before it divides by the frequency; None for no rounding.

    Returns
    -------
    gyro, compensation : ndarray of complex, shape (n,)
    gained : ndarray, shape (n,)
        Phase of the compensation over the frequency, negated as K06 has it [ms].

    Examples
    --------
    >>> gyro_transfer([5.0, 50.0])[2].round(2).tolist()  # table 6.5: -8.59 and -2.26
    [-8.59, -2.26]
    """
    w = 2 * np.pi * np.asarray(frequency, dtype=float)
    z = np.exp(1j * w * IMU_PERIOD)
    blocks = (gyro_dynamics(), gyro_compensation())
    gyro, undo = (np.asarray(b.to_control().linearize([0, 0], [0])(z)) for b in blocks)
    phase = np.angle(undo) if digits is None else np.angle(undo).round(digits)
    return gyro, undo, -1000 * phase / w


def gyro_response(frequency: Array) -> Array:
    """Return (6.2) over frequency [Hz] with the gyro's pure delay, complex, shape (n,)."""
    delay = np.exp(-2j * np.pi * frequency * PURE_DELAY * IMU_PERIOD)
    response: Array = gyro_transfer(frequency)[0] * delay
    return response


def gyro_sines(frequency: ArrayLike, *, seconds: float = 3.0) -> tuple[Array, Array]:
    """Return the responses that the bench measures with sines of the rate, as K06 did for table 6.5.

    Parameters
    ----------
    frequency : array_like, shape (n,)
        [Hz]
    seconds : float, optional
        Of each sine.

    Returns
    -------
    uncompensated, compensated : ndarray of complex, shape (n,)
        Reading over true rate, with the gyro's pure delay of two samples, which (6.2) leaves out.
    """
    quiet = {"imu.yaw_rate_noise": 0.0, "imu.yaw_rate_bias_spread": 0.0, "turntable.lag": 1e-3}
    found: dict[float, list[complex]] = {0.0: [], 1.0: []}
    time = ticks(seconds)
    late = time > 0.5
    for f in np.asarray(frequency, dtype=float).tolist():
        wave = np.exp(2j * np.pi * f * time[late])
        basis = np.column_stack([wave.real, wave.imag, np.ones(late.sum())])
        for on, responses in found.items():
            params = {**quiet, "command.motion": 2.0, "command.rate": 2.0, "command.frequency": f}
            run = _gyro().simulate(time, params={**params, "gyro_compensation.dynamics": on})
            rows = dict(zip(run.output_labels, run.outputs, strict=True))
            seen, true = (
                np.linalg.lstsq(basis, rows[name][late], rcond=None)[0] for name in ("yaw_rate_used", "r")
            )
            responses.append(complex(seen[0], -seen[1]) / complex(true[0], -true[1]))
    return np.array(found[0.0]), np.array(found[1.0])


@lru_cache(maxsize=1)
def _gyro() -> CompiledBlock:
    return interconnect(gyro_chain(), "gyro_bench", outputs=["r", "yaw_rate_used"]).compile()


# ---- items ------------------------------------------------------------------------------------------


@rebuilds("k06", "table 6.5")
def table_6_5(folder: Path) -> Mapping[str, float]:
    """Change of the gyro's delay by its compensation [K06 table 6.5]."""
    frequency, printed = TABLE_6_5[:, 0], TABLE_6_5[:, -1]
    ours = gyro_transfer(frequency)[2]
    columns = np.column_stack([frequency, printed, ours])
    head = "frequency_Hz,printed_ms,ours_ms"
    np.savetxt(folder / "table.csv", columns, delimiter=",", header=head, comments="")
    return {"dt, largest difference": float(np.abs(ours - printed).max())}


@rebuilds("k06", "fig 6.15", lacks="the curves' numbers")
def fig_6_15(folder: Path) -> Mapping[str, float]:
    """Impulse and frequency response of the gyro: (6.2) behind its pure delay [K06 fig 6.15]."""
    count = 2048
    frequency = np.asarray(np.fft.rfftfreq(count, IMU_PERIOD), dtype=np.float64)
    frequency[0] = 1e-9
    response = gyro_response(frequency)
    impulse = np.fft.irfft(response, count) / IMU_PERIOD  # per unit area, as K06 draws it
    time = IMU_PERIOD * np.arange(count)
    figure = Figure(figsize=(11.0, 4.5), layout="constrained")
    left, right = figure.subplots(1, 2)
    left.stem(time[:46], impulse[:46], basefmt="k-")
    left.set(xlabel="time [s]", ylabel="impulse response [1/s]", xlim=(-0.02, 0.3))
    _bode(right, "gyro, (6.2) and two samples", response[1:], frequency[1:])
    figure.savefig(folder / "gyro.png", dpi=130)
    return {
        "impulse response, largest": float(impulse.max()),
        "time of the largest [s]": float(time[impulse.argmax()]),
    }


@rebuilds("k06", "fig 6.16")
def fig_6_16(folder: Path) -> Mapping[str, float]:
    """Frequency response of the real gyro, as table 6.5 has it, and of (6.2) [K06 fig 6.16]."""
    frequency, gain, phase = TABLE_6_5[:, 0], TABLE_6_5[:, 1], TABLE_6_5[:, 2]
    ours = gyro_response(frequency)
    figure = Figure(figsize=(6.5, 4.5), layout="constrained")
    axes = figure.subplots()
    curve = np.geomspace(1.0, 60.0, 200)
    twin = _bode(axes, "(6.2) and two samples", gyro_response(curve), curve)
    axes.plot(frequency, 20 * np.log10(gain), "ko", mfc="none", label="real gyro, gain of table 6.5")
    twin.plot(frequency, np.degrees(phase), "ks", mfc="none", label="real gyro, phase of table 6.5")
    axes.legend(frameon=False, loc="lower left", fontsize=8)
    twin.legend(frameon=False, loc="upper right", fontsize=8)
    figure.savefig(folder / "gyro_model.png", dpi=130)
    return {
        "gain below 20 Hz, largest difference": float(np.abs(np.abs(ours) / gain - 1)[frequency < 20].max()),
        "gain at 50 Hz, ours over the real one": float(abs(ours[-1]) / gain[-1]),
    }


def _bode(axes: Axes, label: str, response: Array, frequency: Array) -> Axes:
    """Draw gain [dB] and, on a second axis, phase [deg]; return that axis."""
    twin = axes.twinx()
    axes.semilogx(frequency, 20 * np.log10(np.abs(response)), "C0-", label=f"gain: {label}")
    twin.semilogx(frequency, np.degrees(np.unwrap(np.angle(response))), "C1--", label="phase")
    axes.set(xlabel="frequency [Hz]", ylabel="gain [dB]", xlim=(1.0, 76.0))
    twin.set_ylabel("phase, dashed [deg]")
    return twin


# ---- table 6.5 as a picture -------------------------------------------------------------------------


def main(out: Path, progress: Progress = quiet, *, points: int = 200) -> list[Path]:
    """Draw gain and delay of (6.2), of a bench run with sines, and of K06's table."""
    frequency, printed = TABLE_6_5[:, 0], TABLE_6_5[:, 1:].T
    curve = np.linspace(1.0, 60.0, points)
    exact, rounded = (gyro_transfer(frequency, digits=n)[2] for n in (None, 2))
    progress(0.2)
    sines = dict(zip(("uncompensated", "compensated"), gyro_sines(frequency), strict=True))
    progress(0.8)
    figure = Figure(figsize=(16.0, 5.5), layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    _draw_readings(left, middle, sines, curve)
    right.plot(curve, gyro_transfer(curve, digits=None)[2], "k-", label="inverse of (6.2)")
    right.plot(frequency, printed[4], "ko", ms=8, label="table 6.5")
    right.plot(
        frequency, rounded, "x", color="0.5", ms=9, label="(6.2), phases rounded to 0.01 rad as printed"
    )
    right.set(xlabel="frequency [Hz]", ylabel="dt [ms]")
    right.set_title("Change of delay by the compensation", fontsize=11)
    for axes in (left, middle, right):
        axes.legend(frameon=False, fontsize=9)
    columns = {
        "frequency [Hz]": frequency,
        "printed dt [ms]": printed[4],
        "reproduced dt [ms]": rounded,
        "ratio": rounded / printed[4],
        "unrounded dt [ms]": exact,
    }
    for k, (name, run) in enumerate(sines.items()):
        columns |= {
            f"printed {name} gain": printed[2 * k],
            f"reproduced {name} gain": abs(run),
            f"printed {name} phase [rad]": printed[2 * k + 1],
            f"reproduced {name} phase [rad]": np.unwrap(np.angle(run)),
        }
    findings = _findings(sines["uncompensated"], exact, rounded)
    files = save(out, "k06_gyro", figure, {"k06_gyro": columns}, findings)
    progress(1.0)
    return files


def _draw_readings(left: Axes, middle: Axes, sines: Mapping[str, Array], curve: Array) -> None:
    """Draw gain and delay of the gyro's reading, compensated or not."""
    frequency = TABLE_6_5[:, 0]
    gyro, pure = gyro_transfer(curve)[0], 1000 * PURE_DELAY * IMU_PERIOD
    model = {
        "uncompensated": (abs(gyro), _delay(gyro, curve) + pure, "-", "o", "black"),
        "compensated": (np.ones(len(curve)), np.full(len(curve), pure), "--", "s", "none"),
    }
    for k, (name, (gain, delay, dash, mark, fill)) in enumerate(model.items()):
        table_gain, table_phase = TABLE_6_5[:, 1 + 2 * k], TABLE_6_5[:, 2 + 2 * k]
        table_delay = -1000 * table_phase / (2 * np.pi * frequency)
        for axes, known, said, line, bench in (
            (left, table_gain, "(6.2)", gain, abs(sines[name])),
            (middle, table_delay, "(6.2) and two samples", delay, _delay(sines[name], frequency)),
        ):
            axes.plot(curve, line, color="black", ls=dash, label=f"{said}, {name}")
            axes.plot(frequency, known, mark, color="black", mfc=fill, ms=8, label=f"table 6.5, {name}")
            axes.plot(frequency, bench, "x", color="0.5", ms=9, label=f"bench, {name}")
    left.set(xlabel="frequency [Hz]", ylabel="gain [1]", ylim=(0.0, 2.0))
    left.set_title("Gain of the gyro's reading", fontsize=11)
    middle.set(xlabel="frequency [Hz]", ylabel="delay: phase over frequency [ms]", ylim=(0.0, None))
    middle.set_title("Delay of the gyro's reading", fontsize=11)


def _findings(raw: Array, exact: Array, rounded: Array) -> list[str]:
    frequency, gain, phase, compensated, _, dt = TABLE_6_5.T
    delay, printed = _delay(raw, frequency), -1000 * phase / (2 * np.pi * frequency)
    return [
        f"Table 6.5: the inverse of (6.2) gives every dt within {abs(rounded - dt).max():.3f} ms if phases "
        f"are rounded to 0.01 rad as K06 prints them, within {abs(exact - dt).max():.3f} ms unrounded.",
        "The table's gains, compensated over uncompensated, are those of the inverse within "
        f"{abs(compensated / gain * abs(raw) - 1).max():.1%}. Its phases at 10 Hz, both, are about 4 "
        "ms early beside those at the other frequencies.",
        "The table's other columns are of the real gyro: with two samples (13.1 ms) of pure delay the "
        f"modelled delay without compensation is {delay.min():.1f} to {delay.max():.1f} ms (printed "
        f"{printed.min():.1f} to {printed.max():.1f} ms).",
        f"(6.2) damps high frequencies too much, as K06 says: at 50 Hz its gain is {abs(raw[-1]):.2f} "
        f"(printed {gain[-1]:.2f}), so its inverse raises the real gyro's to {compensated[-1]:.2f} "
        "instead of 1.",
    ]


def _delay(response: Array, frequency: Array) -> Array:
    return -1000 * np.unwrap(np.angle(response)) / (2 * np.pi * frequency)
