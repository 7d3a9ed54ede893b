"""Diagnosis of hidden effects: two 60 s logs and a hold-out log at 50 Hz, each in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator

CASES = (
    ("nothing hidden", (), 3.0),
    ("slope", ("slope",), 7.0),
    ("thrust_lag", ("thrust_lag",), 7.0),
    ("yaw_quadratic_drag", ("yaw_quadratic_drag",), 7.0),
    ("munk_moment + sway_yaw_coupling", ("munk_moment", "sway_yaw_coupling"), 20.0),
)

_ONE = """
import json, resource, sys, time
from hovercontrol.identification.diagnose import diagnose
from tests.identification.diagnose.generator import make
names = json.loads(sys.argv[1])
spent = []
for seed in (40, 41):  # the first also builds what is not in the cache
    case = make(seed, names)
    begin = time.perf_counter()
    found = diagnose(case.model, case.logs, case.holdout)
    spent.append(time.perf_counter() - begin)
print(json.dumps([*spent, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, found.verdict]))
"""


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    most = 0.0
    for text, names, wanted in CASES:
        done = subprocess.run(
            [sys.executable, "-c", _ONE, json.dumps(names)], capture_output=True, text=True, check=True
        )
        first, second, memory, verdict = json.loads(done.stdout)
        most = max(most, memory)
        found = f"{second:.1f} s ({verdict}; first time {first:.1f} s)"
        yield text, found, f"<= {wanted:g} s", second <= wanted
    yield "largest memory", f"{most:.0f} MiB", "<= 1024 MiB", most <= 1024
