"""Simulation of a Block over time, with inputs held between samples.

python-control interpolates inputs linearly, so a step on a coarse grid becomes a ramp. Here each input sample
is held until the next one (or interpolated, with ``hold="linear"``), and the solver restarts wherever an
input jumps.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delays import arrivals, undelayed
from hovercontrol.blocks.functions import call_scalar, numpy_functions
from hovercontrol.blocks.simulation.arguments import checked_times, initial_state, input_rows
from hovercontrol.blocks.simulation.effort import Effort
from hovercontrol.blocks.simulation.ticking import run_hybrid
from hovercontrol.blocks.switching import longest_step

if TYPE_CHECKING:
    import control

    from hovercontrol.blocks.simulation.response import Response


#: Solvers of :func:`scipy.integrate.solve_ivp`.
METHODS = ("RK45", "RK23", "DOP853", "Radau", "BDF", "LSODA")


@checked
def simulate(
    block: Block,
    time: ArrayLike,
    inputs: ArrayLike | Mapping[str, ArrayLike] | None = None,
    x0: ArrayLike | Mapping[str, float] | None = None,
    params: Mapping[str, float] | None = None,
    *,
    hold: Literal["zero", "linear"] = "zero",
    method: str = "RK45",
    rtol: float = 1e-6,
    atol: float = 1e-9,
    max_step: float = math.inf,
    outputs: Sequence[str] | None = None,
    progress: Callable[[float], None] | None = None,
) -> control.TimeResponseData:
    """Simulate a Block over a time grid.

    Parameters
    ----------
    block : Block
    time : array_like, shape (n,)
        Increasing times [s]; the results are given at these times.
    inputs : array_like of shape (n_inputs, n) or (n_inputs,), or mapping by name, optional
        Values at those times; for a single input, an array of shape (n,) is enough. Inputs not given keep
        their start values. A delayed input has its start value until the first sample arrives.
    x0 : array_like, shape (n_states,), or mapping by name, optional
        Initial state; states not given have their start values.
    params : mapping, optional
        Parameter values by key.
    hold : {"zero", "linear"}, optional
        "zero" holds each input between samples (a step stays a step); "linear" interpolates.
    method, rtol, atol, max_step
        As for :func:`scipy.integrate.solve_ivp`. If the Block has time-dependent switches (waypoints,
        pulses), the step size is at most half the shortest time between two switches, so that no step skips
        one. A hybrid Block ignores `method`: it is integrated between ticks by the Dormand-Prince method.
    outputs : sequence of str, optional
        Names of the outputs to compute (default: all).
    progress : callable, optional
        Called with the time reached [s], often during the run.

    Returns
    -------
    control.TimeResponseData
        Has the signals' names, their units in ``.units``, and ``.plot()`` (``.to_pandas()`` if pandas is
        installed).

    Raises
    ------
    InputError
        If times do not increase, a shape or name is wrong, or the solver fails (the message gives the time).

    Examples
    --------
    >>> from hovercontrol.blocks.signals import Signal
    >>> v, a = Signal("v", "m/s"), Signal("a", "m/s^2")
    >>> cart = Block("cart", [v], [a], [v], derivatives={"v": a.symbol})
    >>> response = simulate(cart, [0, 1, 2], {"a": [0, 1, 1]})
    >>> response.outputs.round(6).tolist()
    [0.0, 0.0, 1.0]
    """
    block = block.in_continuous_time
    if outputs is not None:
        block = block.with_outputs(outputs)
    times = checked_times(time)
    u = input_rows(block, inputs, times)
    x = initial_state(block, x0)
    p = block.parameter_values(params)
    _check_solver(method, rtol, atol, max_step)
    if hold not in ("zero", "linear"):
        raise InputError(f"hold must be 'zero' or 'linear', found {hold!r}")
    if hold != "zero" and (block.delays or block.ticks):
        kind = "block with delays" if block.delays else "hybrid block"
        raise InputError(f"block {block.name!r}: the inputs of a {kind} hold, found hold={hold!r}")
    if block.delays:
        late = arrivals(block, times, u, p)
        run = simulate(
            undelayed(block), late.times, late.inputs, x, params, method=method, rtol=rtol, atol=atol,
            max_step=max_step, progress=progress,
        )  # fmt: skip
        y, z = (np.reshape(rows, (-1, len(late.times)))[:, late.given] for rows in (run.outputs, run.states))
        return time_response(block, times, y, z, u)
    longest = min(max_step, longest_step(block, params, times[0], times[-1]))
    if block.ticks:
        states = run_hybrid(block, times, u, x, p, rtol=rtol, atol=atol, longest=longest, progress=progress)
    else:
        states = _integrate(
            block,
            times,
            u,
            x,
            p,
            hold,
            method=method,
            rtol=rtol,
            atol=atol,
            longest=longest,
            progress=progress,
        )
    y = numpy_functions(block).outputs(times, states, u, params)
    return time_response(block, times, y, states, u, held=hold == "zero")


def _check_solver(method: str, rtol: float, atol: float, max_step: float) -> None:
    check_known(method, METHODS, f"unknown method {method!r}")
    for name, limit in (("rtol", rtol), ("atol", atol), ("max_step", max_step)):
        if not limit > 0:
            raise InputError(f"{name} must be positive, found {limit:g}")
        if name != "max_step" and limit == math.inf:  # the first step would be infinite
            raise InputError(f"{name} must be finite, found {limit:g}")


def _integrate(
    block: Block,
    times: Array,
    u: Array,
    x: Array,
    p: Sequence[float],
    hold: Literal["zero", "linear"],
    *,
    method: str,
    rtol: float,
    atol: float,
    longest: float,
    progress: Callable[[float], None] | None,
) -> Array:
    """Return the states of a continuous Block at the given times; the solver restarts where inputs jump."""
    states = np.empty((len(block.states), len(times)))
    states[:, 0] = x
    rhs = numpy_functions(block).scalar_pair("derivatives")
    effort = Effort(block, p, float(times[0]), float(times[-1]), rtol, atol)
    latest: tuple[float, list[float], list[float]] = float(times[0]), x.tolist(), u[:, 0].tolist()
    for first, last in _pieces(times, u, hold):
        value = _input_function(times, u, first, last, hold)

        def f(t: float, x: Array, value: Callable[[float], list[float]] = value) -> Any:
            nonlocal latest
            latest = t, x.tolist(), value(t)
            effort.spend(*latest)
            if progress is not None:
                progress(t)
            return call_scalar(rhs, *latest, p)

        if block.states:
            if not np.isfinite(f(times[first], states[:, first])).all():  # the solver would never return
                raise effort.stopped(*latest, "a derivative is not a number there")
            result = solve_ivp(
                f,
                (times[first], times[last]),
                states[:, first],
                t_eval=times[first : last + 1],
                method=method,
                rtol=rtol,
                atol=atol,
                max_step=longest,
            )
            if not result.success or not np.isfinite(result.y).all():
                raise effort.stopped(*latest, result.message.rstrip("."))
            states[:, first : last + 1] = result.y
    return states


def time_response(
    block: Block,
    times: Array,
    outputs: Array,
    states: Array,
    u: Array,
    *,
    held: bool = True,
    kind: type[Response] | None = None,
) -> Response:
    """Return a simulation's arrays, each of shape (signals, times), as a response with names and units.

    Parameters
    ----------
    kind : type, optional
        Class of the response (default: :class:`.Response`).
    """
    from hovercontrol.blocks.simulation.response import (
        Response,  # the import takes a second; done only when needed
    )

    response = (kind or Response)(
        times,
        outputs,
        states,
        u,
        issiso=len(block.outputs) == 1 and len(block.inputs) == 1,
        output_labels=[s.name for s in block.outputs],
        state_labels=[s.name for s in block.states],
        input_labels=[s.name for s in block.inputs],
        sysname=block.name,
        title=block.name,
        plot_inputs=bool(block.inputs),
    )
    response.units = {s.name: s.unit for s in (*block.states, *block.outputs, *block.inputs)}
    response.held = held
    return response


def _pieces(times: Array, u: Array, hold: str) -> list[tuple[int, int]]:
    """Return index pairs of the segments within which no input jumps (held) or bends (interpolated)."""
    change = np.diff(u, axis=1)
    if hold == "linear":  # unless it restarts at each bend, the solver can skip a short pulse
        change = np.diff(change / np.diff(times), axis=1)
    jumps = (np.flatnonzero((change != 0).any(axis=0)) + 1).tolist()
    edges = [0, *(k for k in jumps if k < u.shape[1] - 1), u.shape[1] - 1]
    return list(pairwise(edges))


def _input_function(
    times: Array, u: Array, first: int, last: int, hold: str
) -> Callable[[float], list[float]]:
    if hold == "zero" or (u == u[:, :1]).all():
        held = u[:, first].tolist()
        return lambda t: held
    return lambda t: [float(np.interp(t, times, row)) for row in u]
