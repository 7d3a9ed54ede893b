"""Blind cases with remainders, gusts and dirty logs: what ``diagnose`` makes of them (a sample of five).

``python -m benchmarks.discrepancy SUITE`` runs a whole suite; with ``--out`` it goes on where it was stopped.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from tests.identification.diagnose.imperfect import DISTURBANCES, SUITES, Key, keys
from tests.identification.diagnose.kept_rows import append_rows, read_rows
from tests.identification.diagnose.score import OUTCOMES, outcome, shares

#: What ``python -m benchmarks`` runs: one case of each suite.
SAMPLE = (
    Key("partial", "slope", "cable", "", 0),
    Key("remainder", "", "patch", "", 0),
    Key("dirty", "yaw_quadratic_drag", "", "", 0),
    Key("gusts", "rudder_offset", "gusts", "", 0),
    Key("dirty", "", "", "", 0),
)
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")


@dataclass(frozen=True)
class Row:
    """What came of one case."""

    suite: str
    case: str
    seed: int
    hidden: str
    verdict: str
    named: str
    rivals: str
    seconds: float
    outcome: str
    share_effect: float  # errors of predictions over 0.5 s, in standard deviations of the noise
    share_disturbance: float

    @property
    def key(self) -> tuple[str, str, int]:
        """What says which case it is."""
        return self.suite, self.case, self.seed

    def line(self) -> str:
        """Return it in one line."""
        rivals = f" (rivals {self.rivals})" if self.rivals else ""
        return (
            f"{self.suite:9} {self.case:34} {self.seed:2}  {self.hidden or '-':20} {self.verdict:11} "
            f"{(self.named or '-') + rivals:36} {self.seconds:6.1f} s  {self.outcome}"
        )


def run(key: Key) -> Row:
    """Return what comes of one case."""
    from hovercontrol.identification.diagnose import diagnose

    case = key.case()
    begin = time.perf_counter()
    try:
        found = diagnose(case.model, case.logs, case.holdout)
    except Exception as error:  # the other cases go on
        verdict, named, rivals = f"{type(error).__name__}", [], []
        counts = "wrong"
        print(f"{key.suite} {key.name} {key.seed}: {error}", file=sys.stderr, flush=True)
    else:
        verdict, named = found.verdict, sorted({e.effect for e in found.effects})
        rivals = sorted({(r.name, r.instead_of) for r in found.rivals})
        counts = outcome(case.names, verdict, named, rivals, remainder=bool(key.disturbance))
    seconds = time.perf_counter() - begin
    told = "+".join(f"{name} for {of}" for name, of in rivals)
    of_effect, of_disturbance = (round(float(s), 2) for s in case.shares)
    return Row(
        key.suite, key.name, key.seed, "+".join(case.names), verdict, "+".join(named), told,
        round(seconds, 2), counts, of_effect, of_disturbance,
    )  # fmt: skip


def results(todo: Sequence[Key], jobs: int) -> Iterator[Row]:
    """Return the rows of these cases as they come, from processes of one thread each."""
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    try:
        with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
            for future in as_completed([pool.submit(run, key) for key in todo]):
                yield future.result()
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def table(found: Sequence[Row]) -> str:
    """Return how many outcomes there are of each kind, by suite and by kind of disturbance."""
    lines = [f"{'suite':22} {'cases':>5} " + " ".join(f"{o:>7}" for o in OUTCOMES) + "   median     max"]
    for suite in (s for s in SUITES if any(r.suite == s for r in found)):
        of = [r for r in found if r.suite == suite]
        lines.append(_line(suite, of))
        if suite in ("partial", "remainder"):
            for kind in (*DISTURBANCES, "gusts"):
                those = [r for r in of if kind in r.case.split()[0].split("+")]
                lines += [_line(f"  {kind}", those)] if those else []
            poses = [r for r in of if r.case.endswith(" pose")]
            lines += [_line("  pose only", poses)] if poses else []
    return "\n".join([*lines, _line("all", found)] if found else lines)


def _line(text: str, found: Sequence[Row]) -> str:
    seconds = [r.seconds for r in found]
    numbers = " ".join(f"{n:7}" for n in shares([r.outcome for r in found]).values())
    return f"{text:22} {len(found):5} {numbers} {np.median(seconds):7.1f}s {max(seconds):6.1f}s"


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    for row in results(SAMPLE, 1):
        found = f"{row.verdict} {row.named or row.rivals}".strip()
        yield (
            f"{row.suite}: {row.case}, {row.outcome}",
            f"{found}, {row.seconds:.1f} s",
            "not wrong",
            (row.outcome != "wrong"),
        )


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="benchmarks.discrepancy", description=__doc__.splitlines()[0])
    parser.add_argument("suite", choices=[*SUITES, "all"])
    parser.add_argument("--seeds", type=int, default=5, help="cases of each kind (default: 5)")
    parser.add_argument("--first", type=int, default=0, help="the first seed (default: 0)")
    parser.add_argument("--jobs", type=int, default=2, help="processes (default: 2)")
    parser.add_argument("--only", default="", help="only cases whose name has this in it")
    parser.add_argument("--out", type=Path, help="CSV file; cases that are in it are not run again")
    given = parser.parse_args(arguments)
    suites = SUITES if given.suite == "all" else (given.suite,)
    wanted = [k for s in suites for k in keys(s, given.seeds, given.first) if given.only in k.name]
    if not wanted:
        parser.error(f"no case of {given.suite} has {given.only!r} in its name")
    asked = {(k.suite, k.name, k.seed) for k in wanted}
    old = read_rows(given.out, Row) if given.out else []
    done = {r.key for r in old}
    found = [r for r in old if r.key in asked]
    for row in found:
        print(row.line())
    todo = [k for k in wanted if (k.suite, k.name, k.seed) not in done]
    for row in results(todo, given.jobs) if todo else ():
        found.append(row)
        print(row.line(), flush=True)
        if given.out:
            append_rows(given.out, [row])
    print(f"\n{table(found)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
