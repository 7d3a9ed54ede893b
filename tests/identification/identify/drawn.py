"""Coefficients of incomplete models: ``python -m tests.identification.identify.drawn``.

Each case simulates a machine that has one effect of the catalogue, or none, which its model lacks, and
identifies the model from the log. Five machines: a rudder craft, a craft of six fans, a motor, a pendulum, a
car. A coefficient is *wrong* where it is off by more than three of its noise's standard errors and by more
than 2 %; it is wrong *without a word* where the printed standard error does not cover that either and its row
says nothing. Cases are written to a CSV file as they come, so that a run that was stopped goes on.
"""

from __future__ import annotations

import argparse
import csv
import zlib
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

import numpy as np
import sympy as sp

import hovercontrol as hc
from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.craft.models.model import Model
from hovercontrol.identification.identify import identify
from hovercontrol.logs import Log
from tests.identification.diagnose.generator import FANS, SIZES, Conditions, make, mild
from tests.identification.diagnose.imperfect import Key

Random = np.random.Generator
Sizes = Mapping[str, float]

#: Standard errors beyond which a coefficient is off, and the part of it that matters to a prediction.
FAR, MATTERS = 3.0, 0.02


@dataclass(frozen=True)
class Row:
    """One coefficient of one case."""

    machine: str
    hidden: str
    seed: int
    coefficient: str
    truth: float
    value: float
    noise_std: float
    std: float
    readings: str
    remarked: bool
    seconds: float

    @property
    def off(self) -> float:
        """The error in standard errors of a complete model."""
        return abs(self.value - self.truth) / self.noise_std

    @property
    def wrong(self) -> bool:
        return self.off > FAR and abs(self.value - self.truth) > MATTERS * abs(self.truth)

    @property
    def silent(self) -> bool:
        """Whether it is wrong and neither its row nor its standard error says so."""
        return self.wrong and abs(self.value - self.truth) > FAR * self.std and not self.remarked


# ---- machines ------------------------------------------------------------------------------------------


def motor() -> hc.Block:
    S = hc.Signal
    v, u = S("speed", "rad/s"), S("volt", "V")
    k, d = S("gain", "rad/(s^2*V)", start=12.0), S("damping", "1/s", start=3.0)
    return hc.Block("motor", [v], [u], [v], [k, d], {"speed": k.symbol * u.symbol - d.symbol * v.symbol})


def pendulum() -> hc.Block:
    S = hc.Signal
    q, w, u = S("angle", "rad"), S("rate", "rad/s"), S("torque", "N*m")
    g, d = S("gravity", "1/s^2", start=14.0), S("damping", "1/s", start=0.4)
    b = S("gain", "1/(kg*m^2)", start=25.0)
    slope = b.symbol * u.symbol - g.symbol * sp.sin(q.symbol) - d.symbol * w.symbol
    return hc.Block("pendulum", [q, w], [u], [q], [g, d, b], {"angle": w.symbol, "rate": slope})


def car() -> hc.Block:
    S = hc.Signal
    v, h = S("speed", "m/s"), S("heading", "rad")
    drive, steer = S("drive", "1"), S("steer", "rad")
    k, d = S("pull", "m/s^2", start=4.0), S("drag", "1/s", start=0.8)
    length = S("per_length", "1/m", start=2.2)
    return hc.Block(
        "car", [v, h], [drive, steer], [v, h], [k, d, length],
        {
            "speed": k.symbol * drive.symbol - d.symbol * v.symbol,
            "heading": length.symbol * v.symbol * sp.tan(steer.symbol),
        },
    )  # fmt: skip


@dataclass(frozen=True)
class Machine:
    """A Block, what it may lack, how it is driven and measured."""

    block: Callable[[], hc.Block]
    lacks: Mapping[str, Sizes]
    inputs: Mapping[str, tuple[float, float]]
    noise: Sizes
    dt: float
    hold: tuple[float, float]


