"""A particle filter on raw ranges, future work of K06 like the extended Kalman filter (section 7.2)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.short_repr import short_repr
from hovercontrol.base.tables import number, positive
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.observers.ins.cloud import Cloud
from hovercontrol.control.observers.ins.imu import IMU, IMU_PERIOD
from hovercontrol.control.observers.ins.mechanisation import HELD_IMU, finite
from hovercontrol.control.observers.ins.navigation import (
    ESTIMATE,
    QUANTITIES,
    Aid,
    added_variances,
    next_estimate,
    outputs_of_estimate,
    stored_estimate,
)
from hovercontrol.control.observers.ins.noise import InsNoise, noise_from_sensors
from hovercontrol.control.observers.ins.ranges import RangeAids, measured_ranges
from hovercontrol.control.observers.ins.velocity_position import innovation_outputs
from hovercontrol.craft.hardware.sensors.beacons import Beacons

#: Default number of particles; 2000 may lose the correct side if the start is anywhere in 4 m by 8 m.
PARTICLES = 3000
#: Roughening: Silverman's rule, ``(4 / (n + 2) / particles)^(1 / (n + 4))``, for n = 8 and 3000 particles.
ROUGHENING = 0.5
#: The range of an echo is uniformly distributed from 0 to this distance [m].
FARTHEST = 10.0

EFFECTIVE = Signal("effective", "1", "how many particles count", lower=0.0)


@checked
@dataclass(frozen=True, eq=False)
class ParticleFilter:
    """A bootstrap filter with the inputs and outputs of :func:`range_filter`.

    It is made by :func:`range_particles`.

    :func:`simulate_runs` and :func:`run_ins` accept it in place of a filter's Block. It is not a Block:
    equations for thousands of particles cannot sensibly be printed, compiled or exported.

    Attributes
    ----------
    name : str
    period : float
        Time from tick to tick [s].
    inputs, outputs, states : tuple of Signal
        Those of the Kalman filter with the same arguments, and the output ``effective``, the effective sample
        size. The states are the means about which the initial particles are drawn.
    particles : int
        Number of particles.
    ranges, noise, range_bias, area, roughening, echoes, seed
        As given to :func:`range_particles`.

    Examples
    --------
    >>> found = range_particles(Beacons([(0, 0), (3, 0)], 2.0), particles=1000)
    >>> found.particles, found.period
    (1000, 0.0065536)
    """

    name: str
    period: float
    particles: int
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    states: tuple[Signal, ...]
    ranges: RangeAids = field(repr=False)
    noise: InsNoise = field(repr=False)
    range_bias: float = field(repr=False)
    area: tuple[tuple[float, float], tuple[float, float]] | None
    roughening: float
    echoes: float
    seed: int

    __repr__ = short_repr

    def start(self, runs: int = 1, start: Mapping[str, ArrayLike] | None = None) -> RunningParticles:
        """Draw the initial particles of one or more runs.

        Parameters
        ----------
        runs : int, optional
            Number of runs.
        start : mapping of str to array_like, shape () or (runs,), optional
            Initial means of states, by name, in place of their start values.
        """
        return RunningParticles(self, runs, start or {})


@checked
def range_particles(
    beacons: Beacons,
    units: Sequence[Sequence[float]] = ((0.0, 0.0),),
    *,
    cone: tuple[float, float] | None = None,
    heading: bool = False,
    range_noise: float = 0.01,
    range_bias: float = 0.0,
    noise: InsNoise | None = None,
    pose: Sequence[float] = (0.0, 0.0, 0.0),
    velocity: Sequence[float] = (0.0, 0.0),
    area: Sequence[Sequence[float]] | None = None,
    particles: int = PARTICLES,
    roughening: float = ROUGHENING,
    echoes: float = 0.0,
    seed: int = 1,
    period: float = IMU_PERIOD,
    name: str = "ins",
) -> ParticleFilter:
    """Return a particle filter on raw ranges: the equations of :func:`range_filter` without linearisation.

    Ranges may fit several positions: those of two beacons fit a position and its mirror image. The filter
    keeps all of them until the motion decides between them. Estimates are means over the particles, so until
    then they lie between these positions.

    Parameters
    ----------
    beacons, units, cone, heading, range_noise, range_bias, noise, pose, velocity, period, name
        As for :func:`range_filter`.
    area : pair of pairs of float, optional
        ``((x_min, x_max), (y_min, y_max))`` [m]: the initial position is uniform in this area and the initial
        heading is uniform. The pose is then ignored.
    particles : int, optional
        Number of particles, at least 2.
    roughening : float, optional
        Standard deviation of the noise added after resampling, as a share of the particles' spread along
        each principal axis. The spread counts at most as the resolution of a range: its standard deviation in
        position, this divided by 0.2 m in heading, and divided by 0.1 s in velocity. Silverman's rule gives
        0.5.
    echoes : float, optional
        Share of the ranges that are echoes, uniform from 0 to 10 m; 0: no echoes.
    seed : int, optional
        Seed of the random numbers.

    Returns
    -------
    ParticleFilter

    Raises
    ------
    InputError
        If there are fewer than two particles, a share is not from 0 to less than 1, an area is empty, or as
        for :func:`range_filter`.

    Examples
    --------
    >>> from hovercontrol.blocks.simulation.sampled import simulate_runs
    >>> block = range_particles(Beacons([(0, 0), (3, 0)], 2.0), area=((0, 3), (0, 2)), particles=1000)
    >>> still = {s.name: np.zeros(40) for s in block.inputs} | {"range_1_valid": np.ones(40)}
    >>> ranges = {"range_1": np.full(40, 6**0.5), "range_2": np.full(40, 3.0), "range_2_valid": np.ones(40)}
    >>> found = simulate_runs(block, still | ranges)  # at (1, 1)
    >>> bool(abs(found["x_hat"][-1] - 1) < 0.02 > abs(found["y_hat"][-1] - 1))
    True
    """
    noise = noise or noise_from_sensors(period=positive(f"{name}: period", period))
    ranges = measured_ranges(
        name,
        beacons,
        units,
        cone=cone,
        heading=heading,
        range_noise=range_noise,
        range_bias=range_bias,
        noise=noise,
    )
    if isinstance(particles, bool) or not isinstance(particles, int) or particles < 2:
        raise InputError(f"{name}: expected a whole number of particles, at least 2, found {particles!r}")
    for what, share in (("roughening", roughening), ("echoes", echoes)):
        if not 0 <= number(f"{name}: {what}", share) < 1:
            raise InputError(f"{name}: {what} must be from 0 to less than 1, found {share!r}")
    x, y, psi = finite(f"{name}: pose", pose, 3)
    first = [psi, *finite(f"{name}: velocity", velocity, 2), x, y]
    quantities = (*QUANTITIES, *ranges.bias)
    memory = stored_estimate(quantities, first, noise, [range_bias**2] * len(ranges.bias))
    measured = dict.fromkeys(s for aid in ranges.aids for s in (aid.signal, aid.valid))
    told, _ = outputs_of_estimate(sp.Matrix([*ESTIMATE, *(s.symbol for s in ranges.bias)]), ranges.bias)
    return ParticleFilter(
        name,
        positive(f"{name}: period", period),
        particles,
        (*IMU, *measured, *ranges.inputs),
        (*told, *innovation_outputs(tuple(a.signal for a in ranges.aids)), *memory.outputs(), EFFECTIVE),
        memory.values,
        ranges,
        noise,
        range_bias,
        None if area is None else _area(name, area),
        roughening,
        echoes,
        seed,
    )


class RunningParticles:
    """The particles of several runs; made by :meth:`ParticleFilter.start`."""

    def __init__(self, made: ParticleFilter, runs: int, start: Mapping[str, ArrayLike]) -> None:
        self._made, self._rng = made, np.random.default_rng(made.seed)
        noise, bias, sigma = made.noise, made.ranges.bias, math.sqrt(_variance(made.ranges.aids[-1]))
        mean = [np.broadcast_to(np.asarray(start.get(s.name, s.start), float), (runs,)) for s in made.states]
        first = [noise.P1[0], *noise.P2[:4], noise.P1[1], *noise.P2[4:], *[made.range_bias**2] * len(bias)]
        size = np.sqrt(np.array(first))
        x = np.array(mean).T[:, :, None] + size[:, None] * self._rng.standard_normal(
            (runs, len(size), made.particles)
        )
        if made.area is not None:
            for row, (low, high) in zip((0, 3, 4), ((-math.pi, math.pi), *made.area), strict=True):
                x[:, row] = self._rng.uniform(low, high, (runs, made.particles))
        near = np.array([sigma / 0.2, *[sigma / 0.1] * 2, sigma, sigma, *size[5:]])
        self._cloud = Cloud(x, near, made.roughening, self._rng)
        self._added = np.sqrt(added_variances(noise))
        self._held: Array | None = None
        self._psi = np.array(mean[0])
        self._functions = _functions(made)

    def __repr__(self) -> str:
        made = self._made
        return f"RunningParticles of {made.name}: {len(self._psi)} runs of {made.particles} particles"

    def tick(self, inputs: Array, span: float, outputs: Sequence[str]) -> Array:
        """Advance the particles by one tick and return the outputs.

        Parameters
        ----------
        inputs : ndarray, shape (n_inputs, runs)
        span : float
            Time since the last tick [s]; ignored at the first tick.
        outputs : sequence of str
            Names of the outputs to return.

        Returns
        -------
        ndarray, shape (n_outputs, runs)
        """
        names = [s.name for s in self._made.inputs]
        given = dict(zip(names, inputs, strict=True))
        now = inputs[:3]
        move, expect, tell = self._functions
        x = self._cloud.x
        # x+ = f(x, w), w ~ N(0, Q span / period), each particle with its own w.
        if self._held is not None:
            share = math.sqrt(span / self._made.period)
            w = [
                s * share * self._rng.standard_normal(x[:, 0].shape) if s else np.float64(0.0)
                for s in self._added
            ]
            held, seen = (list(rows[:, :, None]) for rows in (self._held, now))
            moved = move(list(x.transpose(1, 0, 2)[:8]), w, held, seen, span)
            for i, row in enumerate(moved):
                x[:, i] = row
        self._held = now.copy()
        innovation = self._measured(given, expect)
        return self._told(given, innovation, tell, outputs)

    def _measured(self, given: Mapping[str, Array], expect: Callable[..., list[Array]]) -> dict[str, Array]:
        """Weight the particles by the measurements; return innovations and their variances."""
        # nu = sum_i w_i (z - h(x_i)),  S = sum_i w_i (z - h(x_i) - nu)^2 + R, before the weights change.
        made, cloud = self._made, self._cloud
        aids = made.ranges.aids
        runs = len(cloud.x)
        found = {
            name: np.zeros(runs)
            for s in innovation_outputs(tuple(a.signal for a in aids))
            for name in [s.name]
        }
        use = np.array([given[a.valid.name] > 0.5 for a in aids])
        unit = given["range_unit"] if made.ranges.inputs else np.ones(runs)
        for run in np.flatnonzero(use.any(axis=0)):
            heard = [(k, a, float(given[a.signal.name][run])) for k, a in enumerate(aids) if use[k, run]]

            def likelihood(
                x: Array, run: int = int(run), heard: list[tuple[int, Aid, float]] = heard
            ) -> Array:
                expected = expect(list(x), float(unit[run]))
                return np.asarray(sum(_log_likelihood(a, z - expected[k], made.echoes) for k, a, z in heard))

            weights, expected = cloud.weights[run], expect(list(cloud.x[run]), float(unit[run]))
            for k, a, z in heard:
                off = _off(a, z - np.broadcast_to(expected[k], weights.shape))
                mean = float(weights @ off)
                found[f"{a.signal.name}_innovation"][run] = mean
                found[f"{a.signal.name}_innovation_variance"][run] = weights @ (off - mean) ** 2 + _variance(
                    a
                )
            cloud.meet(int(run), likelihood)
        return found

    def _told(
        self,
        given: Mapping[str, Array],
        innovation: Mapping[str, Array],
        tell: Callable[..., list[Array]],
        outputs: Sequence[str],
    ) -> Array:
        """Return the outputs computed from means over the particles."""
        # x_hat = sum_i w_i x_i, psi_hat = arg sum_i w_i exp(j psi_i) (unwrapped),
        # P = sum_i w_i (x_i - x_hat) (x_i - x_hat)^T.
        x, w = self._cloud.x, self._cloud.weights
        mean = np.einsum("rip,rp->ir", x, w)
        turned = np.angle(np.einsum("rp,rp->r", w, np.exp(1j * x[:, 0])))
        mean[0] = self._psi = self._psi + _wrapped(turned - self._psi)
        values = dict(innovation)
        told = outputs_of_estimate(sp.Matrix(ESTIMATE), ())[0]
        imu = [given[s.name] for s in IMU]
        extras = [f"{s.name}_hat" for s in self._made.ranges.bias]
        values |= dict(zip([s.name for s in told], tell(list(mean[:8]), imu), strict=True))
        values |= dict(zip(extras, mean[8:], strict=True))
        if "effective" in outputs:
            values["effective"] = 1.0 / (w**2).sum(axis=1)
        if any(name.startswith("P[") for name in outputs):
            off = x - mean.T[:, :, None]
            off[:, 0] = _wrapped(off[:, 0])
            P = (off * w[:, None, :]) @ off.transpose(0, 2, 1)
            size = P.shape[1]
            values |= {f"P[{i},{j}]": P[:, i, j] for i in range(size) for j in range(i, size)}
        return np.array([np.broadcast_to(values[name], (len(x),)) for name in outputs])


def _functions(made: ParticleFilter) -> tuple[Callable[..., list[Array]], ...]:
    """Return motion, expected measurements and outputs as NumPy functions, from the filters' equations."""
    w, span = sp.Matrix([sp.Dummy(real=True) for _ in range(6)]), sp.Dummy("span", real=True)
    x = [*ESTIMATE, *(s.symbol for s in made.ranges.bias)]
    values = {s.symbol: s.start for s in made.ranges.parameters}
    held, now = ([s.symbol for s in group] for group in (HELD_IMU, IMU))
    unit = sp.Symbol("range_unit", real=True)
    defined = {sp.Symbol(k, real=True): e for k, e in made.ranges.definitions.items()}
    expected = [sp.sympify(a.expected).xreplace(defined).xreplace(values) for a in made.ranges.aids]
    _, told = outputs_of_estimate(sp.Matrix(ESTIMATE), ())
    move = sp.lambdify(
        [list(ESTIMATE), list(w), held, now, span], list(next_estimate(span, w)), "numpy", cse=True
    )
    expect = sp.lambdify([x, unit], expected, "numpy", cse=True)
    tell = sp.lambdify([list(ESTIMATE), now], list(told.values()), "numpy", cse=True)
    return move, expect, tell


