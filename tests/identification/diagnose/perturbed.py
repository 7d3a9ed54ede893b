"""The same answer on every machine: ``python -m tests.identification.diagnose.perturbed``.

Another processor, another BLAS or another number of threads rounds otherwise. Here cases of the blind test
are diagnosed as they are, and with all numbers of their logs changed by 1e-13 to 1e-10 of themselves, which
does what another rounding does, with one thread and with two. Verdicts and names must be the same, and
coefficients within a hundredth of their standard error. Results are written to a CSV file as they come: a run
that was stopped goes on where it was.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from hovercontrol.blocks.backends.shoot import pool
from hovercontrol.identification.diagnose import Diagnosis, diagnose
from hovercontrol.logs import Log

from .kept_rows import append_rows, read_rows
from .table import Planned, case_of, reduced

#: Relative changes of all numbers in the logs, and the number of threads; the first is the reference.
RUNS = ((0.0, 1), (1e-13, 2), (1e-12, 1), (1e-11, 2), (1e-10, 1), (1e-10, 2))

#: Standard errors by which a coefficient may differ.
ALLOWED = 0.01


@dataclass(frozen=True)
class Row:
    """How a perturbed case differs from the case as it is."""

    axis: str
    hidden: str
    seed: int
    size: float
    threads: int
    verdict: str
    named: str
    other: str  # verdict and names, where they differ
    deviation: float  # the largest of a coefficient, in its standard errors
    of: str
    seconds: float


def perturbed(log: Log, size: float, rng: np.random.Generator) -> Log:
    """Return a log whose numbers are changed by a part of themselves; times stay."""
    return log.with_columns(
        {name: values * (1.0 + size * rng.standard_normal(len(log))) for name, values in log.columns.items()}
    )


def drawn(count: int) -> list[Planned]:
    """Return cases of the reduced blind table, spread evenly over it."""
    every = reduced()
    return [every[int((k + 0.5) * len(every) / count)] for k in range(count)]


def run(axis: str, hidden: tuple[str, ...], seed: int) -> list[Row]:
    """Return what comes of one case under every perturbation."""
    of = case_of(axis, hidden, seed)
    found: list[Diagnosis] = []
    rows: list[Row] = []
    for k, (size, threads) in enumerate(RUNS):
        rng = np.random.default_rng(k)
        logs = [perturbed(log, size, rng) for log in of.logs]
        begin = time.perf_counter()
        with in_threads(threads):
            found.append(diagnose(of.model, logs, perturbed(of.holdout, size, rng)))
        seconds = time.perf_counter() - begin
        one, other = _said(found[0]), _said(found[k])
        deviation, coefficient = _deviation(found[0], found[k]) if one == other else (np.inf, "")
        differs = "" if one == other else " ".join(other)
        case = axis, "+".join(hidden), seed
        rows.append(Row(*case, size, threads, *one, differs, deviation, coefficient, round(seconds, 1)))
    return rows


@contextmanager
def in_threads(count: int) -> Iterator[None]:
    """Let windows be simulated and matrices multiplied in so many threads."""
    before = os.environ.get("OMP_NUM_THREADS")
    os.environ["OMP_NUM_THREADS"] = str(count)
    pool.cache_clear()
    try:
        with threadpool_limits(count):
            yield
    finally:
        pool.cache_clear()
        os.environ.pop("OMP_NUM_THREADS")
        if before is not None:
            os.environ["OMP_NUM_THREADS"] = before


def _said(found: Diagnosis) -> tuple[str, str]:
    return found.verdict, "+".join(sorted(e.effect for e in found.effects))


def _deviation(one: Diagnosis, other: Diagnosis) -> tuple[float, str]:
    """Return by how many standard errors coefficients differ at most, and which."""
    a, b = one.selection.final, other.selection.final
    values = dict(zip(b.problem.names, b.p, strict=True))
    std = np.sqrt(np.maximum(np.diag(a.covariance), 0.0))
    off = {
        name: abs(value - values[name]) / s if s > 0 else 0.0
        for name, value, s in zip(a.problem.names, a.p, std, strict=True)
    }
    worst = max(off, key=lambda name: off[name])
    return float(off[worst]), worst


def table(rows: Sequence[Row]) -> str:
    """Return the result as Markdown."""
    cases = defaultdict(list)
    for row in rows:
        cases[row.axis, row.hidden, row.seed].append(row)
    different = [r for r in rows if r.other]
    beyond = [r for r in rows if not r.other and r.deviation > ALLOWED]
    largest = [max((r.deviation for r in own), default=0.0) for own in cases.values()]
    finite = [value for value in largest if np.isfinite(value)]
    runs = len(rows) - len(cases)
    lines = [
        f"{len(cases)} cases, each under {len(RUNS) - 1} changes of 1e-13 to 1e-10, in one or two threads:",
        f"verdict and names differ in {len(different)} of {runs} runs;",
        f"coefficients differ by more than {ALLOWED} standard errors in {len(beyond)};",
        f"largest deviation of a case: median {np.median(finite):.1e}, largest {max(finite):.1e}.",
    ]
    lines += [
        f"- {r.axis} {r.hidden or 'none'} (seed {r.seed}), {r.size:g}: {r.verdict} {r.named} became {r.other}"
        for r in different
    ]
    lines += [
        f"- {r.axis} {r.hidden or 'none'} (seed {r.seed}), {r.size:g}: {r.of} off by {r.deviation:.2g}"
        for r in beyond
    ]
    return "\n".join(lines) + "\n"


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=40, help="how many of the reduced table (default: 40)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--out", type=Path, default=Path("out/perturbed"))
    given = parser.parse_args(arguments)
    given.out.mkdir(parents=True, exist_ok=True)
    path = given.out / "runs.csv"
    rows = read_rows(path, Row)
    done = {(r.axis, r.hidden, r.seed) for r in rows}
    wanted = drawn(given.cases)
    names = {(axis, "+".join(hidden), seed) for axis, hidden, seed in wanted}
    rows = [r for r in rows if (r.axis, r.hidden, r.seed) in names]
    todo = [c for c in wanted if (c[0], "+".join(c[1]), c[2]) not in done]
    todo = [case for first in range(4) for case in todo[first::4]]  # stopped early, it has seen every axis
    with ProcessPoolExecutor(given.jobs) as workers:
        waiting = [workers.submit(run, *case) for case in todo]
        for k, future in enumerate(as_completed(waiting)):
            found = future.result()
            rows += found
            append_rows(path, found)
            worst = max(found, key=lambda r: (bool(r.other), r.deviation))
            note = f"{worst.other or worst.deviation} ({sum(r.seconds for r in found):.0f} s)"
            case = f"{found[0].axis} {found[0].hidden} {found[0].seed}"
            said = f"{found[0].verdict} {found[0].named}"
            print(f"{k + 1}/{len(todo)} {case}: {said}: {note}", file=sys.stderr, flush=True)
    text = table(rows)
    (given.out / "table.md").write_text(text, encoding="utf-8")
    print(text)
    return 1 if any(r.other or r.deviation > ALLOWED for r in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
