"""A Block as a Gymnasium environment: each step holds the actions for a time and integrates in machine code.

The reward and the end of an episode are expressions in the Block's signals, computed with the outputs, or
functions of the observation and the action.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import sympy as sp
from sympy.logic.boolalg import Boolean

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known, did_you_mean
from hovercontrol.blocks.backends.gym_task import ENDED, REWARD, Bounds, Judge, Task, joined
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.blocks.simulation.arguments import by_state


@checked
def to_gym(
    block: Block,
    step: float,
    *,
    reward: sp.Expr | float | Judge,
    terminated: Boolean | Judge | None = None,
    duration: float = math.inf,
    actions: Sequence[str] | None = None,
    observations: Sequence[str] | None = None,
    bounds: Bounds | None = None,
    start: Bounds | None = None,
    params: Mapping[str, float] | None = None,
    rtol: float = 1e-6,
    atol: float = 1e-9,
    num_envs: int | None = None,
    substep: float | None = None,
) -> Any:
    """Return a Block as a ``gymnasium.Env``, or many as a ``gymnasium.vector.VectorEnv``.

    ``block.gym(...)`` does the same. Needs ``pip install ".[rl]"``.

    Parameters
    ----------
    block : Block
    step : float
        Time for which a step holds the actions [s].
    reward : sympy.Expr, float, or callable
        An expression in the Block's signals, at the end of each step, or a function
        ``reward(observation, action)`` of arrays whose last axis counts the signals.
    terminated : sympy condition or callable, optional
        When an episode ends, in the same form.
    duration : float, optional
        An episode is truncated after this time [s].
    actions, observations : sequence of str, optional
        Inputs and outputs (default: all). Other inputs keep their start values.
    bounds : mapping of str to (float, float), optional
        Limits of actions and observations, over the signals' own. Actions are not clipped.
    start : mapping of str to (float, float), optional
        Limits from which each reset draws initial states, by name, and parameters, by key, uniformly.
        Parameters named ``seed`` are drawn at each reset.
    params : mapping, optional
        Parameter values by key.
    rtol, atol : float, optional
        Relative and absolute tolerance of the solver.
    num_envs : int, optional
        Number of environments of a vector environment. A Block without ticks and delays steps them side by
        side in vector instructions by the classical Runge-Kutta method.
    substep : float, optional
        Longest step of that method [s] (default: a tenth of `step`).

    Returns
    -------
    gymnasium.Env or gymnasium.vector.VectorEnv
        ``reset(seed=, options={"x0": {...}, "params": {...}})`` also sets initial states and parameters. If
        the simulation cannot continue, the episode is terminated with a reward of 0 and the reason in
        ``info["stopped"]``.

    Raises
    ------
    InputError
        If Gymnasium is not installed, a name is unknown, or a value is wrong.

    Examples
    --------
    >>> from hovercontrol import Block, Signal
    >>> v, a = Signal("v", "m/s"), Signal("a", "m/s^2", lower=-1.0, upper=1.0)
    >>> cart = Block("cart", [v], [a], [v], derivatives={"v": a.symbol})
    >>> env = to_gym(cart, 0.1, reward=-v.symbol**2, start={"v": (-1.0, 1.0)}, duration=10.0)
    >>> observation, info = env.reset(seed=1, options={"x0": {"v": 0.5}})
    >>> observation, reward, terminated, truncated, info = env.step([-1.0])
    >>> observation.round(6).tolist(), round(reward, 6), terminated, truncated
    ([0.4], -0.16, False, False)
    """
    for name, value in (("step", step), ("duration", duration), ("rtol", rtol), ("atol", atol)):
        if not value > 0 or (value == math.inf and name != "duration"):
            raise InputError(block.where(f"{name} must be positive, found {value:g}"))
    if num_envs is not None and num_envs < 1:
        raise InputError(block.where(f"num_envs must be 1 or more, found {num_envs}"))
    if substep is not None and not 0 < substep < math.inf:
        raise InputError(block.where(f"substep must be positive, found {substep:g}"))
    try:
        import gymnasium
    except ImportError:
        raise InputError('an environment needs Gymnasium: pip install ".[rl]"') from None
    from hovercontrol.blocks.backends.gym_env import SingleSteps
    from hovercontrol.blocks.backends.gym_vector import LaneSteps, RunnerSteps

    block = block.in_continuous_time
    start = by_state(block, start or {})
    seen = _chosen(block, "output", block.outputs, observations)
    acting = _chosen(block, "input", block.inputs, actions)
    task = Task(
        _observed(block, seen, reward, terminated),
        acting,
        seen,
        step,
        0 if duration == math.inf else max(1, math.ceil(duration / step - 1e-9)),
        _judge(reward),
        _judge(terminated),
        tuple(block.inputs.index(s) for s in acting),
        _draws(block, start),
        tuple(
            block.parameter_key(p.name)
            for p in block.parameters
            if p.name.rpartition(".")[2] == "seed"
            and not {p.name, block.parameter_key(p.name)} & {*start, *(params or {})}
        ),
        dict(params or {}),
        _limits(block, (*seen, *acting), bounds or {}),
        rtol,
        atol,
    )
    block.parameter_values(params)
    if num_envs is None:
        return joined(SingleSteps, gymnasium.Env)(task)
    lanes = not (block.ticks or block.delays)
    return joined(LaneSteps if lanes else RunnerSteps, gymnasium.vector.VectorEnv)(task, num_envs, substep)


def _judge(given: Any) -> Judge | None:
    """Return a function that judges a step, None for an expression: SymPy's symbols can be called, too."""
    return given if callable(given) and not isinstance(given, sp.Basic) else None


