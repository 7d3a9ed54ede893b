"""Monte Carlo runs of the navigation filters, from which NEES and NIS follow."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.block import Block
from hovercontrol.control.analysis.ins_monte_carlo import (
    course,
    covariance,
    estimation_errors,
    innovations,
    inputs_of,
    ranged,
    sensed,
    started,
)
from hovercontrol.control.observers.ins import (
    IMU_PERIOD,
    Consistency,
    InsNoise,
    SensorErrors,
    aided_ins,
    consistency,
    coupled_filter,
    heading_filter,
    noise_from_sensors,
    range_filter,
    simulate_runs,
    velocity_position_filter,
)
from hovercontrol.craft.hardware.sensors import Beacons

#: The sensors as stated, with biases that do not walk.
ERRORS = SensorErrors(gyro_walk=0.0, acceleration_walk=0.0)
#: Without a heading aid the initial heading is 11 degrees off.
LOST = replace(ERRORS, heading=0.2)
FIXES = ("fix_x", "fix_y")
#: Four beacons about 4 m apart and 2 m above the craft, and the places of two units on it [m].
BEACONS = Beacons([(0.0, 0.0), (4.0, 0.2), (0.1, 3.5), (3.8, 3.9)], 2.0)
UNITS = ((0.2, 0.0), (-0.2, 0.0))
RANGE_NOISE, RANGE_BIAS = 0.01, 0.05
#: By the filter's name.
Results = dict[str, Consistency]


class FilterRuns(NamedTuple):
    """Runs of a filter whose covariances can be varied.

    Attributes
    ----------
    errors : SensorErrors
        From which the filter's covariances follow.
    make : callable
        The filter from its covariances.
    inputs, start : mapping of str to ndarray
        As for :func:`~hovercontrol.control.observers.ins.simulate_runs`.
    judge : callable
        From the filter's outputs to its consistency, by the label of the row.
    """

    errors: SensorErrors
    make: Callable[[InsNoise], Block]
    inputs: Mapping[str, Array]
    start: Mapping[str, Array]
    judge: Callable[[Mapping[str, Array]], Results]

    def judged(self, noise: InsNoise) -> Results:
        """Run the filter with these covariances."""
        block = self.make(noise)
        return self.judge(simulate_runs(block, inputs_of(block, dict(self.inputs)), start=self.start))


# ---- K06's error models --------------------------------------------------------------------------------


def heading_model(period: float) -> Callable[[int, Array, Array], Array]:
    """Return (3.31), which maps tick, error and noise to the next error of heading and gyro.

    ``dpsi' = dpsi + dt b + w1``, ``b' = b + w2``, with the gyro's bias b.
    """
    return lambda k, x, w: np.array([x[0] + period * x[1] + w[0], x[1] + w[1]])


def motion_model(psi: Array, period: float) -> Callable[[int, Array, Array], Array]:
    """Return (3.32) along a heading, for the errors of velocity, position and accelerometers.

    ``dv' = dv + dt B(psi) b + B(psi) w1``, ``dp' = dp + dt dv + dt^2/2 B(psi) b``, ``b' = b + w2``, with the
    accelerometers' biases b and the rotation B (2.2).
    """

    def step(k: int, x: Array, w: Array) -> Array:
        c, s = np.cos(psi[k]), np.sin(psi[k])
        B = np.array([[c, -s], [s, c]])
        push = B @ x[4:]
        v = x[:2] + period * push + B @ w[:2]
        return np.vstack([v, x[2:4] + period * x[:2] + period**2 / 2 * push, x[4:] + w[2:]])

    return step


def model_errors(
    rng: np.random.Generator,
    step: Callable[[int, Array, Array], Array],
    P: ArrayLike,
    Q: ArrayLike,
    *,
    ticks: int,
    runs: int,
) -> Array:
    """Draw errors from a model, shape (n, ticks, runs), with initial variances P and process variances Q."""
    first, each = np.sqrt(np.asarray(P, dtype=float)), np.sqrt(np.asarray(Q, dtype=float))
    errors = np.empty((len(first), ticks, runs))
    errors[:, 0] = rng.normal(size=(len(first), runs)) * first[:, None]
    for k in range(1, ticks):
        w = rng.normal(size=(len(each), runs)) * each[:, None]
        errors[:, k] = step(k - 1, errors[:, k - 1], w)
    return errors


# ---- K06's two filters, errors drawn from their own model ------------------------------------------------


def own_heading(
    rng: np.random.Generator, runs: int, seconds: float, drawn: InsNoise | None = None
) -> FilterRuns:
    """Errors by (3.31), a measurement at every fifth tick (3.35); the true rate is zero."""
    errors, noise = SensorErrors(), drawn or noise_from_sensors()
    ticks = round(seconds / IMU_PERIOD)
    off = model_errors(rng, heading_model(IMU_PERIOD), noise.P1, noise.Q1, ticks=ticks, runs=runs)
    psi = rng.uniform(-3, 3, (ticks, 1))
    use = (np.arange(ticks) % 5 == 0).astype(float)
    inputs = {
        "psi_ins": psi + off[0],
        "yaw_rate": off[1],
        "heading_aid": psi + rng.normal(size=(ticks, runs)) * np.sqrt(noise.R1),
        "heading_aid_valid": use,
    }

    def judge(found: Mapping[str, Array]) -> Results:
        left = np.array([found["psi_hat"] - psi, found["r_hat"]])
        told = innovations(found, ["heading_aid"])
        return {
            "heading filter, own model": consistency(
                left, covariance(found, "P1", 2), *told, measured=use[:, None] > 0
            )
        }

    return FilterRuns(errors, lambda n: heading_filter(noise=n), inputs, {}, judge)


def own_motion(
    rng: np.random.Generator, runs: int, seconds: float, drawn: InsNoise | None = None
) -> FilterRuns:
    """Errors by (3.32) of a craft that rests, along a turn, a fix at every twentieth tick (3.38)."""
    errors, noise = SensorErrors(), drawn or noise_from_sensors()
    ticks = round(seconds / IMU_PERIOD)
    psi = 0.02 * np.arange(ticks, dtype=float)
    step = motion_model(psi, IMU_PERIOD)
    off = model_errors(rng, step, noise.P2, noise.Q2, ticks=ticks, runs=runs)
    use = (np.arange(ticks) % 20 == 0).astype(float)
    names = ("v_x_ins", "v_y_ins", "x_ins", "y_ins", "acceleration_x", "acceleration_y")
    inputs = dict(zip(names, off, strict=True)) | {"psi_hat": psi, "fix_valid": use}
    inputs |= {name: rng.normal(size=(ticks, runs)) * np.sqrt(noise.R2[0]) for name in FIXES}

    def judge(found: Mapping[str, Array]) -> Results:
        names = ("v_x_hat", "v_y_hat", "x_hat", "y_hat", "force_x_hat", "force_y_hat")
        left = np.array([found[n] for n in names])
        told = innovations(found, FIXES)
        return {
            "velocity/position filter, own model": consistency(
                left, covariance(found, "P2", 6), *told, measured=use[:, None] > 0
            )
        }

    return FilterRuns(errors, lambda n: velocity_position_filter(noise=n), inputs, {}, judge)


# ---- whole navigation with simulated sensors -------------------------------------------------------------


def aided(rng: np.random.Generator, runs: int, seconds: float) -> FilterRuns:
    """K06's navigation: heading aid and fix twice a second."""
    truth = course(seconds, 0.5, 0.6, period=IMU_PERIOD)
    seen = sensed(rng, truth, ERRORS, every=0.5, runs=runs)
    use = seen.inputs["fix_valid"][:, None] > 0

    def judge(found: Mapping[str, Array]) -> Results:
        off = estimation_errors(found, truth, seen.biases)
        off[5:] *= -1  # K06's covariance is of true less estimated biases
        parts = {
            "aided_ins, heading": ([0, 5], "P1", ["heading_aid"]),
            "aided_ins, motion": ([1, 2, 3, 4, 6, 7], "P2", FIXES),
        }
        return {
            label: consistency(
                off[rows], covariance(found, P, len(rows)), *innovations(found, aids), measured=use
            )
            for label, (rows, P, aids) in parts.items()
        }

    names = [f"mechanisation.last_{n}_ins" for n in ("psi", "v_x", "v_y", "x", "y")]
    return FilterRuns(
        ERRORS, lambda n: aided_ins(noise=n), seen.inputs, started(names, seen.start, truth), judge
    )


