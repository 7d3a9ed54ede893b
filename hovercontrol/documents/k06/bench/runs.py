"""Runs of K06's bench: assumed sensor errors, rms errors over seeds, and one run over time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.base.short_repr import short_repr
from hovercontrol.blocks.backends.compiled import CompiledBlock
from hovercontrol.control.autopilot.turntable import ARM
from hovercontrol.control.observers.ins import IMU_PERIOD, K06_NOISE
from hovercontrol.documents.item import Printed
from hovercontrol.documents.k06.bench.blocks import OLDEST, bench
from hovercontrol.documents.k06.bench.instruments import CENTRE

Settings = Mapping[str, float]

#: Seeds of each item's test.
SEEDS = 8

#: Settings of these tests that K06 does not print.
LACKS = (
    "the noise of the tachometer, how the axis leans, how old Cricket's fixes are, the Q1 of table 6.6's run"
)

#: Noise of a sample as K06 measured it at rest for an hour: the roots of Q1 and Q2 (5.4.5). The biases of
#: section 6.1.1, the magnetometer's R1 and Cricket's slot are those of the sensors themselves.
STATED: Settings = {
    "imu.yaw_rate_noise": math.sqrt(K06_NOISE.Q1[0]),
    "imu.acceleration_noise": math.sqrt((K06_NOISE.Q2[0] + K06_NOISE.Q2[1]) / 2),
}
#: The tilt of the spin axis, and the noise of the reference, which K06 says is larger than the INS'.
BENCH_ERRORS: Settings = {
    "turntable.tilt": math.radians(0.5),
    "tachometer.noise": math.radians(3.4),
}
#: Cricket's fixes are 13 ticks (85 ms) late instead of a slot: K06's heading errors of 5, 10 and 20 deg at
#: 57, 115 and 230 deg/s correspond to 87 ms.
CRICKET_AGE: Settings = {"cricket_ranges.latency": 0.0, "ranged.aged": 1.0, "cricket_age.samples": 12.0}
#: Assumed sensor errors, from those that K06 prints to those that bring every figure within 30 %.
COLUMNS: Mapping[str, Settings] = {
    "simulated": {},
    "stated": STATED,
    "bench errors": {**STATED, **BENCH_ERRORS},
    "bench errors, Cricket 85 ms": {**STATED, **BENCH_ERRORS, **CRICKET_AGE},
}
#: The last of them, whose bench errors are guessed.
GUESSED = list(COLUMNS)[-1]

#: Yaw rate of the tests at a constant rate, by aid [rad/s].
RATES = {"magnetometer": math.radians(-166.0), "cricket": math.radians(-115.0)}
_SEEDS = ("imu", "magnetometer", "cricket_ranges", "tachometer")


@dataclass(frozen=True)
class Rms:
    """A root mean square error over several seeds, beside the printed one.

    Attributes
    ----------
    runs : ndarray, shape (seeds,)
    printed : Printed
        The number that K06 prints, with its name and unit.
    """

    runs: Array
    printed: Printed

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
        """Mean over the printed value."""
        return self.mean / self.printed.value

    def words(self, digits: int) -> str:
        """Return mean, spread and printed value with the unit."""
        p = self.printed
        return f"{self.mean:.{digits}f} +- {self.spread:.{digits}f} {p.unit} (printed {p.value:g})"


def rows(found: Mapping[str, Sequence[Rms]]) -> list[dict[str, Any]]:
    """Return a table of errors, one row for each; `found` is by the sensors' errors."""
    return [
        {
            "sensors": column,
            "entry": r.printed.name,
            "unit": r.printed.unit,
            "printed": r.printed.value,
            "reproduced": r.mean,
            "ratio": r.ratio,
            "spread over seeds": r.spread,
        }
        for column, every in found.items()
        for r in every
    ]


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
        Parameters of :func:`~hovercontrol.documents.k06.bench.blocks.bench`; ``turntable.arm`` sets all arms.
    seeds : int
        Number of runs.
    seconds, settled : float
        Length of a run, and the time from which errors count [s].

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


def rms(error: Array) -> float:
    """Return the root mean square of one run's error."""
    return float(np.sqrt(np.mean(error**2)))


def _run(settings: Settings) -> tuple[dict[str, float], dict[str, float]]:
    """Return all parameters of a run, and a start at the platform's own motion, known to the navigation."""
    arm = settings.get("turntable.arm", ARM)
    constant = not settings.get("command.motion", 0.0)
    rate = settings.get("command.rate", RATES["magnetometer"]) if constant else 0.0
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
