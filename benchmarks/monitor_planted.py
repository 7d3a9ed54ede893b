"""Changes planted in a real log (../shared/data, or $HOVERCONTROL_DATA): are they found, named, sized?

The six-fan craft is fitted on the first half of its log. Its commands are the fans' nominal forces, so that
a command may be larger than a fan can give. In the second half, from several times on, the command of a fan
is divided by a factor: its force is that factor of what the log says. Or a sensor is shifted, or the samples
come later. A reading counts as right if the name is that of what was planted, alone or among rivals, and as
honest if nothing else stands alone.

``python -m benchmarks.monitor_planted`` prints each; of a change that is not found, the largest evidence of
its name beside the threshold.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

import hovercontrol as hc
from benchmarks import real_craft
from benchmarks.monitor_logs import LAG, PERIOD, POSE, RATE
from hovercontrol.identification.monitor.monitor import monitor
from hovercontrol.identification.monitor.noise import trained_model
from hovercontrol.identification.monitor.replay import replay

#: Parts of the second half at which a change is planted.
ONSETS = 0.25, 0.45, 0.62
#: Time of the second half that is replayed before and after an onset [s].
BEFORE, AFTER = 10.0, 15.0
FACTORS, SHIFT, LATE = (0.7, 0.4), 0.01, 4


def planted(log: hc.Log, onset: float) -> Iterator[tuple[str, float, hc.Log]]:
    """Yield the name, the size and the log of each change."""
    on = log.time >= onset

    def changed(**columns: np.ndarray) -> hc.Log:
        whole = hc.Log(log.name, log.time, {**log.columns, **columns})
        return whole.between(onset - BEFORE, onset + AFTER)

    for k, motor in enumerate(real_craft.MOTORS):
        part = FACTORS[k % len(FACTORS)]
        yield f"{motor}_gain", part - 1.0, changed(**{motor: np.where(on, log[motor] / part, log[motor])})
    for channel in POSE:
        size = SHIFT if channel != "psi" else 5.0 * SHIFT
        yield f"{channel}_bias", size, changed(**{channel: log[channel] + size * on})
    late = {c: np.where(on, np.roll(log[c], LATE), log[c]) for c in POSE}
    yield "time_offset", LATE * float(np.median(np.diff(log.time))), changed(**late)


def by_force() -> tuple[hc.Model, hc.Log]:
    """Return the craft and its log with the fans' nominal forces as commands."""
    log, craft = real_craft.holohover("h1"), real_craft.fan_craft(real_craft.MASS["h1"])
    nominal = np.polynomial.Polynomial([0.0, *real_craft.CURVE])
    forces = {motor: np.asarray(nominal(log[motor])) for motor in real_craft.MOTORS}
    craft = replace(craft, fans=tuple(replace(fan, curve=None) for fan in craft.fans))
    lag = hc.effect("fan_lag", seconds=LAG)
    return craft.with_effects([lag]), hc.Log(log.name, log.time, {**log.columns, **forces})


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    if not real_craft.DATA.exists():
        yield "planted changes", f"not at {real_craft.DATA}", "", None
        return
    craft, log = by_force()
    middle = float(log.time[0] + log.time[-1]) / 2
    first, second = log.between(log.time[0], middle), log.between(middle, log.time[-1])
    fitted, noise, _ = trained_model(craft, first, POSE)
    gains, biases = [f"{m}_gain" for m in real_craft.MOTORS], [f"{c}_bias" for c in POSE]
    watch = monitor(
        fitted, [*craft.linear_coefficients(), *gains, *biases, "time_offset"],
        false_alarms_per_hour=RATE, period=PERIOD, process_noise=noise.process,
        measurement_noise=noise.measurement, lost_samples=POSE, motion=first, dispersion=True,
    )  # fmt: skip
    told: Counter[str] = Counter()
    for part in ONSETS:
        onset = float(second.time[0] + part * (second.time[-1] - second.time[0]))
        for name, size, changed in planted(second, onset):
            found = replay(watch, changed)
            one = next((a for a in found.alarms if a.time >= onset), None)
            said = str(one)
            if one is None:
                kind = "not found"
                most = found.evidence[name][found.time >= onset].max()
                said = f"evidence {most:.1f} of {found.threshold:.1f}"
            elif one.name == name or name in one.rivals:
                kind = "right"
                told["size within two standard errors"] += abs(one.change - size) < 2.0 * one.std
            else:
                kind = "honest" if one.kind == "unknown" or one.rivals else "wrong alone"
            told[kind] += 1
            yield f"{name} {size:.3g} at {onset:.1f} s", f"{kind}: {said}", "", None
    good, every = told["right"] + told["honest"], len(ONSETS) * (len(gains) + len(biases) + 1)
    text = f"of {every}: " + ", ".join(f"{k} {n}" for k, n in told.items())
    met = good >= 0.8 * every and not told["wrong alone"]
    yield "all", text, "80 % right or honest, 0 wrong alone", met


if __name__ == "__main__":
    for row in rows():
        print(*row, flush=True)