MACHINES = {
    "motor": Machine(
        motor,
        {
            "volt_deadzone": {"width": 0.4}, "volt_lag": {"seconds": 0.08}, "speed_coulomb": {"value": 3.0},
            "volt_saturation": {"limit": 2.6}, "speed_quadratic_drag": {"value": 0.2}, "delay": {"rows": 4},
            "speed_offset": {"value": 2.0},
        },
        {"volt": (-4.0, 4.0)}, {"speed": 0.05}, 0.01, (0.2, 1.0),
    ),
    "pendulum": Machine(
        pendulum,
        {
            "rate_coulomb": {"value": 0.4}, "torque_lag": {"seconds": 0.06}, "delay": {"rows": 3},
            "torque_deadzone": {"width": 0.05}, "rate_quadratic_drag": {"value": 0.2},
            "angle_bias": {"value": 0.05},
        },
        {"torque": (-0.5, 0.5)}, {"angle": 2e-3}, 0.01, (0.2, 1.5),
    ),
    "car": Machine(
        car,
        {
            "steer_lag": {"seconds": 0.12}, "drive_lag": {"seconds": 0.15}, "delay": {"rows": 3},
            "drive_deadzone": {"width": 0.1}, "speed_coulomb": {"value": 0.3},
            "steer_backlash": {"width": 0.05},
        },
        {"drive": (-0.2, 1.0), "steer": (-0.35, 0.35)}, {"speed": 0.01, "heading": 2e-3}, 0.02, (0.3, 1.5),
    ),
}  # fmt: skip


def run_of_block(name: str, hidden: str, seed: int) -> tuple[hc.Block, Log, dict[str, float]]:
    """Return the Block that is identified, a log, and the true coefficients."""
    of = MACHINES[name]
    rng = np.random.default_rng([seed, zlib.crc32(f"{name} {hidden}".encode())])
    given = of.block()
    truth = {p.name.rpartition(".")[2]: p.start * rng.uniform(0.8, 1.25) for p in given.parameters}
    model = BlockModel(given.with_values(truth))
    late = 0
    if hidden == "delay":
        late = int(of.lacks[hidden]["rows"])
    elif hidden:
        sizes = {k: v * rng.uniform(0.7, 1.4) for k, v in of.lacks[hidden].items()}
        model = model.with_effects([model.effect_class(hidden)(**sizes)])
    t = np.arange(0.0, 40.0, of.dt)
    inputs = {}
    for signal, span in of.inputs.items():
        held = np.repeat(rng.uniform(*span, 400), (rng.uniform(*of.hold, 400) / of.dt).astype(int))
        inputs[signal] = held[: t.size] + 0.01 * (span[1] - span[0]) * rng.normal(size=t.size)
    acted = [np.r_[np.full(late, u[0]), u[: u.size - late]] for u in inputs.values()]
    run = model.plant().compile(friction="smooth").simulate(t, acted, rtol=1e-7, atol=1e-9)
    y = dict(zip(run.output_labels, np.atleast_2d(run.outputs), strict=True))
    seen = {c: y.get(f"{c}_measured", y[c]) + s * rng.normal(size=t.size) for c, s in of.noise.items()}
    return given, Log(name, t, {**inputs, **seen}), truth


def run_of_craft(hidden: str, seed: int) -> tuple[Model, Log, dict[str, float]]:
    """Return a rudder craft whose widths of friction are known, a log and the true coefficients."""
    conditions = Conditions(duration=40.0, logs=1)
    if seed % 2:
        conditions = replace(conditions, commands=mild)
    case = make(7000 + seed, (hidden,) if hidden else (), conditions)
    truth = case.truth.coefficients()
    widths = {k: v for k, v in truth.items() if k.endswith("_width") and k in case.model.coefficients()}
    return case.model.with_coefficients(widths), case.logs[0], truth


def run_of_fans(hidden: str, seed: int) -> tuple[Model, Log, dict[str, float]]:
    case = Key("rest", hidden, "", "fans", 50 + seed).case()
    return case.model, case.logs[0], case.truth.coefficients()


# ---- cases ---------------------------------------------------------------------------------------------


