"""A real craft with six fans: what is named takes of what any function of a few signals takes.

``python -m benchmarks.six_fans`` fits the first half of the log ``h1`` (../shared/data, or
$HOVERCONTROL_DATA), names what the nominal craft lacks, and prints of the second half: the errors 0.2 s ahead
before and after, beside those that the log's authors print of their best model on another day's log; and for
each equation what functions of one to three signals could still take from left-out segments of it.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Sequence

from benchmarks.real_craft import DATA, MASS, holohover_halves
from hovercontrol.identification.diagnose import diagnose
from hovercontrol.identification.diagnose.diagnosis import Diagnosis
from hovercontrol.identification.diagnose.laws.scan import yardsticks

#: The authors' best model: errors 0.2 s ahead on another day's log [m, m, rad] (the data's README).
AUTHORS = {"x": 0.0108, "y": 0.0097, "psi": 0.39}
HORIZON = 0.2


def lines(found: Diagnosis) -> Iterator[str]:
    """Yield what a diagnosis takes on its held-out log, in lines of text."""
    before, after = found.held_before, found.held_after
    if before is None or after is None:
        return
    numbers = ", ".join(f"{e.parameter} {e.value:.4g} {e.unit}" for e in found.effects)
    yield f"{len(found.effects)} coefficients: {numbers}"
    for a in found.ahead:
        if a.horizon == HORIZON:
            fall = f"{a.before:.4g} -> {a.after:.4g} {a.unit}"
            yield f"{a.channel}, {HORIZON} s ahead: {fall} (authors: {AUTHORS[a.channel]:g})"
    taken, left = before.cost - after.cost, 0.0
    for i in after.problem.driven:
        (y,) = yardsticks(after, [after.problem.block.states[after.problem.free[i]].name])
        left += y.gain
        yield f"{y.equation}: functions of {', '.join(y.signals)} could still take {y.gain:.0f}"
    share = 100.0 * taken / max(taken + left, 1e-9)
    yield f"named effects take {taken:.0f}, such functions {left:.0f} more: {share:.0f} % is told"


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="benchmarks.six_fans", description=__doc__.splitlines()[0])
    parser.add_argument("log", nargs="?", default="h1", choices=list(MASS))
    given = parser.parse_args(arguments)
    if not DATA.exists():
        parser.error(f"no data at {DATA}; set HOVERCONTROL_DATA")
    title, craft, logs, held = holohover_halves(given.log)[0]
    begin = time.perf_counter()
    found = diagnose(craft, logs, held)
    print(f"{title}: {found.verdict}, {time.perf_counter() - begin:.0f} s", flush=True)
    for line in lines(found):
        print(line, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