def _chosen(
    block: Block, kind: str, signals: Sequence[Signal], names: Sequence[str] | None
) -> tuple[Signal, ...]:
    known = {s.name: s for s in signals}
    for name in names or ():
        check_known(name, known, block.where(f"gym: unknown {kind} {name!r}"))
    found = tuple(known[name] for name in (known if names is None else names))
    if not found or len(set(found)) < len(found):
        raise InputError(
            block.where(f"gym: expected one or more different {kind}s, found {list(names or ())}")
        )
    return found


def _observed(block: Block, seen: Sequence[Signal], reward: Any, terminated: Any) -> Block:
    """Return the Block with the observations as its outputs, then the reward and the end."""
    known = {s.symbol for s in (*block.states, *block.inputs, *block.parameters)}
    known |= {time, *(sp.Symbol(name, real=True) for name in block.definitions)}
    own = {sp.Symbol(name, real=True): e for name, e in block.output_expressions.items()}
    told = {s.name: block.output_expressions[s.name] for s in seen}
    outputs = list(seen)
    for name, given in ((REWARD, reward), (ENDED, terminated)):
        if given is None or _judge(given) is not None:
            continue
        e = sp.sympify(given)
        e = sp.Piecewise((1.0, e), (0.0, True)) if name == ENDED else e
        e = e.xreplace({s: own[s] for s in e.free_symbols - known if s in own})
        for symbol in sorted(e.free_symbols - known, key=str):
            hint = did_you_mean(str(symbol), map(str, {*known, *own}))
            raise InputError(block.where(f"gym: {name[4:]} uses unknown signal {str(symbol)!r}{hint}"))
        told[name] = e
        outputs.append(Signal(name))
    return block.unchecked(outputs=tuple(outputs), output_expressions=Expressions(told))


def _draws(block: Block, start: Bounds) -> tuple[tuple[str, bool, float, float], ...]:
    states = {s.name for s in block.states}
    for name, (low, high) in start.items():
        if name not in states and name not in block.default_parameters:
            hint = did_you_mean(name, [*states, *block.default_parameters])
            raise InputError(block.where(f"start: unknown state or parameter {name!r}{hint}"))
        _interval(block, "start", name, low, high)
        if name not in states:
            for end in (low, high):
                block.parameter_values({name: end})
    return tuple((name, name in states, *ends) for name, ends in start.items())


def _limits(block: Block, signals: Sequence[Signal], bounds: Bounds) -> dict[str, tuple[float, float]]:
    known = [s.name for s in signals]
    for name, (low, high) in bounds.items():
        check_known(name, known, block.where(f"bounds: unknown action or observation {name!r}"))
        _interval(block, "bounds", name, low, high)
    return dict(bounds)


def _interval(block: Block, what: str, name: str, low: float, high: float) -> None:
    if not low <= high:
        raise InputError(block.where(f"{what} of {name!r}: expected (low, high), found ({low!r}, {high!r})"))
