"""Logs of craft on which something acts that is in no catalogue, or that a poor recorder wrote.

As in :mod:`.generator` a case is made of a seed and what is hidden, and the search sees only the model, its
coefficients up to 3 % off, and the logs. Here a craft that lacks a known effect meets a disturbance as well:
a rough patch of floor, a load that swings, a cable, an oscillating torque, bumps, gusts. Seven suites:

========== =================================================================================
partial    an effect of the catalogue beside a disturbance, about as large as the effect
remainder  a disturbance, nothing of the catalogue
dirty      outliers, lost rows, stamps that are off; an effect or none
gusts      coloured accelerations; an effect or none
beyond     an effect that is named only where a search is asked for it; it is not
rest       an effect of the catalogue that the blind table does not have; of six fans also none
fans       a craft of six fans whose thrust lags, on a floor with a patch, tracked by cameras
========== =================================================================================
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import count
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hovercontrol.craft.effects import Effect, effect, effect_names
from hovercontrol.craft.models.model import Fan, Model
from hovercontrol.identification.benchmark.cases import gust
from hovercontrol.logs import Log

from .disturbances import Disturbance, Drive, Motion, placed, unmet
from .generator import (
    BEYOND,
    FANS,
    GUST,
    NOISE,
    REST,
    Case,
    Conditions,
    craft,
    faulty,
    given,
    hidden,
)
from .windows import late, misfit

Array = NDArray[np.float64]
Random = np.random.Generator

POSE = ("x", "y", "psi")
DISTURBANCES = ("patch", "resonance", "cable", "torque", "bumps")
EFFECTS = (
    "thrust_lag",
    "input_delay",
    "slope",
    "yaw_quadratic_drag",
    "rudder_offset",
    "sway_quadratic_drag",
    "thrust_deadzone",
    "gyro_scale",
    "surge_stribeck",
    "munk_moment",
)
#: What poses cannot show, and what is hidden in its place.
IN_POSE = {"gyro_scale": "thrust_saturation"}
#: Errors of a prediction over 0.5 s, in standard deviations of the noise: of a disturbance that is alone, and
#: the least of one beside an effect.
ALONE, LEAST = (2.0, 6.0), 1.5
#: Effects beside a disturbance are made larger until they make an error of one standard deviation.
LARGER = (1.0, 1.5, 2.0, 3.0)
#: A disturbance beside an effect makes so many times the error that the effect makes.
BESIDE = (0.5, 1.5)
CAMERA = {"x": 3e-4, "y": 3e-4, "psi": 5e-4}  # standard deviations [m, rad], on the fan craft


@dataclass(frozen=True)
class Disturbed(Case):
    """A case, and how large what was hidden is.

    Attributes
    ----------
    disturbance : Disturbance or None
    shares : (float, float)
        Error of a prediction over 0.5 s, coefficients fitted again, in standard deviations of the noise: what
        the effects make, what the disturbance makes; NaN where it was not measured.
    """

    disturbance: Disturbance | None = field(default=None, repr=False)
    shares: tuple[float, float] = field(default=(np.nan, np.nan), repr=False)


# ---- logs ----------------------------------------------------------------------------------------------


def driven(name: str, rng: Random, conditions: Conditions) -> Drive:
    commands = conditions.commands(rng, conditions.duration, conditions.dt)
    t = conditions.dt * np.arange(len(next(iter(commands.values()))))
    pushes = {f"bump_{a}": np.zeros(t.size) for a in ("u", "v", "r")}
    for begin in np.cumsum(rng.exponential(1.5, int(conditions.duration))):
        rows = (t >= begin) & (t < begin + rng.uniform(0.03, 0.08))
        seconds = max(conditions.dt * rows.sum(), conditions.dt)
        for a, size in (("u", 0.15), ("v", 0.15), ("r", 0.4)):  # changes of speed [m/s, rad/s]
            pushes[f"bump_{a}"][rows] = size * rng.normal() / seconds
    pushes |= {f"gust_{a}": gust(rng, t.size, conditions.dt, size) for a, size in GUST.items()}
    return Drive(name, np.asarray(t, dtype=np.float64), commands, pushes, rng.uniform(0.0, 2 * np.pi))


def move(truth: Model, drive: Drive, disturbance: Disturbance | None = None) -> Motion:
    """Return the motion of a craft."""
    block = truth.plant(late=True)
    if disturbance:
        block = disturbance.added(block, drive.phase)
    t, delay = drive.time, late(truth)
    grid = np.unique(np.round(np.concatenate([t, t + delay, [min(0.0, delay)]]), 9)) if delay else t
    held = np.searchsorted(t, grid - delay + 1e-9, side="right") - 1
    now = np.clip(np.searchsorted(t, grid + 1e-9, side="right") - 1, 0, t.size - 1)
    rows = [
        drive.pushes[s.name][now]
        if s.name in drive.pushes
        else np.where(held >= 0, drive.commands[s.name][np.clip(held, 0, t.size - 1)], 0.0)
        for s in block.inputs
    ]
    run = block.compile(friction="smooth").simulate(grid, rows, rtol=1e-7, atol=1e-9)
    at = np.searchsorted(grid, t - 1e-9)
    states = {s.name: x[at] for s, x in zip(block.states, np.atleast_2d(run.states), strict=True)}
    y = dict(zip(run.output_labels, np.atleast_2d(run.outputs), strict=True))
    return Motion(drive, states, {c: y.get(f"{c}_measured", y[c])[at] for c in NOISE})


def _log(motion: Motion, rng: Random, conditions: Conditions, noise: Mapping[str, float]) -> Log:
    drive = motion.drive
    seen = {
        c: motion.seen[c] + conditions.noise * noise[c] * rng.normal(size=drive.time.size)
        for c in conditions.channels
    }
    log = Log(drive.name, drive.time, {**seen, **drive.commands})
    return faulty(log, rng, conditions) if conditions.faults else log


def disturbed(
    rng: Random,
    model: Model,
    effects: Sequence[Callable[[float], Effect]],
    kind: str,
    conditions: Conditions,
    noise: Mapping[str, float] = NOISE,
) -> Disturbed:
    """Return a case: a craft that lacks effects and meets a disturbance.

    Parameters
    ----------
    model : Model
        The craft without what is hidden, its coefficients true.
    effects : sequence of callable
        Hidden: each returns its effect of a size, 1.0 for the usual one.
    kind : str
        One of ``DISTURBANCES``, ``"gusts"``, or empty.
    """
    believed = given(model, rng)
    titles = [f"log {k + 1}" for k in range(conditions.logs)] + ["hold-out"]
    drives = [driven(name, rng, conditions) for name in titles]
    train = drives[: conditions.logs]
    error = partial(misfit, channels=conditions.channels, noise=noise)
    disturbance, shares, of_effects = None, (np.nan, np.nan), 0.0
    for scale in LARGER:
        truth = model.with_effects([sized(scale) for sized in effects])
        if kind not in DISTURBANCES or not effects:
            break
        of_effects = error(model, [move(truth, d) for d in train])
        if of_effects >= 1.0:
            break

    def made(d: Disturbance) -> float:
        return error(truth, [move(truth, x, d) for x in train])

    if kind:
        disturbance = Disturbance(kind, {})
    if kind in DISTURBANCES:
        calm = [move(truth, d) for d in drives]
        wanted = max(rng.uniform(*BESIDE) * of_effects, LEAST) if effects else rng.uniform(*ALONE)
        best = np.inf
        for _ in range(8 if kind == "patch" else 1):  # a patch may hold a craft, or be left for good
            tried = _sized(Disturbance(kind, placed(kind, rng, calm)), made, wanted)
            made_by_it = made(tried)
            off = abs(np.log(made_by_it / wanted)) + unmet(tried, [move(truth, d, tried) for d in drives])
            if off < best:
                best, disturbance, shares = off, tried, (of_effects, made_by_it)
            if off < 0.5:
                break
    motions = [move(truth, d, disturbance) for d in drives]
    logs = [_log(m, rng, conditions, noise) for m in motions]
    names = [e.name for e in truth.effects if e not in model.effects]
    return Disturbed(believed, logs[:-1], logs[-1], truth, tuple(names), disturbance, shares)


def _sized(of: Disturbance, made: Callable[[Disturbance], float], wanted: float) -> Disturbance:
    """Return the disturbance so strong that it makes about the error that is wanted."""
    if of.kind == "patch":  # too rough a patch holds the craft, which then shows less of it
        tried = [replace(of, gain=float(gain)) for gain in np.geomspace(0.06, 2.5, 9)]
        return min(tried, key=lambda d: abs(np.log(made(d) / wanted)))
    low, high = {"resonance": (0.02, 0.9), "cable": (1e-3, 3.0)}.get(of.kind, (0.02, 20.0))
    of = replace(of, gain=float(np.sqrt(low * high)))
    for _ in range(3):
        gain = of.gain * np.clip(wanted / made(of), 0.1, 10.0)
        of = replace(of, gain=float(np.clip(gain, low, high)))
    return of


# ---- the fan craft -------------------------------------------------------------------------------------

_TILT, _REACH, _HALF = np.pi / 3, 0.052, 0.019


def fan_craft(rng: Random) -> Model:
    """Return a light craft of six fans: three pairs about the hull, those of a pair against each other."""
    fans = []
    for letter, angle in zip("abc", (0.0, 2 * np.pi / 3, -2 * np.pi / 3), strict=True):
        for k, side in ((1, -1.0), (2, 1.0)):
            x = _REACH * np.cos(angle) - side * _HALF * np.sin(angle)
            y = _REACH * np.sin(angle) + side * _HALF * np.cos(angle)
            fans.append(Fan(f"fan_{letter}_{k}", x, y, angle - side * np.pi / 2))
    mass, inertia = rng.uniform(0.15, 0.19), rng.uniform(3.5e-4, 5e-4)
    width = rng.uniform(2e-3, 1e-2)
    effects = [
        effect("surge_linear_drag", rng.uniform(0.1, 0.3)),
        effect("sway_linear_drag", rng.uniform(0.1, 0.3)),
        effect("yaw_linear_drag", rng.uniform(0.8, 1.2)),
        effect("surge_coulomb", rng.uniform(0.02, 0.05), width=width),
        effect("sway_coulomb", rng.uniform(0.02, 0.05), width=width),
        effect("fan_force", 1.0 / mass),
        effect("fan_torque", 1.0 / inertia),
    ]
    return Model("fan_craft", tuple(effects), fans=tuple(fans))


def fan_steps(rng: Random, duration: float, dt: float) -> dict[str, Array]:
    """Return random steps of six fans' forces, sent at 100 Hz; of each pair mostly one fan runs."""
    rows, sent = round(duration / dt), round(0.01 / dt)
    forces = {f"fan_{letter}_{k}": np.zeros(rows) for letter in "abc" for k in (1, 2)}
    for letter in "abc":
        k = 0
        while k < rows:
            n = sent * max(1, int(rng.uniform(0.05, 0.4) / (sent * dt)))
            for fan in (1, 2):
                forces[f"fan_{letter}_{fan}"][k : k + n] = rng.uniform(0.002, 0.01)
            forces[f"fan_{letter}_{rng.integers(1, 3)}"][k : k + n] = rng.uniform(0.02, 0.15)
            k += n
    return forces


