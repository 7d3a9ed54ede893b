"""Assembles the Block of a monitor: samples, filter, bank of tests, decision."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from hovercontrol.core.block import Block
from hovercontrol.core.delay_line import fixed
from hovercontrol.core.expressions import Expressions
from hovercontrol.core.signals import Signal, time
from hovercontrol.errors import InputError, did_you_mean
from hovercontrol.estimators.disturbance import disturbance_name, with_disturbances
from hovercontrol.estimators.filter_equations import corrections, estimate_of, filter_states
from hovercontrol.estimators.ins.kalman import Equations
from hovercontrol.estimators.observed import Observed, observed
from hovercontrol.estimators.propagation import Dynamics, Prediction, predict, runge_kutta
from hovercontrol.monitor.bank import Bank, write_bank
from hovercontrol.monitor.candidates import Candidate
from hovercontrol.monitor.decision import decide
from hovercontrol.monitor.sensors import check_samples

RESET = Signal("reset", "1", "1 to restart the tests at the next tick", lower=0.0, upper=1.0)


@dataclass(frozen=True)
class Design:
    """All that determines the equations of a monitor, except the numbers of its parameters.

    Attributes
    ----------
    model : Observed
        Plant, noise and measured channels.
    candidates : tuple of Candidate
    period, dead_after : float
        [s]
    repeats : bool
        Whether a value equal to the one before is a sample.
    windows, first : int
        Number of windows, and ticks after which the first begins anew.
    substeps : int
        Runge-Kutta steps per tick.
    settle : float
        Time after the start and after a reset before which the tests do not begin [s].
    """

    model: Observed
    candidates: tuple[Candidate, ...]
    period: float
    dead_after: float
    repeats: bool
    windows: int
    first: int
    substeps: int
    settle: float = 2.0


def estimation_model(
    plant: Block,
    measured: Sequence[str],
    process_noise: Mapping[str, float],
    measurement_noise: Mapping[str, float],
    gusts: Mapping[str, float],
    gust_seconds: float,
    coefficient_std: Mapping[str, float],
    start_std: Mapping[str, float],
    name: str,
    lost_samples: bool | Sequence[str],
) -> Observed:
    """Return the plant as the filter knows it.

    Gusts are Ornstein-Uhlenbeck accelerations of standard deviation sigma and correlation time tau: states
    ``d' = -d/tau + w`` with the intensity ``2 sigma^2/tau``. Uncertain coefficients are constant states.
    """
    # The filter learns uncertain coefficients; its innovations stay white for every value of them.
    noise, start = dict(process_noise), dict(start_std)
    block = _with_uncertain(plant, coefficient_std, name)
    start |= {_short(key): std for key, std in coefficient_std.items()}
    if gusts:
        block = with_disturbances(block, list(gusts), correlation_time=gust_seconds)
        for state, sigma in gusts.items():
            d = disturbance_name(state)
            noise[d] = sigma * (2.0 / gust_seconds) ** 0.5
            start[d] = sigma
    return observed(
        block, measured, noise, measurement_noise, start, name, continuous=False, lost_samples=lost_samples
    )


def _short(key: str) -> str:
    return key.rpartition(".")[2]


def _with_uncertain(plant: Block, std: Mapping[str, float], name: str) -> Block:
    """Return a plant some of whose parameters are constant states."""
    states, swap = [], {}
    known = {_short(p.name): p for p in plant.parameters}
    for key in std:
        if _short(key) not in known:
            raise InputError(
                f"{name}: coefficient_std: unknown coefficient {key!r}{did_you_mean(key, known)}"
            )
        p = known[_short(key)]
        s = p.replace(name=_short(key), lower=-sp.oo, upper=sp.oo)
        states.append(s)
        swap[p.symbol] = s.symbol

    def swapped(expressions: Mapping[str, sp.Expr]) -> Expressions:
        return Expressions((k, e.xreplace(swap)) for k, e in expressions.items())

    if not states:
        return plant
    return Block(
        plant.name,
        states=(*plant.states, *states),
        inputs=plant.inputs,
        outputs=plant.outputs,
        parameters=tuple(p for p in plant.parameters if p.symbol not in swap),
        derivatives=Expressions(
            [*swapped(plant.derivatives).items(), *((s.name, 0 * s.symbol) for s in states)]
        ),
        output_expressions=swapped(plant.output_expressions),
        definitions=swapped(plant.definitions),
        definition_signals=plant.definition_signals,
    )


def monitor_block(
    design: Design, threshold: float, floors: Sequence[float], *, signatures: bool = False
) -> Block:
    """Return the Block of a monitor.

    Parameters
    ----------
    threshold : float
    floors : sequence of float
        J0 of each candidate.
    signatures : bool, optional
        Whether its outputs are the signatures ``eta[w,j,i]`` instead, for the computation of the threshold.
    """
    model, write = design.model, Equations()
    name, plant = model.name, model.plant.states
    n = len(plant)
    states = filter_states(model)
    prior = estimate_of(states, n)
    step = fixed("period", design.period, "of the samples")
    dead_after = Signal(
        "dead_after", "s", "without a new sample, a sensor is dead", start=design.dead_after, lower=0.0
    )
    level = Signal("threshold", "1", "of the evidence, for an alarm", start=threshold, lower=0.0)
    floor = [
        Signal(
            f"floor_{c.name}",
            "1",
            f"information on {c.name} below which a window says little",
            start=v,
            lower=0.0,
        )
        for c, v in zip(design.candidates, floors, strict=True)
    ]
    sensors = check_samples(
        model, write, prior, design.period, step.symbol, dead_after.symbol, repeats=design.repeats
    )
    steps = corrections(sensors.observed, write, prior)
    now = steps[-1].estimate
    # The candidates act on the true motion: after an alarm, the estimate is corrected by the named change.
    shift = sp.Matrix([sp.Symbol(f"shift[{i}]", real=True) for i in range(n)])
    memory = _Memory(design, write, write.matrix("actual", now.x + shift))
    driven = sorted({i for i, s in enumerate(plant) for c in design.candidates if s.name in c.rates})
    h = write.define("substep", step.symbol / design.substeps)
    then, dynamics, every = now, Dynamics(model.plant), []
    for k in range(design.substeps):
        one = predict(dynamics, write, f"step_{k}", then, model.intensities, time + k * h, h, driven=driven)
        every.append(one)
        then = one.estimate
    Phi, drive = _over_the_tick(write, every)
    forced = []
    for j, c in enumerate(design.candidates):
        g = sp.zeros(n, 1)
        for i, s in enumerate(plant):
            if s.name in c.rates:
                a = write.define(f"a[{j},{i}]", memory.rate(c, s.name))
                g += drive[i] * a
        forced.append(g)
    bias = [[memory.at(c, c.seen.get(s.name, sp.S.Zero)) for s in model.measured] for c in design.candidates]
    latched = Signal("latched", "1", "1 after an alarm")
    settle = Signal("settle", "s", "after a start, until the tests begin", start=design.settle, lower=0.0)
    running = Signal("running", "s", "time since the start, at most `settle`")
    begun = running.symbol >= settle.symbol - step.symbol / 2
    settled = write.define("settled", sp.Piecewise((1, begun), (0, True)))
    bank = write_bank(
        write, plant, steps, Phi, forced, bias,
        windows=design.windows, first=design.first, hold=sp.Symbol("test_alarm", real=True),
    )  # fmt: skip
    decision = decide(
        write, design.candidates, bank, floor, level.symbol, latched.symbol, settled, sensors.dead,
        model.measured, step.symbol,
    )  # fmt: skip
    for i in range(n):
        write.definitions[f"shift[{i}]"] = decision.shift[i]
    restart = sp.Symbol("reset", real=True) > sp.S.Half
    upper = [then.P[i, j] for i in range(n) for j in range(i, n)]
    following = dict(zip((s.name for s in states[:n]), then.x, strict=True))
    elapsed = write.define("elapsed", sp.Min(running.symbol + step.symbol, settle.symbol))
    following[running.name] = sp.Piecewise((sp.S.Zero, restart), (elapsed, True))
    signals = [*states[n:], latched, *bank.states]
    values = dict(zip((s.name for s in states[n:]), upper, strict=True))
    values |= {"latched": decision.alarm} | bank.next_values
    begin = [
        Signal(f"start_std_{s.name}", s.unit, f"of the error of {s.name}, after a reset", start=v, lower=0.0)
        for s, v in zip(plant, model.start_std, strict=True)
    ]
    again = {f"P[{i},{i}]": s.symbol**2 for i, s in enumerate(begin)}
    for s in signals:
        start = again.get(s.name, sp.Integer(round(s.start)))
        begins = restart if s in states else sp.Or(restart, settled < sp.S.Half)
        following[s.name] = sp.Piecewise((start, begins), (values[s.name], True))
    following |= sensors.next_values | memory.next_values
    outputs, shown = decision.outputs, decision.values
    if signatures:
        outputs, shown = _signature_outputs(bank)
    block = Block(
        name,
        states=(*states, latched, running, *sensors.states, *memory.states, *bank.states),
        inputs=(*model.inputs, RESET),
        outputs=outputs,
        parameters=(
            step,
            dead_after,
            settle,
            level,
            *floor,
            *begin,
            *model.parameters,
            *(p for c in design.candidates for p in c.parameters),
        ),
        derivatives=following,
        output_expressions=shown,
        definitions=write.definitions,
        period=design.period,
    )
    return block


def _signature_outputs(bank: Bank) -> tuple[tuple[Signal, ...], dict[str, sp.Expr]]:
    shown = {
        f"signature[{w},{j},{i}]": e
        for j, mine in enumerate(bank.signature)
        for w, etas in enumerate(mine)
        for i, e in enumerate(etas)
    }
    return tuple(Signal(key, "1", "signature") for key in shown), shown


def _over_the_tick(write: Equations, steps: Sequence[Prediction]) -> tuple[sp.Matrix, dict[int, sp.Matrix]]:
    """Return the transition matrix of a tick, and its drive, from those of its steps."""
    Phi, drive = steps[0].Phi, dict(steps[0].drive)
    for k, one in enumerate(steps[1:], start=1):
        Phi = write.matrix(f"tick_Phi_{k}", one.Phi * Phi)
        drive = {
            i: write.matrix(f"tick_drive_{k}_{i}", one.Phi * before + one.drive[i])
            for i, before in drive.items()
        }
    return Phi, drive


class _Memory:
    """What candidates remember: states of their own, and late commands."""

    def __init__(self, design: Design, write: Equations, x: sp.Matrix) -> None:
        self._write, self._design = write, design
        plant = design.model.plant
        self._here: dict[sp.Expr, sp.Expr] = {s.symbol: e for s, e in zip(plant.states, x, strict=True)}
        # uncertain coefficients are states of the filter, and parameters in a candidate's expressions
        name = design.model.name
        self._here |= {
            sp.Symbol(f"{name}.{s.name}", real=True): e for s, e in zip(plant.states, x, strict=True)
        }
        self.states: list[Signal] = []
        self.next_values: dict[str, sp.Expr] = {}
        self._own: dict[str, dict[sp.Expr, sp.Expr]] = {}
        self._lines: dict[str, list[sp.Expr]] = {}
        for c in design.candidates:
            self._own[c.name] = self._late(c) | self._remembered(c)

    def rate(self, c: Candidate, state: str) -> sp.Expr:
        """Return a of a candidate in the derivative of a state."""
        return self.at(c, c.rates[state])

    def at(self, c: Candidate, e: sp.Expr) -> sp.Expr:
        """Return an expression of a candidate at the estimate."""
        return sp.sympify(e).xreplace(self._own[c.name]).xreplace(self._here)

    def _late(self, c: Candidate) -> dict[sp.Expr, sp.Expr]:
        """Write the late commands: their mean over the tick, of commands that hold from tick to tick."""
        if not c.delay:
            return {}
        ticks = c.delay / self._design.period
        whole = int(ticks + 1e-9)
        part = max(ticks - whole, 0.0)
        found: dict[sp.Expr, sp.Expr] = {}
        for s in self._design.model.plant.inputs:
            late = [s.symbol, *self._line(s, whole + 1)]
            value = (1 - part) * late[whole] + part * late[whole + 1] if part > 1e-6 else late[whole]
            found[sp.Symbol(f"{s.name}_late", real=True)] = value
        return found

    def _line(self, s: Signal, count: int) -> list[sp.Expr]:
        """Return a command of the ticks before, the latest first."""
        line = self._lines.setdefault(s.name, [])
        while len(line) < count:
            k = len(line) + 1
            before = s.replace(
                name=f"{s.name}_before[{k}]",
                description=f"{s.name}, {k} ticks ago",
                lower=-sp.oo,
                upper=sp.oo,
            )
            self.states.append(before)
            self.next_values[before.name] = line[-1] if line else s.symbol
            line.append(before.symbol)
        return line

    def _remembered(self, c: Candidate) -> dict[sp.Expr, sp.Expr]:
        """Write the candidate's own states a tick later; return their means over the tick."""
        if not c.memory:
            return {}
        own = {s.symbol: s.replace(name=f"{c.name}.{s.name}", lower=-sp.oo, upper=sp.oo) for s in c.memory}
        rename = {old: new.symbol for old, new in own.items()}
        # the commands and the estimate hold during the tick
        laws = {
            new.name: c.memory[old].xreplace(rename).xreplace(self._here)
            for old, new in zip(c.memory, own.values(), strict=True)
        }
        block = Block("memory").unchecked(states=tuple(own.values()), derivatives=Expressions(laws))
        x = sp.Matrix([s.symbol for s in own.values()])
        h = sp.Symbol("period", real=True)
        new = runge_kutta(Dynamics(block), self._write, f"memory_{c.name}", x, time, h, jacobian=False).x
        for s, value in zip(own.values(), new, strict=True):
            self.states.append(s)
            self.next_values[s.name] = value
        return {old: (s.symbol + value) / 2 for (old, s), value in zip(own.items(), new, strict=True)}
