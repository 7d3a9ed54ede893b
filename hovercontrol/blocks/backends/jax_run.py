"""Runs of a Block in JAX: one scan over the rows of a time grid, within it one over steps and ticks.

States, inputs and parameters are tuples of arrays, one for each signal, so that many runs go side by side in
the arrays' axes and XLA fuses a step's equations into few loops.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.blocks.backends.engines import checked_solver
from hovercontrol.blocks.backends.jax_needs import Run, need_jax
from hovercontrol.blocks.backends.library import Solver
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delays import Arrivals, arrivals
from hovercontrol.blocks.simulation.arguments import by_state, checked_times, initial_state, input_rows
from hovercontrol.blocks.simulation.reasons import REASONS, StoppedError
from hovercontrol.blocks.simulation.trajectory import time_response
from hovercontrol.blocks.switching import longest_step, switching_conditions, switching_times
from hovercontrol.blocks.ticks import ROOM, Schedule

if TYPE_CHECKING:
    import control

    from hovercontrol.blocks.backends.jax import JaxFunctions

State = tuple[Any, ...]

#: Maximum number of steps of Diffrax between two instants.
MAX_STEPS = 100_000

#: Where the first and last stage of a step evaluate conditions on time, as a part of the step from its ends.
INSIDE = 1e-6


class Plan(NamedTuple):
    """When a run steps and ticks: arrays of shape (rows, steps, ...), the same for all runs.

    Attributes
    ----------
    t, h : ndarray, shape (rows, steps)
        Begin and length of each step [s]; rows with fewer steps end with steps of length 0.
    u : ndarray, shape (rows, steps, n_inputs)
        Held inputs.
    due : ndarray of bool, shape (rows, steps, n_ticks)
        Ticks executed before the step.
    """

    t: Any
    h: Any
    u: Any
    due: Any


def plan_of(block: Block, times: Array, late: Arrivals, values: Array, solver: Solver) -> Plan:
    """Return the plan of a run; the last row is the last time, with one step of length 0.

    Parameters
    ----------
    block : Block
        Without delays.
    times : ndarray, shape (n,)
    late : Arrivals
        The inputs as they arrive.
    values : ndarray, shape (n_parameters,)
    """
    begin, end = float(times[0]), float(times[-1])
    schedule = Schedule([tick.period for tick in block.ticks], begin)
    params = dict(zip(block.default_parameters, values.tolist(), strict=True))
    due: dict[float, list[int]] = {}
    while schedule.is_due(end) and block.ticks:
        at = schedule.time
        due.setdefault(at, []).extend(schedule.take(at))
    switches = [t for t in switching_times(block, params) if begin < t < end]
    instants = np.unique(np.concatenate([late.times, list(due), switches]))
    # instants that differ by rounding are one: the later is dropped, unless it is a given time
    same = np.flatnonzero(np.diff(instants) <= ROOM * np.abs(instants[1:]))
    given = np.isin(instants, times)
    instants = np.delete(instants, [k if given[k + 1] else k + 1 for k in same.tolist()])
    ticks = np.zeros((len(instants), len(block.ticks)), dtype=bool)
    for at, which in due.items():
        ticks[int(np.abs(instants - at).argmin()), which] = True
    held = np.searchsorted(late.times, instants + ROOM * np.abs(instants), side="right") - 1
    longest = longest_step(block, params, begin, end) if solver.method == "rk4" else math.inf
    longest = min(longest, solver.step or math.inf)
    rows: list[list[tuple[float, float, int, int]]] = []
    row = np.searchsorted(times, instants, side="right") - 1
    for k, (a, b) in enumerate(pairwise(instants.tolist())):
        n = max(1, math.ceil((b - a) / longest - 1e-9)) if solver.method == "rk4" else 1
        if row[k] == len(rows):
            rows.append([])
        rows[-1] += [(a + (b - a) * j / n, (b - a) / n, k, j) for j in range(n)]
    steps = max(map(len, rows))
    plan = Plan(
        np.repeat(times[:, None], steps, axis=1),
        np.zeros((len(times), steps)),
        np.repeat(late.inputs.T[late.given][:, None], steps, axis=1),
        np.zeros((len(times), steps, len(block.ticks)), dtype=bool),
    )
    for k, found in enumerate(rows):
        for j, (a, h, instant, part) in enumerate(found):
            plan.t[k, j], plan.h[k, j], plan.u[k, j] = a, h, late.inputs[:, held[instant]]
            plan.due[k, j] = ticks[instant] & (part == 0)
    plan.due[-1, 0] = ticks[-1]
    return plan


def runner_of(functions: JaxFunctions, solver: Solver, record: str) -> Callable[..., Any]:
    """Return ``(x, p, plan) -> (rows, states at the end)``; x and p are tuples of arrays.

    Parameters
    ----------
    functions : JaxFunctions
        Of a Block without delays.
    record : {"states", "outputs"}
        What a row holds, after the ticks of its time.
    """
    import jax

    jnp = need_jax()
    outputs = functions.rows("outputs")
    move = _rk4(functions) if solver.method == "rk4" else _dormand_prince(functions, solver)
    if not functions.block.n_continuous:  # ticks alone move it
        move = _still
    ticked = ticks_of(functions)

    def run(x: State, p: State, plan: Plan) -> tuple[State, State]:
        def row(x: State, each: Plan) -> tuple[State, State]:
            first = Plan(*(a[0] for a in each))
            x = ticked(first.t, x, tuple(first.u), p, first.due)
            rest = each._replace(due=each.due.at[0].set(False))

            def step(x: State, now: Plan) -> tuple[State, None]:
                u = tuple(now.u)
                return move(now.t, now.h, ticked(now.t, x, u, p, now.due), u, p), None

            # A gradient keeps the states before each step and computes the step again. Within a scan XLA
            # cannot merge the two computations, so the barrier against that (prevent_cse) is not needed.
            after, _ = jax.lax.scan(jax.checkpoint(step, prevent_cse=False), x, rest)
            return after, kept(first, x)

        def kept(at: Plan, x: State) -> State:
            if record == "states":
                return x
            found = outputs(at.t, x, tuple(at.u), p)
            shape = jnp.broadcast_shapes(*(jnp.shape(a) for a in (*x, *p)))
            return tuple(jnp.broadcast_to(jnp.asarray(y, dtype=float), shape) for y in found)

        last = Plan(*(a[-1, 0] for a in plan))
        x, rows = jax.lax.scan(row, x, Plan(*(a[:-1] for a in plan)))
        x = ticked(last.t, x, tuple(last.u), p, last.due)
        rows = tuple(jnp.concatenate([a, b[None]]) for a, b in zip(rows, kept(last, x), strict=True))
        return rows, x

    return run


def ticks_of(functions: JaxFunctions) -> Callable[..., State]:
    """Return the ticks of an instant as ``(t, x, u, p, due) -> x``; `due` tells which are executed."""
    import jax

    block, jnp = functions.block, need_jax()
    places = {s.name: k for k, s in enumerate(block.states)}
    updates = [(functions.rows(k), [places[name] for name in t.updates]) for k, t in enumerate(block.ticks)]

    def ticked(t: Any, x: State, u: State, p: State, due: Any) -> State:
        for k, (function, at) in enumerate(updates):

            def act(x: State, function: Any = function, at: list[int] = at) -> State:
                new = list(x)
                for place, value in zip(at, function(t, x, u, p), strict=True):
                    new[place] = jnp.broadcast_to(value, x[place].shape).astype(float)
                return tuple(new)

            x = jax.lax.cond(due[k], act, lambda x: x, x)
        return x

    return ticked


def condition_margin(block: Block) -> float:
    """Return how far inside a step its first and last stage are evaluated, as a part of the step.

    A condition on time changes at the ends of steps: each step takes the value that it has within it.
    """
    return INSIDE if switching_conditions(block) else 0.0


def _rk4(functions: JaxFunctions) -> Callable[..., State]:
    """Return a step of the classical Runge-Kutta method as ``(t, h, x, u, p) -> x``."""
    f, n = functions.rows("moving"), functions.block.n_continuous
    inside = condition_margin(functions.block)

    def step(t: Any, h: Any, x: State, u: State, p: State) -> State:
        def ahead(part: Any, k: State) -> State:
            return (*(a + part * b for a, b in zip(x, k, strict=False)), *x[n:])

        # k1 = f(t, x), k2 = f(t + h/2, x + h/2 k1), k3 = f(t + h/2, x + h/2 k2), k4 = f(t + h, x + h k3)
        # x(t + h) = x + h/6 (k1 + 2 k2 + 2 k3 + k4)
        k1 = f(t + inside * h, x, u, p)
        k2 = f(t + h / 2, ahead(h / 2, k1), u, p)
        k3 = f(t + h / 2, ahead(h / 2, k2), u, p)
        k4 = f(t + h - inside * h, ahead(h, k3), u, p)
        return ahead(h / 6, tuple(a + 2 * (b + c) + d for a, b, c, d in zip(k1, k2, k3, k4, strict=True)))

    return step


def _still(t: Any, h: Any, x: State, u: State, p: State) -> State:
    return x


def _dormand_prince(functions: JaxFunctions, solver: Solver) -> Callable[..., State]:
    """Return the integration of one run between two instants as ``(t, h, x, u, p) -> x``, by Diffrax."""
    import jax

    diffrax = need_diffrax()
    jnp, f, n = need_jax(), functions.rows("moving"), functions.block.n_continuous
    control = diffrax.PIDController(rtol=solver.rtol, atol=solver.atol, dtmax=solver.step or None)

    def field(t: Any, moving: State, given: tuple[State, State, State]) -> State:
        held, u, p = given
        return tuple(jnp.asarray(v, dtype=float) for v in f(t, (*moving, *held), u, p))

    def step(t: Any, h: Any, x: State, u: State, p: State) -> State:
        def solve(moving: State) -> State:
            found = diffrax.diffeqsolve(
                diffrax.ODETerm(field), diffrax.Dopri5(), t, t + h, None, moving, (x[n:], u, p),
                saveat=diffrax.SaveAt(t1=True), stepsize_controller=control, max_steps=MAX_STEPS, throw=False,
            )  # fmt: skip
            done = found.result == diffrax.RESULTS.successful
            return tuple(jnp.where(done, y[0], jnp.nan) for y in found.ys)

        return (*jax.lax.cond(h > 0, solve, lambda moving: moving, x[:n]), *x[n:])

    return step


def need_diffrax() -> Any:
    """Import and return Diffrax.

    Raises
    ------
    InputError
        If it is not installed.
    """
    need_jax()
    try:
        import diffrax
    except ImportError:
        raise InputError('method "dormand-prince" in JAX needs Diffrax: pip install ".[jax]"') from None
    return diffrax


def run_function(
    functions: JaxFunctions,
    time: ArrayLike,
    inputs: ArrayLike | Mapping[str, ArrayLike] | None,
    method: str,
    step: float | None,
    rtol: float,
    atol: float,
) -> Run:
    """Return the run of :meth:`.jax.JaxFunctions.run_function`."""
    functions, step = functions.running, step or functions.block.period or None
    jnp, block, times = need_jax(), functions.block, checked_times(time)
    solver, u = checked_solver(method, step, rtol, atol), input_rows(block, inputs, times)
    defaults = np.array(block.parameter_values())
    plan = plan_of(functions.plain.block, times, arrivals(block, times, u, defaults), defaults, solver)
    go = functions.cached(("run", solver), lambda: runner_of(functions.plain, solver, "states"))
    starts = {s.name: s.start for s in block.states}
    fixed = {str(symbol) for e in block.delays.values() for symbol in e.free_symbols}
    fixed |= {str(symbol) for pair in switching_conditions(block) for e in pair for symbol in e.free_symbols}
    fixed = {block.parameter_key(p.name) for p in block.parameters if p.name in fixed}

    def run(params: Mapping[str, Any] | None = None, x0: Mapping[str, Any] | None = None) -> dict[str, Any]:
        x0 = by_state(block, x0 or {})
        params = {block.full_key(name): value for name, value in (params or {}).items()}
        for given, known, kind in ((params, block.default_parameters, "parameter"), (x0, starts, "state")):
            for name in given:
                check_known(name, known, block.where(f"unknown {kind} {name!r}"))
        for name in fixed & set(params):
            raise InputError(block.where(f"{name!r} sets times at which the run restarts and is fixed in it"))
        p = _columns(block.default_parameters, params)
        x = _columns(starts, x0)
        shape = jnp.broadcast_shapes(*(a.shape for a in (*x, *p)))
        x = tuple(jnp.broadcast_to(a, shape) for a in x)
        states, _ = go(x, p, plan)
        at = (-1, *(1,) * len(shape))
        late = [jnp.asarray(row).reshape(at) for row in plan.u[:, 0].T]
        outputs = functions.plain.rows("outputs")(jnp.asarray(times).reshape(at), states, late, p)
        every = {s.name: x for s, x in zip(block.states, states, strict=True)}
        full = (len(times), *shape)
        return every | {
            s.name: jnp.broadcast_to(jnp.asarray(y, dtype=float), full)
            for s, y in zip(block.outputs, outputs, strict=True)
        }

    return run


def _columns(defaults: Mapping[str, float], given: Mapping[str, Any] | None) -> State:
    jnp = need_jax()
    return tuple(jnp.asarray(v, dtype=float) for v in {**defaults, **(given or {})}.values())


def simulate(
    functions: JaxFunctions,
    time: ArrayLike,
    inputs: ArrayLike | Mapping[str, ArrayLike] | None,
    x0: ArrayLike | Mapping[str, float] | None,
    params: Mapping[str, float] | None,
    method: str,
    step: float | None,
    rtol: float,
    atol: float,
) -> control.TimeResponseData:
    """Simulate as :meth:`.jax.JaxFunctions.simulate`."""
    import jax

    functions, step = functions.running, step or functions.block.period or None
    block, times = functions.block, checked_times(time)
    solver, u = checked_solver(method, step, rtol, atol), input_rows(block, inputs, times)
    x, p = initial_state(block, x0), np.array(block.parameter_values(params))
    plan = plan_of(functions.plain.block, times, arrivals(block, times, u, p), p, solver)
    go = functions.cached(("simulate", solver), lambda: jax.jit(runner_of(functions.plain, solver, "states")))
    states = np.array(go(tuple(x), tuple(p), plan)[0]).reshape(len(block.states), -1)
    bad = np.flatnonzero(~np.isfinite(states).all(axis=0))
    if bad.size:
        after = times[max(bad[0] - 1, 0)]
        raise StoppedError(block.where(f"the simulation stops after t = {after:.6g} s: {REASONS[2]}"), 2)
    outputs = np.array(functions.plain._stacked("outputs", times, states, plan.u[:, 0].T, p[:, None]))
    return time_response(block, times, outputs, states, u)
