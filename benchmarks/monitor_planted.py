"""Changes planted in a real log (../shared/data, or $HOVERCONTROL_DATA): are they found, named, sized?

The six-fan craft is fitted on the first half of its log, its fans without their lag: what the model lacks
counts as dispersion. In the second half, from several times on, the
command of a fan is divided by a factor, so that its force is that factor of what the log says; a sensor is
shifted; or the samples come later. A reading counts as right if the name is that of what was planted, alone
or among rivals, and as honest if nothing else stands alone.

``python -m benchmarks.monitor_planted`` prints each.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

import hovercontrol as hc
from benchmarks import real_craft
from benchmarks.monitor_logs import PERIOD, POSE, RATE
from hovercontrol.identification.monitor.monitor import monitor
from hovercontrol.identification.monitor.noise import trained_model
from hovercontrol.identification.monitor.replay import replay

#: Parts of the second half at which a change is planted.
ONSETS = 0.3, 0.5
#: Time of the second half that is replayed after an onset [s].
AFTER = 15.0
FACTORS, SHIFT, LATE = (0.7, 0.4), 0.01, 4


def planted(log: hc.Log, onset: float) -> Iterator[tuple[str, float, hc.Log]]:
    """Yield the name, the size and the log of each change."""
    on = log.time >= onset

    def changed(**columns: np.ndarray) -> hc.Log:
        return hc.Log(log.name, log.time, {**log.columns, **columns}).between(onset - 10.0, onset + AFTER)

    for k, motor in enumerate(real_craft.MOTORS):
        part = FACTORS[k % len(FACTORS)]
        force, signals = _force(log[motor]), np.linspace(0.0, 1.5, 3001)
        stronger = np.interp(force / part, _force(signals), signals)
        yield f"{motor}_gain", part - 1.0, changed(**{motor: np.where(on, stronger, log[motor])})
    for channel in POSE:
        size = SHIFT if channel != "psi" else 5.0 * SHIFT
        yield f"{channel}_bias", size, changed(**{channel: log[channel] + size * on})
    late = {c: np.where(on, np.roll(log[c], LATE), log[c]) for c in POSE}
    yield "time_offset", LATE * float(np.median(np.diff(log.time))), changed(**late)


def _force(signal: np.ndarray) -> np.ndarray:
    return sum(c * signal ** (k + 1) for k, c in enumerate(real_craft.CURVE))


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    if not real_craft.DATA.exists():
        yield "planted changes", f"not at {real_craft.DATA}", "", None
        return
    log = real_craft.holohover("h1")
    middle = float(log.time[0] + log.time[-1]) / 2
    first, second = log.between(log.time[0], middle), log.between(middle, log.time[-1])
    craft, noise, _ = trained_model(real_craft.fan_craft(real_craft.MASS["h1"]), first, POSE)
    gains = [f"{motor}_gain" for motor in real_craft.MOTORS]
    watch = monitor(
        craft, [*craft.linear_coefficients(), *gains, *(f"{c}_bias" for c in POSE)],
        false_alarms_per_hour=RATE, period=PERIOD, process_noise=noise.process,
        measurement_noise=noise.measurement, lost_samples=POSE, motion=first,
        dispersion=True,
    )  # fmt: skip
    told: Counter[str] = Counter()
    for part in ONSETS:
        onset = float(second.time[0] + part * (second.time[-1] - second.time[0]))
        for name, size, changed in planted(second, onset):
            alarms = [a for a in replay(watch, changed).alarms if a.time >= onset]
            first_one = alarms[0] if alarms else None
            if first_one is None:
                kind = "not found"
            elif first_one.name == name or name in first_one.rivals:
                kind = "right"
            elif first_one.kind == "unknown" or first_one.rivals:
                kind = "honest"
            else:
                kind = "wrong alone"
            told[kind] += 1
            yield f"{name} {size:.3g} at {onset:.1f} s", f"{kind}: {first_one}", "", None
    good = told["right"] + told["honest"]
    yield (
        "all",
        ", ".join(f"{k} {n}" for k, n in told.items()),
        "80 % right or honest",
        good >= 0.8 * told.total(),
    )


if __name__ == "__main__":
    for row in rows():
        print(*row, flush=True)
