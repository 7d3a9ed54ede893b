"""A family of manoeuvres within given limits of the commands."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.short_repr import short_repr
from hovercontrol.blocks.signals import Signal

Limits = Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class ManoeuvreLimits:
    """Limits of proposed manoeuvres.

    No published source: set by hand, exercised by tests/identification/diagnose/test_experiment.py.

    Attributes
    ----------
    seconds : float
        Length of every manoeuvre [s].
    drawn : int
        Number of random manoeuvres.
    held : tuple
        Shortest and longest time for which a random command is held [s].
    farther : float
        Largest command relative to the largest one in the logs, within the bounds of the model.
    """

    seconds: float = 20.0
    drawn: int = 2
    held: tuple[float, float] = (0.3, 3.0)
    farther: float = 2.0


#: The values in use.
MANOEUVRES = ManoeuvreLimits()


@dataclass(frozen=True, eq=False)
class Manoeuvre:
    """A manoeuvre: commands over time.

    Attributes
    ----------
    name, text : str
        ``"spin"``; its description, as the object of "Drive".
    time : ndarray, shape (n,)
        [s].
    commands : dict of str to ndarray, shape (n,)
    """

    name: str
    text: str
    time: Array
    commands: Mapping[str, Array]

    __repr__ = short_repr

    def until(self, part: float) -> Manoeuvre:
        """Return the first part of the manoeuvre, as a fraction of its rows."""
        n = max(int(part * self.time.size), 2)
        return replace(self, time=self.time[:n], commands={k: row[:n] for k, row in self.commands.items()})


def reach(signal: Signal, driven: Array) -> tuple[float, float]:
    """Return the smallest and the largest command that a proposal may use.

    Commands within the range of the logs are taken as safe. If the model bounds the command on a side, up to
    twice the largest command of the logs on that side is allowed, within the bound. A direction that was
    never driven is not used.

    Parameters
    ----------
    signal : Signal
        The input, with its bounds.
    driven : ndarray
        Values of this command in the logs.

    Examples
    --------
    >>> reach(Signal("thrust", "A", lower=-6.1, upper=6.1), np.array([0.0, 2.0]))
    (0.0, 4.0)
    >>> reach(Signal("thrust"), np.array([0.5, 2.0]))
    (0.5, 2.0)
    """
    low, high = float(driven.min()), float(driven.max())
    if low < 0.0 and np.isfinite(signal.lower):
        low = max(signal.lower, MANOEUVRES.farther * low)
    if high > 0.0 and np.isfinite(signal.upper):
        high = min(signal.upper, MANOEUVRES.farther * high)
    return low, high


def family(
    limits: Limits, step: float, seed: int = 0, tempo: float = 1.0, drawn: int = MANOEUVRES.drawn
) -> list[Manoeuvre]:
    """Return the manoeuvres that a machine with these commands can drive.

    Parameters
    ----------
    limits : dict of str to (float, float)
        Smallest and largest value of each command.
    step : float
        Time from row to row [s].
    seed : int, optional
        Seed of the random manoeuvres.
    tempo : float, optional
        By which lengths of time are multiplied.
    drawn : int, optional
        Number of random manoeuvres.

    Examples
    --------
    >>> [m.name for m in family({"thrust": (0.0, 3.0), "rudder": (-0.4, 0.4)}, 0.02)]
    ['steps', 'fast steps', 'coast-down', 'spin', 'figure eight', 'circle', 'ramp', 'random 1', 'random 2']
    >>> [m.name for m in family({"force": (-1.0, 1.0)}, 0.01)]
    ['steps', 'fast steps', 'coast-down', 'ramp', 'random 1', 'random 2']
    """
    t = np.arange(0.0, MANOEUVRES.seconds * tempo, step)

    def last(*seconds: float) -> str:
        return " to ".join(f"{s * tempo:.3g}" for s in seconds) + " s"

    makers: list[tuple[str, str, Callable[[Array, Limits], dict[str, Array]]]] = [
        ("steps", f"steps of all commands, held {last(1.0, 2.0)}", lambda t, x: _steps(t, x, 1.5)),
        ("fast steps", f"steps of all commands, held {last(0.3, 0.6)}", lambda t, x: _steps(t, x, 0.45)),
        ("coast-down", f"pushes of {last(2.5)}, each followed by a coast-down of {last(2.5)}", _coast),
    ]
    if {"thrust", "rudder"} <= set(limits):
        makers += [
            ("spin", "turns at full rudder to either side, with pauses", _spin),
            ("figure eight", "a figure eight at two speeds", _eight),
            ("circle", "circles, the thrust changed every 4 s", _circle),
        ]
        if limits["thrust"][0] < 0:
            makers.append(("reverse", "ahead and astern by turns, the rudder amidships", _reverse))
    makers.append(("ramp", "slow ramps of all commands from one limit to the other", _ramp))
    rng = np.random.default_rng(seed)
    for k in range(1, drawn + 1):
        text = f"steps of all commands at random times ({k} of {drawn} drawn with seed {seed})"
        makers.append((f"random {k}", text, lambda t, x: _drawn(t, x, rng)))
    return [Manoeuvre(name, text, t, make(t / tempo, limits)) for name, text, make in makers]


def _steps(t: Array, limits: Limits, hold: float) -> dict[str, Array]:
    """Return steps that cover the range evenly, each command at its own times.

    Step k of command i is at the fraction ``(1/2 + phi (k + 3.7 i)) mod 1`` of its range, phi = 0.618 (golden
    ratio).
    """
    found = {}
    for i, (name, (low, high)) in enumerate(limits.items()):
        own = hold * (1.0 + 0.3 * i)
        place = (0.5 + 0.618033988749895 * (np.floor(t / own) + 3.7 * i)) % 1.0
        found[name] = low + (high - low) * place
    return found


def _drawn(t: Array, limits: Limits, rng: np.random.Generator) -> dict[str, Array]:
    """Return steps of random height, held for random times, uniform in their logarithm."""
    found = {}
    for name, (low, high) in limits.items():
        count = int(t[-1] / MANOEUVRES.held[0]) + 1
        begin = np.cumsum(np.exp(rng.uniform(np.log(MANOEUVRES.held[0]), np.log(MANOEUVRES.held[1]), count)))
        found[name] = rng.uniform(low, high, count + 1)[np.searchsorted(begin, t, side="right")]
    return found


def _coast(t: Array, limits: Limits) -> dict[str, Array]:
    push = (t % 5.0) < 2.5
    part = 1.0 - 0.25 * np.floor(t / 5.0)
    return {
        name: np.where(push, part * high, np.clip(0.0, low, high)) if name != "rudder" else np.zeros_like(t)
        for name, (low, high) in limits.items()
    }


def _spin(t: Array, limits: Limits) -> dict[str, Array]:
    (low, high), (left, right) = limits["thrust"], limits["rudder"]
    push = (t % 4.0) < 2.5
    side = np.where((t % 8.0) < 4.0, right, left)
    return _rest(t, limits) | {"thrust": np.where(push, high, max(low, 0.0)), "rudder": side}


def _eight(t: Array, limits: Limits) -> dict[str, Array]:
    (low, high), (left, right) = limits["thrust"], limits["rudder"]
    wave = np.sin(2 * np.pi * t / 5.0)
    speed = np.where(t < MANOEUVRES.seconds / 2, 0.4, 0.9)
    rudder = 0.5 * (left + right) + 0.35 * (right - left) * wave
    return _rest(t, limits) | {"thrust": max(low, 0.0) + speed * (high - max(low, 0.0)), "rudder": rudder}


def _circle(t: Array, limits: Limits) -> dict[str, Array]:
    (low, high), (left, right) = limits["thrust"], limits["rudder"]
    stairs = np.array([0.3, 0.9, 0.5, 1.0, 0.2])[np.minimum((t // 4.0).astype(int), 4)]
    side = np.where(t < MANOEUVRES.seconds / 2, 0.5 * right, 0.5 * left)
    return _rest(t, limits) | {"thrust": max(low, 0.0) + stairs * (high - max(low, 0.0)), "rudder": side}


def _reverse(t: Array, limits: Limits) -> dict[str, Array]:
    low, high = limits["thrust"]
    return _rest(t, limits) | {"thrust": np.where((t % 5.0) < 2.5, high, low), "rudder": np.zeros_like(t)}


def _ramp(t: Array, limits: Limits) -> dict[str, Array]:
    found = {}
    for i, (name, (low, high)) in enumerate(limits.items()):
        phase = (t / (MANOEUVRES.seconds / (1.0 + i))) % 1.0
        found[name] = low + (high - low) * np.abs(2.0 * phase - 1.0)
    return found


def _rest(t: Array, limits: Limits) -> dict[str, Array]:
    """Return commands of zero, or of the allowed value nearest to zero."""
    return {name: np.full_like(t, np.clip(0.0, low, high)) for name, (low, high) in limits.items()}
