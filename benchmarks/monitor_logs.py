"""The monitor along real logs (../shared/data, or $HOVERCONTROL_DATA): six fans, and four fans.

The six-fan craft is fitted on the first half of its log; the monitor runs along the second half, with the lag
of the fans in the model and without. The four-fan craft is taken as it is, the noise from the first part of
each run.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

import hovercontrol as hc
from benchmarks import real_craft, real_logs
from hovercontrol.monitor.alarms import Alarm
from hovercontrol.monitor.build import build
from hovercontrol.monitor.monitor import monitor
from hovercontrol.monitor.noise import fitted_on
from hovercontrol.monitor.replay import replay

POSE = ["x", "y", "psi"]
PERIOD, RATE, LAG = 0.0125, 0.1, 0.0276


def told(alarms: tuple[Alarm, ...]) -> str:
    """Return the number of alarms by their names."""
    names = Counter(f"{a.name} dead" if a.kind == "dead" else a.name for a in alarms)
    return ", ".join(f"{name} {count}" for name, count in names.items()) or "no alarm"


def sensor_noise(log: hc.Log) -> np.ndarray:
    """Return the noise of the pose by third differences, d^3 y/20^(1/2): no model enters."""
    return np.array([np.std(np.diff(log[c], n=3)) / np.sqrt(20.0) for c in POSE])


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    if not real_craft.DATA.exists():
        yield "real logs", f"not at {real_craft.DATA}", "", None
        return
    log = real_craft.holohover("h1")
    middle = float(log.time[0] + log.time[-1]) / 2
    first, second = log.between(log.time[0], middle), log.between(middle, log.time[-1])
    louder = sensor_noise(second) / sensor_noise(first)
    what = "noise of x, y, psi in the second half over the first"
    yield what, ", ".join(f"{v:.2f}" for v in louder), "", None
    craft = real_craft.fan_craft(real_craft.MASS["h1"])
    craft, noise, std = fitted_on(craft.with_effects([hc.effect("fan_lag", seconds=LAG)]), first, POSE)
    lacking = craft.without_effects("fan_lag")
    std = {name: std[name] for name in craft.linear_coefficients() if name in std}
    for label, model, more, known in (
        ("lag not in the model", lacking, ["fan_lag"], {}),
        ("fitted model", craft, [], {}),
        ("fitted model, its errors known", craft, [], std),
    ):
        names = [*model.linear_coefficients(), *(f"{c}_bias" for c in POSE), *more]
        block = monitor(
            model, names, false_alarms_per_hour=RATE, period=PERIOD, process_noise=noise.process,
            measurement_noise=noise.measurement, coefficient_std=known, lost_samples=POSE, motion=first,
        )  # fmt: skip
        yield f"six fans, second half, {label}", told(replay(block, second).alarms), "", None
    for run in "abc":
        log = real_logs.read(run)
        built = build(hc.vehicle("four_fan"), log)
        yield f"four fans, run {run}", told(replay(built.block, log).alarms), "", None
