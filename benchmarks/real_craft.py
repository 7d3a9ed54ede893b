"""Real craft (../shared/data, or $HOVERCONTROL_DATA): what ``diagnose`` finds, and how held-out logs gain.

``python -m benchmarks.real_craft h1`` prints the whole findings: the first half of the log fitted and the
second held out, and the other way round. ``h1_blue`` is the same hull with other motors, ``h1_raw`` that
run as it was recorded; ``abcd`` holds out each run of the four-fan craft in turn, one row each; ``drive``
takes each run of that craft alone, its first half fitted.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from benchmarks import real_logs
from hovercontrol.craft.effects import effect
from hovercontrol.craft.models.model import Fan, Model
from hovercontrol.craft.models.vehicles import vehicle
from hovercontrol.identification.diagnose import diagnose
from hovercontrol.logs import Log, gather, read_log

DATA = real_logs.DATA.parent / "holohover"
#: Places [m] and directions [rad] of the motors, as the data's README has them.
MOTORS = {
    "motor_a_1": (0.044048, -0.015000, 1.570796),
    "motor_a_2": (0.044048, 0.015000, -1.570796),
    "motor_b_1": (-0.009034, 0.045647, -2.617994),
    "motor_b_2": (-0.035014, 0.030647, 0.523599),
    "motor_c_1": (-0.035014, -0.030647, -0.523599),
    "motor_c_2": (-0.009034, -0.045647, 2.617994),
}
MASS = {"h1": 0.1377, "h1_blue": 0.1446, "h1_raw": 0.1446}  # kg
INERTIA = 3.4e-4  # kg m^2
#: Nominal thrust [N] of a motor over its signal s: coefficients of s, s^2, s^3.
CURVE = (0.02683, 1.05084, -0.43372)

Split = tuple[str, Model, list[Log], Log]


def fan_craft(mass: float) -> Model:
    """Return the nominal craft: rigid body, fans with their nominal curve, a little linear drag."""
    return Model(
        "holohover",
        (
            effect("surge_linear_drag", 0.1),
            effect("sway_linear_drag", 0.1),
            effect("yaw_linear_drag", 0.1),
            effect("fan_force", 1.0 / mass),
            effect("fan_torque", 1.0 / INERTIA),
        ),
        fans=tuple(Fan(name, *place, curve=CURVE) for name, place in MOTORS.items()),
    )


def holohover(name: str) -> Log:
    """Return a log; its inputs are the motors' signals."""
    if name == "h1_raw":
        files = f"{DATA}/h1_blue_raw_pose.csv+{DATA}/h1_blue_raw_command.csv"
        log = gather(files, list(MOTORS))
        log = log.between(*_both(files, log))
    else:
        log = read_log(DATA / f"{name}_aligned.csv", inputs=list(MOTORS))
    return log


def _both(files: str, log: Log) -> tuple[float, float]:
    """Return from when to when there are commands as well."""
    sent = read_log(files.split("+")[1], inputs=list(MOTORS))
    return float(sent.time[0]), float(min(sent.time[-1], log.time[-1]))


def halves(name: str, craft: Model, log: Log) -> list[Split]:
    """Return a log's two halves, each fitted once and held out once."""
    middle = float(log.time[0] + log.time[-1]) / 2
    one = Log(f"{name}, first half", log.time, log.columns).between(-math.inf, middle)
    two = Log(f"{name}, second half", log.time, log.columns).between(
        math.nextafter(middle, math.inf), math.inf
    )
    return [
        (f"{name}: first half fitted", craft, [one], two),
        (f"{name}: second half fitted", craft, [two], one),
    ]


def holohover_halves(name: str) -> list[Split]:
    """Return a log of the six-fan craft, each half fitted once and held out once."""
    return halves(name, fan_craft(MASS[name]), holohover(name))


def abcd() -> list[Split]:
    """Return the four runs of the four-fan craft, each held out in turn."""
    craft, runs = vehicle("four_fan"), {run: real_logs.read(run) for run in "abcd"}
    return [
        (f"{run} held out", craft, [log for name, log in runs.items() if name != run], held)
        for run, held in runs.items()
    ]


def drive() -> list[Split]:
    """Return each run of the four-fan craft alone, its first half fitted."""
    craft = vehicle("four_fan")
    return [halves(f"run {run}", craft, real_logs.read(run))[0] for run in "abcd"]


WHAT: dict[str, Callable[[], list[Split]]] = {
    **{name: partial(holohover_halves, name) for name in MASS},
    "abcd": abcd,
    "drive": drive,
}


def told(split: Split, whole: bool) -> tuple[str, dict[str, Any]]:
    """Return what a diagnosis says in one line, and what it says in full."""
    title, craft, logs, held = split
    begin = time.perf_counter()
    found = diagnose(craft, logs, held)
    seconds = time.perf_counter() - begin
    numbers = ", ".join(f"{e.parameter} {e.value:.4g} +- {e.std:.2g} {e.unit}" for e in found.effects)
    rivals = ", ".join(f"{r.name} for {r.instead_of}" for r in found.rivals)
    line = f"{title:30} {found.verdict:12} {numbers or '-'}{f' (rivals {rivals})' if rivals else ''}"
    result = found.result()
    kept: dict[str, Any] = {k: result[k] for k in ("gap", "evidence", "remainder", "leads") if k in result}
    of_effects = {e["name"]: e["evidence"] for e in result["effects"] if "evidence" in e}
    if of_effects:
        kept["evidence of effects"] = of_effects
    return f"{line}  {seconds:.1f} s  {_gain(result) if not whole else ''}".rstrip(), kept


def _gain(result: dict[str, Any]) -> str:
    """Return the held-out errors before and after, by channel, as parts of the motion's size."""
    gap = result["gap"]["holdout"]
    return ", ".join(
        f"{channel} {before:.3g} -> {gap['after'].get(channel, math.nan):.3g}"
        for channel, before in gap.get("before", {}).items()
    )


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="benchmarks.real_craft", description=__doc__.splitlines()[0])
    parser.add_argument("what", nargs="+", choices=list(WHAT))
    given = parser.parse_args(arguments)
    if not DATA.exists():
        parser.error(f"no data at {DATA}; set HOVERCONTROL_DATA")
    for what in given.what:
        for split in WHAT[what]():
            whole = what != "abcd"
            line, kept = told(split, whole)
            print(line)
            if whole:
                print(json.dumps(kept, indent=2, default=_plain))
            sys.stdout.flush()
    return 0


def _plain(value: Any) -> Any:
    return value.tolist() if hasattr(value, "tolist") else str(value)


if __name__ == "__main__":
    sys.exit(main())
