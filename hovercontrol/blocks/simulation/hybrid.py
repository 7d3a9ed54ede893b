"""Simulation of a hybrid Block: integration between ticks; each tick occurs exactly at its time.

At a tick a sampled Block reads the continuous outputs and the other Blocks' outputs of that instant. It
computes its own outputs, which are held until its next tick, and then updates its states.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.simulation.arguments import initial_state
from hovercontrol.blocks.simulation.sampled import Ticking as Ticking
from hovercontrol.blocks.simulation.trajectory import simulate, time_response

if TYPE_CHECKING:
    import control

#: Maximum number of rows in the result of a simulation.
MAX_ROWS = 2_000_000


def simulate_hybrid(
    plant: Block,
    sampled: Block | Sequence[Block],
    until: float,
    *,
    x0: Sequence[float] | Mapping[str, float] | None = None,
    params: Mapping[str, float] | None = None,
    step: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> control.TimeResponseData:
    """Simulate a continuous Block with sampled Blocks in the loop, wired by signal name.

    Equivalent to :func:`~hovercontrol.blocks.interconnect.interconnect` followed by
    :func:`~hovercontrol.blocks.simulation.trajectory.simulate`, but the states keep the plant's own names.

    Parameters
    ----------
    plant : Block
        Continuous; join several with :func:`~hovercontrol.blocks.interconnect.interconnect`.
    sampled : Block or sequence of Block
        Each ticks at the multiples of its own period, from 0 s on.
    until : float
        Length of the simulation [s].
    x0 : array_like or mapping by name, optional
        Initial state of the plant; states not given have their start values.
    params : mapping, optional
        Parameter values of any of the Blocks, by key.
    step : float, optional
        Time between two rows of the result [s] (default: the shortest period of the sampled Blocks).
    progress : callable, optional
        Called at each row after the first with its time [s].

    Returns
    -------
    control.TimeResponseData
        The outputs are those of the plant, then those of the sampled Blocks after the ticks of that time. The
        states are those of the plant.

    Raises
    ------
    InputError
        If the plant is not continuous or another Block is not sampled, if an input has no source, if a key is
        unknown, or if the result would have more than two million rows.

    Examples
    --------
    >>> from hovercontrol.blocks.signals import Signal
    >>> v, a = Signal("v", "m/s", start=1.0), Signal("a", "m/s^2")
    >>> cart = Block("cart", [v], [a], [v], derivatives={"v": a.symbol})
    >>> k = Signal("k", "1/s", start=2.0)
    >>> brake = Block("brake", [], [v], [a], [k], output_expressions={"a": -k.symbol * v.symbol}, period=0.25)
    >>> simulate_hybrid(cart, brake, 1.0).outputs[0].round(9).tolist()  # halved from tick to tick
    [1.0, 0.5, 0.25, 0.125, 0.0625]
    """
    blocks = [sampled] if isinstance(sampled, Block) else list(sampled)
    _check(plant, blocks)
    whole = interconnect([plant, *blocks], inputs=[])
    step = min(block.period for block in blocks) if step is None else step
    if not (math.isfinite(until) and until > 0 and math.isfinite(step) and step > 0):
        raise InputError(f"simulate_hybrid: until and step must be positive, found {until!r} and {step!r}")
    if until / step > MAX_ROWS:
        raise InputError(f"simulate_hybrid: {until:g} s in steps of {step:g} s are too many rows")
    start = {
        f"{plant.name}.{s.name}": value
        for s, value in zip(plant.states, initial_state(plant, x0), strict=True)
    }
    times = np.array([k * step for k in range(math.floor(until / step * (1 + 1e-12)) + 1)])
    run = simulate(whole, times, x0=start, params=params, progress=progress)
    n = len(plant.states)
    outputs = np.atleast_2d(run.outputs)
    names = [s.name for s in whole.outputs]
    driven = np.array([outputs[names.index(s.name)] for s in plant.inputs]).reshape(-1, len(times))
    shown = plant.unchecked(outputs=whole.outputs)
    return time_response(shown, times, outputs, np.atleast_2d(run.states)[:n], driven)


def _check(plant: Block, blocks: Sequence[Block]) -> None:
    if not blocks:
        raise InputError("simulate_hybrid: expected at least one sampled block")
    plant.need_continuous("part between ticks", hybrid=False)
    for block in blocks:
        if not block.period:
            raise InputError(
                f"simulate_hybrid: block {block.name!r} is continuous: by interconnect, join it with the "
                "plant or, if it has no states, with a sampled block"
            )
