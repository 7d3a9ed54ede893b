"""Try thousands of hostile and clumsy inputs: ``python -m tests.fuzz --seconds 600``, or ``make fuzz``.

Every input is made from a seed of its own, which is printed where one breaks something:
``--seed 12345 --inputs 1`` tries that one again.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from random import Random

import matplotlib

from tests.fuzz.trials import TRIALS


def main() -> int:
    parser = argparse.ArgumentParser(description="Try hostile and clumsy inputs.")
    parser.add_argument("--seconds", type=float, default=600.0, help="how long (default: 600)")
    parser.add_argument("--inputs", type=int, default=sys.maxsize, help="how many at most")
    parser.add_argument("--seed", type=int, default=time.time_ns() % 10**9, help="of the first input")
    parser.add_argument("--only", default="", help="trials whose name has this in it")
    given = parser.parse_args()
    matplotlib.use("Agg")
    trials = {trial: weight for trial, weight in TRIALS.items() if given.only in trial.__name__}
    counts, spent, broken = Counter(), Counter(), 0
    begin = time.monotonic()
    print(f"first seed {given.seed}", flush=True)
    for seed in range(given.seed, given.seed + given.inputs):
        if time.monotonic() - begin > given.seconds:
            break
        rng = Random(seed)
        (trial,) = rng.choices(list(trials), list(trials.values()))
        at = time.monotonic()
        with tempfile.TemporaryDirectory(prefix="hc-fuzz-") as folder:
            try:
                status = trial(rng, Path(folder))
            except Exception as fault:  # Broken, or a fault of the trial itself
                broken += 1
                status = "broken"
                print(f"\nseed {seed}, {trial.__name__}: {fault}", flush=True)
        counts[trial.__name__, status] += 1
        spent[trial.__name__] += time.monotonic() - at
    for name in sorted(spent):
        each = ", ".join(f"{s}: {n}" for (t, s), n in sorted(counts.items(), key=str) if t == name)
        print(f"{name:32} {spent[name]:6.1f} s   {each}")
    print(f"{sum(counts.values())} inputs in {time.monotonic() - begin:.0f} s, {broken} broke something")
    return 1 if broken else 0


if __name__ == "__main__":
    status = main()
    sys.stdout.flush()
    os._exit(status)  # a thread that an input left behind may not hold up the end
