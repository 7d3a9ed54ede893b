"""Assembles the Block of a monitor: samples, filter, bank of tests, decision."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import sympy as sp

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delay_line import fixed
from hovercontrol.blocks.derivatives import needed_definitions
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.control.observers.filter_equations import corrections, estimate_of, filter_states
from hovercontrol.control.observers.ins.kalman import Equations, Estimate, chosen
from hovercontrol.control.observers.propagation import Dynamics, Prediction, predict, runge_kutta
from hovercontrol.identification.monitor.bank import Bank, write_bank
from hovercontrol.identification.monitor.candidates import Candidate
from hovercontrol.identification.monitor.decision import Decision, decide
from hovercontrol.identification.monitor.design import Design
from hovercontrol.identification.monitor.memory import Memory
from hovercontrol.identification.monitor.sensors import Sensors, check_samples
from hovercontrol.identification.monitor.sized import AtTheEstimate

RESET = Signal("reset", "1", "1 to restart the tests at the next tick", lower=0.0, upper=1.0)
#: Length of a segment of :mod:`.refined` in lengths of the shortest window.
SEGMENT = 2

LATCHED = Signal("latched", "1", "1 after an alarm")
RUNNING = Signal("running", "s", "time since the start, at most `settle`")


@dataclass(frozen=True)
class _Constants:
    """Parameters of the Block that are its own."""

    period: Signal
    dead_after: Signal
    settle: Signal
    threshold: Signal
    floors: tuple[Signal, ...]
    begin: tuple[Signal, ...]
    dispersion: tuple[Signal, ...]

    @property
    def every(self) -> tuple[Signal, ...]:
        limits = (self.period, self.dead_after, self.settle, self.threshold)
        return (*limits, *self.floors, *self.begin, *self.dispersion)


def _constants(
    design: Design, threshold: float, floors: Sequence[float], dispersion: Sequence[float]
) -> _Constants:
    def constant(name: str, unit: str, text: str, start: float) -> Signal:
        return Signal(name, unit, text, start=start, lower=0.0)

    return _Constants(
        fixed("period", design.period, "of the samples"),
        constant("dead_after", "s", "without a new sample, a sensor is dead", design.dead_after),
        constant("settle", "s", "after a start, until the tests begin", design.settle),
        constant("threshold", "1", "of the evidence, for an alarm", threshold),
        tuple(
            constant(f"floor_{c.name}", "1", f"information on {c.name} below which a window says little", v)
            for c, v in zip(design.every, floors, strict=True)
        ),
        tuple(
            constant(f"start_std_{s.name}", s.unit, f"of the error of {s.name}, after a reset", v)
            for s, v in zip(design.model.plant.states, design.model.start_std, strict=True)
        ),
        tuple(
            constant(f"dispersion_{c.name}", "1", f"of the scores of {c.name} along a reference log", v)
            for c, v in zip(design.every, dispersion, strict=bool(dispersion))
        ),
    )


def monitor_block(
    design: Design, threshold: float, floors: Sequence[float], dispersion: Sequence[float] = ()
) -> Block:
    """Return the Block of a monitor.

    Parameters
    ----------
    threshold : float
    floors : sequence of float
        J0 of each candidate and unknown change.
    dispersion : sequence of float, optional
        phi of each of them (default: 1).
    """
    return _assembled(design, threshold, floors, dispersion)


def column_block(design: Design) -> Block:
    """Return the part of a monitor without an alarm that gives what the signatures follow from.

    Its outputs are the entries of eta of the candidates and the unknown changes, shape (J, m), of the columns
    s, (J, n), of C, (m, n), of M = Phi A, (n, n), row by row, and of the limited e, (m,): see
    :mod:`hovercontrol.identification.monitor.bank`.
    """
    write = Equations()
    begun = _tests(replace(design, windows=1), write, _constants(design, 1.0, [1.0] * len(design.every), ()))
    bank = begun.bank
    every = [*(e for row in bank.own for e in row), *(e for s in bank.columns for e in s), *bank.C, *bank.M]
    every += bank.limited
    shown = Expressions((f"column[{k}]", e) for k, e in enumerate(every))
    no_shift = {f"shift[{i}]": sp.S.Zero for i in range(len(design.model.plant.states))}
    n = len(design.model.plant.states)
    upper = [begun.then.P[i, j] for i in range(n) for j in range(i, n)]
    following = dict(zip((s.name for s in begun.states), [*begun.then.x, *upper], strict=True))
    following |= begun.sensors.next_values | begun.memory.next_values | bank.next_values
    following |= {s.name: sp.S.Zero for s in begun.ahead}
    block = Block(design.model.name).unchecked(
        states=(*begun.states, *begun.sensors.states, *begun.memory.states, *begun.ahead, *bank.states),
        inputs=(*design.model.inputs, RESET),
        parameters=begun.parameters,
        derivatives=Expressions(following),
        outputs=tuple(Signal(name) for name in shown),
        output_expressions=shown,
        definitions=Expressions({**no_shift, **write.definitions}),
        period=design.period,
    )
    wanted, used = every, set[Signal]()
    while True:  # states on which the outputs depend
        needed = [*wanted, *(block.definitions[name] for name in needed_definitions(block, wanted))]
        symbols = set().union(*(e.free_symbols for e in needed))
        states = tuple(s for s in block.states if s.symbol in symbols)
        if len(states) == len(used):
            break
        wanted, used = [*every, *(block.derivatives[s.name] for s in states)], set(states)
    return block.unchecked(
        states=states, derivatives=Expressions((s.name, block.derivatives[s.name]) for s in states)
    )


@dataclass(frozen=True)
class _Tests:
    """Filter and tests of a monitor, without the decision."""

    states: tuple[Signal, ...]
    sensors: Sensors
    now: Estimate
    then: Estimate
    Phi: sp.Matrix
    drive: dict[int, sp.Matrix]
    shift: sp.Matrix
    ahead: tuple[Signal, ...]
    memory: Memory
    bank: Bank
    settled: sp.Expr
    parameters: tuple[Signal, ...]


def _tests(design: Design, write: Equations, own: _Constants) -> _Tests:
    model, plant, step = design.model, design.model.plant.states, own.period.symbol
    n, settle = len(plant), own.settle.symbol
    states = filter_states(model)
    prior = estimate_of(states, n)
    sensors = check_samples(
        model, write, prior, design.period, design.outliers_within, step, own.dead_after.symbol,
        repeats=design.repeats,
    )  # fmt: skip
    steps = corrections(sensors.observed, write, prior)
    now = steps[-1].estimate
    # The candidates act on the true motion: after an alarm, the estimate is corrected by the named change.
    shift = sp.Matrix([sp.Symbol(f"shift[{i}]", real=True) for i in range(n)])
    ahead = _ahead(design)
    before = prior.x + sp.Matrix([s.symbol for s in ahead]) if ahead else prior.x
    memory = Memory(design, write, write.matrix("actual", now.x + shift), before)
    then, Phi, drive = _predicted(design, write, now, step)
    forced, bias = _effects(design, write, memory, drive)
    settled = write.define("settled", chosen(RUNNING.symbol >= settle - step / 2, sp.S.One, sp.S.Zero))
    phi = [s.symbol for s in own.dispersion] or [sp.S.One] * len(design.every)
    bank = write_bank(
        write, plant, steps, Phi, forced, bias,
        windows=design.windows, first=design.first, dispersion=phi, tested=len(design.candidates),
        many=sensors.many, jump=sensors.jump, hold=sp.Symbol("test_alarm", real=True),
        raised=sp.Symbol("raised", real=True), best_window=sp.Symbol("best_window", real=True),
    )  # fmt: skip
    parameters = (*own.every, *model.parameters, *(p for c in design.every for p in c.parameters))
    return _Tests(states, sensors, now, then, Phi, drive, shift, ahead, memory, bank, settled, parameters)


def _assembled(
    design: Design, threshold: float, floors: Sequence[float], dispersion: Sequence[float] = ()
) -> Block:
    model, write, own = design.model, Equations(), _constants(design, threshold, floors, dispersion)
    plant, step, settle = model.plant.states, own.period.symbol, own.settle.symbol
    n, begun = len(plant), _tests(design, write, own)
    states, sensors, then, Phi, drive = begun.states, begun.sensors, begun.then, begun.Phi, begun.drive
    memory, bank, settled = begun.memory, begun.bank, begun.settled
    # after an alarm, the named candidate is linearised at its estimate
    keys = ("named", "named_theta", "named_variance"), ("named_next", "theta", "theta_variance")
    at_now, at_then = (tuple(sp.Symbol(key, real=True) for key in some) for some in keys)
    at = AtTheEstimate(write, memory, drive, design.period, at_now, at_then)
    sized = {j: at.write(c, j, [s.name for s in plant]) for j, c in enumerate(design.candidates) if c.law}
    limits = [_bounds(c, design, begun.now) for c in design.every]
    decision = decide(
        write, design.candidates, design.unknowns, bank, plant, then.P, own.floors, limits,
        own.threshold.symbol, LATCHED.symbol, settled, sensors.dead, model.measured, step, sized,
        _moves(begun, design, write, step), _turns(begun, design, write),
        SEGMENT * design.first,
    )  # fmt: skip
    for i in range(n):
        write.definitions[f"shift[{i}]"] = decision.refined.shift[i]
    elapsed = write.define("elapsed", sp.Min(RUNNING.symbol + step, settle))
    tests = (LATCHED, *decision.states, *bank.states, *decision.refined.states)
    following = _following(states, tests, then, own, bank, decision, settled, elapsed)
    following |= sensors.next_values | memory.next_values | at.next_values | decision.paired.next_values
    apart = (*sensors.states, *memory.states, *begun.ahead, *at.states, *decision.paired.states)
    following |= {s.name: (Phi[i, :] * begun.shift)[0] for i, s in enumerate(begun.ahead)}
    return Block(
        model.name,
        states=(*states, RUNNING, *apart, *tests),
        inputs=(*model.inputs, RESET),
        outputs=decision.outputs,
        parameters=begun.parameters,
        derivatives=following,
        output_expressions=decision.values,
        definitions=write.definitions,
        period=design.period,
    )


def _ahead(design: Design) -> tuple[Signal, ...]:
    """Return states for the error of the prediction by the named change, before the measurements.

    Errors of sensors that depend on the motion need it: the error after the measurements follows from them.
    """
    plant = design.model.plant.states
    moving = {s.symbol for s in plant}
    if not any(e.free_symbols & moving for c in design.candidates for e in c.seen.values()):
        return ()
    text = "error of the prediction by the named change"
    return tuple(Signal(f"ahead[{i}]", s.unit, f"{text}, of {s.name}") for i, s in enumerate(plant))


def _bounds(c: Candidate, design: Design, now: Estimate) -> tuple[sp.Expr, sp.Expr]:
    """Return the bounds of a candidate's theta; zero lies between them.

    An uncertain coefficient is a state of the filter, and has the value of its estimate.
    """
    name, plant = design.model.name, design.model.plant.states
    here = {sp.Symbol(f"{name}.{s.name}", real=True): e for s, e in zip(plant, now.x, strict=True)}
    lower, upper = c.lower.xreplace(here), c.upper.xreplace(here)
    return (
        lower if lower.is_number else sp.Min(lower, 0),
        upper if upper.is_number else sp.Max(upper, 0),
    )


def _predicted(
    design: Design, write: Equations, now: Estimate, step: sp.Expr
) -> tuple[Estimate, sp.Matrix, dict[int, sp.Matrix]]:
    """Write the estimate a tick later; return it, the transition matrix of the tick and its drive."""
    model = design.model
    driven = [i for i, s in enumerate(model.plant.states) if any(s.name in c.rates for c in design.every)]
    h = write.define("substep", step / design.substeps)
    then, dynamics, every = now, Dynamics(model.plant), []
    for k in range(design.substeps):
        one = predict(dynamics, write, f"step_{k}", then, model.intensities, time + k * h, h, driven=driven)
        every.append(one)
        then = one.estimate
    return then, *_over_the_tick(write, every)


def _moves(begun: _Tests, design: Design, write: Equations, step: sp.Expr) -> sp.Matrix:
    """Write ``f(x + d) - f(x)`` of the tick, with the error d by the named change."""
    plant, h, n = design.model.plant, step / design.substeps, len(design.model.plant.states)
    x = sp.Matrix([sp.Symbol(f"actual[{i}]", real=True) for i in range(n)])
    for k in range(design.substeps):
        x = runge_kutta(Dynamics(plant), write, f"true_{k}", x, time + k * h, h, jacobian=False).x
    return write.matrix("moves", x - begun.then.x)


def _turns(begun: _Tests, design: Design, write: Equations) -> list[sp.Matrix]:
    """Write the slopes by the state of the candidates' changes of the state over the tick."""
    plant, every = design.model.plant.states, []
    for j, c in enumerate(design.every):
        turn = sp.zeros(len(plant), len(plant))
        for i, s in enumerate(plant):
            for k, by in enumerate(plant):
                slope = sp.diff(c.rates.get(s.name, sp.S.Zero), by.symbol)
                if slope != 0:
                    turn[:, k] += begun.drive[i] * write.define(
                        f"a_x[{j},{i},{k}]", begun.memory.at(c, slope)
                    )
        every.append(turn)
    return every


