"""The motion along which a monitor's threshold is computed: measured channels and commands at ticks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError, shown
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.simulation.sampled import Ticking, simulate_runs
from hovercontrol.craft.models.base import output_for_channel
from hovercontrol.identification.monitor.pace import paced
from hovercontrol.logs.log import Log

#: Without a log: length of the motion [s], time between two steps of the commands [s], and their size in
#: units of the nominal size.
LENGTH, HOLD, SIZE = 60.0, 2.0, 2.5


@dataclass(frozen=True)
class Motion:
    """Measured channels and commands at ticks.

    Attributes
    ----------
    measured, inputs : ndarray, shape (K, m) and (K, p)
    seen : ndarray of bool, shape (K, m)
        Whether a tick has a sample of a channel; else the one before is held.
    sizes : dict of str to float
        Largest absolute value of each input, root mean square of each measured state.
    """

    measured: Array
    inputs: Array
    seen: NDArray[np.bool_]
    sizes: dict[str, float]


def motion_of(
    plant: Block,
    measured: Sequence[str],
    period: float,
    log: Log | None,
    name: str,
    *,
    is_craft: bool = True,
) -> Motion:
    """Return the motion of a log, or a simulated one under random steps of the commands.

    Raises
    ------
    InputError
        If the log lacks a channel or is short, or the simulated motion is not finite.
    """
    return (
        _simulated(plant, measured, period, name, is_craft)
        if log is None
        else _logged(plant, measured, period, log, name)
    )


def _logged(plant: Block, measured: Sequence[str], period: float, log: Log, name: str) -> Motion:
    for key in (*measured, *(s.name for s in plant.inputs)):
        if key not in log.columns:
            raise InputError(f"{name}: motion: log {log.name!r} has no column {key!r}")
    # row i belongs to the tick round((t_i - t_0)/T); of several the nearest in time, as in :mod:`.feed`
    place = (log.time - log.time[0]) / period
    tick = np.rint(place).astype(int)
    nearest_last = np.argsort(-np.abs(place - tick), kind="stable")

    def held(key: str) -> tuple[Array, NDArray[np.bool_]]:
        column = np.asarray(log.columns[key])
        rows = nearest_last[np.isfinite(column[nearest_last])]
        if not rows.size:
            raise InputError(f"{name}: motion: log {log.name!r} has no samples of {key!r}")
        at = np.full(tick[-1] + 1, np.nan)
        at[tick[rows]] = column[rows]
        seen = np.isfinite(at)
        last = np.maximum.accumulate(np.where(seen, np.arange(at.size), int(seen.argmax())))
        return at[last], seen

    pairs = [held(key) for key in measured]
    u = [held(s.name)[0] for s in plant.inputs]
    sizes = {s.name: float(np.abs(c).max()) or 1.0 for s, c in zip(plant.inputs, u, strict=True)}
    rates = {s.name: log.columns.get(s.name) for s in plant.states}
    sizes |= {k: float(np.sqrt(np.nanmean(np.square(c)))) or 1.0 for k, c in rates.items() if c is not None}
    y, seen = (np.stack(some, axis=1) for some in zip(*pairs, strict=True))
    return Motion(y, np.stack(u, axis=1) if u else np.zeros((len(y), 0)), seen, sizes)


def _simulated(plant: Block, measured: Sequence[str], period: float, name: str, is_craft: bool) -> Motion:
    rng = np.random.default_rng(1)
    length, hold = (paced(seconds, period, is_craft=is_craft) for seconds in (LENGTH, HOLD))
    K, each = round(length / period), max(1, round(hold / period))
    columns = []
    for s in plant.inputs:
        low, high = float(s.lower), float(s.upper)
        low = low if np.isfinite(low) else -SIZE * s.nominal
        high = high if np.isfinite(high) else SIZE * s.nominal
        columns.append(np.repeat(rng.uniform(low, high, K // each + 1), each)[:K])
    u = np.stack(columns, axis=1) if columns else np.zeros((K, 0))
    every = _ticked(plant, u) if plant.period else _integrated(plant, period, u)
    states = {s.name: every[s.name] for s in plant.states}
    y = np.stack([every[output_for_channel(list(every), key)] for key in measured], axis=1)
    if not np.isfinite(y).all():
        raise InputError(
            f"{name}: the model's motion under steps of its commands is not finite: give a log as motion, "
            f"with the columns {shown([*measured, *(s.name for s in plant.inputs)])}"
        )
    sizes = {s.name: float(np.abs(c).max()) or 1.0 for s, c in zip(plant.inputs, columns, strict=True)}
    sizes |= {k: float(np.sqrt(np.mean(c**2))) or 1.0 for k, c in states.items()}
    return Motion(y, u, np.ones(y.shape, bool), sizes)


def _integrated(plant: Block, period: float, u: Array) -> dict[str, Array]:
    """Return states and outputs of a continuous plant under inputs held for a period [s], (K, p)."""
    run = plant.compile().simulate(np.arange(len(u)) * period, u.T if u.size else None)
    found = dict(zip((s.name for s in plant.states), np.atleast_2d(run.states), strict=True))
    return found | dict(zip((s.name for s in plant.outputs), np.atleast_2d(run.outputs), strict=True))


def _ticked(plant: Block, u: Array) -> dict[str, Array]:
    """Return states and outputs of a sampled plant under inputs, (K, p), at the begin of its ticks."""
    shown = {s.name: s.symbol for s in plant.states} | dict(plant.output_expressions)
    signals = {s.name: s for s in (*plant.states, *plant.outputs)}
    every = plant.unchecked(
        outputs=tuple(signals[key] for key in shown), output_expressions=Expressions(shown)
    )
    inputs = dict(zip((s.name for s in plant.inputs), u.T, strict=True))
    if not inputs:
        run = Ticking(every)
        rows = [list(run.tick(k * plant.period, {}).values()) for k in range(len(u))]
        return dict(zip(shown, np.array(rows).T, strict=True))
    return {key: row[:, 0] for key, row in simulate_runs(every, inputs).items()}
