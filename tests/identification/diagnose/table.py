"""The blind test as a table: ``python -m tests.identification.diagnose.table``.

Every case hides effects in a craft, makes logs, and lets
:func:`hovercontrol.identification.diagnose.diagnose` look at the logs and at a model whose coefficients are
off. Cases are written to a CSV file as they come, so that a run that was stopped goes on where it was; the
table is made from that file. With ``--reduced`` only the cases of ``blind/reduced.csv`` are run, which were
drawn once by :func:`drawn`.
"""

from __future__ import annotations

import argparse
import csv
import datetime
import os
import platform
import sys
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hovercontrol.identification.diagnose import Diagnosis, diagnose
from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.evidence.holdout import gap, held_fit
from hovercontrol.identification.engine.data import gather
from hovercontrol.identification.engine.fit import Fit, estimate, first_noise, refit
from hovercontrol.identification.engine.prior import Prior, prior_of
from hovercontrol.identification.engine.problem import Problem

from .generator import OUTSIDE, SIZES, VELOCITY_ONLY, Case, Conditions, make, mild, outside
from .kept_rows import append_rows, read_rows

#: In every log a delay of the commands is a clock that is late: these two may be named together.
SAME = {"input_delay", "time_offset"}

Planned = tuple[str, tuple[str, ...], int]  # axis, hidden, seed

POSE, VELOCITIES = ("x", "y", "psi"), ("u", "v", "r")
ONE = tuple((name,) for name in SIZES)
TWINS = (
    ("rudder_offset", "thrust_yaw_torque"),
    ("slope", "wind"),
    ("munk_moment", "sway_yaw_coupling"),
)
MORE = (
    *TWINS,
    ("surge_quadratic_drag", "thrust_lag"),
    ("yaw_quadratic_drag", "rudder_lag"),
    ("slope", "gyro_bias"),
    ("wind", "input_delay"),
    ("thrust_deadzone", "sway_yaw_coupling"),
    ("yaw_stribeck", "rudder_offset"),
    ("battery_sag", "surge_quadratic_drag"),
    ("sensor_lever_arm", "munk_moment"),
    ("slope", "thrust_lag", "yaw_quadratic_drag"),
    ("rudder_offset", "sway_quadratic_drag", "gyro_scale"),
    ("thrust_saturation", "munk_moment", "body_side_force"),
)
SEEN_IN_POSE = tuple(n for n in ONE if n[0] not in VELOCITY_ONLY)
SEEN_IN_VELOCITIES = tuple(n for n in ONE if n[0] not in ("slope", "wind", "velocity_misalignment"))


@dataclass(frozen=True)
class Axis:
    """One row of the table."""

    text: str
    conditions: Conditions
    hidden: Sequence[tuple[str, ...]]
    seeds: int
    wanted: str


BASE = Conditions()
TENTH = replace(BASE, scale=0.1)
AXES = {
    "rich": Axis("rich steps, noise x1", BASE, ONE, 5, "see all three"),
    "rich3": Axis("rich steps, noise x3", replace(BASE, noise=3.0), ONE, 5, "see all three"),
    "mild": Axis("mild laps", replace(BASE, commands=mild), ONE, 5, "see all three"),
    "none": Axis("nothing hidden, rich", BASE, ((),), 15, "see all four"),
    "none3": Axis("nothing hidden, noise x3", replace(BASE, noise=3.0), ((),), 15, "see all four"),
    "none_mild": Axis("nothing hidden, mild", replace(BASE, commands=mild), ((),), 15, "see all four"),
    "none_gusts": Axis("nothing hidden, gusts", replace(BASE, gusts=True), ((),), 15, "see all four"),
    "pairs": Axis("pairs, near twins, triples", BASE, MORE, 3, "exact >= 98 %, the rest ambiguous"),
    "gusts": Axis("process noise", replace(BASE, gusts=True), ONE, 3, "exact >= 95 %, wrong <= 1 %"),
    "tenth": Axis("a tenth of the size", TENTH, ONE, 3, "exact >= 95 %, the rest honest"),
    "tenth10": Axis("a tenth, noise x10", replace(TENTH, noise=10.0), ONE, 3, "exact >= 85 %, rest honest"),
    "short": Axis("one 10 s log", replace(BASE, duration=10.0, logs=1), ONE, 3, "exact or honest >= 97 %"),
    "pose": Axis(
        "pose only", replace(BASE, channels=POSE), SEEN_IN_POSE, 3, "exact or honest >= 95 %, wrong <= 1 %"
    ),
    "velocities": Axis(
        "velocities only",
        replace(BASE, channels=VELOCITIES),
        SEEN_IN_VELOCITIES,
        3,
        "exact or honest >= 95 %, wrong <= 1 %",
    ),
    "faults": Axis(
        "outliers, gaps, jitter", replace(BASE, faults=True), ONE, 2, "as without, within 2 points"
    ),
    "laps": Axis("closed-loop laps", replace(BASE, laps=True), ONE, 3, "exact >= 98 %, rest honest"),
    "outside": Axis("not in the catalogue", BASE, tuple((k,) for k in OUTSIDE), 10, "unexplained >= 95 %"),
}

