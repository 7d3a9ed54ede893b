"""How near the decisions of ``diagnose`` are to their limits, on cases of the reduced blind table.

``python -m benchmarks.criteria --out DIR`` keeps the rows of the trace in DIR, so that the table is printed
again without a run; ``--reruns`` runs cases again with a limit doubled and halved.
"""

from __future__ import annotations

import argparse
import math
import re
import sys
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from unittest.mock import patch

import numpy as np

from hovercontrol.identification.diagnose import diagnose
from hovercontrol.identification.diagnose.criteria import CRITERIA, Criteria
from hovercontrol.identification.diagnose.search.fit import TRIALS
from tests.identification.diagnose.kept_rows import append_rows, read_rows
from tests.identification.diagnose.table import Planned, case_of, reduced

FEW, MANY, RERUN = 12, 40, 6
FACTORS = (2.0, 0.5)

#: Thresholds of each rule, by the start of its text. Some serve several rules, which then change together.
BEHIND = {
    "cross-validated gain": ((TRIALS, "promised"), (CRITERIA, "share")),
    "gain of the fit": ((TRIALS, "half"),),
    "cost above": ((TRIALS, "near"),),
    "gain in twice": ((CRITERIA, "least"), (CRITERIA, "each")),
    "p-value": ((CRITERIA, "level"),),
    "spread": ((CRITERIA, "spread"),),
    "behind": ((CRITERIA, "apart"),),
    "gain of EFFECT": ((CRITERIA, "apart"),),
    "mean t": ((CRITERIA, "worse"),),
    "t of the gain": ((CRITERIA, "confirmed"),),
}


@dataclass(frozen=True)
class Row:
    """One decision of one case."""

    axis: str
    hidden: str
    seed: int
    found: str  # verdict, names, rivals
    step: str
    effect: str
    rule: str
    value: float
    limit: float
    passed: int

    @property
    def case(self) -> Planned:
        return self.axis, tuple(n for n in self.hidden.split("+") if n), self.seed

    def turns(self, factor: float) -> bool:
        """Whether the comparison comes out otherwise with the limit times `factor`."""
        return self._holds(self.limit) != self._holds(factor * self.limit)

    def _holds(self, limit: float) -> bool:
        upper = self.rule.endswith(("at most", "less than"))
        return self.value <= limit if upper else self.value >= limit


@dataclass(frozen=True)
class Rerun:
    """What comes of a case with a limit changed."""

    rule: str
    factor: float
    axis: str
    hidden: str
    seed: int
    before: str
    after: str


def planned(count: int) -> list[Planned]:
    """Return cases of the reduced table: in random order, one of each axis before a second of any."""
    every = reduced()
    order = [every[k] for k in np.random.default_rng(2026).permutation(len(every))]
    before: Counter[str] = Counter()
    turn = []
    for case in order:
        turn.append(before[case[0]])
        before[case[0]] += 1
    return [order[k] for k in np.argsort(turn, kind="stable")[:count]]


def diagnosed(case: Planned) -> list[Row]:
    """Return the rows of one case that compare numbers."""
    of = case_of(*case)
    found = diagnose(of.model, of.logs, of.holdout)
    names = "+".join(sorted({e.effect for e in found.effects})) or "-"
    rivals = "+".join(sorted({r.name for r in found.rivals}))
    text = f"{found.verdict} {names}" + (f" (rivals {rivals})" if rivals else "")
    return [
        Row(
            case[0],
            "+".join(case[1]),
            case[2],
            text,
            d.step,
            d.effect,
            d.rule,
            d.value,
            d.limit,
            int(d.passed),
        )
        for d in found.trace
        if math.isfinite(d.value) and math.isfinite(d.limit)
    ]


@contextmanager
def changed(rule: str, factor: float) -> Iterator[None]:
    """Multiply the thresholds behind a rule; they are frozen, so this is for a process of its own."""
    owners = next(own for begin, own in BEHIND.items() if rule.startswith(begin))
    kept = [(owner, name, getattr(owner, name)) for owner, name in owners if name != "spread"]
    spread = Criteria.spread
    try:
        for owner, name, value in kept:
            object.__setattr__(owner, name, factor * value)
        if len(kept) == len(owners):
            yield
        else:
            with patch.object(Criteria, "spread", lambda own, n: factor * spread(own, n)):
                yield
    finally:
        for owner, name, value in kept:
            object.__setattr__(owner, name, value)


def again(rule: str, factor: float, case: Planned, before: str) -> Rerun:
    """Return what comes of a case with the limit of a rule multiplied."""
    with changed(rule, factor):
        after = diagnosed(case)
    return Rerun(rule, factor, case[0], "+".join(case[1]), case[2], before, after[0].found if after else "-")


def kind(rule: str) -> str:
    """Return the text of a rule without the name of an effect in it."""
    return re.sub(r"^(behind|gain of) \w+ in its place", r"\1 EFFECT in its place", rule)


