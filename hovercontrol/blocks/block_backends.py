"""The methods of a Block that its backends carry out.

Each method imports its backend when it is called: Block is at the bottom of the package, its backends are
above. This is the one module that may import from a layer above its own, and only inside functions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

from numpy.typing import ArrayLike

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.installed_backends import installed_backend

if TYPE_CHECKING:
    import control

    from hovercontrol.blocks.backends.casadi import CasadiFunctions
    from hovercontrol.blocks.backends.compiled import CompiledBlock
    from hovercontrol.blocks.backends.jax import JaxFunctions
    from hovercontrol.blocks.backends.trim import Trim
    from hovercontrol.blocks.block import Block
    from hovercontrol.blocks.friction import Friction
    from hovercontrol.blocks.functions import NumpyFunctions
    from hovercontrol.blocks.simulation.runner import BlockRunner


#: The method of each backend of this package, by the name for ``block.to``.
_OWN = {
    "numpy": "to_numpy",
    "control": "to_control",
    "compiled": "compile",
    "c": "to_c",
    "fmu": "to_fmu",
    "casadi": "to_casadi",
    "jax": "to_jax",
    "gym": "gym",
}


@partial(checked, name="Block")
class Backends:
    """The methods of a :class:`~hovercontrol.blocks.block.Block` that others carry out."""

    @property
    def _block(self) -> Block:
        return cast("Block", self)

    def _repr_html_(self) -> str:
        from hovercontrol.blocks.display import block_html

        return block_html(self._block)

    @cached_property
    def in_continuous_time(self) -> Block:
        """The Block itself; for a sampled Block a hybrid one that does the same, with held outputs.

        The states of the hybrid Block have the Block's name in front, as in any interconnection.
        """
        from hovercontrol.blocks.interconnect import interconnect

        block = self._block
        return interconnect([block], block.name, hybrid=True) if block.period else block

    def to(self, backend: str, **options: Any) -> Any:
        """Return the Block in the form of a backend, by the backend's name.

        Backends of this package are ``numpy``, ``control``, ``compiled``, ``c``, ``fmu``, ``casadi``, ``jax``
        and ``gym``: the methods :meth:`to_numpy`, :meth:`to_control`, :meth:`compile`, :meth:`to_c`,
        :meth:`to_fmu`, :meth:`to_casadi`, :meth:`to_jax` and :meth:`gym`. Another package adds a backend by
        an entry point of the group ``hovercontrol.backends``
        (:mod:`hovercontrol.blocks.installed_backends`): a function of the Block and the options.

        Parameters
        ----------
        backend : str
        **options
            Arguments of the backend, such as ``path`` of ``fmu``.

        Returns
        -------
        object
            What the backend returns.

        Raises
        ------
        InputError
            If the backend is unknown or cannot be imported; otherwise as the backend.

        Examples
        --------
        >>> import hovercontrol as hc
        >>> plant = hc.vehicle("hoverdemon").plant()
        >>> plant.to("control", step=0.02).dt
        0.02
        >>> plant.to("nunpy")  # doctest: +ELLIPSIS, +NORMALIZE_WHITESPACE
        Traceback (most recent call last):
            ...
        hovercontrol.base.errors.InputError: Block.to: unknown backend 'nunpy'; did you mean 'numpy'? known:
        ...
        """
        if backend in _OWN:
            return getattr(self, _OWN[backend])(**options)
        return installed_backend(backend, own=_OWN)(self, **options)

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
        from hovercontrol.blocks.equations import latex_equations, text_equations

        if form not in ("text", "latex"):
            raise InputError(f"equations: expected form 'text' or 'latex', found {form!r}")
        return text_equations(self._block) if form == "text" else latex_equations(self._block)

    def to_numpy(self) -> NumpyFunctions:
        """Return the Block as NumPy functions (:mod:`hovercontrol.blocks.functions`).

        Raises
        ------
        InputError
            If inputs act late: no function of a point knows their past.
        """
        from hovercontrol.blocks.functions import numpy_functions

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
            (:class:`hovercontrol.blocks.simulation.runner.Runner`).

        Raises
        ------
        InputError
            If a name, a shape or a value is wrong.

        Examples
        --------
        >>> from hovercontrol.blocks.block import Block
        >>> from hovercontrol.blocks.signals import Signal
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
        from hovercontrol.blocks.simulation.python_runner import start_block

        return start_block(self._block, x0, params, inputs=inputs, time=time, rtol=rtol, atol=atol)

    def to_control(
        self, name: str | None = None, *, step: float | None = None, pade: int | None = None
    ) -> control.NonlinearIOSystem:
        """Return the Block as one python-control system (:mod:`hovercontrol.blocks.backends.to_control`).

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
        from hovercontrol.blocks.backends.to_control import to_control

        return to_control(self._block, name, step=step, pade=pade)

    def compile(self, *, friction: Friction = "smooth") -> CompiledBlock:
        """Return the Block as machine code, for fast simulation and sweeps over many runs.

        Parameters
        ----------
        friction : {"smooth", "events"}, optional
            Dry friction smoothed over its width, as the other backends compute it: results are those of
            :func:`hovercontrol.simulate`. Or Coulomb's law, sticking at exactly zero velocity, its events
            located; see :data:`hovercontrol.blocks.friction.Friction` for what is physical.
        """
        from hovercontrol.blocks.backends.compiled import compile_block

        return compile_block(self.in_continuous_time, friction=friction)

    def to_c(self, folder: str | Path) -> list[Path]:
        """Write a sampled Block as C99 for a board: header, code and an example program.

        Parameters
        ----------
        folder : path
            Receives NAME.h, NAME.c, model.c, main.c and the headers that they include.

        Returns
        -------
        list of Path

        Raises
        ------
        InputError
            If the Block is not sampled with one period.

        Examples
        --------
        >>> import tempfile, hovercontrol as hc
        >>> v = hc.Signal("v", "m/s")
        >>> slow = hc.Block("slow", [v], [], [v], [], {"v": 0.5 * v.symbol}, period=0.1)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     [file.name for file in slow.to_c(folder + "/slow")][:4]
        ['slow.h', 'slow.c', 'model.c', 'main.c']
        """
        from hovercontrol.blocks.backends.board import write_c

        return write_c(self._block, folder)

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
        model_name: str = "",
        arrays: bool = False,
        progress: Callable[[float], None] | None = None,
    ) -> Path:
        """Write the Block as an FMU, Model Exchange and Co-Simulation in one file.

        A sampled Block becomes one whose outputs hold. Arguments, result and errors are those of
        :func:`hovercontrol.fmi.exporter.export.export_fmu`.

        Parameters
        ----------
        path : path
            Ends in ``.fmu``.
        version, platforms, friction, step, stop, rtol, atol, model_name, arrays, progress
            As for :func:`hovercontrol.fmi.exporter.export.export_fmu`.
        """
        from hovercontrol.fmi.exporter.export import export_fmu

        return export_fmu(
            self._block,
            path,
            version=version,
            platforms=platforms,
            friction=friction,
            step=step,
            stop=stop,
            rtol=rtol,
            atol=atol,
            model_name=model_name,
            arrays=arrays,
            progress=progress,
        )

    def to_casadi(self) -> CasadiFunctions:
        """Return the Block as CasADi functions (:mod:`hovercontrol.blocks.backends.casadi`).

        Raises
        ------
        InputError
            If CasADi is not installed (``pip install ".[mpc]"``), an input acts late, or an
            expression has no form in CasADi.

        Examples
        --------
        >>> import hovercontrol as hc
        >>> hc.vehicle("c17_simulation").plant().to_casadi().derivatives
        Function(derivatives:(t,x[6],u[2],p[11])->(dx[6]) SXFunction)
        """
        from hovercontrol.blocks.backends.casadi import to_casadi

        return to_casadi(self._block)

    def to_jax(self) -> JaxFunctions:
        """Return the Block as pure JAX functions, for gradients of runs, ``vmap`` and GPUs.

        Needs ``pip install ".[jax]"``. JAX is set to double precision for the whole process.

        Returns
        -------
        JaxFunctions
            With ``derivatives``, ``outputs``, ``run_function``, ``simulate`` and ``sweep``
            (:class:`hovercontrol.blocks.backends.jax.JaxFunctions`).

        Raises
        ------
        InputError
            If JAX is not installed.
        """
        from hovercontrol.blocks.backends.jax import to_jax

        return to_jax(self._block)

    def gym(self, step: float, **options: Any) -> Any:
        """Return the Block as a Gymnasium environment, or many as a vector environment.

        Arguments, result and errors are those of :func:`hovercontrol.blocks.backends.gym.to_gym`. Needs
        ``pip install ".[rl]"``.

        Parameters
        ----------
        step : float
            Time for which a step holds the actions [s].
        **options
            ``reward``, ``terminated``, ``duration``, ``actions``, ``observations``, ``bounds``, ``start``,
            ``params``, ``num_envs``, ... as for that function.
        """
        from hovercontrol.blocks.backends.gym import to_gym

        return to_gym(self._block, step, **options)

    def trim(
        self,
        states: Mapping[str, float] | None = None,
        inputs: Mapping[str, float] | None = None,
        outputs: Mapping[str, float] | None = None,
        *,
        rates: Mapping[str, float | None] | None = None,
        params: Mapping[str, float] | None = None,
        time: float = 0.0,
        guess: Mapping[str, float] | Trim | None = None,
    ) -> Trim:
        """Return an operating point: a point at which the Block moves steadily or rests.

        Values are given by name; every other state and input is free within its signal's bounds. The rate of
        each state is zero, except of those that may move steadily: the states on which the other rates do not
        depend (of a craft its position and heading; in wind its position alone). Where the conditions leave a
        choice, the point nearest to the guess is taken, each difference divided by its signal's nominal size.
        Inputs that act late have the values that arrive.

        Parameters
        ----------
        states, inputs, outputs : mapping of str to float, optional
            Given values in their units.
        rates : mapping of str to float or None, optional
            Given derivatives of states, unit of the state per second; None leaves one free. Of a sampled
            state: what a step adds.
        params : mapping, optional
            Parameter values by key, over the defaults, in their units.
        time : float, optional
            Of equations that depend on time [s].
        guess : mapping of str to float, or Trim, optional
            Where the search for free states and inputs begins, such as a neighbouring trim (default: their
            start values).

        Returns
        -------
        Trim
            With ``states``, ``inputs``, ``outputs`` and ``rates`` by name, and ``x``, ``u``, ``y`` as arrays.

        Raises
        ------
        InputError
            If a name is unknown, a value is out of its bounds, or no point meets the conditions: the line
            then says which are not met, by how much, and which signal is at a bound.

        Examples
        --------
        >>> import hovercontrol as hc
        >>> craft = hc.vehicle("c17_simulation").plant()
        >>> ahead = craft.trim(states={"u": 1.0})
        >>> print(round(ahead.inputs["thrust"], 3), ahead.rates["x"])
        1.8 1.0
        """
        from hovercontrol.blocks.backends.trim import trim

        return trim(self._block, states, inputs, outputs, rates=rates, params=params, time=time, guess=guess)

    def linearize(
        self,
        at: ArrayLike | Mapping[str, float] | control.OperatingPoint | Trim | None = None,
        u: ArrayLike | Mapping[str, float] | None = None,
        params: Mapping[str, float] | None = None,
        t: float | None = None,
        *,
        friction: Literal["smooth", "none", "describing"] = "smooth",
        amplitude: Mapping[str, float] | None = None,
    ) -> control.StateSpace:
        """Return the exact linearisation at a point as a python-control state-space system.

        Parameters
        ----------
        at : Trim, control.OperatingPoint, mapping by name or array_like, shape (n_states,), optional
            The point; default the start values. A mapping has values of states and inputs in their units,
            over their start values; a scalar is the value of all states.
        u : array_like, shape (n_inputs,), scalar for all inputs, or mapping by name, optional
            Default: that of the Trim, operating point or mapping; beside an array 0.
        params : mapping, optional
            Parameter values by key, over those of the Trim and the defaults.
        t : float, optional
            Time [s]; default that of the Trim, or 0.
        friction : {"smooth", "none", "describing"}, optional
            Slope of dry friction, ``sgn(v, w)``, anywhere in the Block. "smooth": of tanh(v/w), as it is
            written; at v = 0 that is 1/w, and a warning tells if it makes a pole. "none": 0, as where v keeps
            its sign. "describing": 4/(pi A) sqrt(1 - (v/A)^2), that of an oscillation of amplitude A about v.
        amplitude : mapping of str to float, optional
            Of the oscillation, by state, in its unit, for "describing"; friction in other states has slope 0.

        Returns
        -------
        control.StateSpace
            Signals by their names; of a sampled Block in discrete time, and of a hybrid one whose parts tick
            with one period: from tick to tick, the states being those before it and the outputs after it.

        Raises
        ------
        InputError
            If a name, a number of values or the friction is wrong, an input acts late, or parts of the Block
            tick with different periods.

        Warns
        -----
        SmoothedFrictionWarning
            If friction is "smooth" and a pole is the slope of that smoothing.

        Examples
        --------
        >>> import hovercontrol as hc
        >>> craft = hc.vehicle("c17_simulation").plant()
        >>> ahead = craft.trim(states={"u": 1.0})
        >>> for A in (0.5, 0.1):
        ...     line = craft.linearize(ahead, friction="describing", amplitude={"r": A})
        ...     print(round(float(line.A[5, 5]), 3))
        -2.594
        -11.048
        """
        from hovercontrol.blocks.backends.linearization import linearize

        return linearize(self._block, at, u, params, t, friction=friction, amplitude=amplitude)
