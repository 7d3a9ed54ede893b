"""Unknown functions in a model of one's own: is the form right, and is its probability?

``python -m benchmarks.unknown_functions bioreactor [--seeds 5] [--published]``: the fed-batch reactor of the
SciML showcase "Optimal Data Gathering for Missing Physics" (and of arXiv 2604.01231), written anew from its
equations; the growth mu(C_s) is unknown, two experiments of 15 h, 1 % noise on all three states, a row every
three minutes. ``--published``: C_s alone, once an hour, 16 samples with noise of 0.1 kg/m^3; the first states
of the others are not given.

``python -m benchmarks.unknown_functions forms [--cases 100] [--every] [--seed 1000]``: carts with a drag of
one of eight forms, drawn at random (``--every``: one of all forms); the probability of the likeliest form
against the share that is right.

``python -m benchmarks.unknown_functions experiment [--cases 10]``: carts pushed so gently that the form of
their drag stays open; the proposed experiment (and, beside it, random pushes of the same length), then a
diagnosis of both logs.

The generators share no code with the package.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.integrate import solve_ivp

import hovercontrol as hc
from hovercontrol.craft.models.interface import as_model
from hovercontrol.identification.diagnose.diagnosis import Diagnosis
from hovercontrol.identification.diagnose.experiment.proposal import Experiment
from hovercontrol.identification.diagnose.unknown.forms import named_forms
from hovercontrol.identification.diagnose.unknown.function import FittedFunction
from hovercontrol.identification.diagnose.unknown.tables import tabulated, with_constants
from hovercontrol.identification.engine.data import gather

Array = np.ndarray

SEED = 58_2604
HOUR = 3600.0

#: Of the showcase: largest growth [1/s], half-saturation [kg/m^3], feed concentration [kg/m^3], yield [1].
MOST, HALF, FEED, YIELD = 0.421 / HOUR, 4.39, 50.0, 0.777

#: Rows per hour, largest feed [m^3/s].
ROWS, LARGEST = 20, 2e-3 / HOUR


def reactor() -> hc.Block:
    """The reactor's balances, with the growth unknown."""
    C_s = hc.Signal("C_s", "kg/m^3", "substrate", start=1.0, nominal=10.0)
    C_x = hc.Signal("C_x", "kg/m^3", "biomass", start=1.0)
    V = hc.Signal("V", "m^3", "volume", start=7e-3, nominal=1e-2)
    Q = hc.Signal("Q_in", "m^3/s", "feed", nominal=1e-6)
    C_in, y = hc.Signal("C_in", "kg/m^3", start=FEED), hc.Signal("y", "1", "yield", start=YIELD)
    mu, thin = hc.unknown("mu", of=["C_s"], unit="1/s"), Q.symbol / V.symbol
    slopes = {
        "C_s": -mu / y.symbol * C_x.symbol + thin * (C_in.symbol - C_s.symbol),
        "C_x": mu * C_x.symbol - thin * C_x.symbol,
        "V": Q.symbol,
    }
    return hc.Block("reactor", [C_s, C_x, V], [Q], [C_s, C_x, V], [C_in, y], slopes)


def experiment(rng: np.random.Generator, hours: int = 15, noise: float = 0.01) -> hc.Log:
    """Fifteen hours with another feed each hour."""
    feed, x, rows = rng.uniform(0.0, LARGEST, hours), np.array([1.0, 1.0, 7e-3]), list[Array]()
    for q in feed:

        def slopes(t: float, x: Array, q: float = q) -> list[float]:
            growth = MOST * x[0] / (HALF + x[0])
            return [
                -growth / YIELD * x[1] + q / x[2] * (FEED - x[0]),
                growth * x[1] - q / x[2] * x[1],
                q,
            ]

        at = np.linspace(0.0, HOUR, ROWS + 1)
        run = solve_ivp(slopes, (0.0, HOUR), x, t_eval=at, rtol=1e-9, atol=1e-12).y.T
        rows.append(run[:-1])
        x = run[-1]
    states = np.concatenate(rows)
    seen = states + noise * np.ptp(states, axis=0) * rng.normal(size=states.shape)
    columns = dict(zip(("C_s", "C_x", "V"), seen.T, strict=True))
    t = np.arange(len(states)) * HOUR / ROWS
    return hc.Log("experiment", t, {**columns, "Q_in": np.repeat(feed, ROWS)})