def _effects(
    design: Design, write: Equations, memory: Memory, drive: Mapping[int, sp.Matrix]
) -> tuple[list[sp.Matrix], list[list[sp.Expr]]]:
    """Write the changes' g of the state over the tick, and b of the measured values."""
    plant, forced = design.model.plant.states, []
    for j, c in enumerate(design.every):
        g = sp.zeros(len(plant), 1)
        for i, s in enumerate(plant):
            if s.name in c.rates:
                g += drive[i] * write.define(f"a[{j},{i}]", memory.rate(c, s.name))
        forced.append(g)
    bias = [
        [write.define(f"error[{j},{i}]", memory.seen(c, s.name)) for i, s in enumerate(design.model.measured)]
        for j, c in enumerate(design.every)
    ]
    return forced, bias


def _following(
    states: Sequence[Signal],
    tests: Sequence[Signal],
    then: Estimate,
    own: _Constants,
    bank: Bank,
    decision: Decision,
    settled: sp.Expr,
    elapsed: sp.Expr,
) -> dict[str, sp.Expr]:
    """Return the next values of the filter and of the tests.

    A reset keeps the estimate, with its first covariance. The tests stay at their start until the filter has
    settled.
    """
    n, restart = len(then.x), RESET.symbol > sp.S.Half
    following = dict(zip((s.name for s in states[:n]), then.x, strict=True))
    following[RUNNING.name] = sp.Piecewise((sp.S.Zero, restart), (elapsed, True))
    upper = [then.P[i, j] for i in range(n) for j in range(i, n)]
    again = {f"P[{i},{i}]": s.symbol**2 for i, s in enumerate(own.begin)}
    for s, value in zip(states[n:], upper, strict=True):
        following[s.name] = chosen(restart, again.get(s.name, sp.S.Zero), value)
    values = {LATCHED.name: decision.alarm} | bank.next_values | decision.next_values
    values |= decision.refined.next_values
    begins = sp.Or(restart, settled < sp.S.Half)
    for s in tests:
        following[s.name] = chosen(begins, sp.Integer(round(s.start)), values[s.name])
    return following


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