def coupled(rng: np.random.Generator, runs: int, seconds: float) -> FilterRuns:
    """No heading aid, a fix a second."""
    truth = course(seconds, 0.8, 0.3, period=IMU_PERIOD)
    seen = sensed(rng, truth, LOST, every=1.0, runs=runs)
    use = seen.inputs["fix_valid"][:, None] > 0

    def judge(found: Mapping[str, Array]) -> Results:
        off = estimation_errors(found, truth, seen.biases)
        told = innovations(found, FIXES)
        return {"coupled_filter": consistency(off, covariance(found, "P", 8), *told, measured=use)}

    start = started([f"last_xhat[{i}]" for i in range(5)], seen.start, truth)
    return FilterRuns(LOST, lambda n: coupled_filter(noise=n), seen.inputs, start, judge)


def by_ranges(rng: np.random.Generator, runs: int, seconds: float) -> FilterRuns:
    """Raw ranges of two units with a common bias, each once a second, no heading aid."""
    truth = course(seconds, 0.3, 0.5, period=IMU_PERIOD, at=(1.5, 1.5))
    seen = sensed(rng, truth, LOST, every=1.0, runs=runs)
    bias = rng.normal(size=runs) * RANGE_BIAS
    inputs = seen.inputs | ranged(rng, truth, BEACONS, UNITS, noise=RANGE_NOISE, bias=bias, runs=runs)

    def judge(found: Mapping[str, Array]) -> Results:
        off = np.array([*estimation_errors(found, truth, seen.biases), found["range_bias_hat"] - bias])
        told = innovations(found, [f"range_{k}" for k in range(1, 5)])
        use = inputs["range_unit"][:, None] > 0
        return {"range_filter": consistency(off, covariance(found, "P", 9), *told, measured=use)}

    def make(noise: InsNoise) -> Block:
        return range_filter(BEACONS, UNITS, range_noise=RANGE_NOISE, range_bias=RANGE_BIAS, noise=noise)

    return FilterRuns(
        LOST, make, inputs, started([f"last_xhat[{i}]" for i in range(5)], seen.start, truth), judge
    )


FILTER_RUNS = (own_heading, own_motion, aided, coupled, by_ranges)
