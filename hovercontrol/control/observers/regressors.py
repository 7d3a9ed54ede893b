"""h and G of a regression as compiled functions, for estimators and excitation checks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arguments import as_row
from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.functions import call_scalar, numpy_functions
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.blocks.units import simplified
from hovercontrol.control.observers.regression import Regression


@checked
class Regressors:
    """h and G of a regression ``x' = h + G c`` as compiled functions of time and signals.

    Of a sampled Block ``x(k+1) = h + G c``.

    Parameters
    ----------
    model : Regression
    drift : bool, optional
        False omits h (it is returned as zero), so that only the signals in G are needed.

    Attributes
    ----------
    measured, inputs : tuple of str
        The Block's states and inputs that are needed, in the Block's order; with drift also the states x.

    Examples
    --------
    >>> from hovercontrol.control.observers.regression import regression
    >>> from hovercontrol.craft.models.vehicles import hoverdemon
    >>> f = Regressors(regression(hoverdemon().plant()))
    >>> f.measured, f.inputs
    (('u', 'v', 'r'), ('thrust', 'rudder'))
    >>> f.at(0.0, [0.5, 0.0, 1.0, 2.0, 0.0])[:2]  # columns h, thrust, rudder_torque
    array([[ 0. ,  2. ,  0. ],
           [-0.5,  0. ,  0. ]])
    """

    def __init__(self, model: Regression, drift: bool = True) -> None:
        n, m = model.G.shape
        rates = [s.unit if model.block.period else simplified(f"({s.unit})/s") for s in model.states]
        entries = {
            (i, 0): (Signal(f"h[{i}]", rates[i]), e) for i, e in enumerate(model.h) if drift and e != 0
        }
        for i in range(n):
            for j, c in enumerate(model.coefficients):
                if model.G[i, j] != 0:
                    signal = Signal(f"G[{i},{j}]", simplified(f"{rates[i]}/({c.unit})"))
                    entries[i, j + 1] = (signal, model.G[i, j])
        used = set().union(*(e.free_symbols for _, e in entries.values())) - {time}
        own = set(model.states) if drift else set()
        measured = [s for s in model.block.states if s.symbol in used or s in own]
        inputs = [s for s in model.block.inputs if s.symbol in used]
        block = Block(
            model.block.name,
            inputs=(*measured, *inputs),
            outputs=tuple(s for s, _ in entries.values()),
            parameters=tuple(p for p in model.block.parameters if p.symbol in used),
            output_expressions={s.name: e for s, e in entries.values()},
        )
        self.model = model
        self.measured = tuple(s.name for s in measured)
        self.inputs = tuple(s.name for s in inputs)
        self._shape = (n, m + 1)
        self._places = np.array([i * (m + 1) + j for i, j in entries], dtype=int)
        self._functions = numpy_functions(block)
        self._pair = self._functions.scalar_pair("outputs")
        self._values = block.parameter_values()

    def __repr__(self) -> str:
        return f"Regressors of {', '.join((*self.measured, *self.inputs))}"

    def at(self, t: float, signals: Sequence[float]) -> Array:
        """Return ``[h G]``, shape (n, 1 + m), at time t [s]; signals: measured, then inputs."""
        table = np.zeros(self._shape)
        table.ravel()[self._places] = call_scalar(self._pair, t, (), signals, self._values)
        return table

    def series(self, t: Array, signals: Mapping[str, ArrayLike]) -> Array:
        """Return ``[h G]`` over times [s], shape (n, 1 + m, len(t)); errors as :meth:`columns`.

        Parameters
        ----------
        t : ndarray, shape (k,)
            Times [s].
        signals : mapping of str to array_like
            States and inputs by name, each shape (k,) or a number.
        """
        t = as_row("time", t)
        values = self.columns(t, signals)
        table = np.zeros((self._shape[0] * self._shape[1], len(t)))
        table[self._places] = self._functions.outputs(t, (), values)
        return table.reshape(*self._shape, len(t))

    def columns(self, t: Array, signals: Mapping[str, ArrayLike]) -> Array:
        """Return the needed signals, shape (number, len(t)), measured first.

        Raises
        ------
        InputError
            If time does not increase, or signals are missing (the message names all of them), of another
            length or not finite.
        """
        t = as_row("time", t)
        if len(t) < 2 or not np.isfinite(t).all() or not (np.diff(t) > 0).all():
            raise InputError("time must be two or more finite, increasing numbers")
        names = (*self.measured, *self.inputs)
        missing = [name for name in names if name not in signals]
        if missing:
            hint = did_you_mean(missing[0], signals)
            raise InputError(
                f"block {self.model.block.name!r}: missing signals {', '.join(missing)} "
                f"(needed: {', '.join(names)}){hint}"
            )
        rows = np.empty((len(names), len(t)))
        for k, name in enumerate(names):
            own = np.asarray(signals[name], dtype=float)
            if own.shape != t.shape:
                text = f"expected {len(t)} values, found shape {own.shape}"
                raise InputError(f"signal {name!r}: {text}")
            bad = np.flatnonzero(~np.isfinite(own))
            if bad.size:
                where = f"at t = {t[bad[0]]:.6g} s (row {bad[0]})"
                raise InputError(f"signal {name!r}: not finite {where}")
            rows[k] = own
        return rows