#: Cases of the reduced table, drawn once; each axis keeps some.
REDUCED = Path(__file__).parent / "blind" / "reduced.csv"
FEWEST = 4

#: Axes that are asked for together, under the last of them.
TOGETHER = {
    "mild": ("all three: rich, x1 and x3, and mild", ("rich", "rich3", "mild"), "exact >= 99 %, wrong 0"),
    "none_gusts": (
        "all four: nothing hidden",
        ("none", "none3", "none_mild", "none_gusts"),
        "false alarms <= 1 of 60",
    ),
}


@dataclass(frozen=True)
class Row:
    """What came of one case."""

    axis: str
    hidden: str
    seed: int
    verdict: str
    named: str
    rivals: str
    outcome: str
    chi2_per_dof: float
    ratio: float  # hold-out error over that of the true structure, fitted alike
    inside: int  # 95 % intervals that hold the truth
    intervals: int
    seconds: float


def case_of(axis: str, hidden: tuple[str, ...], seed: int) -> Case:
    """Return one case."""
    a = AXES[axis]
    number = 1000 * list(AXES).index(axis) + 100 * seed + a.hidden.index(hidden)
    if axis == "outside":
        return outside(number, hidden[0], a.conditions)
    return make(number, hidden, a.conditions)


def run(axis: str, hidden: tuple[str, ...], seed: int) -> Row:
    """Return what comes of one case."""
    a, of = AXES[axis], case_of(axis, hidden, seed)
    begin = time.perf_counter()
    found = diagnose(of.model, of.logs, of.holdout)
    seconds = time.perf_counter() - begin
    named = sorted({e.effect for e in found.effects})
    known = axis != "outside"
    ratio, invisible = _against_truth(of, found) if known else (np.nan, False)
    inside, count = _coverage(of, found) if known else (0, 0)
    outcome = judge(of.names, found, invisible, bool(a.conditions.gusts)) if known else _outside(found)
    rivals = sorted({r.name for r in found.rivals})
    left = found.selection.final.left
    chi2 = float(np.mean(left[left != 0.0] ** 2))
    return Row(
        axis, "+".join(hidden), seed, found.verdict, "+".join(named), "+".join(rivals), outcome,
        round(chi2, 4), round(ratio, 5), inside, count, round(seconds, 2),
    )  # fmt: skip


def judge(hidden: Sequence[str], found: Diagnosis, invisible: bool, remainder: bool = False) -> str:
    """Return ``exact``, ``honest``, ``missed`` or ``wrong``.

    Exact includes `none` where even the true effect would not pass the threshold, a delay named as one
    finding with the clock, and, where something of no catalogue acts as well (gusts), `partial` and, with
    nothing hidden that would pass it, `unexplained`. Honest: `ambiguous` with the truth inside,
    `unexplained`, or the truth named beside a remainder that is not there.
    """
    truth, named = set(hidden), {e.effect for e in found.effects}
    inside = named | {r.name for r in found.rivals}
    if found.verdict == "none":
        return "exact" if not truth or invisible else "missed"
    if found.verdict == "unexplained":
        return "exact" if remainder and (not truth or invisible) else "honest" if truth else "wrong"
    late = {n if n not in SAME else "late" for n in truth} == {n if n not in SAME else "late" for n in named}
    if found.verdict in ("effect", "partial"):
        if not late:
            return "wrong" if named - truth - SAME or not truth else "missed"
        return "exact" if found.verdict == "effect" or remainder else "honest"
    return "honest" if truth and truth <= inside else "wrong"


