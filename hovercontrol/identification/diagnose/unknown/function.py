"""A function that logs filled in: its table with standard errors, and the forms that it may have."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.figure_style import BLUE, VERMILION
from hovercontrol.base.percent import percent
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.base.short_repr import short_repr
from hovercontrol.base.text_table import aligned
from hovercontrol.craft.models.functions import KnownFunction
from hovercontrol.identification.engine.fit import Fit

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@checked
@dataclass(frozen=True, eq=False)
class Form:
    """A form of few numbers that a function may have.

    Attributes
    ----------
    name : str
        ``"saturating"``; ``"table"`` for none of the forms.
    text : str
        ``"a C_s/(b + C_s)"``.
    function : TableFunction or FormFunction
    numbers : mapping of str to (float, float)
        Value and standard error of each of its numbers.
    units : mapping of str to str
    probability : float
        Among all forms and the table, by their evidence.
    at, values : ndarray, shape (m,)
        The form over the range of the logs.
    fit : Fit
        Of the model with this form.
    """

    name: str
    text: str
    function: KnownFunction
    numbers: Mapping[str, tuple[float, float]]
    units: Mapping[str, str]
    probability: float
    at: Array
    values: Array
    fit: Fit

    __repr__ = short_repr

    def odds(self, other: Form) -> float:
        """Return how many times likelier it is than another form."""
        return self.probability / max(other.probability, 1e-300)

    def __str__(self) -> str:
        own = [f"{k} = {v:.4g} ± {s:.2g} {self.units[k]}".rstrip(" 1") for k, (v, s) in self.numbers.items()]
        return f"{self.text}{', ' if own else ''}{', '.join(own)}"


@checked
@dataclass(frozen=True, eq=False)
class FittedFunction:
    """An unknown function (:func:`hovercontrol.unknown`) as the logs show it.

    Attributes
    ----------
    name, argument : str
        ``"mu"``, ``"C_s"``.
    unit, argument_unit : str
    grid : ndarray, shape (n,)
        Values of the argument: the nodes of a cubic spline. Beyond them it is constant.
    values, std : ndarray, shape (n,)
        The function there, and its standard errors.
    forms : tuple of Form
        The likeliest first; empty from ``identify``.
    """

    name: str
    argument: str
    unit: str
    argument_unit: str
    grid: Array
    values: Array
    std: Array
    forms: tuple[Form, ...] = ()

    __repr__ = short_repr

    def lines(self) -> list[str]:
        """Return the function as lines of text."""
        head = (f"{self.argument} [{self.argument_unit}]", f"{self.name} [{self.unit}]", "std")
        rows = zip(self.grid, self.values, self.std, strict=True)
        table = [(f"{a:.4g}", f"{v:.4g}", f"{s:.2g}") for a, v, s in rows]
        forms = [(percent(f.probability), str(f)) for f in self.forms if f.probability > 1e-3]
        return [*aligned([head, *table]), *(aligned([("probability", "form"), *forms]) if forms else [])]

    def sentence(self) -> str:
        """Return one sentence on the likeliest form."""
        best, *others = self.forms
        if best.name == "table":
            return f"{self.name}({self.argument}) has none of the known forms: it is a table."
        near = [f"{f.text} ({percent(f.probability)})" for f in others if f.probability > 0.01]
        said = f"{self.name}({self.argument}) = {best}, with {percent(best.probability)} probability"
        return f"{said}{'; or else ' if near else ''}{', '.join(near)}."

    def result(self) -> dict[str, Any]:
        """Return the function for JSON."""
        return {
            "name": self.name,
            "signals": [self.argument],
            "unit": self.unit,
            "grid": self.grid.tolist(),
            "values": self.values.tolist(),
            "std": self.std.tolist(),
            "forms": [
                {
                    "name": f.name, "text": f.text, "probability": f.probability,
                    "numbers": {
                        k: {"value": v, "std": s, "unit": f.units[k]} for k, (v, s) in f.numbers.items()
                    },
                }
                for f in self.forms
            ],
        }  # fmt: skip

    def plot(self) -> Figure:
        """Return a figure of the table with its 95 % band, and of the likeliest form."""
        return open_in_pyplot(function_figure(self))


def function_figure(f: FittedFunction) -> Figure:
    """Return a figure of a function and its 95 % band, and of its likeliest form."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.0, 3.6), layout="constrained")
    axes = figure.subplots()
    wide = np.where(np.isfinite(f.std), 1.96 * f.std, np.nan)
    axes.fill_between(f.grid, f.values - wide, f.values + wide, color=BLUE, alpha=0.2, linewidth=0)
    axes.plot(f.grid, f.values, "o-", color=BLUE, markersize=4, label="table, 95 %")
    for form in f.forms[:1]:
        if form.name != "table":
            label = f"{form.text} ({percent(form.probability)})"
            axes.plot(form.at, form.values, "--", color=VERMILION, label=label)
    axes.set(xlabel=f"{f.argument} [{f.argument_unit}]", ylabel=f"{f.name} [{f.unit}]")
    axes.legend(frameon=False)
    return figure
