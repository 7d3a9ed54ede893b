"""An FMU as a model: estimates within two errors, effects named, cost of a fit.

The FMUs are exported here (a machine with drag, a craft of six states) or written by hand in C (an
oscillator, a ball that bounces, a decay in fixed steps). The true runs of the craft and of those written by
hand come from their equations: in closed form, or by SciPy's DOP853 at 1e-10. Standard error shows each case
as it ends.
"""

from __future__ import annotations

import math
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

import hovercontrol as hc
from hovercontrol.control.analysis.intervals import clopper_pearson
from hovercontrol.identification.identify.fmu import FmuIdentified
from tests.fmi.test_written import ball
from tests.fmi.written import written_fmu

Array = NDArray[np.float64]
Row = tuple[str, str, str, bool | None]

#: With 1000 the share of an estimator that is right at 95 % has a standard error of 0.7 %.
RUNS = 1000
NOISE = 0.01
#: Cases with nothing missing, and cases of each effect.
SOUND, EACH = 50, 17


def motor() -> hc.Block:
    """Return a first-order machine with quadratic drag."""
    v, u = hc.Signal("v", "m/s"), hc.Signal("u", "V")
    k, b = hc.Signal("k", "m/s^2/V", start=2.0), hc.Signal("b", "1/m", start=0.8)
    slope = k.symbol * u.symbol - b.symbol * v.symbol * abs(v.symbol)
    return hc.Block("motor", (v,), (u,), (v,), (k, b), {"v": slope})


def counted(what: str, hits: int, runs: int, bar: str, low: float, high: float = 1.0) -> Row:
    """Return a row on a share with its Clopper-Pearson interval at 95 %."""
    a, b = (float(x) for x in clopper_pearson(hits, runs))
    share = hits / runs
    return what, f"{share:.1%} ({hits} of {runs}) [{a:.0%}, {b:.0%}]", bar, low <= share <= high


def ended(*what: object) -> None:
    """Show a case that has ended."""
    print(*what, file=sys.stderr, flush=True)


def fitted(kind: str, seed: int, found: FmuIdentified, true: Mapping[str, float]) -> dict[str, bool]:
    """Show the estimates of a run, and return whether each is within two standard errors."""
    off = {name: (found[name].value - value) / found[name].std for name, value in true.items()}
    values = ", ".join(
        f"{name} = {found[name].value:.9g} +- {found[name].std:.3g} ({off[name]:+.2f} std)" for name in true
    )
    ended(kind, seed, values)
    return {name: abs(z) <= 2.0 for name, z in off.items()}


def motors(folder: Path) -> Iterator[Row]:
    """Yield how often the drag of a machine is within two errors."""
    block = motor()
    path = block.to_fmu(folder / "motor.fmu", version=2)
    t = 0.02 * np.arange(1000, dtype=float)
    for kind in ("ModelExchange", "CoSimulation"):
        hits, begin = 0, time.perf_counter()
        plant = hc.fmu_plant(path, ["motor.b"], kind=kind, values={"motor.b": 1.1}, isolated=False)
        for seed in range(RUNS):
            rng = np.random.default_rng(seed)
            u = np.repeat(rng.uniform(-2.0, 2.0, 20), 50)
            seen = np.asarray(hc.simulate(block, t, {"u": u}).outputs, dtype=float).reshape(-1)
            log = hc.Log("run", t, {"u": u, "v": seen + NOISE * rng.normal(size=t.size)})
            found = hc.identify(plant, [log])
            hits += fitted(kind, seed, found, {"motor.b": 0.8})["motor.b"]
        plant.close()
        each = (time.perf_counter() - begin) / RUNS
        yield counted(f"{kind}: b within two errors", hits, RUNS, "93-97 %", 0.93, 0.97)
        yield f"{kind}: a fit of one parameter, 1000 rows", f"{each:.2f} s", "", None


