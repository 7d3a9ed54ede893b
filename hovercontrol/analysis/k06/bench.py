"""K06's tables 6.5, 6.6 and 6.7 and figure 6.20, from the package's own sensors and navigation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hovercontrol.analysis.k06.bench_blocks import CENTRE, OLDEST, bench, gyro_chain
from hovercontrol.autopilot.turntable import ARM
from hovercontrol.core.interconnect import interconnect
from hovercontrol.estimators.ins import IMU_PERIOD, K06_NOISE
from hovercontrol.hardware.sensors import gyro_compensation, gyro_dynamics
from hovercontrol.io.short_repr import short_repr
from hovercontrol.targets.compiled import CompiledBlock

Array = NDArray[np.float64]
Settings = Mapping[str, float]

#: Table 6.5: frequency [Hz], uncompensated gain and phase [rad], compensated gain and phase, dt [ms].
TABLE_6_5 = np.array(
    [
        [5, 1.05, -0.65, 1.03, -0.38, -8.59], [10, 0.98, -1.05, 1.06, -0.51, -8.59],
        [15, 0.93, -1.95, 1.20, -1.17, -8.28], [20, 0.90, -2.39, 1.48, -1.45, -7.48],
        [30, 0.67, -3.55, 1.80, -2.52, -5.46], [40, 0.47, -4.61, 1.87, -3.70, -3.62],
        [50, 0.33, -5.29, 1.74, -4.58, -2.26],
    ]
)  # fmt: skip
#: Table 6.6, compensated and uncompensated: yaw rate [rad/s] and heading [rad].
TABLE_6_6 = {"rate": (0.20, 0.30), "heading": (0.019, 0.044)}
#: Table 6.7: yaw rate [deg/s], heading [deg], velocity [cm/s], position [cm].
TABLE_6_7 = {"magnetometer": (3.7, 0.5, 7.5, 3.4), "cricket": (4.1, 9.8, 16.8, 8.1)}
QUANTITIES = ("rate", "heading", "velocity", "position")
#: Figure 6.20: raw and assisted heading of the two units, about [deg].
FIGURE_6_20 = (25.0, 10.0)

#: Noise of a sample as K06 measured it at rest for an hour: the roots of Q1 and Q2 (5.4.5); the biases of
#: section 6.1.1, the magnetometer's R1 and Cricket's slot are those of the sensors themselves.
STATED: Settings = {
    "imu.yaw_rate_noise": math.sqrt(K06_NOISE.Q1[0]),
    "imu.acceleration_noise": math.sqrt((K06_NOISE.Q2[0] + K06_NOISE.Q2[1]) / 2),
}
#: The platform's wobble, and the reference's own noise, of which K06 says that it is larger than the INS'.
BENCH_ERRORS: Settings = {
    "turntable.tilt": math.radians(0.5),
    "tachometer.noise": math.radians(3.4),
}
#: Cricket tells 13 ticks (85 ms) late instead of a slot: K06's heading errors of 5, 10 and 20 deg at 57, 115
#: and 230 deg/s are those of 87 ms.
CRICKET_AGE: Settings = {"cricket_ranges.latency": 0.0, "ranged.aged": 1.0, "cricket_age.samples": 12.0}
#: What the sensors are taken to be, from what K06 prints to what brings every figure near.
COLUMNS: Mapping[str, Settings] = {
    "simulated": {},
    "stated": STATED,
    "bench errors": {**STATED, **BENCH_ERRORS},
    "bench errors, Cricket 85 ms": {**STATED, **BENCH_ERRORS, **CRICKET_AGE},
}
#: Heading filter for table 6.6: Q1 as the model integrates it, the gyro's variance times dt^2, and a bias
#: that walks 1e-3 rad/s a tick. With Q1 as printed the filter copies its magnetometer.
INTEGRATED_Q1: Settings = {"heading.Q1[0,0]": K06_NOISE.Q1[0] * IMU_PERIOD**2, "heading.Q1[1,1]": 1e-6}
#: The square wave [rad/s]: as fast as the gyro, whose gain is 1.046, reads it within 300 deg/s with room for
#: noise and bias; K06's words are "a high rate", the axis of figure 6.17 ends at 6 rad/s.
SQUARE = 4.7
#: Other places of the second Cricket unit, 8 in from the first, in the body's axes [m].
PLACES = {
    "farther from the axis": (0.0, -8 * 0.0254),
    "ahead along x": (8 * 0.0254, 0.0),
    "behind along x": (-8 * 0.0254, 0.0),
}

_RATES = {"magnetometer": math.radians(-166.0), "cricket": math.radians(-115.0)}
_SECONDS = {"magnetometer": 12.0, "cricket": 45.0}
#: Errors count from here [s]; K06's plots begin in the run.
_SETTLED = {"magnetometer": 3.0, "cricket": 5.0}
_SEEDS = ("imu", "magnetometer", "cricket_ranges", "tachometer")


@dataclass(frozen=True)
class Rms:
    """A root mean square error over several seeds.

    Attributes
    ----------
    runs : ndarray, shape (seeds,)
    printed : float
        What K06 has; NaN for nothing.
    """

    runs: Array
    printed: float = math.nan

    __repr__ = short_repr

    @property
    def mean(self) -> float:
        """Mean over the seeds."""
        return float(self.runs.mean())

    @property
    def spread(self) -> float:
        """Standard deviation from seed to seed."""
        return float(self.runs.std(ddof=1)) if len(self.runs) > 1 else 0.0

    @property
    def ratio(self) -> float:
        """Reproduced over printed."""
        return self.mean / self.printed


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


def gyro_sines(frequency: ArrayLike, *, seconds: float = 3.0) -> tuple[Array, Array]:
    """Return what the bench measures with sines of the rate, as K06 did for table 6.5.

    Parameters
    ----------
    frequency : array_like, shape (n,)
        [Hz]
    seconds : float, optional
        Of each sine.

    Returns
    -------
    uncompensated, compensated : ndarray of complex, shape (n,)
        Reading over true rate, with the gyro's pure delay of two samples, of which (6.2) knows nothing.
    """
    quiet = {"imu.yaw_rate_noise": 0.0, "imu.yaw_rate_bias_spread": 0.0, "turntable.lag": 1e-3}
    found: dict[float, list[complex]] = {0.0: [], 1.0: []}
    time = ticks(seconds)
    late = time > 0.5
    for f in np.asarray(frequency, dtype=float).tolist():
        wave = np.exp(2j * np.pi * f * time[late])
        basis = np.column_stack([wave.real, wave.imag, np.ones(late.sum())])
        for on, told in found.items():
            params = {**quiet, "command.motion": 2.0, "command.rate": 2.0, "command.frequency": f}
            run = _gyro().simulate(time, params={**params, "gyro_compensation.dynamics": on})
            rows = dict(zip(run.output_labels, run.outputs, strict=True))
            seen, true = (
                np.linalg.lstsq(basis, rows[name][late], rcond=None)[0] for name in ("yaw_rate_used", "r")
            )
            told.append(complex(seen[0], -seen[1]) / complex(true[0], -true[1]))
    return np.array(found[0.0]), np.array(found[1.0])


def ticks(seconds: float) -> Array:
    """Return the IMU's ticks up to a time [s], each the nearest double, so that a row sees its tick."""
    count = np.arange(int(seconds / IMU_PERIOD) + 1)
    exact = Fraction(str(IMU_PERIOD))
    return count * exact.numerator / exact.denominator