def hourly(log: hc.Log, rng: np.random.Generator) -> hc.Log:
    """The substrate alone, once an hour."""
    every = {name: log[name][::ROWS] for name in ("C_s", "Q_in")}
    noise = 0.1 * rng.normal(size=every["C_s"].size)
    return hc.Log(log.name, log.time[::ROWS], {**every, "C_s": every["C_s"] + noise})


def bioreactor(seeds: int, published: bool) -> None:
    """Print a row for each seed: Monod's numbers, their errors, and the time."""
    first = right = 0
    for seed in range(seeds):
        rng, begin = np.random.default_rng([SEED, seed]), time.process_time()
        logs = (
            [hourly(experiment(rng, 16, 0.0), rng) for _ in range(2)]
            if published
            else [experiment(rng) for _ in range(2)]
        )
        found = hc.diagnose(reactor(), logs, fixed=["C_in", "y"])
        best = found.functions[0].forms[0]
        (a, da), (b, db) = [*best.numbers.values(), (np.nan, np.nan)][:2]
        within = abs(a - MOST) < 2.0 * da and abs(b - HALF) < 2.0 * db
        first += best.name == "saturating"
        right += best.name == "saturating" and within
        said, seconds = "within" if within else "not within", time.process_time() - begin
        text = f"{found.verdict}, {best} ({best.probability:.0%}), {said} two errors, {seconds:.0f} s"
        print(f"seed {seed}: {text}", flush=True)
    print(f"Monod first in {first} of {seeds}, with both numbers within two errors in {right}")


def forms(rng: np.random.Generator) -> tuple[str, Callable[[Array], Array]]:
    """A form of a drag over speeds of about 0 to 2 m/s, with numbers drawn at random."""
    a, b = rng.uniform(0.5, 2.0), rng.uniform(0.3, 1.5)
    n = rng.choice([0.5, 1.5, 2.5])
    every: dict[str, Callable[[Array], Array]] = {
        "proportional": lambda v: a * v,
        "square": lambda v: a * v**2,
        "quadratic": lambda v: a * v + b * v**2,
        "power": lambda v: a * np.maximum(v, 1e-9) ** n,
        "saturating": lambda v: 2 * a * v / (b + v),
        "exponential approach": lambda v: a * (1 - np.exp(-v / b)),
        "logistic": lambda v: 2 * a / (1 + np.exp((0.8 - v) / (0.3 * b))),
        "hinge on a line": lambda v: 0.5 * a * v + 2 * a * np.maximum(v - 0.8, 0.0),
    }
    name = list(every)[int(rng.integers(len(every)))]
    return name, every[name]


def driven(rng: np.random.Generator, t: Array, push: Array, drag: Callable[[Array], Array]) -> hc.Log:
    """A cart that is pushed from rest, 3 mm/s of noise."""
    v, seen, step = 0.0, list[float](), (t[1] - t[0]) / 50
    for force in push:
        seen.append(v)
        for _ in range(50):
            v = max(v + step * (force - float(drag(np.array(v)))), 0.0)
    return hc.Log("run", t, {"v": np.array(seen) + 3e-3 * rng.normal(size=t.size), "F": push})