# ---- FMUs written by hand in C (tests/fmi/models) ----


@dataclass(frozen=True)
class Written:
    """An FMU with its true run.

    Attributes
    ----------
    name, kind : str
        Of the FMU, and its interface.
    true : mapping of str to float
        Values of its parameters in the runs; the fits begin at the FMU's own.
    run : callable
        Of a seed: time [s], inputs and the exact output by name.
    output : str
    """

    name: str
    kind: Literal["ModelExchange", "CoSimulation"]
    true: Mapping[str, float]
    run: Callable[[int], tuple[Array, dict[str, Array], Array]]
    output: str


def oscillator(_seed: int) -> tuple[Array, dict[str, Array], Array]:
    """Return the oscillator of Van der Pol, ``x'' = mu (1 - x^2) x' - x``, by SciPy's DOP853."""
    t, mu = 0.02 * np.arange(400, dtype=float), WRITTEN[0].true["mu"]
    run = solve_ivp(
        lambda t, x: [x[1], mu * (1 - x[0] ** 2) * x[1] - x[0]], (0.0, t[-1]), [2.0, 0.0], "DOP853", t,
        rtol=1e-10, atol=1e-12,
    )  # fmt: skip
    return t, {}, np.asarray(run.y[0])


def bounced(_seed: int) -> tuple[Array, dict[str, Array], Array]:
    """Return the height of a ball that bounces, its parabolas in closed form."""
    t, true = 0.01 * np.arange(200, dtype=float), WRITTEN[1].true
    return t, {}, np.asarray(ball(t, true["g"], true["e"]))


def decayed(seed: int) -> tuple[Array, dict[str, Array], Array]:
    """Return ``x' = u - k x`` (Dahlquist) in the Euler steps of 0.1 s that the FMU takes."""
    u = np.repeat(np.random.default_rng(1000 + seed).uniform(-1.0, 1.0, 10), 10)
    x = [1.0]
    for now in u[:-1]:
        x.append(x[-1] + 0.1 * (now - WRITTEN[2].true["k"] * x[-1]))
    return 0.1 * np.arange(100, dtype=float), {"u": u}, np.array(x)


WRITTEN = (
    Written("van_der_pol", "ModelExchange", {"mu": 1.5}, oscillator, "x"),
    Written("bouncing_ball", "ModelExchange", {"g": 9.6, "e": 0.75}, bounced, "h"),
    Written("dahlquist", "CoSimulation", {"k": 1.4}, decayed, "x"),
)


def by_closed_form(seen: Array) -> bool:
    """Return whether g of the ball is within two errors in a least-squares fit of its parabolas.

    The unknowns are those of the FMU's fit: g, e, and height and speed at the first row. A ball thrown up at
    v from h is one that is dropped from h + v^2/2g at the time v/g.
    """
    t, true = 0.01 * np.arange(200, dtype=float), WRITTEN[1].true

    def off(p: Array) -> Array:
        g, e, h, v = p
        return np.asarray((seen - ball(t - v / g, g, e, h + v**2 / (2.0 * g))) / NOISE)

    begin = [true["g"], true["e"], 1.0, 0.0]
    fit = least_squares(off, begin, x_scale=[1.0, 0.1, 0.1, 0.1], diff_step=1e-7)
    C = np.linalg.inv(fit.jac.T @ fit.jac) * 2.0 * fit.cost / (t.size - len(begin))
    return bool(abs(fit.x[0] - true["g"]) <= 2.0 * math.sqrt(C[0, 0]))


