"""The monitor along real logs (../shared/data, or $HOVERCONTROL_DATA): six fans, and four fans.

The six-fan craft is fitted on the first half of its log; the monitor runs along the second half, with the lag
of the fans in the model and without. The four-fan craft is taken as it is, the noise from the first part of
each run.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator

import numpy as np

import hovercontrol as hc
from benchmarks import real_craft, real_logs
from hovercontrol.blocks.block import Block
from hovercontrol.identification.monitor.build import build
from hovercontrol.identification.monitor.monitor import monitor
from hovercontrol.identification.monitor.noise import trained_model
from hovercontrol.identification.monitor.replay import replay

POSE = ["x", "y", "psi"]
PERIOD, RATE, LAG = 0.0125, 0.1, 0.0276
FOUR_FAN_MASS = 0.1763  # kg


def told(watch: Block, log: hc.Log) -> Iterator[tuple[str, str, str, bool | None]]:
    """Yield the alarms along a log: their number by names, then each one."""
    begin = time.perf_counter()
    found = replay(watch, log)
    names = Counter(f"{a.name} dead" if a.kind == "dead" else a.name for a in found.alarms)
    counts = ", ".join(f"{name} {count}" for name, count in names.items()) or "no alarm"
    spent = time.perf_counter() - begin
    yield f"... alarms in {found.seconds:.0f} s", f"{counts}; threshold {found.threshold:.1f}", "", None
    for alarm in found.alarms:
        yield "...", f"{alarm}, evidence {alarm.evidence:.0f}", "", None
    yield "... replayed in", f"{spent:.0f} s", "", None


def pose_rows(log: hc.Log) -> Iterator[tuple[str, str, str, bool | None]]:
    """Yield gaps and steps of the poses, and the circle of the tracked point while the craft spins.

    From 46 s to 51 s positions are fitted by polynomials of degree 5 and an offset fixed in the body, turned
    by the heading. A constant thrust acceleration a gives the radius a/r^2.
    """
    x, y, psi = (np.asarray(log[c]) for c in POSE)
    seen = np.isfinite(x)
    t, x, y, psi = log.time[seen], x[seen], y[seen], psi[seen]
    yield "... longest gap between poses", f"{np.diff(t).max():.2f} s", "", None
    steps = np.hypot(np.diff(x), np.diff(y))
    large = ", ".join(f"{1e3 * steps[k]:.0f} mm at {t[k + 1]:.2f} s" for k in np.flatnonzero(steps > 0.02))
    yield "... steps of more than 20 mm", large or "none", "", None
    m = (t >= 46.0) & (t < 51.0)
    if m.sum() < 100:
        return
    powers = ((t[m] - 46.0) / 5.0)[:, None] ** np.arange(6)
    c, s, none = np.cos(psi[m])[:, None], np.sin(psi[m])[:, None], np.zeros_like(powers)
    left = np.block([[powers, none, c, -s], [none, powers, s, c]])
    ahead, aside = 1e3 * np.linalg.lstsq(left, np.concatenate([x[m], y[m]]), rcond=None)[0][-2:]
    rate = np.polyfit(t[m], psi[m], 1)[0]
    during = (log.time >= 46.0) & (log.time < 51.0)
    force = [np.nanmean(log[f"{p}_left"][during] + log[f"{p}_right"][during]) for p in ("rear", "front")]
    by_thrust = -1e3 * (force[0] - force[1]) / FOUR_FAN_MASS / rate**2
    text = f"{ahead:.1f} mm ahead, {aside:.1f} mm aside; {by_thrust:.1f} mm ahead by the thrust"
    yield f"... body offset at {rate:.1f} rad/s", text, "", None


def sensor_noise(log: hc.Log) -> np.ndarray:
    """Return the noise of the pose by third differences, d^3 y/20^(1/2): no model enters."""
    return np.array([np.std(np.diff(log[c], n=3)) / np.sqrt(20.0) for c in POSE])


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    if not real_craft.DATA.exists():
        yield "real logs", f"not at {real_craft.DATA}", "", None
        return
    four_fan = hc.vehicle("four_fan")
    for run in "abcd":
        log = real_logs.read(run)
        yield f"four fans, run {run}", "", "", None
        yield from pose_rows(log)
        yield from told(build(four_fan, log).block, log)
        names = [*four_fan.linear_coefficients(), *(f"{c}_bias" for c in POSE), "pose_lever_arm"]
        yield f"four fans, run {run}, with the place of the tracked point as a candidate", "", "", None
        yield from told(build(four_fan, log, candidates=names).block, log)
    log = real_craft.holohover("h1")
    middle = float(log.time[0] + log.time[-1]) / 2
    first, second = log.between(log.time[0], middle), log.between(middle, log.time[-1])
    louder = sensor_noise(second) / sensor_noise(first)
    what = "noise of x, y, psi in the second half over the first"
    yield what, ", ".join(f"{v:.2f}" for v in louder), "", None
    craft = real_craft.fan_craft(real_craft.MASS["h1"])
    craft, noise, std = trained_model(craft.with_effects([hc.effect("fan_lag", seconds=LAG)]), first, POSE)
    lacking = craft.without_effects("fan_lag")
    std = {name: std[name] for name in craft.linear_coefficients() if name in std}
    largest = 1.0
    for label, model, more, known in (
        ("fitted model", craft, [], {}),
        ("fitted model, its errors known", craft, [], std),
        ("lag not in the model", lacking, ["fan_lag"], {}),
    ):
        # without the lag in the model, the lag would count as dispersion: take the largest of the one with it
        names = [*model.linear_coefficients(), *(f"{c}_bias" for c in POSE), *more]
        begin, louder = time.perf_counter(), largest**0.5 if more else 1.0
        block = monitor(
            model, names, false_alarms_per_hour=RATE, period=PERIOD,
            process_noise={k: v * louder for k, v in noise.process.items()},
            measurement_noise={k: v * louder for k, v in noise.measurement.items()},
            coefficient_std=known, lost_samples=POSE, motion=first, dispersion=not more,
        )  # fmt: skip
        yield f"six fans, {label}: built in", f"{time.perf_counter() - begin:.0f} s", "", None
        phi = {
            s.name.removeprefix("dispersion_"): s.start for s in block.parameters if "dispersion_" in s.name
        }
        if phi:
            largest = max(largest, *map(float, phi.values()))
            yield "... dispersion", ", ".join(f"{k} {float(v):.2f}" for k, v in phi.items()), "", None
        else:
            yield "... evidence divided by", f"{largest:.2f}", "", None
        for half, part in (("first half (fitted)", first), ("second half", second)):
            yield f"six fans, {label}, {half}", "", "", None
            yield from told(block, part)