def errors(settings: Settings, seeds: int, seconds: float, settled: float) -> dict[str, Array]:
    """Return rms errors of runs of the bench that differ in their random numbers.

    Parameters
    ----------
    settings : mapping of str to float
        Parameters of :func:`~hovercontrol.analysis.k06.bench_blocks.bench`; ``turntable.arm`` sets all arms.
    seeds : int
        How many runs.
    seconds, settled : float
        Length of a run, and from when errors count [s].

    Returns
    -------
    dict of str to ndarray, shape (seeds,)
        By output: ``heading_error`` and so on, SI units.
    """
    params, start = _run(settings)
    each = np.arange(1.0, seeds + 1)
    many: dict[str, ArrayLike] = {**params, **{f"{name}.seed": each for name in _SEEDS}}
    found = _bench().sweep(ticks(seconds), params=many, x0=start, start=settled)
    return {name: found[name].rms for name in found.outputs if name.endswith("_error")}


def time_course(settings: Settings, seconds: float, seed: int = 1) -> dict[str, Array]:
    """Return one run of the bench by output, with ``time`` [s]; arguments as of :func:`errors`."""
    params, start = _run(settings)
    time = ticks(seconds)
    run = _bench().simulate(time, params={**params, **{f"{n}.seed": seed for n in _SEEDS}}, x0=start)
    return {"time": time, **dict(zip(run.output_labels, run.outputs, strict=True))}