def written(folder: Path) -> Iterator[Row]:
    """Yield how near the parameters are on clean logs, and how often within two errors on noisy ones."""
    for one in WRITTEN:
        own = folder / one.name
        own.mkdir()
        plant = hc.fmu_plant(written_fmu(one.name, own), list(one.true), kind=one.kind, isolated=False)
        t, inputs, exact = one.run(0)
        found = hc.identify(plant, [hc.Log("clean", t, {**inputs, one.output: exact})])
        off = max(abs(found[name].value / true - 1.0) for name, true in one.true.items())
        yield f"{one.name}: a clean log, furthest parameter off", f"{off:.1e}", "1 %", off <= 0.01
        hits, begin, exactly = dict.fromkeys(one.true, 0), time.perf_counter(), 0
        for seed in range(RUNS):
            t, inputs, exact = one.run(seed)
            seen = exact + NOISE * np.random.default_rng(seed).normal(size=t.size)
            found = hc.identify(plant, [hc.Log("run", t, {**inputs, one.output: seen})])
            exactly += one.name == "bouncing_ball" and by_closed_form(seen)
            for name, within in fitted(one.name, seed, found, one.true).items():
                hits[name] += within
        plant.close()
        for name, count in hits.items():
            yield counted(f"{one.name}: {name} within two errors", count, RUNS, "93-97 %", 0.93, 0.97)
        if exactly:
            yield counted(f"{one.name}: g by least squares, closed form", exactly, RUNS, "", 0.0)
        each = (time.perf_counter() - begin) / RUNS
        yield f"{one.name}: a fit of {len(one.true)}, {len(t)} rows", f"{each:.2f} s", "", None


# ---- effects around a craft of six states ----

#: Coefficients of the craft: drags [1/s], thrust [m/s^2], torque of the rudder [rad/s^2].
DRAG, THRUST, TORQUE = (0.6, 1.2, 1.0), 0.75, 6.1425
SPREAD = {"x": 5e-3, "y": 5e-3, "psi": 2e-3, "u": 5e-3, "v": 5e-3, "r": 5e-3}
PERIOD, ROWS, SETTLING = 0.02, 2000, 0.08

#: Planted effects: place, name as it is reported, and its size.
PLANTED = {
    "delay before": ("before", "input_delay", 0.1),
    "lag before": ("before", "thrust_lag", 0.25),
    "dead zone before": ("before", "rudder_deadzone", 0.06),
    "offset before": ("before", "rudder_offset", 0.04),
    "bias after": ("after", "r_bias", 0.01),
    "lag after": ("after", "r_lag", SETTLING),
}


def moved(t: float, s: Array, given: Array, planted: str) -> Array:
    """Return the slopes of a rudder craft (K06), of the lag of its thrust and of a sensor's lag, by hand."""
    _x, _y, psi, u, v, r, lagged, sensed = s
    thrust, rudder = (lagged if planted == "lag before" else given[0]), given[1]
    if planted == "dead zone before":
        rudder = math.copysign(max(abs(rudder) - PLANTED[planted][2], 0.0), rudder)
    if planted == "offset before":
        rudder += PLANTED[planted][2]
    a, b, c = DRAG
    return np.array([
        u * math.cos(psi) - v * math.sin(psi),
        u * math.sin(psi) + v * math.cos(psi),
        r,
        THRUST * thrust * math.cos(rudder) + r * v - a * u,
        THRUST * thrust * math.sin(rudder) - r * u - b * v,
        -TORQUE * thrust * math.sin(rudder) - c * r,
        (given[0] - lagged) / PLANTED["lag before"][2],
        (r - sensed) / SETTLING,
    ])  # fmt: skip


