"""A Block as JAX functions: pure functions for ``jax.jit``, ``jax.grad`` and ``jax.vmap``, and runs.

The functions are printed from the same expressions as those of NumPy, common subexpressions computed once.
All numbers are double precision; dry friction is smoothed over its width.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike
from sympy.printing.numpy import JaxPrinter

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.backends.jax_needs import Run, need_jax
from hovercontrol.blocks.backends.sweep import Many, SweepResult
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delays import undelayed
from hovercontrol.blocks.functions import ArrayPrinter, Function, program_function
from hovercontrol.blocks.program import Program
from hovercontrol.blocks.summary import block_line

if TYPE_CHECKING:
    import control

Method = Literal["rk4", "dormand-prince"]


@checked
def to_jax(block: Block) -> JaxFunctions:
    """Return a Block as JAX functions; ``block.to_jax()`` does the same.

    JAX is set to double precision (``jax_enable_x64``) for the whole process.

    Parameters
    ----------
    block : Block

    Raises
    ------
    InputError
        If JAX is not installed.

    Examples
    --------
    >>> from hovercontrol import Block, Signal
    >>> v, k = Signal("v", "m/s", start=1.0), Signal("k", "1/s", start=2.0)
    >>> decay = to_jax(Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol}))
    >>> decay.derivatives(0.0, [3.0]).tolist()
    [-6.0]
    >>> import jax
    >>> jax.grad(lambda k: decay.derivatives(0.0, [3.0], p=[k])[0])(2.0).item()
    -3.0
    """
    need_jax()
    return JaxFunctions(block)


class JaxFunctions:
    """The functions of one Block in JAX, from ``block.to_jax()``.

    Parameters
    ----------
    block : Block
    """

    def __init__(self, block: Block) -> None:
        self.block = block
        self._compiled: dict[Any, Function] = {}
        self._runs: dict[Any, Any] = {}

    def __repr__(self) -> str:
        return f"JaxFunctions of {block_line(self.block)}"

    def __reduce__(self) -> tuple[Any, ...]:
        return to_jax, (self.block,)

    @checked
    def parameters(self, params: Mapping[str, float] | None = None) -> Any:
        """Return the values of all parameters in order, shape (n_parameters,), `params` over the defaults.

        Parameters
        ----------
        params : mapping, optional
            Values by key (``plant.yaw_coulomb``).
        """
        return need_jax().array(self.block.parameter_values(params))

    def derivatives(self, t: Any, x: Any, u: Any = (), p: Any = None) -> Any:
        """Return the states' time derivatives, shape (n_states, ...); pure.

        Parameters
        ----------
        t : array, scalar or shape (...)
            Time [s].
        x : array, shape (n_states, ...)
            States; further axes are independent points.
        u : array, shape (n_inputs, ...), optional
        p : array, shape (n_parameters, ...), optional
            All parameter values in the Block's order (default: :meth:`parameters`).

        Raises
        ------
        InputError
            If the Block is sampled (see :meth:`next`), inputs act late, or a shape is wrong.
        """
        self.block.need_continuous("derivatives, but next values: next(t, x, u, p)")
        return self._stacked("derivatives", t, x, u, p)

    def next(self, t: Any, x: Any, u: Any = (), p: Any = None) -> Any:
        """Return the next states of a sampled Block, shape (n_states, ...); as :meth:`derivatives`.

        Parameters
        ----------
        t, x, u, p
            As for :meth:`derivatives`, at a tick.

        Raises
        ------
        InputError
            If the Block is not sampled, or a shape is wrong.
        """
        if not self.block.period:
            raise InputError(self.block.where("it is not sampled and has no next states"))
        return self._stacked("derivatives", t, x, u, p)

    def tick(self, number: int, t: Any, x: Any, u: Any = (), p: Any = None) -> Any:
        """Return the states after a tick of a hybrid Block, shape (n_states, ...); as :meth:`derivatives`.

        Parameters
        ----------
        number : int
            Index into the Block's ``ticks``.
        t, x, u, p
            As for :meth:`derivatives`; the states before the tick.

        Raises
        ------
        InputError
            If there is no such tick, or a shape is wrong.
        """
        if not 0 <= number < len(self.block.ticks):
            raise InputError(
                self.block.where(f"it has {len(self.block.ticks)} ticks, found number {number!r}")
            )
        return self._stacked(number, t, x, u, p)

    def outputs(self, t: Any, x: Any, u: Any = (), p: Any = None) -> Any:
        """Return the outputs, shape (n_outputs, ...); as :meth:`derivatives`.

        Parameters
        ----------
        t, x, u, p
            As for :meth:`derivatives`.
        """
        return self._stacked("outputs", t, x, u, p)

    @checked
    def run_function(
        self,
        time: ArrayLike,
        inputs: ArrayLike | Mapping[str, ArrayLike] | None = None,
        *,
        method: Method = "rk4",
        step: float | None = None,
        rtol: float = 1e-6,
        atol: float = 1e-9,
        outputs: Sequence[str] | None = None,
    ) -> Run:
        """Return a run over a time grid as a pure function, for ``jax.jit``, ``jax.grad`` and ``jax.vmap``.

        Parameters
        ----------
        time : array_like, shape (n,)
            Increasing times [s]; results are given at these times.
        inputs : optional
            As for :func:`hovercontrol.simulate`; held between samples.
        method : {"rk4", "dormand-prince"}, optional
            The classical Runge-Kutta method in equal steps, in one ``jax.lax.scan``, or Dormand-Prince 5(4)
            with step-size control, by Diffrax.
        step : float, optional
            Step size of rk4 [s], required of a Block with continuous parts; maximum step size of
            dormand-prince.
        rtol, atol : float, optional
            Relative and absolute tolerance of dormand-prince.
        outputs : sequence of str, optional
            Names of the outputs to compute (default: all).

        Returns
        -------
        callable
            ``run(params=None, x0=None)`` with mappings by parameter key and by state name, of numbers or JAX
            arrays of one shape. It returns a dict of outputs and states by name, each of shape (n, ...). The
            values of a run that fails are NaN from there on.

        Raises
        ------
        InputError
            If a name, a shape or a value is wrong; of the returned function, if a name is unknown.

        Examples
        --------
        >>> from hovercontrol import Block, Signal
        >>> v, k = Signal("v", "m/s", start=1.0), Signal("k", "1/s", start=2.0)
        >>> decay = to_jax(Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol}))
        >>> run = decay.run_function([0.0, 1.0], step=0.01)
        >>> round(run({"decay.k": 1.0})["v"][-1].item(), 6)
        0.367879
        >>> import jax
        >>> round(jax.grad(lambda k: run({"decay.k": k})["v"][-1])(1.0).item(), 6)  # -exp(-k) at k = 1
        -0.367879
        """
        from hovercontrol.blocks.backends.jax_run import run_function

        return run_function(self._selected(outputs), time, inputs, method, step, rtol, atol)

    @checked
    def simulate(
        self,
        time: ArrayLike,
        inputs: ArrayLike | Mapping[str, ArrayLike] | None = None,
        x0: ArrayLike | Mapping[str, float] | None = None,
        params: Mapping[str, float] | None = None,
        *,
        method: Method = "dormand-prince",
        step: float | None = None,
        rtol: float = 1e-6,
        atol: float = 1e-9,
        outputs: Sequence[str] | None = None,
    ) -> control.TimeResponseData:
        """Simulate over a time grid; as :meth:`.compiled.CompiledBlock.simulate`.

        Parameters
        ----------
        time, inputs, x0, params, method, step, rtol, atol, outputs
            As for that method.

        Raises
        ------
        InputError
            As for that method.
        """
        from hovercontrol.blocks.backends.jax_run import simulate

        return simulate(self._selected(outputs), time, inputs, x0, params, method, step, rtol, atol)

    @checked
    def sweep(
        self,
        time: ArrayLike,
        *,
        params: Many | None = None,
        x0: Many | ArrayLike | None = None,
        inputs: ArrayLike | Many | None = None,
        start: float = -math.inf,
        band: float | Mapping[str, float] = 0.02,
        threads: int | None = None,
        method: Method = "rk4",
        step: float | None = None,
        rtol: float = 1e-6,
        atol: float = 1e-9,
        outputs: Sequence[str] | None = None,
        chunk: int | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> SweepResult:
        """Simulate many runs over one time grid; return figures of each run, not its trajectory.

        Parameters
        ----------
        time, params, x0, inputs, start, band, threads, step, rtol, atol, outputs, progress
            As for :meth:`.compiled.CompiledBlock.sweep`.
        method : {"rk4", "dormand-prince"}, optional
            With rk4, the step is the same for all runs of a chunk.
        chunk : int, optional
            Number of runs computed together (default: as many as fit in the processor's cache, on a GPU in
            its memory).

        Returns
        -------
        SweepResult
            A run that fails is marked in it; the other runs continue.

        Raises
        ------
        InputError
            If a name, a shape or a value is wrong.
        """
        from hovercontrol.blocks.backends.jax_sweep import sweep

        return sweep(
            self._selected(outputs), time, params, x0, inputs, start, band, threads, method, step, rtol, atol,
            chunk, progress,
        )  # fmt: skip

    # ---- inside --------------------------------------------------------------------------------------

    @cached_property
    def plain(self) -> JaxFunctions:
        """The functions of the Block without its delays, whose inputs are those that arrive."""
        return JaxFunctions(undelayed(self.block)) if self.block.delays else self

    @cached_property
    def running(self) -> JaxFunctions:
        """The functions of a sampled Block in its form in continuous time, which runs; else these."""
        return JaxFunctions(self.block.in_continuous_time) if self.block.period else self

    def _selected(self, outputs: Sequence[str] | None) -> JaxFunctions:
        """Return the functions with these outputs only, traced once for each selection."""
        if outputs is None:
            return self
        block = self.block.with_outputs(outputs)
        made: JaxFunctions = self.cached(("outputs", tuple(outputs)), lambda: JaxFunctions(block))
        return made

    def rows(self, rows: str | int) -> Function:
        """Return the unchecked function ``(t, x, u, p) -> tuple``.

        Parameters
        ----------
        rows : {"derivatives", "moving", "outputs"} or int
            Of all states, of those that no tick sets, of the outputs, or the values a tick sets.
        """
        if rows not in self._compiled:
            block = self.block
            groups = [[s.symbol for s in g] for g in (block.states, block.inputs, block.parameters)]
            wanted: Mapping[str, sp.Expr] = (
                block.ticks[rows].updates
                if isinstance(rows, int)
                else block.output_expressions
                if rows == "outputs"
                else block.derivatives
                if rows == "derivatives"
                else dict(list(block.derivatives.items())[: block.n_continuous])
            )
            import jax

            need_jax()
            program = Program(block, list(wanted.values()))
            self._compiled[rows] = program_function(program, groups, _Printer(), jax)
        return self._compiled[rows]

    def cached(self, key: Any, make: Callable[[], Any]) -> Any:
        """Return what `make` returned for a key before, so that JAX traces each run once."""
        if key not in self._runs:
            self._runs[key] = make()
        return self._runs[key]

    def _stacked(self, rows: str | int, t: Any, x: Any, u: Any, p: Any) -> Any:
        jnp, block = need_jax(), self.block
        t, x, u = (jnp.asarray(a, dtype=float) for a in (t, x, u))
        p = self.parameters() if p is None else jnp.asarray(p, dtype=float)
        groups = (
            ("states", x, block.states),
            ("inputs", u, block.inputs),
            ("parameters", p, block.parameters),
        )
        for kind, given, signals in groups:
            if given.ndim == 0 or given.shape[0] != len(signals):
                raise InputError(block.where(f"expected {len(signals)} {kind}, found shape {given.shape}"))
        shape = np.broadcast_shapes(t.shape, x.shape[1:], u.shape[1:], p.shape[1:])
        values: Sequence[Any] = self.rows(rows)(t, x, u, p)
        if isinstance(rows, int):
            new = dict(zip(block.ticks[rows].updates, values, strict=True))
            values = [new.get(s.name, x[k]) for k, s in enumerate(block.states)]
        if not values:
            return jnp.zeros((0, *shape))
        return jnp.stack([jnp.broadcast_to(jnp.asarray(v, dtype=float), shape) for v in values])


class _Printer(ArrayPrinter, JaxPrinter):
    """Prints JAX code for arrays that broadcast."""

    def _print_And(self, expr: sp.And) -> str:
        return self._fold("jax.numpy.logical_and", expr.args)

    def _print_Or(self, expr: sp.Or) -> str:
        return self._fold("jax.numpy.logical_or", expr.args)

    def _print_Pow(self, expr: sp.Pow, rational: bool = False) -> str:
        # a small whole power is a product: jax.numpy.power of floats takes a logarithm
        base, exponent = expr.as_base_exp()
        if expr.is_number:
            return repr(float(expr))
        if exponent.is_Integer and 2 <= exponent <= 3:
            return "(" + "*".join([f"({self._print(base)})"] * int(exponent)) + ")"
        return str(super()._print_Pow(expr, rational=rational))

    def _print_entry(self, expr: sp.Function) -> str:
        index, values = self._print(expr.args[0]), expr.args[1].values
        place = f"jax.numpy.clip({index}, 0, {len(values) - 1})"
        return f"jax.numpy.array({values!r})[jax.numpy.asarray({place}).astype(int)]"