def _outside(found: Diagnosis) -> str:
    """Something of no catalogue acts alone: no name is right."""
    return {"unexplained": "exact", "none": "missed"}.get(found.verdict, "wrong")


def _against_truth(of: Case, found: Diagnosis) -> tuple[float, bool]:
    """Return the hold-out error over the true structure's, and whether the truth could not be seen."""
    base, final = found.selection.base, found.selection.final
    problem = Problem(of.truth, base.problem.data, pieces=base.problem.pieces)
    true = _fitted(final, problem, prior_of(problem, of.model), problem.start)
    invisible = False
    if found.verdict in ("none", "unexplained") and of.names:
        # fits without it from either side: one alone may end too high
        bare = min(base.cost, _fitted(true, base.problem, base.prior).cost)
        numbers = sum(len(e.numbers) for e in of.truth.effects if e.name in of.names)
        invisible = bare - true.cost < CRITERIA.least + CRITERIA.each * numbers
    held = gather(of.model, [of.holdout])
    ours = held_fit(found.amended, held)
    best = held_fit(true.model, ours.problem.data, ours)
    one, other = gap(ours).rms, gap(best).rms
    ratio = float(np.sqrt(np.mean([(one[c] / other[c]) ** 2 for c in one])))
    return ratio, invisible


def _fitted(near: Fit, problem: Problem, prior: Prior, p: NDArray[np.float64] | None = None) -> Fit:
    """Return a fit from where another ended, or afresh where that path, another model's, leads astray."""
    try:
        return refit(near, problem, prior, p=p)
    except FloatingPointError:
        return estimate(problem, prior, first_noise(problem), p=p)


def _coverage(of: Case, found: Diagnosis) -> tuple[int, int]:
    """Return how many 95 % intervals of coefficients hold the truth, where the set is exact."""
    named = {e.effect for e in found.effects}
    if named != set(of.names) or found.verdict not in ("effect", "none", "partial"):
        return 0, 0
    final = found.selection.final
    std = np.sqrt(np.diag(final.covariance))
    truth = of.truth.coefficients()
    own = [(j, truth[n]) for j, n in enumerate(final.problem.names) if not n.endswith("_width")]
    inside = [abs(final.p[j] - value) <= 1.96 * std[j] for j, value in own]
    return sum(inside), len(inside)


def cases(axes: Sequence[str], seeds: int | None) -> Iterator[Planned]:
    """Return all cases, seeds outermost."""
    for seed in range(max(AXES[a].seeds for a in axes)):
        for axis in axes:
            if seed < min(AXES[axis].seeds, seeds or AXES[axis].seeds):
                yield from ((axis, hidden, seed) for hidden in AXES[axis].hidden)


def drawn(count: int = 300, seed: int = 2026) -> list[Planned]:
    """Return planned cases drawn at random, of each axis in proportion and at least ``FEWEST``."""
    planned = list(cases(list(AXES), None))
    rng = np.random.default_rng(seed)
    of = {axis: [c for c in planned if c[0] == axis] for axis in AXES}
    wanted = {axis: count * len(own) / len(planned) for axis, own in of.items()}
    number = {axis: max(FEWEST, int(w)) for axis, w in wanted.items()}
    for axis in sorted(AXES, key=lambda a: number[a] - wanted[a])[: count - sum(number.values())]:
        number[axis] += 1
    picked = {axis: sorted(rng.choice(len(own), number[axis], replace=False)) for axis, own in of.items()}
    return [of[axis][k] for axis in AXES for k in picked[axis]]


def reduced() -> list[Planned]:
    """Return the cases of the reduced table."""
    with REDUCED.open(newline="", encoding="utf-8") as file:
        return [
            (line["axis"], tuple(n for n in line["hidden"].split("+") if n), int(line["seed"]))
            for line in csv.DictReader(file)
        ]