def by_rule(found: Iterable[Row]) -> dict[str, list[Row]]:
    """Return the rows of each rule."""
    rules: dict[str, list[Row]] = defaultdict(list)
    for row in found:
        rules[kind(row.rule)].append(row)
    return dict(rules)


def limits(found: Sequence[Row]) -> str:
    """Return the limit of a rule, or the least and the greatest."""
    least, most = min(r.limit for r in found), max(r.limit for r in found)
    return f"{least:.3g}" if f"{least:.3g}" == f"{most:.3g}" else f"{least:.3g} to {most:.3g}"


def nearest(found: Sequence[Row]) -> str:
    """Return value/limit of the decision nearest to its limit."""
    ratios = [r.value / r.limit for r in found if r.limit and r.value / r.limit > 0.0]
    return f"{min(ratios, key=lambda ratio: abs(math.log(ratio))):.3g}" if ratios else "-"


def table(found: Sequence[Row], reruns: Sequence[Rerun] = ()) -> str:
    """Return the table as Markdown."""
    cases = len({r.case for r in found})
    lines = [
        f"{len(found):,} decisions of {cases} cases of the reduced blind table. "
        f"`python -m benchmarks.criteria{' --all' if cases >= MANY else ''} --reruns`",
        "",
        "| step | rule | limit | decisions | turn if doubled | turn if halved | nearest value/limit |",
        "|---|---|---|---|---|---|---|",
    ]
    for rule, rows in by_rule(found).items():
        numbers = " | ".join(str(sum(r.turns(factor) for r in rows)) for factor in FACTORS)
        lines.append(
            f"| {rows[0].step} | {rule} | {limits(rows)} | {len(rows)} | {numbers} | {nearest(rows)} |"
        )
    if not reruns:
        return "\n".join([*lines, ""])
    lines += ["", "| rule | limit | cases run again | other result |", "|---|---|---|---|"]
    for rule, factor in dict.fromkeys((r.rule, r.factor) for r in reruns):
        own = [r for r in reruns if (r.rule, r.factor) == (rule, factor)]
        other = [
            f"{r.axis}, hidden {r.hidden or 'nothing'}, seed {r.seed}: {r.before} became {r.after}"
            for r in own
            if r.before != r.after
        ]
        lines.append(f"| {rule} | x {factor:g} | {len(own)} | {'; '.join(other) or 'none'} |")
    return "\n".join([*lines, ""])


def to_rerun(found: Sequence[Row], most: int) -> list[tuple[str, float, Planned, str]]:
    """Return what to run again: the rules with the largest share of decisions that turn, and these cases."""
    turning = [
        (sum(r.turns(factor) for r in own) / len(own), rule, factor)
        for rule, own in by_rule(found).items()
        for factor in FACTORS
    ]
    todo = []
    for share, rule, factor in sorted(turning, key=lambda t: -t[0]):
        counts = Counter((r.case, r.found) for r in found if kind(r.rule) == rule and r.turns(factor))
        todo += [(rule, factor, case, before) for (case, before), _ in counts.most_common(most) if share]
    return todo


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    found = [row for case in planned(FEW) for row in diagnosed(case)]
    for rule, own in by_rule(found).items():
        doubled, halved = (sum(r.turns(factor) for r in own) for factor in FACTORS)
        yield rule, f"{doubled} doubled, {halved} halved turn of {len(own)}", "", None


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="benchmarks.criteria", description=__doc__.splitlines()[0])
    parser.add_argument("--all", action="store_true", help=f"{MANY} cases instead of {FEW}")
    parser.add_argument("--reruns", action="store_true", help=f"at most {RERUN} cases again for each limit")
    parser.add_argument("--jobs", type=int, default=1, help="processes (default: 1)")
    parser.add_argument("--out", type=Path, default=Path("out/criteria"))
    given = parser.parse_args(arguments)
    given.out.mkdir(parents=True, exist_ok=True)
    trace, second = given.out / "trace.csv", given.out / "reruns.csv"
    wanted = planned(MANY if given.all else FEW)
    done = {r.case for r in read_rows(trace, Row)}
    with ProcessPoolExecutor(given.jobs, mp_context=get_context("spawn")) as pool:
        for future in as_completed([pool.submit(diagnosed, case) for case in wanted if case not in done]):
            own = future.result()
            append_rows(trace, own)
            print(*own[0].case, own[0].found, file=sys.stderr, flush=True)
        found = [r for r in read_rows(trace, Row) if r.case in wanted]
        todo = to_rerun(found, RERUN) if given.reruns else []
        had = {(r.rule, r.factor, r.axis, r.hidden, r.seed) for r in read_rows(second, Rerun)}
        left = [t for t in todo if (t[0], t[1], t[2][0], "+".join(t[2][1]), t[2][2]) not in had]
        for late in as_completed([pool.submit(again, *t) for t in left]):
            one = late.result()
            append_rows(second, [one])
            print(*asdict(one).values(), file=sys.stderr, flush=True)
    text = table(found, read_rows(second, Rerun))
    (given.out / "criteria.md").write_text(text, encoding="utf-8")
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
