"""Laws that are in no catalogue: ``python -m benchmarks.laws`` plants six of them in three machines.

Each run has two logs and one held out, process noise and measurement noise, and coefficients up to 3 % off.
Printed are, with Clopper-Pearson intervals, how often the right form is named (alone, or with rivals that
are told), how often a false form is named without a rival, and how often the coefficient is within two
errors. With ``--out`` each row is written as its run ends, and a table that was stopped goes on.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np

import hovercontrol as hc
from hovercontrol.blocks.simulation.reasons import StoppedError
from hovercontrol.identification.benchmark.cases import with_rates
from hovercontrol.identification.benchmark.machines import pendulum, ship
from tests.identification.diagnose.generator import Conditions, craft, given, simulated
from tests.identification.diagnose.kept_rows import append_rows, read_rows

Random = np.random.Generator


@dataclass(frozen=True)
class Planted:
    """A law in a machine: its name, and the range of its coefficient's size."""

    machine: str
    law: str
    low: float
    high: float
    either: bool = False  # of either sign; else as given

    @property
    def name(self) -> str:
        return f"{self.machine}: {self.law}"


LAWS = (
    Planted("craft", "law_r__abs_u__r", -0.6, -0.3),
    Planted("craft", "law_u__sqr_r", 0.03, 0.08, True),
    Planted("ship", "law_r__abs_v__r", -0.8, -0.4),
    Planted("ship", "law_v__abs_r__r", 2.0, 4.0, True),
    Planted("pendulum", "law_rate__cub_angle", -2.0, -0.8),
    Planted("pendulum", "law_rate__sin2_angle", 1.0, 2.5, True),
)


@dataclass(frozen=True)
class Row:
    """What came of one run."""

    case: str
    seed: int
    verdict: str
    named: str
    rivals: str
    value: float
    estimate: float
    std: float
    seconds: float
    outcome: str

    def line(self) -> str:
        """Return it in one line."""
        named = f"{self.named or '-'}{f' (or {self.rivals})' if self.rivals else ''}"
        size = f"{self.value:8.3g} {self.estimate:8.3g} ± {self.std:.2g}"
        run = f"{self.case:32} {self.seed:2} {self.verdict:11} {named:60}"
        return f"{run} {size} {self.seconds:6.1f} s  {self.outcome}"


def slow_ship() -> hc.BlockModel:
    """Return the ship of the public benchmark with the coefficients of a larger one."""
    return ship().with_coefficients({"yv": 0.05, "yr": 0.3, "yd": 0.01, "nv": 0.04, "nr": 0.3, "nd": 0.03})


#: Of each machine: the model, dt, rows, size of the commands, how long they hold [s], measurement noise,
#: size of the process noise [unit of the state / s].
BLOCKS = {
    "ship": (slow_ship, 0.1, 3000, 0.6, 20.0, {"psi": 2e-3, "v": 3e-3, "r": 1e-3}, {"v": 2e-4, "r": 1e-4}),
    "pendulum": (pendulum, 0.02, 1500, 4.0, 0.8, {"angle": 1e-3, "rate": 5e-3}, {"rate": 0.1}),
}


def block_case(planted: Planted, seed: int) -> tuple[hc.BlockModel, list[hc.Log], hc.Log, float]:
    """Return the given model of a machine, two logs, one held out, and the coefficient of the law.

    A machine whose law drives it out of its region of attraction (the simulation stops: a quadratic law
    escapes in finite time) cannot be flown: coefficients, law and logs are drawn again, from the next
    numbers of the same seed.
    """
    rng = np.random.default_rng([seed, 7])
    while True:
        try:
            return _drawn_block_case(planted, rng)
        except StoppedError:
            continue


def _drawn_block_case(planted: Planted, rng: Random) -> tuple[hc.BlockModel, list[hc.Log], hc.Log, float]:
    make, dt, n, size, hold, noise, push = BLOCKS[planted.machine]
    model = make()
    truth = model.with_coefficients({k: v * rng.uniform(0.8, 1.25) for k, v in model.coefficients().items()})
    value = _value(planted, rng)
    believed = truth.with_coefficients(
        {k: v * rng.uniform(0.97, 1.03) for k, v in truth.coefficients().items()}
    )
    plant = truth.with_effects([truth.effect_class(planted.law)(value)]).plant(late=True)
    pushes = {name: hc.Signal(f"push_{name}", f"({plant.signal(name).unit})/s") for name in push}
    d = {**plant.derivatives, **{n_: plant.derivatives[n_] + s.symbol for n_, s in pushes.items()}}
    run_block = with_rates(plant, d, inputs=tuple(pushes.values())).compile(friction="smooth")
    t = dt * np.arange(n)

    def log(name: str) -> hc.Log:
        edges = np.cumsum(rng.uniform(0.4 * hold, 1.6 * hold, int(n * dt / hold * 3) + 3))
        command = rng.uniform(-size, size, edges.size)[np.searchsorted(edges, t)]
        rows = [command, *(_coloured(rng, n, dt, push[p]) for p in pushes)]
        run = run_block.simulate(t, rows, rtol=1e-8, atol=1e-10)
        y = dict(zip(run.output_labels, np.atleast_2d(run.outputs), strict=True))
        seen = {c: y[c] + s * rng.normal(size=n) for c, s in noise.items()}
        return hc.Log(name, t, {**seen, believed.block.inputs[0].name: command})

    return believed, [log("log 1"), log("log 2")], log("hold-out"), value


