"""What a Block offers of its backends, each asked for by name (:mod:`hovercontrol.core.backends`)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal, cast

from numpy.typing import ArrayLike

from hovercontrol.core.backends import backend
from hovercontrol.core.boundary import checked
from hovercontrol.errors import InputError

if TYPE_CHECKING:
    import control

    from hovercontrol.core.block import Block
    from hovercontrol.core.friction import Friction
    from hovercontrol.core.functions import NumpyFunctions
    from hovercontrol.simulation.runner import BlockRunner
    from hovercontrol.targets.compiled import CompiledBlock


@partial(checked, name="Block")
class Backends:
    """The methods of a :class:`~hovercontrol.core.block.Block` that others carry out."""

    @property
    def _block(self) -> Block:
        return cast("Block", self)

    def _repr_html_(self) -> str:
        return str(backend("html")(self))

    def equations(self, form: Literal["text", "latex"] = "text") -> str:
        """Return the equations, one line each: definitions, derivatives, then computed outputs.

        Parameters
        ----------
        form : {"text", "latex"}, optional

        Raises
        ------
        InputError
            If the form is another.
        """
        from hovercontrol.core.equations import latex_equations, text_equations

        if form not in ("text", "latex"):
            raise InputError(f"equations come as 'text' or 'latex', not {form!r}")
        return text_equations(self._block) if form == "text" else latex_equations(self._block)

    def to_numpy(self) -> NumpyFunctions:
        """Return the Block as NumPy functions (:mod:`hovercontrol.core.functions`).

        Raises
        ------
        InputError
            If inputs act late: no function of a point knows their past.
        """
        from hovercontrol.core.functions import numpy_functions

        return numpy_functions(self._block)

    def start(
        self,
        x0: ArrayLike | Mapping[str, float] | None = None,
        params: Mapping[str, float] | None = None,
        *,
        inputs: Sequence[float] | Mapping[str, float] | float | None = None,
        time: float = 0.0,
        rtol: float = 1e-6,
        atol: float = 1e-9,
    ) -> BlockRunner:
        """Start a run that goes step by step, on plain Python floats; ``block.compile().start()`` is faster.

        Parameters
        ----------
        x0 : array_like, shape (n_states,), or mapping by name, optional
            Initial state over the states' start values.
        params : mapping, optional
            Parameter values by key, over the defaults.
        inputs : sequence of float, or mapping by name, optional
            Before the first step, over the inputs' start values.
        time : float, optional
            To start at [s].
        rtol, atol : float, optional
            Relative and absolute tolerance of the solver.

        Returns
        -------
        BlockRunner
            With ``step(inputs, dt)``, ``set``, ``state``, ``outputs``, ``time``, ``save`` and ``restore``
            (:class:`hovercontrol.simulation.runner.Runner`).

        Raises
        ------
        InputError
            If a name, a shape or a value is wrong.

        Examples
        --------
        >>> from hovercontrol.core.block import Block
        >>> from hovercontrol.core.signals import Signal
        >>> v, k = Signal("v", "m/s", start=1.0), Signal("k", "1/s", start=2.0)
        >>> run = Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol}).start()
        >>> run.step(None, 0.5).round(5).tolist(), run.time
        ([0.36788], 0.5)
        >>> begin = run.save()
        >>> run.set(params={"decay.k": 0.0})
        >>> run.step(None, 0.5).round(5).tolist()
        [0.36788]
        >>> run.restore(begin)
        >>> run.step(None, 0.5).round(5).tolist()
        [0.13534]
        """
        run: BlockRunner = backend("start")(self, x0, params, inputs=inputs, time=time, rtol=rtol, atol=atol)
        return run

    def to_control(
        self, name: str | None = None, *, step: float | None = None, pade: int | None = None
    ) -> control.NonlinearIOSystem:
        """Return the Block as one python-control system (:mod:`hovercontrol.targets.to_control`).

        A continuous Block becomes a continuous-time system or, with `step`, a discrete-time one that is exact
        for inputs that hold from step to step (zero-order hold); so is its linearisation. A sampled Block
        becomes a discrete-time system of its period, a hybrid one of `step`. Inputs that act late are held in
        shift registers of `step`, or approximated by Pade's fraction of order `pade`.

        Parameters
        ----------
        name : str, optional
            Of the system; default the Block's.
        step : float, optional
            Of the discrete-time system [s].
        pade : int, optional
            Order of the fraction that stands for a delay.

        Raises
        ------
        InputError
            If the step is not positive, or an input acts late and neither `step` nor `pade` is given.

        Examples
        --------
        >>> import hovercontrol as hc
        >>> plant = hc.vehicle("hoverdemon").plant()
        >>> plant.to_control().isctime(), plant.to_control(step=0.02).dt
        (True, 0.02)
        """
        return backend("control")(self, name, step=step, pade=pade)

    def compile(self, *, friction: Friction = "smooth") -> CompiledBlock:
        """Return the Block as machine code, for fast simulation and sweeps over many runs.

        Parameters
        ----------
        friction : {"smooth", "events"}, optional
            Dry friction smoothed over its width, as the other backends compute it: results are those of
            :func:`hovercontrol.simulate`. Or Coulomb's law, sticking at exactly zero velocity, its events
            located; see :data:`hovercontrol.core.friction.Friction` for what is physical.
        """
        compiled: CompiledBlock = backend("compile")(self._block.in_continuous_time, friction=friction)
        return compiled

    def to_fmu(
        self,
        path: str | Path,
        *,
        version: Literal[2, 3] = 3,
        platforms: str | Iterable[str] | None = None,
        friction: Friction = "smooth",
        step: float | None = None,
        stop: float | None = None,
        rtol: float = 1e-6,
        atol: float = 1e-9,
        progress: Callable[[float], None] | None = None,
    ) -> Path:
        """Write the Block as an FMU, Model Exchange and Co-Simulation in one file.

        A sampled Block becomes one whose outputs hold. Arguments, result and errors are those of
        :func:`hovercontrol.fmi.exporter.export.export_fmu`.

        Parameters
        ----------
        path : path
            Ends in ``.fmu``.
        version, platforms, friction, step, stop, rtol, atol, progress
            As for :func:`hovercontrol.fmi.exporter.export.export_fmu`.
        """
        written: Path = backend("fmu")(
            self,
            path,
            version=version,
            platforms=platforms,
            friction=friction,
            step=step,
            stop=stop,
            rtol=rtol,
            atol=atol,
            progress=progress,
        )
        return written

    def linearize(
        self,
        x: ArrayLike | control.OperatingPoint,
        u: ArrayLike | None = None,
        params: Mapping[str, float] | None = None,
        t: float = 0.0,
    ) -> control.StateSpace:
        """Return the exact linearisation at a point as a python-control state-space system.

        Parameters
        ----------
        x : array_like, shape (n_states,), scalar for all states, or control.OperatingPoint
        u : array_like, shape (n_inputs,), or scalar for all inputs; default the operating point's, or 0
        params : mapping, optional
            Parameter values by key, over the defaults.
        t : float, optional
            Time [s].
        """
        return self.to_control().linearize(x, u, t=t, params=params)
