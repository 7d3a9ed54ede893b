"""The regressors G of a regression along a motion, for checks of excitation."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arguments import as_row
from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.functions import numpy_functions
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.blocks.units import simplified
from hovercontrol.control.observers.regression import Regression


@checked
def regressors_along(model: Regression, t: ArrayLike, signals: Mapping[str, ArrayLike]) -> Array:
    """Return G of a regression ``x' = h + G c`` along a motion, shape (n, m, len(t)).

    Of a sampled Block ``x(k+1) = h + G c``.

    Parameters
    ----------
    model : Regression
    t : array_like, shape (k,)
        Increasing times [s].
    signals : mapping of str to array_like, shape (k,)
        The states and inputs that G needs, by name; more are ignored.

    Raises
    ------
    InputError
        If time does not increase, or signals are missing (the message names all of them), of another
        length or not finite.

    Examples
    --------
    >>> from hovercontrol.control.observers.regression import regression
    >>> from hovercontrol.craft.models.vehicles import hoverdemon
    >>> signals = {"thrust": [2.0, 4.0], "rudder": [0.0, 0.0]}
    >>> regressors_along(regression(hoverdemon().plant()), [0.0, 1.0], signals)[0, 0]  # of thrust in u'
    array([2., 4.])
    """
    n, m = model.G.shape
    rates = [s.unit if model.block.period else simplified(f"({s.unit})/s") for s in model.states]
    entries = {
        (i, j): Signal(f"G[{i},{j}]", simplified(f"{rates[i]}/({c.unit})"))
        for i in range(n)
        for j, c in enumerate(model.coefficients)
        if model.G[i, j] != 0
    }
    used = model.G.free_symbols - {time}
    needed = [s for s in (*model.block.states, *model.block.inputs) if s.symbol in used]
    block = Block(
        model.block.name,
        inputs=tuple(needed),
        outputs=tuple(entries.values()),
        parameters=tuple(p for p in model.block.parameters if p.symbol in used),
        output_expressions={s.name: model.G[place] for place, s in entries.items()},
    )
    t = as_row("time", t)
    table = np.zeros((n, m, len(t)))
    table[tuple(np.transpose(list(entries)))] = numpy_functions(block).outputs(
        t, (), _rows(block, t, signals)
    )
    return table


def _rows(block: Block, t: Array, signals: Mapping[str, ArrayLike]) -> Array:
    """Return a Block's inputs along a motion, shape (number, len(t))."""
    if len(t) < 2 or not np.isfinite(t).all() or not (np.diff(t) > 0).all():
        raise InputError("time must be two or more finite, increasing numbers")
    names = [s.name for s in block.inputs]
    missing = [name for name in names if name not in signals]
    if missing:
        hint = did_you_mean(missing[0], signals)
        raise InputError(
            f"block {block.name!r}: missing signals {', '.join(missing)} (needed: {', '.join(names)}){hint}"
        )
    rows = np.empty((len(names), len(t)))
    for k, name in enumerate(names):
        own = np.asarray(signals[name], dtype=float)
        if own.shape != t.shape:
            raise InputError(f"signal {name!r}: expected {len(t)} values, found shape {own.shape}")
        bad = np.flatnonzero(~np.isfinite(own))
        if bad.size:
            where = f"at t = {t[bad[0]]:.6g} s (row {bad[0]})"
            raise InputError(f"signal {name!r}: not finite {where}")
        rows[k] = own
    return rows