def _coloured(rng: Random, n: int, dt: float, size: float) -> np.ndarray:
    fade = np.exp(-dt / 0.3)
    z, values = rng.normal(size=n), [0.0]
    for fresh in z[1:]:
        values.append(fade * values[-1] + size * np.sqrt(1 - fade**2) * fresh)
    return np.array(values)


def _value(planted: Planted, rng: Random) -> float:
    value = float(rng.uniform(planted.low, planted.high))
    return value * float(rng.choice([-1.0, 1.0])) if planted.either else value


def case(planted: Planted, seed: int) -> tuple[hc.Model | hc.BlockModel, list[hc.Log], hc.Log, float]:
    """Return the given model, two logs, one held out, and the coefficient of the law."""
    if planted.machine != "craft":
        return block_case(planted, seed)
    rng = np.random.default_rng([seed, 7])
    model, conditions = craft(rng), Conditions(gusts=True)
    value = _value(planted, rng)
    truth = model.with_effects([model.effect_class(planted.law)(value)])
    runs = [simulated(truth, rng, conditions, n) for n in ("log 1", "log 2", "hold-out")]
    return given(model, np.random.default_rng([seed, 1])), runs[:2], runs[2], value


def run(planted: Planted, seed: int) -> Row:
    """Return what comes of one run; an error is an outcome too."""
    begin, value = time.perf_counter(), float("nan")
    try:
        model, logs, holdout, value = case(planted, seed)
        begin = time.perf_counter()
        found = hc.diagnose(model, logs, holdout)
    except Exception as error:  # the other runs go on
        text = f"crashed: {type(error).__name__}: {error}"
        seconds = round(time.perf_counter() - begin, 1)
        return Row(planted.name, seed, "-", "", "", value, float("nan"), float("nan"), seconds, text)
    seconds = round(time.perf_counter() - begin, 1)
    named = {e.effect: e for e in found.effects}
    rivals = {r.name for r in found.rivals if not r.same}
    own = named.get(planted.law)
    if own is not None and set(named) == {planted.law}:
        outcome = "told among rivals" if found.verdict == "ambiguous" else "right"
    elif planted.law in {*named, *rivals}:
        outcome = "told among rivals" if found.verdict == "ambiguous" else "right and more"
    elif not named:
        outcome = "withheld"
    else:
        outcome = "false, told as one of several" if found.verdict == "ambiguous" else "false"
    return Row(
        planted.name, seed, found.verdict, "+".join(named), "+".join(sorted(rivals)), value,
        own.value if own else float("nan"), own.std if own else float("nan"), seconds, outcome,
    )  # fmt: skip


def results(todo: Sequence[tuple[Planted, int]], jobs: int) -> Iterator[Row]:
    """Yield the rows of all runs, as they end."""
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        for one in as_completed([pool.submit(run, *which) for which in todo]):
            yield one.result()


def main(show: Callable[[str], None] = print) -> None:
    parser = argparse.ArgumentParser("benchmarks.laws", description=__doc__.split("\n")[0])
    parser.add_argument("--seeds", type=int, default=10, help="runs of each law (default: 10)")
    parser.add_argument("--first", type=int, default=0, help="the first seed (default: 0)")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", default="", help="only laws whose name has this in it")
    parser.add_argument("--out", type=Path, help="CSV file; runs that are in it are not run again")
    asked = parser.parse_args()
    seeds = range(asked.first, asked.first + asked.seeds)
    wanted = [(p, s) for s in seeds for p in LAWS if asked.only in p.name]
    names = {(p.name, s) for p, s in wanted}
    rows = [r for r in read_rows(asked.out, Row) if (r.case, r.seed) in names] if asked.out else []
    done = {(r.case, r.seed) for r in rows}
    for row in rows:
        show(row.line())
    for row in results([(p, s) for p, s in wanted if (p.name, s) not in done], asked.jobs):
        rows.append(row)
        show(row.line())
        sys.stdout.flush()
        if asked.out:
            append_rows(asked.out, [row])
    summary(rows, show)


def summary(rows: list[Row], show: Callable[[str], None]) -> None:
    """Print shares with their 95 % intervals (Clopper and Pearson)."""
    known = [r for r in rows if np.isfinite(r.std)]
    within = [abs(r.estimate - r.value) <= 2 * r.std for r in known]
    counts = (
        ("right form named, alone", [r.outcome == "right" for r in rows]),
        ("right form named, or told among several", [r.outcome[:5] in ("right", "told ") for r in rows]),
        ("a false form named without a rival", [r.outcome == "false" for r in rows]),
        ("coefficient within two errors, of those named", within),
    )
    for what, hits in counts:
        low, high = hc.analysis.clopper_pearson(sum(hits), len(hits)) if hits else (0.0, 1.0)
        show(
            f"{what:50} {sum(hits):3} of {len(hits):3}  ({100 * float(low):.0f} to {100 * float(high):.0f} %)"
        )


if __name__ == "__main__":
    main()
