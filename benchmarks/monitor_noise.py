"""False alarms of a monitor of a cart: noise not normal or not white, rounding, errors of coefficients."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.signal import lfilter

import hovercontrol as hc
from hovercontrol.identification.monitor import bank

Array = NDArray[np.float64]
Noise = Callable[[np.random.Generator, int], Array]

PERIOD, DRAG, MASS, NOISE, PUSH = 0.1, 0.5, 2.0, 0.02, 0.02
KEEP = np.exp(-DRAG * PERIOD)
RATE, SOUND = 20.0, 600.0  # 1/h, s
#: Samples are rounded to 2.5 times their noise; coefficients are 3 % off.
STEP, OFF = 2.5 * NOISE, 0.03


def normal(rng: np.random.Generator, n: int) -> Array:
    return rng.normal(size=n)


def student(freedom: float) -> Noise:
    """Return Student's t, of unit variance."""
    return lambda rng, n: rng.standard_t(freedom, size=n) * np.sqrt(1.0 - 2.0 / freedom)


def slow(rng: np.random.Generator, n: int) -> Array:
    """Return white noise and a process of 2 s with nine times its variance."""
    keep, e = np.exp(-PERIOD / 2.0), rng.normal(size=(2, n))
    return np.asarray(e[0] + 3.0 * lfilter([np.sqrt(1 - keep**2)], [1.0, -keep], e[1]))


def log(seconds: float, noise: Noise, seed: int) -> hc.Log:
    """Return a log of the cart, v' = F/m - c v in exact steps."""
    rng, t = np.random.default_rng(seed), PERIOD * np.arange(round(seconds / PERIOD))
    F = 2.0 * np.sign(np.sin(0.9 * t + 0.1))
    w = PUSH * np.sqrt((1 - KEEP**2) / (2 * DRAG)) * rng.normal(size=t.size)
    drive = np.concatenate([[0.0], ((1 - KEEP) / DRAG * F / MASS + w)[:-1]])
    v = lfilter([1.0], [1.0, -KEEP], drive) + NOISE * noise(rng, t.size)
    return hc.Log("cart", t, {"v": v, "F": F})


def false_alarms(run: hc.Log, wrong: float = 0.0, noise: float = NOISE, **options: Any) -> int:
    """Return the number of alarms along a log, each followed by a reset.

    Parameters
    ----------
    wrong : float, optional
        Relative error of the mass that the monitor takes, and of the drag with the other sign.
    noise : float, optional
        Of a sample, as the monitor takes it.
    **options
        Of the monitor.
    """
    v, F = hc.Signal("v", "m/s"), hc.Signal("F", "N")
    m, c = (
        hc.Signal("m", "kg", start=MASS * (1 + wrong)),
        hc.Signal("c", "1/s", start=DRAG * (1 - wrong)),
    )
    cart = hc.Block("cart", [v], [F], [v], [m, c], {"v": F.symbol / m.symbol - c.symbol * v.symbol})
    watch = hc.monitor(
        cart, ["c", "m", "v_bias"], false_alarms_per_hour=RATE, period=PERIOD, measured=["v"],
        process_noise={"v": PUSH}, measurement_noise={"v": noise}, **options,
    )  # fmt: skip
    alarm, count, reset = hc.Signal("alarm"), hc.Signal("alarms"), hc.Signal("reset")
    following = {"alarms": count.symbol + alarm.symbol}
    counter = hc.Block(
        "counter", [count], [alarm], [count, reset], [], following, {"reset": alarm.symbol}, period=PERIOD
    )
    loop = hc.interconnect([watch, counter], outputs=["alarms"])
    return int(np.ravel(loop.compile().simulate(run.time, dict(run.columns)).outputs)[-1])


def rounded(log: hc.Log) -> hc.Log:
    return hc.Log(log.name, log.time, {**log.columns, "v": STEP * np.round(log["v"] / STEP)})


def told(what: str, found: int, hours: float, bar: bool) -> tuple[str, str, str, bool | None]:
    low, high = stats.poisson.interval(0.95, RATE * hours)
    return (
        what,
        f"{found} in {hours:g} h",
        f"{low:.0f} to {high:.0f}" if bar else "",
        found <= high if bar else None,
    )


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    for label, noise, hours in (
        ("normal noise", normal, 20.0),
        ("Student's t, 5 degrees of freedom", student(5.0), 20.0),
        ("Student's t, 3 degrees of freedom", student(3.0), 20.0),
        ("white noise and a process of 2 s", slow, 4.0),
    ):
        run, sound = log(3600.0 * hours, noise, 2), log(SOUND, noise, 3)
        for dispersion in (True, False):
            found = false_alarms(run, motion=sound, dispersion=dispersion)
            what = f"{label}, {'with' if dispersion else 'without'} dispersion"
            yield told(what, found, hours, dispersion)
        with patch.object(bank, "LIMIT", 1e9):
            yield told(f"{label}, innovations not limited", false_alarms(run, motion=sound), hours, False)
    yield from known_errors(10.0)


def known_errors(hours: float) -> Iterator[tuple[str, str, str, bool | None]]:
    """Yield false alarms with rounded samples and with wrong coefficients, known to the monitor or not."""
    run, sound = log(3600.0 * hours, normal, 2), log(SOUND, normal, 3)
    coarse, quiet = rounded(run), rounded(sound)
    whole = np.hypot(NOISE, STEP / np.sqrt(12.0))
    known: dict[str, Any] = {"noise": whole, "motion": quiet, "repeats": True}
    what = f"rounded to {STEP / NOISE:g} times the noise"
    yield told(f"{what}, known", false_alarms(coarse, **known), hours, True)
    yield told(
        f"{what}, equal samples left out", false_alarms(coarse, **known | {"repeats": False}), hours, False
    )
    yield told(f"{what}, not known", false_alarms(coarse, motion=quiet, repeats=True), hours, False)
    std = {"m": OFF * MASS, "c": OFF * DRAG}
    what = f"coefficients {100 * OFF:g} % off"
    yield told(f"{what}, known", false_alarms(run, OFF, motion=sound, coefficient_std=std), hours, True)
    yield told(f"{what}, dispersion", false_alarms(run, OFF, motion=sound, dispersion=True), hours, True)
    yield told(f"{what}, not known", false_alarms(run, OFF, motion=sound), hours, False)
