"""Inputs in other units, or of the other sign, told by coefficients that come to lie far from the model's."""

from __future__ import annotations

import numpy as np

from hovercontrol.discrepancy.fit import Fit
from hovercontrol.errors import InputError
from hovercontrol.identify.excitation import inputs_beside

#: By how much logs must want more (or less) of an input than the model has, what is its opposite, and how
#: well they must know it (standard error, relative): no craft is so far from its model, but one in other
#: units. What a model lacks may take nearly all of a gain, yet never so surely.
FAR, OPPOSITE, KNOWN = 20.0, -0.5, 0.02


def refuse_gains(base: Fit) -> None:
    """Refuse inputs that do a small part, or many times, or the opposite of what the model says.

    Parameters
    ----------
    base : Fit
        Of the given model.

    Raises
    ------
    InputError
        If the coefficient of an input is 20 times as large or as small as the model's, or about its opposite,
        and well known: its column is in another unit, or of another sign.
    """
    w, std = base.windowed, np.sqrt(np.diag(base.covariance))
    far: dict[int, list[str]] = {}
    for j, (value, given) in enumerate(zip(base.p, w.start, strict=True)):
        if given == 0.0 or std[j] > KNOWN * abs(value):
            continue
        times = value / given
        if times > FAR or abs(times) < 1.0 / FAR or times < OPPOSITE:
            far[j] = inputs_beside(w.block, w.block.parameter(w.names[j]).name)
    far = {j: inputs for j, inputs in far.items() if inputs}
    if not far:
        return
    first = min(far, key=lambda j: len(far[j]))
    shared = [n for n in far[first] if all(n in inputs for inputs in far.values())] or far[first]
    units = {s.name: "" if s.unit == "1" else f" ({s.unit})" for s in w.block.inputs}
    columns = " and ".join(f"{n!r}{units[n]}" for n in shared)
    logs, name = ", ".join(m.name for m in w.data.logs), w.names[first]
    raise InputError(
        f"{logs}: {name} would be {base.p[first]:.3g} {w.block.parameter(name).unit}, the model has "
        f"{w.start[first]:.3g}: {'are columns' if len(shared) > 1 else 'is column'} {columns} in the model's "
        "units, and of its sign? If so, the model is far off: fit it first (hovercontrol identify)"
    )