def lag_of_fans() -> str:
    """Return the name by which the catalogue knows the lag of fans."""
    return "fan_lag" if "fan_lag" in effect_names() else "thrust_lag"


# ---- suites --------------------------------------------------------------------------------------------


class Key(NamedTuple):
    """What a case is made of."""

    suite: str
    effect: str
    disturbance: str
    variant: str
    seed: int

    @property
    def name(self) -> str:
        """What the case is called in tables, without its seed."""
        what = "+".join(filter(None, (self.effect, self.disturbance))) or "none"
        return f"{what} {self.variant}".strip()

    def case(self) -> Disturbed:
        """Return the case."""
        rng = np.random.default_rng([self.seed, zlib.crc32(f"{self.suite} {self.name}".encode())])
        conditions = CONDITIONS[self.suite]
        if self.variant == "pose":
            conditions = replace(conditions, channels=POSE)
        if self.suite == "fans":
            seconds = rng.uniform(0.02, 0.05)
            lag = [lambda scale: effect(self.effect, seconds=scale * seconds)]
            return disturbed(rng, fan_craft(rng), lag, self.disturbance, conditions, CAMERA)
        if self.variant == "fans":
            values = {k: size(rng) for k, size in FANS.get(self.effect, {}).items()}
            own = [lambda scale: effect(self.effect, **values)] if self.effect else []
            return disturbed(rng, fan_craft(rng), own, self.disturbance, CONDITIONS["fans"], CAMERA)
        model, draw = craft(rng), int(rng.integers(2**32))

        def sized(scale: float) -> Effect:
            scale = 1.0 if self.effect == "thrust_saturation" else scale  # a lower limit is another craft
            return hidden(self.effect, np.random.default_rng(draw), model, scale)

        effects = [sized] if self.effect else []
        return disturbed(rng, model, effects, self.disturbance, conditions)


