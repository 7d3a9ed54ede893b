"""False alarms of a monitor under noise that is not normal or not white: a cart with a speed sensor."""

from __future__ import annotations

from collections.abc import Callable, Iterator
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


def false_alarms(run: hc.Log, sound: hc.Log, dispersion: bool) -> int:
    """Return the number of alarms along a log, each followed by a reset."""
    v, F = hc.Signal("v", "m/s"), hc.Signal("F", "N")
    m, c = hc.Signal("m", "kg", start=MASS), hc.Signal("c", "1/s", start=DRAG)
    cart = hc.Block("cart", [v], [F], [v], [m, c], {"v": F.symbol / m.symbol - c.symbol * v.symbol})
    watch = hc.monitor(
        cart, ["c", "m", "v_bias"], false_alarms_per_hour=RATE, period=PERIOD, measured=["v"],
        process_noise={"v": PUSH}, measurement_noise={"v": NOISE}, motion=sound, dispersion=dispersion,
    )  # fmt: skip
    alarm, count, reset = hc.Signal("alarm"), hc.Signal("alarms"), hc.Signal("reset")
    following = {"alarms": count.symbol + alarm.symbol}
    counter = hc.Block(
        "counter", [count], [alarm], [count, reset], [], following, {"reset": alarm.symbol}, period=PERIOD
    )
    loop = hc.interconnect([watch, counter], outputs=["alarms"])
    return int(np.ravel(loop.compile().simulate(run.time, dict(run.columns)).outputs)[-1])


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    for label, noise, hours in (
        ("normal noise", normal, 20.0),
        ("Student's t, 5 degrees of freedom", student(5.0), 20.0),
        ("Student's t, 3 degrees of freedom", student(3.0), 20.0),
        ("white noise and a process of 2 s", slow, 4.0),
    ):
        run, sound = log(3600.0 * hours, noise, 2), log(SOUND, noise, 3)
        low, high = stats.poisson.interval(0.95, RATE * hours)
        for dispersion in (True, False):
            found = false_alarms(run, sound, dispersion)
            what = f"{label}, {'with' if dispersion else 'without'} dispersion"
            wanted = f"{low:.0f} to {high:.0f} in {hours:g} h" if dispersion else ""
            yield what, f"{found}", wanted, found <= high if dispersion else None
        with patch.object(bank, "LIMIT", 1e9):
            yield f"{label}, innovations not limited", f"{false_alarms(run, sound, False)}", "", None
