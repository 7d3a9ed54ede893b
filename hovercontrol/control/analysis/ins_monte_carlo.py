"""Monte Carlo runs of navigation filters: simulated measurements of many noisy sensors along one true course.

Nothing here comes from the filters' Blocks: the true motion is integrated finely, and sensors add the errors
of :class:`~hovercontrol.control.observers.ins.SensorErrors`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import cumulative_trapezoid

from hovercontrol.base.arrays import Array
from hovercontrol.base.short_repr import short_repr
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.simulation.sampled import SampledFilter
from hovercontrol.control.observers.ins.noise import SensorErrors
from hovercontrol.craft.hardware.sensors.beacons import Beacons

#: Integration steps of the true motion per tick.
FINE = 20
#: The filters' estimates of the motion and of the biases, in the order of :func:`estimation_errors`.
ESTIMATES = ("psi_hat", "v_x_hat", "v_y_hat", "x_hat", "y_hat")
BIASES = ("gyro_bias_hat", "acceleration_x_bias_hat", "acceleration_y_bias_hat")


@dataclass(frozen=True)
class Course:
    """A true motion at the ticks.

    Attributes
    ----------
    period : float
        [s].
    time, psi, r : ndarray, shape (ticks,)
        [s], heading [rad], yaw rate [rad/s].
    velocity, position : ndarray, shape (2, ticks)
        Along x and y [m/s, m].
    force : ndarray, shape (2, ticks)
        Specific force, forward and to the left [m/s^2].
    """

    period: float
    time: Array
    psi: Array
    r: Array
    velocity: Array
    position: Array
    force: Array

    __repr__ = short_repr


@dataclass(frozen=True)
class Sensed:
    """Measurements along a course, and the errors behind them.

    Attributes
    ----------
    inputs : dict of str to ndarray, shape (ticks,) or (ticks, runs)
        Of the filters, by name.
    start : ndarray, shape (5, runs)
        Error of the initial psi, v_x, v_y, x, y.
    biases : ndarray, shape (3, runs)
        True biases of gyro and accelerometers.
    """

    inputs: dict[str, Array]
    start: Array
    biases: Array

    __repr__ = short_repr


def course(
    seconds: float, push: float, turn: float, *, period: float, at: tuple[float, float] = (0.0, 0.0)
) -> Course:
    """Return a motion that is pushed back and forth along x and y while its heading swings.

    Parameters
    ----------
    seconds : float
    push : float
        Amplitude of the acceleration [m/s^2].
    turn : float
        Amplitude of the heading [rad].
    period : float
        Of the ticks [s].
    at : (float, float), optional
        The place at the start [m].
    """
    t = np.arange(0, seconds, period)
    fine = np.arange(len(t) * FINE) * period / FINE
    a = push * np.array([np.cos(fine), np.sin(1.7 * fine)])
    v = cumulative_trapezoid(a, fine, initial=0)
    p = cumulative_trapezoid(v, fine, initial=0)[:, ::FINE] + np.array(at)[:, None]
    psi = turn * np.sin(0.5 * t)
    c, s = np.cos(psi), np.sin(psi)
    x, y = a[:, ::FINE]
    body = np.array([c * x + s * y, -s * x + c * y])
    return Course(period, t, psi, 0.5 * turn * np.cos(0.5 * t), v[:, ::FINE], p, body)


def sensed(
    rng: np.random.Generator, truth: Course, errors: SensorErrors, *, every: float, runs: int
) -> Sensed:
    """Draw measurements of IMU, heading aid and fixes; biases are constant.

    Parameters
    ----------
    rng : numpy.random.Generator
    truth : Course
    errors : SensorErrors
        Of which the biases' walks are left out.
    every : float
        Time between two aids [s].
    runs : int
    """
    ticks, draw = len(truth.time), rng.normal
    b_g = draw(size=runs) * errors.gyro_bias
    b_a = draw(size=(2, runs)) * errors.acceleration_bias
    white = draw(size=(2, ticks, runs)) * np.array(errors.acceleration_noise)[:, None, None]
    force = truth.force[:, :, None] + b_a[:, None] + white
    use = (np.arange(ticks) % round(every / truth.period) == 0).astype(float)
    fix = truth.position[:, :, None] + draw(size=(2, ticks, runs)) * errors.fix
    inputs = {
        "acceleration_x": force[0],
        "acceleration_y": force[1],
        "yaw_rate": truth.r[:, None] + b_g + draw(size=(ticks, runs)) * errors.gyro_noise,
        "heading_aid": truth.psi[:, None] + draw(size=(ticks, runs)) * errors.heading_aid,
        "heading_aid_valid": use,
        "fix_x": fix[0],
        "fix_y": fix[1],
        "fix_valid": use,
    }
    sizes = [errors.heading, errors.velocity, errors.velocity, errors.position, errors.position]
    return Sensed(inputs, draw(size=(5, runs)) * np.array(sizes)[:, None], np.array([b_g, *b_a]))


def ranged(
    rng: np.random.Generator,
    truth: Course,
    beacons: Beacons,
    units: Sequence[Sequence[float]],
    *,
    noise: float,
    bias: ArrayLike = 0.0,
    runs: int,
    slot: float = 0.1,
    slots: int = 10,
) -> dict[str, Array]:
    """Draw the ranges of units that take turns, one unit in each slot of a round (K06 section 5.5).

    Parameters
    ----------
    rng, truth, runs
        As for :func:`sensed`.
    beacons : Beacons
    units : sequence of (float, float)
        Places on the craft [m].
    noise : float
        Standard deviation of a range [m].
    bias : array_like, shape () or (runs,), optional
        Common error of all ranges [m].
    slot : float, optional
        [s].
    slots : int, optional
        In a round.

    Returns
    -------
    dict of str to ndarray
        Inputs of :func:`~hovercontrol.control.observers.ins.range_filter`.
    """
    ticks, span = len(truth.time), max(1, round(slot / truth.period))
    turn = np.arange(ticks) % (span * slots)
    unit = np.where(turn % span == 0, turn // span + 1, 0)
    unit[unit > len(units)] = 0
    c, s = np.cos(truth.psi), np.sin(truth.psi)
    forward, side = np.array([(0.0, 0.0), *units])[unit].T
    at = truth.position + np.array([c * forward - s * side, s * forward + c * side])
    inputs = {"range_unit": unit.astype(float)}
    for k, (place, height) in enumerate(zip(beacons.positions, beacons.heights, strict=True), 1):
        true = np.sqrt(((at - np.array(place)[:, None]) ** 2).sum(axis=0) + height**2)
        inputs[f"range_{k}"] = true[:, None] + bias + rng.normal(size=(ticks, runs)) * noise
        inputs[f"range_{k}_valid"] = (unit > 0).astype(float)
    return inputs


def inputs_of(block: Block | SampledFilter, inputs: Mapping[str, Array]) -> dict[str, Array]:
    """Return the inputs of the Block."""
    return {s.name: inputs[s.name] for s in block.inputs}


def started(names: Sequence[str], start: Array, truth: Course) -> dict[str, Array]:
    """Return initial states for psi, v_x, v_y, x, y with the errors `start`."""
    true = [truth.psi[0], *truth.velocity[:, 0], *truth.position[:, 0]]
    return {name: v + off for name, v, off in zip(names, true, start, strict=True)}


def estimation_errors(found: Mapping[str, Array], truth: Course, biases: Array) -> Array:
    """Return estimated less true psi, v_x, v_y, x, y and the three biases, shape (8, ticks, runs)."""
    true = [truth.psi, *truth.velocity, *truth.position]
    off = [found[n] - v[:, None] for n, v in zip(ESTIMATES, true, strict=True)]
    return np.array(off + [found[n] - b for n, b in zip(BIASES, biases, strict=True)])


def covariance(found: Mapping[str, Array], label: str, size: int) -> Array:
    """Return a filter's covariance from its outputs ``LABEL[i,j]``, shape (size, size, ticks, runs)."""
    entry = {(i, j): found[f"{label}[{i},{j}]"] for i in range(size) for j in range(i, size)}
    return np.array([[entry[min(i, j), max(i, j)] for j in range(size)] for i in range(size)])


def innovations(found: Mapping[str, Array], aids: Sequence[str]) -> tuple[Array, Array]:
    """Return the aids' innovations and their variances, shape (aids, ticks, runs) each."""
    told, variance = (
        np.array([found[f"{aid}_innovation{end}"] for aid in aids]) for end in ("", "_variance")
    )
    return told, variance
