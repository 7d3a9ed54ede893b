"""Machines that anyone may write as a Block: ``identify`` and ``diagnose`` on logs simulated by hand.

``python -m benchmarks.own_machines`` draws machines of each family at random (parameters within a factor of
1.3 of usual values), gives a model whose parameters are 5 % off, and prints how errors compare with standard
errors, how often the verdict is right, and each wrong case. ``--hidden`` hides one effect in each.
``--against`` compares with the maximum of a Kalman filter's likelihood, both written by hand. A verdict is
right if no effect is named where none is hidden, and if it is ``none`` where nothing pushes the machine. Of
each case that is not right the same likelihood says how much the truth gains over the model: commands as they
acted, the hidden force as it was, the channel without its bias.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

import hovercontrol as hc
from benchmarks.own_machines_families import FAMILIES, PARTS, Family, Values
from benchmarks.own_machines_likelihood import by_hand

Array = NDArray[np.float64]

#: Number of rows of a log and of a held-out log, and error of the given parameters.
ROWS, HELD_OUT, OFF = 1000, 500, 0.05

#: Added to the seed of a machine for that of its held-out log.
HELD_OUT_SEED = 1000

#: Gain in twice the log likelihood that ``diagnose`` asks of an effect with one coefficient.
ASKED = 24.0

HIDDEN = ("coulomb", "quadratic_drag", "delay", "deadzone", "saturation", "backlash", "bias")


@dataclass
class Case:
    """What came of one machine."""

    family: Family
    seed: int
    hidden: str
    errors: dict[str, float] = field(default_factory=dict)  # in standard errors
    apart: dict[str, float] = field(default_factory=dict)  # from the likelihood by hand
    text: str = ""
    verdict: str = ""
    right: bool = True
    false: bool = False
    shown: float = np.inf  # what the truth gains in twice the log likelihood, of cases that are not right
    seconds: float = 0.0


def drawn(family: Family, seed: int) -> tuple[dict[str, float], dict[str, float]]:
    """Return the true parameters of a machine, and those of the model."""
    rng = np.random.default_rng([seed, 1])
    true = {n: v * 1.3 ** rng.uniform(-1.0, 1.0) for n, (v, _) in family.parameters.items()}
    if family.period or not family.stable:  # a third more would make one unstable, or another law needed
        true = {n: v * 1.05 ** rng.uniform(-1.0, 1.0) for n, (v, _) in family.parameters.items()}
    return true, {n: v * (1.0 + OFF * rng.choice([-1.0, 1.0])) for n, v in true.items()}


def reference(family: Family, seed: int, rows: int) -> Array:
    """Return steps of random size and length, shape (rows, n_inputs)."""
    rng = np.random.default_rng([seed, 2])
    found = np.empty((rows, len(family.inputs)))
    for column in found.T:
        at = 0
        while at < rows:
            last = int(rng.integers(5, 60))
            column[at : at + last] = family.offset + family.size * rng.uniform(-1.0, 1.0)
            at += last
    return found


def force_state(family: Family) -> str:
    """Return the velocity in whose equation hidden forces act."""
    return next((n for n, unit in reversed(list(family.states.items())) if unit in ("m/s", "rad/s")), "")


def simulated(family: Family, p: Values, seed: int, rows: int, hidden: str = "") -> hc.Log:
    """Return a log of a machine in which one effect may be hidden."""
    return simulated_twice(family, p, seed, rows, hidden)[0]


def simulated_twice(
    family: Family, p: Values, seed: int, rows: int, hidden: str = ""
) -> tuple[hc.Log, hc.Log]:
    """Return a log, and the same with what acted: the commands, the hidden force (``force``), no bias."""
    rng = np.random.default_rng([seed, 3])
    names, h = list(family.states), family.step / PARTS
    r, x = reference(family, seed, rows), np.array(family.start or [0.0] * len(names))
    sigma = np.array([family.pushed.get(n, 0.0) for n in names])
    force = names.index(force_state(family)) if force_state(family) else 0
    y, u, acted, memory, play = [], [], [], np.empty(0), np.zeros(r.shape[1])
    reached, forces = [], []
    most = np.full(r.shape[1], family.size)
    if hidden and family.law:  # uniform numbers up to b have the standard deviation b/3^(1/2)
        without = simulated(family, p, seed % HELD_OUT_SEED, ROWS)  # of both logs: it is one machine
        most = np.array([np.sqrt(3.0) * without[c].std() for c in family.inputs])
    at = [names.index(n) for n in family.measured]

    def slopes(x: Array, v: Array) -> Array:
        found = family.rate(x, v, p)
        if hidden == "coulomb":
            found[force] -= 0.1 * push * np.tanh(x[force] / 1e-3)
        if hidden == "quadratic_drag":
            found[force] -= 0.3 * push * x[force] * abs(x[force]) / typical**2
        return found

    # Size of a force: the rate under the full input
    some = np.array(family.start or [0.0] * len(names))
    full = family.rate(some, family.offset + most, p)
    for _ in range(3 if family.period else 3 * PARTS):  # until the input has reached the equation
        some = some + (family.step if family.period else h) * full
        full = family.rate(some, family.offset + most, p)
    push = abs(full[force])
    typical = max(float(np.abs(some[force])), 1e-6) * 3.0
    for k in range(rows):
        seen = x[at] + (family.noise * rng.normal(size=len(at)) if family.law else 0.0)
        v = r[k]
        if family.law:
            v, memory = family.law(seen, memory, float(r[k, 0]))
        y.append(seen)
        u.append(v)
        acted.append(v)
        v = (acted[k - 3] if k > 2 else np.full(v.shape, family.offset)) if hidden == "delay" else v
        v = v if hidden != "deadzone" else np.sign(v) * np.maximum(np.abs(v) - 0.2 * most, 0.0)
        v = v if hidden != "saturation" else np.clip(v, -0.5 * most, 0.5 * most)
        if hidden == "backlash":
            play = np.clip(play, v - 0.15 * most, v + 0.15 * most)
            v = play
        reached.append(v)
        forces.append(slopes(x, v)[force] - family.rate(x, v, p)[force])
        if family.period:
            x = x + family.step * slopes(x, v) + sigma * rng.normal(size=len(x))
            continue
        for _ in range(PARTS):
            a = slopes(x, v)
            b = slopes(x + 0.5 * h * a, v)
            c = slopes(x + 0.5 * h * b, v)
            d = slopes(x + h * c, v)
            x = x + h * ((a + 2.0 * b + 2.0 * c + d) / 6.0) + sigma * np.sqrt(h) * rng.normal(size=len(x))
    Y, U = np.array(y), np.array(u)
    if not np.abs(x).max() < 1e3 * max(np.abs(family.start or [0.0]).max(), 1.0) * max(family.size, 1.0):
        raise FloatingPointError("the machine falls over")
    if not family.law:
        Y = Y + family.noise * Y.std(axis=0) * rng.normal(size=Y.shape)
    t = np.arange(0.0, rows) * family.step
    truth = dict(zip(family.measured, Y.copy().T, strict=True)) | {"force": np.array(forces)}
    truth |= dict(zip(family.inputs, np.array(reached).T, strict=True))
    if hidden == "bias":
        Y[:, 0] += 0.3 * Y[:, 0].std()
    columns = dict(zip(family.measured, Y.T, strict=True)) | dict(zip(family.inputs, U.T, strict=True))
    return hc.Log(f"{family.name} {seed}", t, columns), hc.Log("as it was", t, truth)


def with_force(family: Family) -> Family:
    """Return the family with one more input, a rate of the velocity in whose equation hidden forces act."""
    unit = np.zeros(len(family.states))
    unit[list(family.states).index(force_state(family)) if force_state(family) else 0] = 1.0
    step = family.step if family.period else 1.0

    def slopes(x: Array, u: Array, p: Values) -> Array:
        return family.slopes(x, u[:-1], p) + step * u[-1] * unit.reshape(-1, *[1] * (x.ndim - 1))

    return replace(family, inputs={**family.inputs, "force": ""}, slopes=slopes)


def expected(family: Family, hidden: str) -> list[str]:
    """Return the names of a hidden effect; those of commands act on each input."""
    if hidden in ("coulomb", "quadratic_drag"):
        return [f"{force_state(family)}_{hidden}"]
    if hidden == "bias":
        return [f"{family.measured[0]}_bias"]
    return ["input_delay"] if hidden == "delay" else [f"{u}_{hidden}" for u in family.inputs]


def run(family: Family, seed: int, *, diagnosed: bool, hidden: str = "", against: bool = False) -> Case:
    """Return what comes of one machine."""
    case, begun = Case(family, seed, hidden), time.perf_counter()
    true, given = drawn(family, seed)
    log, truth = simulated_twice(family, true, seed, ROWS, hidden)
    block = family.block(given)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if not hidden:
            found = hc.identify(block, [log], fixed=list(family.known))
            for c in found.coefficients:
                if np.isfinite(c.std):
                    case.errors[c.name] = (c.value - true[c.name]) / c.std
            said = [f"{c.name} {c.value:.4g} +- {c.std:.2g} ({true[c.name]:.4g})" for c in found.coefficients]
            case.text = ", ".join(said)
            if against:
                for name, value in by_hand(family, log, true)[0].items():
                    case.apart[name] = (found[name].value - value) / found[name].noise_std
        if diagnosed or hidden:
            held_out = simulated(family, true, seed + HELD_OUT_SEED, HELD_OUT, hidden)
            result = hc.diagnose(block, [log], held_out, fixed=list(family.known))
            names = sorted(e.effect for e in result.effects)
            rivals = sorted(r.name for r in result.rivals)
            case.verdict = f"{result.verdict} {' + '.join(names)}" + (f" or {rivals}" if rivals else "")
            wanted = sorted(expected(family, hidden)) if hidden else []
            case.right = names == wanted or (bool(wanted) and set(wanted) <= {*names, *rivals})
            case.right &= bool(wanted or family.pushed or result.verdict == "none")
            if wanted and not case.right:
                case.shown = by_hand(family, log, true)[1] - by_hand(with_force(family), truth, true)[1]
            case.false = bool(set(names) - set(wanted)) and not (set(wanted) & set(rivals))
    case.seconds = time.perf_counter() - begun
    return case


def cases(
    families: Sequence[Family], seeds: Sequence[int], *, diagnosed: bool, hidden: bool, against: bool
) -> Iterator[Case]:
    """Run all machines; print those that are wrong or have a false name, and those that fail."""
    for seed in seeds:
        for k, family in enumerate(families):
            effect = HIDDEN[(seed + k) % len(HIDDEN)] if hidden else ""
            forceless = not force_state(family) and effect in HIDDEN[:2]
            if forceless or (not family.stable and effect == "saturation"):
                continue
            try:
                case = run(family, seed, diagnosed=diagnosed, hidden=effect, against=against)
            except (hc.InputError, FloatingPointError, np.linalg.LinAlgError) as error:
                print(f"    {family.name} {seed} {effect}: {error}", flush=True)
                continue
            far = max(map(abs, case.errors.values()), default=0.0) > 3.0
            far |= max(map(abs, case.apart.values()), default=0.0) > 0.1
            if far or not case.right or case.false:
                wanted = f" hidden {' + '.join(expected(family, effect))};" if effect else ""
                apart = {n: round(v, 2) for n, v in case.apart.items()}
                said = f"{case.verdict} {case.text} {apart or ''}"
                said += f"; the truth gains {case.shown:.0f}" if np.isfinite(case.shown) else ""
                print(f"    {family.name} {seed}:{wanted} {said}", flush=True)
            yield case


def figures(found: Sequence[Case]) -> Iterator[tuple[str, str, str, bool | None]]:
    """Yield lines of the table: by family, then of all."""
    every = np.array([e for c in found for e in c.errors.values()])
    for name in dict.fromkeys(c.family.name for c in found):
        own = [c for c in found if c.family.name == name]
        errors = np.array([e for c in own for e in c.errors.values()])
        seconds = np.median([c.seconds for c in own])
        said = f"mean {errors.mean():+.2f}, rms {np.sqrt(np.mean(errors**2)):.2f}; " if errors.size else ""
        right = f"{sum(c.right for c in own)} of {len(own)} right; " if any(c.verdict for c in own) else ""
        yield f"{name}", f"{said}{right}{seconds:.1f} s", "", None
    if every.size:
        two, rms = float(np.mean(np.abs(every) < 2.0)), float(np.sqrt(np.mean(every**2)))
        mean, ok = float(every.mean()), 0.93 <= two <= 0.97
        yield "parameters within two standard errors", f"{two:.1%} of {every.size}", "93 to 97 %", ok
        yield "rms of errors in standard errors", f"{rms:.2f}", "0.9 to 1.1", 0.9 <= rms <= 1.1
        yield "mean of errors in standard errors", f"{mean:+.2f}", "-0.2 to 0.2", abs(mean) <= 0.2
    apart = np.array([v for c in found for v in c.apart.values()])
    if apart.size:
        most = float(np.abs(apart).max())
        ok = most <= 0.1
        yield "largest distance from the likelihood by hand", f"{most:.2f} standard errors", "<= 0.1", ok
    judged = [c for c in found if c.verdict]
    if judged:
        share = float(np.mean([c.right for c in judged]))
        false = float(np.mean([c.false for c in judged]))
        hidden = any(c.hidden for c in judged)
        least = 0.85 if hidden else 0.98
        yield "right verdicts", f"{share:.1%} of {len(judged)}", f">= {least:.0%}", share >= least
        if hidden:
            some = [c for c in judged if c.shown > ASKED]
            share = float(np.mean([c.right for c in some]))
            what = f"the same where the truth gains {ASKED:.0f}"
            yield what, f"{share:.1%} of {len(some)}", f">= {least:.0%}", share >= least
        yield "false names", f"{false:.1%}", "<= 2 %", false <= 0.02


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    """Run two machines of each family, nothing hidden, then with an effect hidden."""
    for hidden in (False, True):
        found = cases(FAMILIES, range(2), diagnosed=True, hidden=hidden, against=not hidden)
        yield from figures(list(found))


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="benchmarks.own_machines", description=__doc__.splitlines()[0])
    parser.add_argument("--families", default="", help="names or their begins, with commas (default: all)")
    parser.add_argument("--seeds", type=int, default=2, help="machines of each family (default: 2)")
    parser.add_argument("--first", type=int, default=0, help="first seed (default: 0)")
    parser.add_argument("--diagnose", action="store_true", help="the verdict of diagnose, too")
    parser.add_argument("--hidden", action="store_true", help="hide one effect in each machine")
    parser.add_argument("--against", action="store_true", help="compare with a likelihood by hand")
    given = parser.parse_args(arguments)
    wanted = [name.strip() for name in given.families.split(",") if name.strip()]
    families = [f for f in FAMILIES if not wanted or any(f.name.startswith(w) for w in wanted)]
    seeds = range(given.first, given.first + given.seeds)
    found = list(cases(families, seeds, diagnosed=given.diagnose, hidden=given.hidden, against=given.against))
    for what, value, bar, met in figures(found):
        print(f"  {what:46} {value:36} {bar:12} { ({True: 'ok', False: 'NOT REACHED'}.get(met) or '') }")
    return 0


if __name__ == "__main__":
    sys.exit(main())