def _variance(aid: Aid) -> float:
    return aid.variance.start


def _off(aid: Aid, seen: Array) -> Array:
    return _wrapped(seen) if aid.angle else seen


def _wrapped(angle: Array) -> Array:
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)


def _log_likelihood(aid: Aid, seen: Array, echoes: float) -> Array:
    """Return the log-likelihood of a measurement: normal, or a mixture for a range that may be an echo."""
    # ln N = -1/2 ((z - h)^2 / R + ln 2 pi R);  with echoes p: ln((1 - p) N + p / FARTHEST).
    R = _variance(aid)
    normal = -0.5 * (_off(aid, seen) ** 2 / R + math.log(2 * math.pi * R))
    if not echoes or aid.angle:
        return np.asarray(normal)
    return np.logaddexp(math.log1p(-echoes) + normal, math.log(echoes / FARTHEST))


def _area(name: str, area: Sequence[Sequence[float]]) -> tuple[tuple[float, float], tuple[float, float]]:
    if not hasattr(area, "__len__") or len(area) != 2:
        raise InputError(f"{name}: area: expected ((x_min, x_max), (y_min, y_max)) [m], found {area!r}")
    sides = []
    for axis, pair in zip("xy", area, strict=True):
        low, high = finite(f"{name}: area, {axis}", pair, 2)
        if not low < high:
            raise InputError(f"{name}: area: expected {axis}_min < {axis}_max, found {low:g} and {high:g}")
        sides.append((low, high))
    return sides[0], sides[1]