def square_wave(settings: Settings | None = None, *, seeds: int = 16) -> dict[str, tuple[Rms, Rms]]:
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
    dict of str to (Rms, Rms)
        Compensated and uncompensated: ``rate`` [rad/s], ``heading`` [rad].
    """
    both = [
        errors(square_settings(settings) | {"gyro_compensation.dynamics": on}, seeds, 25.0, 0.5)
        for on in (1.0, 0.0)
    ]
    return {
        name: (Rms(both[0][f"{name}_error"], printed[0]), Rms(both[1][f"{name}_error"], printed[1]))
        for name, printed in TABLE_6_6.items()
    }


def square_settings(settings: Settings | None = None) -> dict[str, float]:
    """Return the parameters of the square wave's test, the IMU in line with the spin axis."""
    own = INTEGRATED_Q1 if settings is None else settings
    square = {"command.motion": 1.0, "command.rate": SQUARE, "turntable.arm": 0.0}
    return {**COLUMNS["bench errors"], **square, **own}


def aided(aid: str, settings: Settings, *, seeds: int = 16) -> dict[str, Rms]:
    """Return a row of table 6.7.

    As K06 did, rate and heading are of a run with the IMU in line with the spin axis, Cricket's heading raw
    (section 6.2.1.2); velocity and position of one on the beam, Cricket's heading with the INS's help
    (section 6.2.1.4). The gyro is not compensated: that came after.

    Parameters
    ----------
    aid : {"magnetometer", "cricket"}
    settings : mapping
        Such as of :data:`COLUMNS`.
    seeds : int, optional

    Returns
    -------
    dict of str to Rms
        ``rate`` [deg/s], ``heading`` [deg], ``velocity`` [cm/s], ``position`` [cm].
    """
    own = {**settings, **aided_settings(aid)}
    inline = errors(own | {"turntable.arm": 0.0, "aiding.assisted": 0.0}, seeds, _SECONDS[aid], _SETTLED[aid])
    beam = errors(own, seeds, _SECONDS[aid], _SETTLED[aid])
    printed = dict(zip(QUANTITIES, TABLE_6_7[aid], strict=True))
    return {
        q: Rms(
            np.degrees(inline[f"{q}_error"]) if q in ("rate", "heading") else 100 * beam[f"{q}_error"],
            printed[q],
        )
        for q in QUANTITIES
    }


def aided_settings(aid: str) -> dict[str, float]:
    """Return the parameters of table 6.7's test with an aid."""
    return {
        "command.rate": _RATES[aid],
        "gyro_compensation.dynamics": 0.0,
        "aiding.cricket": float(aid == "cricket"),
    }


def unit_headings(settings: Settings, *, seeds: int = 16) -> tuple[Rms, Rms]:
    """Return figure 6.20: rms errors of the two units' heading on the beam, raw and assisted [deg]."""
    found = errors({**settings, **aided_settings("cricket")}, seeds, _SECONDS["cricket"], _SETTLED["cricket"])
    raw, helped = (np.degrees(found[f"{name}_error"]) for name in ("raw", "assisted"))
    return Rms(raw, FIGURE_6_20[0]), Rms(helped, FIGURE_6_20[1])


def second_unit(place: Sequence[float]) -> dict[str, float]:
    """Return the parameters that put the second Cricket unit to a place in the body's axes [m]."""
    return {
        f"{block}.unit_2_{axis}": value
        for block in ("cricket_ranges", "two_unit_heading", "assisted_heading")
        for axis, value in zip("xy", place, strict=True)
    }


def _run(settings: Settings) -> tuple[dict[str, float], dict[str, float]]:
    """Return all parameters of a run, and a start at the platform's own motion, known to the navigation."""
    arm = settings.get("turntable.arm", ARM)
    constant = not settings.get("command.motion", 0.0)
    rate = settings.get("command.rate", _RATES["magnetometer"]) if constant else 0.0
    x, y = CENTRE[0], CENTRE[1] - arm
    known = "ins.filters.mechanisation.last"
    start = {"turntable.r": rate, f"{known}_v_x_ins": arm * rate, f"{known}_x_ins": x, f"{known}_y_ins": y}
    for k in range(1, OLDEST + 1):
        turned = -rate * k * IMU_PERIOD
        start |= {
            f"cricket_age.x_{k}_ago": x + arm * math.sin(turned),
            f"cricket_age.y_{k}_ago": CENTRE[1] - arm * math.cos(turned),
            f"cricket_age.psi_{k}_ago": turned,
        }
    arms = {f"{name}.arm": arm for name in ("turntable", "encoder", "errors")}
    return {**settings, "command.rate": settings.get("command.rate", rate), **arms}, start


@lru_cache(maxsize=1)
def _bench() -> CompiledBlock:
    return bench().compile()


@lru_cache(maxsize=1)
def _gyro() -> CompiledBlock:
    return interconnect(gyro_chain(), "gyro_bench", outputs=["r", "yaw_rate_used"]).compile()