def settling(cases: int) -> None:
    """Print whether the proposed experiment, or a random one of its length, settles the form rightly."""
    v, F = hc.Signal("v", "m/s"), hc.Signal("F", "m/s^2", lower=0.0, upper=4.0)
    block = hc.Block("cart", [v], [F], [v], [], {"v": F.symbol - hc.unknown("drag", ["v"], "m/s^2")})
    open_, after, lost = 0, [0, 0], 0
    by_chance, said, seed = 0, list[float](), 0
    while open_ < cases:
        rng, seed = np.random.default_rng([SEED, 5000 + seed]), seed + 1
        name, drag = forms(rng)
        top, t = float(drag(np.array(0.5))), np.arange(0.0, 15.0, 0.1)
        first = driven(rng, t, np.repeat(rng.uniform(0.0, top, 15), 10), drag)

        def fly(e: Experiment) -> hc.Log:
            said.append(e.sure)
            return driven(rng, e.time, e.commands["F"], drag)  # noqa: B023

        try:
            found = hc.experiment(block, [first], fly=fly, flights=2, names=[])
        except hc.InputError as error:
            print(f"{name}: refused: {error}", flush=True)
            continue
        if found.diagnoses[0].verdict != "ambiguous":
            continue
        open_ += 1
        right = [_settled(d, name) for d in found.diagnoses]
        after[0] += any(right[1:2])
        after[1] += any(right[1:])
        lost += not found.experiments
        chance = False
        if found.experiments:
            e = found.experiments[0]
            push = np.repeat(rng.uniform(0.0, top, e.time.size // 10 + 1), 10)[: e.time.size]
            chance = _settled(hc.diagnose(block, [first, driven(rng, e.time, push, drag)], names=[]), name)
        by_chance += chance
        length = f", {found.experiments[0].time[-1]:.3g} s" if found.experiments else ""
        print(f"{name}: settled rightly after each: {right}{length}; by chance: {chance}", flush=True)
    print(f"{open_} open: settled rightly by one {after[0]}, by two {after[1]}, by random pushes {by_chance}")
    print(f"without a proposal {lost}; said to be sure {np.mean(said):.0%}")


def _settled(found: Diagnosis, name: str) -> bool:
    return found.verdict == "none" and found.functions[0].forms[0].name.removeprefix("signed ") == name


def cart_log(rng: np.random.Generator, drag: Callable[[Array], Array], seconds: int = 20) -> hc.Log:
    """A cart pushed forward by forces that change each second, 10 rows a second, 0.5 to 4 % noise."""
    top = float(drag(np.array(rng.uniform(0.8, 1.8))))
    push, v, seen = np.repeat(rng.uniform(0.05, 1.3, seconds) * top, 10), 0.3, list[float]()
    for force in push:
        seen.append(v)
        for _ in range(50):
            v = max(v + 0.002 * (force - float(drag(np.array(v)))), 0.0)
    rows = np.array(seen)
    noise = np.exp(rng.uniform(np.log(0.005), np.log(0.04))) * np.ptp(rows)
    return hc.Log(
        "run", np.arange(rows.size) / 10, {"v": rows + noise * rng.normal(size=rows.size), "F": push}
    )


#: Forms that are the same for speeds above zero.
ALIKE = {"dead zone": "hinge", "magnitude with offset": "affine"}


def any_form(rng: np.random.Generator) -> tuple[str, Callable[[Array], Array]]:
    """One of all forms, over speeds of 0 to 2 m/s, with numbers drawn at random."""
    a, b, c = rng.uniform(0.5, 2.0), rng.uniform(-2.0, 2.0), rng.uniform(-1.0, 1.0)
    at, wide, n = rng.uniform(0.4, 1.6), rng.uniform(0.1, 0.4), np.exp(rng.uniform(np.log(0.4), np.log(4.0)))

    def power(v: Array) -> Array:
        return np.maximum(v, 1e-9) ** n

    every: dict[str, Callable[[Array], Array]] = {
        "constant": lambda v: a + 0.0 * v,
        "proportional": lambda v: a * v,
        "affine": lambda v: b + a * v,
        "square": lambda v: a * v**2,
        "cubic": lambda v: a * v**3,
        "quadratic": lambda v: b * v + a * v**2,
        "odd cubic": lambda v: b * v + a * v**3,
        "parabola": lambda v: a + b * v + c * v**2,
        "power": lambda v: a * power(v),
        "saturating": lambda v: 2 * a * v / (at + v),
        "inhibited": lambda v: 4 * a * v / (at + v + v**2 / (3 * wide)),
        "hill": lambda v: 2 * a * power(v) / (at**n + power(v)),
        "exponential decay": lambda v: 2 * a * np.exp(-v / at),
        "exponential approach": lambda v: a * (1 - np.exp(-v / at)),
        "logistic": lambda v: 2 * a / (1 + np.exp((at - v) / wide)),
        "hinge": lambda v: 2 * a * np.maximum(v - at, 0.0),
        "hinge below": lambda v: 2 * a * np.maximum(at - v, 0.0),
        "saturating with offset": lambda v: b + 2 * a * v / (at + v),
        "exponential with offset": lambda v: b + 2 * a * np.exp(-v / at),
        "power with offset": lambda v: b + a * power(v),
        "hinge with offset": lambda v: b + 2 * a * np.maximum(v - at, 0.0),
        "hinge on a line": lambda v: c * v + 2 * a * np.maximum(v - at, 0.0),
    }
    name = list(every)[int(rng.integers(len(every)))]
    return name, every[name]


def braked_log(rng: np.random.Generator, drag: Callable[[Array], Array], seconds: int = 20) -> hc.Log:
    """A cart with a known brake of 4/s besides, pushed to speeds of 0.1 to 1.9 m/s, 0.5 to 4 % noise."""
    wanted = rng.uniform(0.1, 1.9, seconds)
    push, v, seen = np.repeat(4.0 * wanted + drag(wanted), 10), 1.0, list[float]()
    for force in push:
        seen.append(v)
        for _ in range(50):
            v += 0.002 * (force - 4.0 * v - float(drag(np.array(v))))
    rows = np.array(seen)
    noise = np.exp(rng.uniform(np.log(0.005), np.log(0.04))) * np.ptp(rows)
    return hc.Log(
        "run", np.arange(rows.size) / 10, {"v": rows + noise * rng.normal(size=rows.size), "F": push}
    )


def function_of(block: hc.Block, log: hc.Log) -> FittedFunction:
    """The only unknown function of a Block, as a log shows it."""
    model = hc.BlockModel(block)
    data = gather(with_constants(as_model(block)), [log]).joined
    fit, tables = tabulated(model, data, ())
    return named_forms(model, fit, tables, lambda what: None)[0]


def calibration(cases: int, every: bool, seed: int) -> None:
    """Print the share right and the share of table nodes within two errors, by the probability stated."""
    v, F, k = hc.Signal("v", "m/s"), hc.Signal("F", "m/s^2"), hc.Signal("k", "1/s", start=4.0)
    k = replace(k, lower=4.0, upper=4.0)  # known
    drag_of, log_of = (any_form, braked_log) if every else (forms, cart_log)
    known = [k] if every else []
    slope = F.symbol - hc.unknown("drag", ["v"], "m/s^2") - (k.symbol * v.symbol if every else 0)
    block = hc.Block("cart", [v], [F], [v], known, {"v": slope})
    said, right, nodes, begin = list[float](), list[bool](), list[float](), time.process_time()
    for case in range(cases):
        rng = np.random.default_rng([SEED, seed + case])
        name, drag = drag_of(rng)
        try:
            found = function_of(block, log_of(rng, drag))
        except hc.InputError as error:
            print(f"{case}: {name}: refused: {error}", flush=True)
            continue
        best = found.forms[0]
        said.append(best.probability)
        right.append(_named(best.name) == name)
        nodes += (np.abs(found.values - drag(found.grid)) < 2.0 * found.std).tolist()
        own = next((f.probability for f in found.forms if _named(f.name) == name), 0.0)
        print(f"{case}: {name}: {best} ({best.probability:.0%}); its own {own:.0%}", flush=True)
    p, hit = np.array(said), np.array(right)
    for low, high in ((0.0, 0.4), (0.4, 0.6), (0.6, 0.8), (0.8, 0.9), (0.9, 1.01)):
        own = (p >= low) & (p < high)
        if own.any():
            means = f"said {p[own].mean():.0%} on average, right {hit[own].mean():.0%}"
            print(f"said {low:.0%} to {min(high, 1.0):.0%}: {own.sum()} cases, {means}")
    seconds = (time.process_time() - begin) / max(p.size, 1)
    print(f"all {p.size}: said {p.mean():.0%} on average, right {hit.mean():.0%}; {seconds:.1f} s a case")
    print(f"values of tables within two errors: {np.mean(nodes):.0%}")


def _named(form: str) -> str:
    """The name of a form among those that are the same above zero."""
    plain = form.removeprefix("signed ")
    return ALIKE.get(plain, plain)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("what", choices=["bioreactor", "forms", "experiment"])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--cases", type=int, default=0, help="default: 100 of forms, 10 of experiment")
    parser.add_argument("--published", action="store_true", help="bioreactor: C_s alone, once an hour")
    parser.add_argument("--every", action="store_true", help="draw from all forms")
    parser.add_argument("--seed", type=int, default=1000, help="of the first case of forms")
    options = parser.parse_args()
    if options.what == "bioreactor":
        bioreactor(options.seeds, options.published)
    elif options.what == "experiment":
        settling(options.cases or 10)
    else:
        calibration(options.cases or 100, options.every, options.seed)


if __name__ == "__main__":
    main()
