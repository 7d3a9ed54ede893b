"""The real logs (../shared/data, or $HOVERCONTROL_DATA): four runs end to end, and a hold-out."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from pathlib import Path

from hovercontrol.craft.models.vehicles import vehicle
from hovercontrol.identification.diagnose import diagnose
from hovercontrol.identification.identify.study import Study
from hovercontrol.logs import BenchTable, Condition, Log, gather

DATA = (
    Path(os.environ.get("HOVERCONTROL_DATA", Path(__file__).parents[2] / "shared" / "data"))
    / "real_hovercraft"
)


def read(run: str) -> Log:
    """Return one run: pose and commands joined, pulses as forces, while the lift fan is on."""
    inputs = [s.name for s in vehicle("four_fan").plant().inputs]
    return gather(
        f"{DATA}/run_{run}_pose.csv+{DATA}/run_{run}_command.csv",
        inputs,
        bench=BenchTable.from_csv(DATA / "thrust_bench.csv", fans=2),
        only_while=Condition.parse("pwm_lift>1000"),
        settle=1.0,
    )


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    if not DATA.exists():
        yield "real logs", f"not at {DATA}", "", None
        return
    craft = vehicle("four_fan")
    for run in "abcd":
        begin = time.perf_counter()
        study = Study.make(craft, [read(run)])
        spent = time.perf_counter() - begin
        spans = study.judged[0].run.rejected
        yield f"run {run}, files to coefficients and prediction", f"{spent:.1f} s", "< 20 s", spent < 20
        told = ", ".join(f"{s.start:.2f}-{s.stop:.2f} s" for s in spans) or "none"
        yield f"run {run}, rejected spans", told, "", None
        gain = study.found["fan_torque"]
        yield f"run {run}, yaw gain", f"{gain.value:.0f} +- {gain.std:.0f} {gain.unit}", "", None
    study = Study.make(craft, [read("a"), read("b")], [read("c")])
    held_out = study.judged[-1]
    p = held_out.prediction
    yield "fit on a + b, yaw rate of c 1 s ahead: rms error", f"{p.rms['r']:.2f} rad/s", "", None
    yield "... if the rate stayed as it is (no model)", f"{p.trivial['r']:.2f} rad/s", "", None
    for r in study.found.remaining:
        what = f"remains of the fit in {r.equation}, of the acceleration seen"
        yield what, f"{r.rms:.2g} of {r.seen:.2g} {r.unit}", "", None
    found = diagnose(craft, [read("a"), read("b")], read("c"))
    names = " + ".join(dict.fromkeys(e.effect for e in found.effects)) or "no name"
    yield "diagnosis of a + b, c held out", f"{found.verdict}, {names}", "", None
    yield "where the missing force is", found.regime, "", None
    for m in found.missing:
        if m.log == found.missing[0].log:
            yield f"... in {m.equation} of {m.log}, root mean square", f"{m.rms:.2g} {m.unit}", "", None