def cases(count: int) -> Iterator[tuple[str, str, int]]:
    """Yield machine, hidden effect (empty: none) and seed, each kind of machine in turn."""
    lists = {
        "craft": ["", *SIZES],
        "fans": ["", *FANS],
        **{name: ["", *of.lacks] for name, of in MACHINES.items()},
    }
    for k in range(count):
        machine = ("craft", "fans", "craft", "motor", "pendulum", "car")[k % 6]
        of = lists[machine]
        number = k // 6 * 2 + (k % 6 == 2) if machine == "craft" else k // 6
        yield machine, of[number % len(of)], k


def tried(machine: str, hidden: str, seed: int) -> list[Row]:
    """Return the coefficients of one case."""
    import time

    make_case = {"craft": run_of_craft, "fans": run_of_fans}
    model, log, truth = (
        make_case[machine](hidden, seed) if machine in make_case else run_of_block(machine, hidden, seed)
    )
    begin = time.perf_counter()
    found = identify(model, [log])
    seconds = round(time.perf_counter() - begin, 2)
    return [
        Row(
            machine, hidden, seed, c.name, truth[c.name], c.value, c.noise_std, c.std,
            "; ".join(map(str, c.readings)), bool(c.readings or c.reason or c.bound), seconds,
        )
        for c in found.coefficients
    ]  # fmt: skip


def read(path: Path) -> list[Row]:
    """Return the rows of an earlier run."""
    if not path.exists():
        return []
    kinds = {"seed": int, "remarked": lambda text: text == "True"}
    kinds |= dict.fromkeys(("truth", "value", "noise_std", "std", "seconds"), float)
    with path.open(newline="") as stream:
        return [Row(**{k: kinds.get(k, str)(v) for k, v in row.items()}) for row in csv.DictReader(stream)]


def summary(rows: list[Row]) -> list[str]:
    """Return the figures of the table."""
    kept = [r for r in rows if np.isfinite(r.noise_std)]
    lacking, whole = [r for r in kept if r.hidden], [r for r in kept if not r.hidden]
    wrong, silent = [r for r in lacking if r.wrong], [r for r in lacking if r.silent]
    right = [r for r in lacking if not r.wrong]
    width = np.array([r.std / r.noise_std for r in whole])
    inside = np.array([abs(r.value - r.truth) < 1.96 * r.std for r in whole])
    n, m = len({r.seed for r in rows}), len({r.seed for r in whole})
    lines = [
        f"{n} logs, {m} of them of a complete model; {len(kept)} coefficients",
        f"one effect missing: {len(lacking)} coefficients, {len(wrong)} wrong, {len(silent)} of them"
        f" without a word ({100 * len(silent) / max(len(lacking), 1):.1f} % of all)",
        f"right ones with a word: {sum(bool(r.readings) for r in right)} of {len(right)}",
    ]
    if whole:
        lines += [
            f"nothing missing: intervals {width.mean():.3f} times as wide as noise alone says (largest"
            f" {width.max():.2f}), {sum(bool(r.readings) for r in whole)} of {len(whole)} with a word,"
            f" {100 * inside.mean():.1f} % cover the truth at 95 %"
        ]
    seconds = [next(r.seconds for r in rows if r.seed == seed) for seed in sorted({r.seed for r in rows})]
    lines.append(f"seconds a log: median {np.median(seconds):.1f}, longest {max(seconds):.1f}")
    lines += [
        f"  without a word: {r.machine} {r.hidden} {r.seed}: {r.coefficient} {r.value:.4g} +- {r.std:.2g},"
        f" truth {r.truth:.4g}"
        for r in silent
    ]
    return lines


def main() -> int:
    parser = argparse.ArgumentParser(description="Coefficients of incomplete models.")
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("out/drawn/drawn.csv"))
    given = parser.parse_args()
    rows = read(given.out)
    done = {r.seed for r in rows}
    todo = [case for case in cases(given.cases) if case[2] not in done]
    given.out.parent.mkdir(parents=True, exist_ok=True)
    with given.out.open("a", newline="") as stream, ProcessPoolExecutor(given.jobs) as pool:
        out = csv.DictWriter(stream, [f.name for f in fields(Row)])
        if not rows:
            out.writeheader()
        for future in as_completed([pool.submit(tried, *case) for case in todo]):
            own = future.result()
            rows += own
            out.writerows(asdict(r) for r in own)
            stream.flush()
    print("\n".join(summary(rows)))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
