"""Many runs of a Block on a GPU in one kernel: each thread integrates one run, its states in registers.

Without it, XLA computes a step of all runs with several kernels, each of which reads and writes the states of
all runs in the GPU's memory. Here the loops over rows and steps stand inside the kernel, which is written
with Pallas and compiled by Triton.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hovercontrol.blocks.backends.jax_needs import need_jax
from hovercontrol.blocks.backends.jax_run import Plan, State, condition_margin, ticks_of
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.lookup import entry

if TYPE_CHECKING:
    from hovercontrol.blocks.backends.jax import JaxFunctions

#: Runs of one program of the kernel: the threads of a warp.
LANES = 32


def fits_kernel(block: Block) -> bool:
    """Return whether the kernel's compiler is there and knows all of a Block (it cannot look up tables).

    JAX 0.12 says that a later version will be without it.
    """
    try:
        from jax.experimental.pallas import triton  # noqa: F401
    except ImportError:
        return False
    return not any(e.has(entry) for _, e in block.all_expressions())


def kernel_runner(functions: JaxFunctions, interpret: bool = False) -> Callable[..., Any]:
    """Return ``(x, p, plan) -> (rows, states at the end)`` of runs of rk4, as :func:`.jax_run.runner_of`.

    Rows hold the outputs. Values of `x` have shape (runs,), those of `p` shape (runs,) or ().

    Parameters
    ----------
    functions : JaxFunctions
        Of a Block without delays that :func:`fits_kernel`.
    interpret : bool, optional
        Execute the kernel as JAX operations, on any processor; for tests.

    """
    import jax
    from jax.experimental import pallas
    from jax.experimental.pallas import triton

    block, jnp = functions.block, need_jax()
    outputs, move = functions.rows("outputs"), _rk4(functions)
    counts = [len(group) for group in (block.states, block.inputs, block.outputs, block.ticks)]
    n, n_inputs, n_outputs, n_ticks = counts

    def lanes(value: Any) -> Any:
        # a scalar's functions are computed in single precision by this compiler: all values are vectors
        return jnp.broadcast_to(jnp.asarray(value, dtype=float), (LANES,))

    ticked = ticks_of(functions)

    def kernel_of(varies: list[bool], n_rows: int, n_steps: int) -> Callable[..., None]:
        def kernel(
            starts: Any, own: Any, same: Any, t: Any, h: Any, u: Any, due: Any, kept: Any, last: Any
        ) -> None:
            at = pallas.ds(pallas.program_id(0) * LANES, LANES)
            places = (np.cumsum(varies) - 1).tolist()
            p = tuple(
                own[j, at] if v else lanes(same[k])
                for k, (v, j) in enumerate(zip(varies, places, strict=True))
            )

            def held(row: Any, step: Any) -> State:
                return tuple(lanes(u[row, step, k]) for k in range(n_inputs))

            def begin(row: Any, x: State) -> State:
                now, given = lanes(t[row, 0]), held(row, 0)
                x = ticked(now, x, given, p, [due[row, 0, k] != 0 for k in range(n_ticks)])
                for k, value in enumerate(outputs(now, x, given, p)):
                    kept[row, k, at] = lanes(value)
                return x

            def one_row(row: Any, x: State) -> State:
                def step(k: Any, x: State) -> State:
                    now, given = lanes(t[row, k]), held(row, k)
                    x = ticked(now, x, given, p, [(due[row, k, i] != 0) & (k > 0) for i in range(n_ticks)])
                    return move(now, lanes(h[row, k]), x, given, p)

                return jax.lax.fori_loop(0, n_steps, step, begin(row, x))

            x = jax.lax.fori_loop(0, n_rows - 1, one_row, tuple(starts[k, at] for k in range(n)))
            for k, value in enumerate(begin(n_rows - 1, x)):
                last[k, at] = value

        return kernel

    def run(x: State, p: State, plan: Plan) -> tuple[State, State]:
        runs, varies = x[0].shape[0], [np.ndim(a) > 0 for a in p]
        padded = -(-runs // LANES) * LANES

        own = [jnp.asarray(a) for a, v in zip(p, varies, strict=True) if v]
        same = jnp.stack(
            [jnp.asarray(0.0 if v else a, dtype=float) for a, v in zip(p, varies, strict=True)]
            or [jnp.zeros(())]
        )
        shapes = ((len(plan.t), max(n_outputs, 1), padded), (n, padded))
        kept, last = pallas.pallas_call(
            kernel_of(varies, *plan.t.shape),
            grid=(padded // LANES,),
            interpret=interpret,
            out_shape=tuple(jax.ShapeDtypeStruct(s, float) for s in shapes),
            compiler_params=None if interpret else triton.CompilerParams(num_warps=1),
        )(
            _table(x, runs, padded), _table(own, runs, padded), same, plan.t, plan.h,
            _columns(plan.u, float), _columns(plan.due, np.int32),
        )  # fmt: skip
        return tuple(kept[:, k, :runs] for k in range(n_outputs)), tuple(a[:runs] for a in last)

    return run


def _table(columns: Sequence[Any], runs: int, padded: int) -> Any:
    """Return the columns of all runs as rows of an array, the last run repeated; at least one row."""
    jnp = need_jax()
    rows = columns or [jnp.zeros(runs)]
    return jnp.stack([jnp.pad(a.astype(float), (0, padded - runs), mode="edge") for a in rows])


def _columns(values: Any, dtype: Any) -> Any:
    """Return an array with at least one column: a kernel takes no empty one."""
    jnp, shape = need_jax(), (*values.shape[:-1], max(values.shape[-1], 1))
    return jnp.asarray(values, dtype=dtype) if values.shape[-1] else jnp.zeros(shape, dtype=dtype)


def _rk4(functions: JaxFunctions) -> Callable[..., State]:
    """Return a step of the classical Runge-Kutta method as ``(t, h, x, u, p) -> x``.

    The stages are a loop, so that the equations stand in the kernel once: of 83 states written four times it
    compiled for 229 s, written once for less than 26 s.
    """
    import jax

    jnp = need_jax()
    f, n = functions.rows("moving"), functions.block.n_continuous
    margin = condition_margin(functions.block)

    def step(t: Any, h: Any, x: State, u: State, p: State) -> State:
        # k_i = f(t + c_i, x + c_i k_(i-1)), x(t + h) = x + sum_i b_i k_i
        # c = (0, h/2, h/2, h), b = (h/6, h/3, h/3, h/6)
        def stage(i: Any, carry: tuple[State, State]) -> tuple[State, State]:
            k, total = carry
            first, last = i == 0, i == 3
            c = jnp.where(first, 0.0 * h, jnp.where(last, h, 0.5 * h))
            b = jnp.where(first | last, h * (1 / 6), h * (1 / 3))
            at = t + jnp.where(first, margin * h, jnp.where(last, (1.0 - margin) * h, 0.5 * h))
            ahead = (*(a + c * v for a, v in zip(x, k, strict=False)), *x[n:])
            k = tuple(jnp.broadcast_to(jnp.asarray(v, dtype=float), t.shape) for v in f(at, ahead, u, p))
            return k, tuple(a + b * v for a, v in zip(total, k, strict=True))

        zeros = tuple(jnp.zeros(t.shape) for _ in range(n))
        _, ahead = jax.lax.fori_loop(0, 4, stage, (zeros, x[:n]))
        return (*ahead, *x[n:])

    return step
