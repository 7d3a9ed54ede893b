"""One-line faults in a copy of the code: do the tests of ``make test`` notice each? ``make mutations``.

A fault that the quick tests miss is tried with all tests of the same folders: what those alone find is a
quick test that is lacking.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

PROJECT = Path(__file__).parents[1]
COPIED = ("hovercontrol", "fmu", "tests", "analyses", "docs", "benchmarks")
#: Seconds for the tests of one fault: some faults let a loop go on for ever.
LONGEST = 900.0
FILES = (
    "pyproject.toml",
    "README.md",
    "CONTRIBUTING.md",
    "ERRANDS.md",
    "ARCHITECTURE.md",
    "Makefile",
    "LICENSE",
)


@dataclass(frozen=True)
class Mutation:
    """A fault: in `file` the only `old` becomes `new`; `tests` should see it."""

    sentence: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]


CORE, EFFECTS = ("tests/blocks",), ("tests/craft/effects",)
ESTIMATION, RUNTIME = (
    ("tests/identification/engine", "tests/identification/identify"),
    ("tests/fmu", "tests/blocks/backends"),
)

MUTATIONS = (
    # core
    Mutation(
        "The chain rule forgets all ways through a definition but the last.",
        "hovercontrol/blocks/derivatives.py",
        "total[j] = total.get(j, sp.S.Zero) + local * inner",
        "total[j] = local * inner",
        CORE,
    ),
    Mutation(
        "The slope of the smoothed sign is that of another function.",
        "hovercontrol/blocks/sgn.py",
        "slope = (1 - sgn(v, w) ** 2) / w",
        "slope = (1 - sgn(v, w)) / w",
        CORE,
    ),
    Mutation(
        "A power has the unit of its base.",
        "hovercontrol/blocks/units.py",
        "return tuple(d * power for d in dims)",
        "return tuple(d for d in dims)",
        CORE,
    ),
    Mutation(
        "A table is interpolated against its slope.",
        "hovercontrol/blocks/lookup.py",
        "return top + (i - i0) * (bottom - top)",
        "return top + (i - i0) * (top - bottom)",
        ("tests/craft/hardware", "tests/blocks"),
    ),
    Mutation(
        "A late input arrives at once.",
        "hovercontrol/blocks/delays.py",
        "at = times[changed] + late[signal.name]",
        "at = times[changed] + 0.0 * late[signal.name]",
        CORE,
    ),
    Mutation(
        "At one instant Blocks take their inputs before the others tell theirs.",
        "hovercontrol/blocks/interconnect.py",
        "return [tick for tick in (*first, *last) if tick.updates]",
        "return [tick for tick in (*last, *first) if tick.updates]",
        ("tests/blocks/simulation", "tests/blocks"),
    ),
    # effects
    Mutation(
        "Quadratic drag pushes ahead when the craft moves astern.",
        "hovercontrol/craft/effects/drag.py",
        "return sp.Abs(w) * w",
        "return w**2",
        EFFECTS,
    ),
    Mutation(
        "The rudder turns the craft to the other side.",
        "hovercontrol/craft/effects/thrust.py",
        'return {"r": -c.value * s.thrust_y}',
        'return {"r": c.value * s.thrust_y}',
        EFFECTS,
    ),
    Mutation(
        "Wind is added to the velocity through the air.",
        "hovercontrol/craft/effects/environment.py",
        "s.air_u, s.air_v = s.air_u - surge, s.air_v - sway",
        "s.air_u, s.air_v = s.air_u + surge, s.air_v - sway",
        EFFECTS,
    ),
    Mutation(
        "A gyro's scale error follows what is measured, bias and all, not the motion.",
        "hovercontrol/craft/effects/measurement.py",
        "s.r = s.r + c.value * s.true.r",
        "s.r = s.r + c.value * s.r",
        EFFECTS,
    ),
    Mutation(
        "The Munk moment forgets the sway velocity.",
        "hovercontrol/craft/effects/coupling.py",
        'return {"r": c.value * s.u * s.v}',
        'return {"r": c.value * s.u * s.u}',
        EFFECTS,
    ),
    # estimation
    Mutation(
        "The filter's covariance grows by half of the process noise.",
        "hovercontrol/identification/engine/kalman.py",
        "P = A[k] @ P @ At[k] + Q[k]",
        "P = A[k] @ P @ At[k] + 0.5 * Q[k]",
        ESTIMATION,
    ),
    Mutation(
        "The smoother's covariance is that of the filter.",
        "hovercontrol/identification/engine/kalman.py",
        "V = Ps[k] - Ps[k] @ N @ Ps[k]",
        "V = Ps[k]",
        ESTIMATION,
    ),
    Mutation(
        "A prior is as strong as its square root.",
        "hovercontrol/identification/engine/prior.py",
        "precision[j] = 1.0 / max(PRIOR.coefficients * abs(centre[j]), PRIOR.alone * alone[j]) ** 2",
        "precision[j] = 1.0 / max(PRIOR.coefficients * abs(centre[j]), PRIOR.alone * alone[j])",
        ESTIMATION,
    ),
    Mutation(
        "Every sample that is a little off is an outlier.",
        "hovercontrol/identification/engine/outliers.py",
        "stands_out: float = 16.0",
        "stands_out: float = 4.0",
        (*ESTIMATION, "tests/identification/diagnose/test_outliers.py"),
    ),
    # the C runtime
    Mutation(
        "A craft at rest sticks where the force is larger than its dry friction.",
        "fmu/hc_friction.c",
        "hc_friction_excess(a[k], b[k]) <= 0.0",
        "hc_friction_excess(a[k], b[k]) >= 0.0",
        RUNTIME,
    ),
    Mutation(
        "Every other tick is left out.",
        "fmu/hc_ticks.c",
        "ticks->due[k] += m->tick_period[k];",
        "ticks->due[k] += 2 * m->tick_period[k];",
        ("tests/blocks/simulation", *RUNTIME),
    ),
    Mutation(
        "The error of a step may be a thousand times what was asked for.",
        "fmu/hc_step_length.c",
        "if (error <= 1.0) {",
        "if (error <= 1e6) {",
        RUNTIME,
    ),
    Mutation(
        "Two digits of a coefficient of the dense output are exchanged.",
        "fmu/hc_dense.c",
        "69997945.0 / 29380423.0",
        "69997945.0 / 29830423.0",
        RUNTIME,
    ),
    Mutation(
        "In an FMU a late input arrives after half of its delay.",
        "fmu/hc_delays.c",
        "!send(late, t + late->delay, u[i])",
        "!send(late, t + 0.5 * late->delay, u[i])",
        ("tests/fmu/test_delays.py", *RUNTIME),
    ),
)


def copied(folder: Path) -> None:
    """Copy the project, without what tests do not need."""
    for name in COPIED:
        if (PROJECT / name).is_dir():
            shutil.copytree(PROJECT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in FILES:
        shutil.copy2(PROJECT / name, folder / name)


def fails(folder: Path, tests: tuple[str, ...], *, quick: bool) -> str:
    """Return the first test that fails, or nothing."""
    there = [t for t in tests if (folder / t).exists()]
    chosen = ["-m", "not slow"] if quick else []
    command = [sys.executable, "-m", "pytest", "-x", "--tb=no", *chosen, *there]
    here = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        done = subprocess.run(
            command, cwd=folder, env=here, capture_output=True, text=True, check=False, timeout=LONGEST
        )
    except subprocess.TimeoutExpired:
        return f"a test that does not end ({LONGEST:.0f} s)"
    if done.returncode == 0:
        return ""
    lines = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return lines[0].split(" ")[1] if lines else f"pytest ends with {done.returncode}"


def main() -> int:
    parser = argparse.ArgumentParser(description="Do the tests notice one-line faults?")
    parser.add_argument("--only", default="", help="faults whose file has this in it")
    parser.add_argument("--list", action="store_true", help="print them and check that each can be made")
    given = parser.parse_args()
    chosen = [m for m in MUTATIONS if given.only in m.file]
    missed = 0
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) / "project"
        folder.mkdir()
        copied(folder)
        for number, m in enumerate(chosen, start=1):
            path = folder / m.file
            whole = path.read_text(encoding="utf-8")
            if whole.count(m.old) != 1:
                print(f"{m.file}: {m.old!r} is there {whole.count(m.old)} times, expected once")
                return 2
            if given.list:
                print(f"{number:2} {m.file}: {m.sentence}")
                continue
            begin = time.monotonic()
            path.write_text(whole.replace(m.old, m.new), encoding="utf-8")
            try:
                own = (m.file,) if m.file.endswith(".py") else ()
                quick = fails(folder, (*own, *m.tests), quick=True)
                found = quick or fails(folder, m.tests, quick=False)
            finally:
                path.write_text(whole, encoding="utf-8")
            missed += bool(found) and not quick
            said = f"caught by {quick}" if quick else f"ONLY SLOW TESTS: {found}" if found else "not caught"
            print(
                f"{number:2} {m.file}: {m.sentence}\n   {said} ({time.monotonic() - begin:.0f} s)", flush=True
            )
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
