"""The result of a simulation: python-control's response, with units on the axes of its plot."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
from matplotlib.figure import Figure

from hovercontrol.base.errors import by_last_part, check_known
from hovercontrol.base.pyplot import in_front, open_in_pyplot
from hovercontrol.base.short_repr import listed

#: Height of one row of axes, and height of the title and the time axis together [in].
ROW, REST = 1.0, 1.2


class Response(control.TimeResponseData):
    """A :class:`control.TimeResponseData` with the units of its signals.

    Returned by :func:`hovercontrol.simulate`, ``block.compile().simulate`` and ``run_ins``. It can be used
    wherever python-control accepts a time response.

    Attributes
    ----------
    units : dict of str to str
        Units of outputs, states and inputs by name.
    held : bool
        Whether inputs are held from one sample to the next; the plot then draws them as steps.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> v, a = hc.Signal("v", "m/s"), hc.Signal("a", "m/s^2")
    >>> run = hc.simulate(hc.Block("cart", [v], [a], [v], derivatives={"v": a.symbol}), [0, 1], {"a": [1, 1]})
    >>> run.units
    {'v': 'm/s', 'a': 'm/s^2'}
    >>> run
    Response of cart: 2 times from 0 to 1 s
        outputs  v [m/s]
        states   v [m/s]
        inputs   a [m/s^2]
    >>> run["v"]
    array([0., 1.])
    """

    units: dict[str, str]
    held: bool

    def __repr__(self) -> str:
        time = np.asarray(self.time)
        of = f" of {self.sysname}" if self.sysname else ""
        lines = [f"Response{of}: {time.size} times from {time[0]:.6g} to {time[-1]:.6g} s"]
        for kind in ("outputs", "states", "inputs"):
            names = getattr(self, f"{kind.removesuffix('s')}_labels") or ()
            if names:
                texts = [f"{name} [{self.units[name]}]" if name in self.units else name for name in names]
                lines.append(f"    {kind:7}  {listed(texts, len(texts))}")
        return "\n".join(lines)

    def __getitem__(self, name: Any) -> Any:
        """Return an output, state or input over time, shape (n,), by its name or its last part where unique.

        A number is an index of python-control's tuple: time, outputs, states.
        """
        if not isinstance(name, str):
            return super().__getitem__(name)
        every: dict[str, Any] = {}
        for kind, rows in (("input", self.u), ("state", self.x), ("output", self.y)):
            every |= dict(
                zip(getattr(self, f"{kind}_labels") or (), rows if rows is not None else (), strict=False)
            )
        full = by_last_part(name, every)
        check_known(full, every, f"response of {self.sysname}: no signal {name!r}")
        return every[full]

    def plot(self, *args: Any, **kwargs: Any) -> control.ControlPlot:
        """Plot outputs and inputs over time, like :func:`control.time_response_plot`, with units on the axes.

        Responses plotted one after another share a figure, as in python-control.

        Parameters
        ----------
        *args, **kwargs
            As for :func:`control.time_response_plot`: ``plot_inputs``, ``overlay_signals``, ``ax``, ...

        Returns
        -------
        control.ControlPlot
            ``.figure``, ``.axes`` and ``.lines``.
        """
        if "ax" not in kwargs:
            self._open_figure(self._rows(kwargs))
        drawn = super().plot(*args, **kwargs)
        if "ax" not in kwargs:
            drawn.figure.set_layout_engine("constrained")  # "tight" would place the title inside tall axes
        for axes in np.ravel(drawn.axes):
            name = axes.get_ylabel()
            if name in self.units:
                axes.set_ylabel(f"{name} [{self.units[name]}]")
            if self.held and name in (self.input_labels or ()) and name not in (self.output_labels or ()):
                for line in axes.lines:
                    line.set_drawstyle("steps-post")
        return drawn

    def _rows(self, kwargs: dict[str, Any]) -> int:
        """Return the number of rows of axes in the figure."""
        inputs = kwargs.get("plot_inputs")
        inputs = self.plot_inputs if inputs is None else inputs
        outputs = self.noutputs if kwargs.get("plot_outputs", True) else 0
        if kwargs.get("transpose"):
            return 1
        if kwargs.get("overlay_signals"):
            return bool(outputs) + (inputs is True)
        return max(outputs, self.ninputs) if inputs == "overlay" else outputs + self.ninputs * bool(inputs)

    def _open_figure(self, rows: int) -> None:
        """Open a figure of the right height unless the front one is empty or has responses with as many rows.

        python-control draws into any open figure with the right number of axes, even an unrelated plot.
        """
        front = in_front()
        if front is not None and hasattr(front, "_output_offset") and rows in (1, len(front.axes)):
            front.set_layout_engine("tight")  # python-control expects this layout engine
        elif front is None or front.axes:
            open_in_pyplot(Figure(figsize=(6.4, max(4.8, REST + ROW * rows))))