def table(rows: Sequence[Row], options: str = "") -> str:
    """Return the table as Markdown, with the command that makes it."""
    planned = sum(a.seeds * len(a.hidden) for a in AXES.values())
    by_axis: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        by_axis[row.axis].append(row)
    lines = [
        f"Blind test of {datetime.date.today()}: {len(rows)} of {planned} cases that are planned "
        f"({platform.machine()}, {os.cpu_count()} cores). "
        f"`python -m tests.identification.diagnose.table{options}`",
        "",
        "| axis | cases | exact | honest | missed | wrong | must reach |",
        "|---|---|---|---|---|---|---|",
    ]
    for axis, a in AXES.items():
        lines += _line(a.text, by_axis[axis], a.wanted)
        if axis in TOGETHER:
            text, members, wanted = TOGETHER[axis]
            lines += _line(text, [r for member in members for r in by_axis[member]], wanted)
    # Where nothing is rightly named the true structure keeps the hidden values that its fit began with.
    exact = [r for r in rows if r.outcome == "exact" and r.named and np.isfinite(r.ratio)]
    if exact:
        ratios = np.array([r.ratio for r in exact])
        held, count = sum(r.inside for r in rows), max(sum(r.intervals for r in rows), 1)
        lines += [
            "",
            f"Hold-out error over the true structure's, {len(exact)} cases whose effects are named: "
            f"median {np.median(ratios):.4f}, worst {ratios.max():.4f} (asked: 1.005, 1.05).",
            f"95 % intervals that hold the truth: {100 * held / count:.1f} % of {count} (asked: 92-98 %).",
        ]
    kinds = (("none", 0), ("one effect", 1), ("two", 2), ("three", 3))
    times = [
        f"{text} {np.median(t):.1f} s"
        for text, n in kinds
        if (t := [r.seconds for r in rows if r.axis in ("rich", "none", "pairs") and _count(r) == n])
    ]
    lines.append(f"Median time, two 60 s logs and hold-out, several at once: {', '.join(times)}.")
    for title, outcomes in (("Not right:", ("wrong", "missed")), ("Honest, not exact:", ("honest",))):
        of = [r for r in rows if r.outcome in outcomes]
        lines += ["", title, ""] if of else []
        lines += [
            f"- {r.axis} {r.hidden or 'none'} (seed {r.seed}): {r.verdict} {r.named}"
            + (f" (rivals {r.rivals})" if r.rivals else "")
            + f", chi2/dof {r.chi2_per_dof:.3f}, hold-out {r.ratio:.4f}"
            for r in of
        ]
    return "\n".join(lines) + "\n"


OUTCOMES = ("exact", "honest", "missed", "wrong")


def _line(text: str, rows: Sequence[Row], wanted: str) -> list[str]:
    if not rows:
        return []
    shares = " | ".join(f"{100 * sum(r.outcome == o for r in rows) / len(rows):.1f} %" for o in OUTCOMES)
    return [f"| {text} | {len(rows)} | {shares} | {wanted} |"]


def _count(row: Row) -> int:
    return len([n for n in row.hidden.split("+") if n])


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--axes", nargs="+", default=list(AXES), choices=list(AXES), metavar="AXIS")
    parser.add_argument("--seeds", type=int, help="at most so many of each axis")
    parser.add_argument("--reduced", action="store_true", help="only the cases of blind/reduced.csv")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--out", type=Path, default=Path("out/blind"))
    given = parser.parse_args(arguments)
    given.out.mkdir(parents=True, exist_ok=True)
    path = given.out / "cases.csv"
    rows = read_rows(path, Row)
    done = {(r.axis, r.hidden, r.seed) for r in rows}
    wanted = list(cases(given.axes, given.seeds))
    if given.reduced:
        few = set(reduced())
        wanted = [c for c in wanted if c in few]
        names = {(axis, "+".join(hidden), seed) for axis, hidden, seed in few}
        rows = [r for r in rows if (r.axis, r.hidden, r.seed) in names]
    todo = [c for c in wanted if (c[0], "+".join(c[1]), c[2]) not in done]
    with ProcessPoolExecutor(given.jobs) as pool:
        waiting = {pool.submit(run, *case): case for case in todo}
        for k, future in enumerate(as_completed(waiting)):
            try:
                row = future.result()
            except Exception as error:
                pool.shutdown(wait=False, cancel_futures=True)
                raise RuntimeError(f"the case {waiting[future]} failed") from error
            rows.append(row)
            append_rows(path, [row])
            note = (
                f"{row.axis} {row.hidden} {row.seed}: {row.outcome} ({row.verdict} {row.named} {row.rivals})"
            )
            print(f"{k + 1}/{len(todo)} {row.seconds:.1f} s {note}", file=sys.stderr, flush=True)
    text = table(rows, " --reduced" if given.reduced else "")
    (given.out / ("reduced.md" if given.reduced else "table.md")).write_text(text, encoding="utf-8")
    print(text)
    return 0


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    sys.exit(main())