CONDITIONS = {
    "partial": Conditions(),
    "remainder": Conditions(),
    "dirty": Conditions(dt=0.01, faults=True),
    "gusts": Conditions(),
    "beyond": Conditions(),
    "rest": Conditions(),
    "fans": Conditions(commands=fan_steps, dt=0.005, channels=POSE),
}
SUITES = tuple(CONDITIONS)


def keys(suite: str, seeds: int, first: int = 0) -> Iterator[Key]:
    """Return the cases of a suite, seeds outermost, so that a run that is stopped has some of all."""
    for seed in range(first, first + seeds):
        if suite == "partial":
            for first, variant in ((seed, ""), (seed + 2, "pose")):
                for k, name in zip(count(first), EFFECTS, strict=False):
                    shown = IN_POSE.get(name, name) if variant else name
                    yield Key(suite, shown, DISTURBANCES[k % len(DISTURBANCES)], variant, seed)
        elif suite == "remainder":
            yield from (Key(suite, "", kind, "", seed) for kind in (*DISTURBANCES, "gusts"))
            yield from (Key(suite, "", kind, "pose", seed) for kind in ("patch", "cable", "torque", "gusts"))
        elif suite == "beyond":
            yield from (Key(suite, name, "", "", seed) for name in BEYOND)
        elif suite == "rest":
            yield from (Key(suite, name, "", "", seed) for name in REST)
            yield from (Key(suite, name, "", "fans", seed) for name in (*FANS, ""))
        elif suite == "fans":
            yield Key(suite, lag_of_fans(), "patch", "", seed)
        else:
            kind = "gusts" if suite == "gusts" else ""
            yield from (Key(suite, name, kind, "", seed) for name in (*EFFECTS, ""))