def voyage(seed: int, planted: str = "", rows: int = ROWS, period: float = PERIOD) -> hc.Log:
    """Return a log of the craft with an effect planted, its truth by SciPy."""
    rng, t = np.random.default_rng(seed), period * np.arange(rows, dtype=float)
    given = np.stack(
        [
            np.repeat(rng.uniform(0.5, 2.5, rows // 50), 50),
            np.repeat(rng.uniform(-0.5, 0.5, rows // 25), 25),
        ],
        axis=1,
    )
    late = round(PLANTED["delay before"][2] / period) if planted == "delay before" else 0
    applied = np.vstack([np.repeat(given[:1], late, axis=0), given[: rows - late]])
    s, path = np.zeros(8), []
    s[6] = given[0, 0]
    for k in range(rows):
        path.append(s)
        if k + 1 < rows:
            run = solve_ivp(
                moved, (t[k], t[k + 1]), s, "DOP853", args=(applied[k], planted), rtol=1e-10, atol=1e-12
            )
            s = run.y[:, -1]
    true = dict(zip(SPREAD, np.array(path).T[:6], strict=True))
    if planted == "lag after":
        true["r"] = np.array(path).T[7]
    if planted == "bias after":
        true["r"] = true["r"] + PLANTED[planted][2]
    seen = {n: y + SPREAD[n] * rng.normal(size=rows) for n, y in true.items()}
    return hc.Log(f"run {seed}", t, {"thrust": given[:, 0], "rudder": given[:, 1], **seen})


def craft(folder: Path) -> Path:
    """Return the FMU of the craft."""
    values = dict(zip(("surge_linear_drag", "sway_linear_drag", "yaw_linear_drag"), DRAG, strict=True))
    values |= {"surge_coulomb": 0.0, "yaw_coulomb": 0.0}
    block = hc.vehicle("c17_simulation").plant().with_values(values)
    return block.to_fmu(folder / "craft.fmu", version=2)


def diagnoses(folder: Path) -> Iterator[Row]:
    """Yield how often a planted effect is named, and how often one that is not there."""
    plant = hc.fmu_plant(craft(folder), ["plant.sway_linear_drag"], isolated=False)
    false, unsound, none, begin = 0, 0, 0, time.perf_counter()
    for seed in range(SOUND):
        found = hc.diagnose(plant, [voyage(seed)])
        ended("nothing planted", seed, found.verdict, *found.effects)
        false += bool(found.effects)
        none += found.verdict == "none"
    yield counted("nothing planted: an effect named", false, SOUND, "0", 0.0, 0.0)
    yield counted("nothing planted: verdict none", none, SOUND, "", 0.0)
    hits, within, wrong = 0, 0, list[str]()
    for k, (case, (place, name, true)) in enumerate(PLANTED.items()):
        own = 0
        for seed in range(EACH):
            found = hc.diagnose(plant, [voyage(100 * (k + 1) + seed, case)])
            ended(case, seed, found.verdict, *found.effects)
            named = [e for e in found.effects if (e.place, e.effect) == (place, name)]
            own += bool(named)
            others = [e for e in found.effects if (e.place, e.effect) != (place, name)]
            wrong += [f"{case}: {e}" for e in others]
            unsound += bool(others) and found.verdict in ("effect", "partial")
            if named:
                value, std = next(iter(named[0].numbers.values())), next(iter(named[0].std.values()))
                within += abs(value - true) <= 2.0 * std
        hits += own
        yield f"{case}: named", f"{own} of {EACH}", "", None
    count = EACH * len(PLANTED)
    yield counted("planted: named", hits, count, ">= 90 %", 0.9)
    yield counted("planted: size within two errors", within, hits or 1, "", 0.0)
    yield counted("planted: another effect named with confidence", unsound, count, "0", 0.0, 0.0)
    for line in wrong:
        yield "another effect", line, "", None
    each = (time.perf_counter() - begin) / (SOUND + count)
    yield "one diagnosis of 2000 rows of six channels", f"{each:.1f} s", "", None
    log = voyage(7, rows=6000, period=0.01)
    begin = time.perf_counter()
    hc.identify(plant, [log])
    each = time.perf_counter() - begin
    yield "a fit of one parameter, 60 s at 100 Hz, six states", f"{each:.1f} s", "<= 10 s", each <= 10.0
    plant.close()


def rows() -> Iterator[Row]:
    """Yield what was measured, its value, the bar, and whether it is met."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        yield from motors(folder)
        yield from written(folder)
        yield from diagnoses(folder)
