"""Discrete-time python-control systems of Blocks, integrated over each step with held inputs.

:class:`HeldSystem` is the system of a continuous Block. It is exact for held inputs (zero-order hold) and has
exact Jacobians. :class:`HybridSystem` is the system of a Block with sampled parts.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.backends.control import BlockSystem
from hovercontrol.blocks.backends.engines import engine_of
from hovercontrol.blocks.backends.library import Solver, Step
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.functions import call_scalar, numpy_functions
from hovercontrol.blocks.simulation.reasons import REASONS
from hovercontrol.blocks.singular import finite_jacobian
from hovercontrol.blocks.switching import switching_times

#: Solver for continuous Blocks. The tolerance is tight because python-control takes finite differences of the
#: results with steps of 1e-6, and SciPy's optimisers with steps of 1e-8.
_HELD = Solver("dormand-prince", 0.0, 1e-10, 1e-12)
#: Solver for hybrid Blocks.
_HYBRID = Solver("dormand-prince", 0.0, 1e-6, 1e-9)
#: Relative and absolute tolerance of the variational equations.
_RTOL, _ATOL = 1e-12, 1e-13


class SteppedSystem(BlockSystem):
    """A discrete-time system whose steps are integrated; the base class of both kinds.

    Parameters
    ----------
    step : float
        Sampling period [s].
    """

    _solver: Solver

    def __init__(self, block: Block, name: str | None, step: float) -> None:
        super().__init__(block, name)
        self.dt = step

    def _prepare(self) -> None:
        super()._prepare()
        self._stepper = lru_cache(maxsize=16)(self._made_stepper)
        self._step: Step | None = None

    def _made_stepper(self, values: tuple[float, ...]) -> Step:
        return engine_of(self.block, "smooth").stepper(self._solver, values)

    def __getstate__(self) -> dict[str, Any]:
        return {k: v for k, v in super().__getstate__().items() if k not in ("_stepper", "_step")}

    def _update_params(self, params: Mapping[str, float] | None) -> None:
        before = self._values
        super()._update_params(params)
        if self._values is not before:
            self._step = None

    def _advanced(self, t: float, until: float, x: Any, u: Any, step: Step | None = None) -> Array:
        if step is None:
            step = self._step = self._step or self._stepper(self._values)
        status, states = step(t, until, np.ravel(x), np.ravel(self._commanded(u)))
        if status:
            raise InputError(
                f"block {self.block.name!r}: the simulation stops after t = {t:.6g} s: {REASONS[status]}"
            )
        return states

    def _rhs(self, t: float, x: Any, u: Any) -> Array:
        return self._advanced(t, t + self.dt, x, u)

    def _updates(self, t: float, x: Any, u: Any, params: Mapping[str, float]) -> Array:
        return self._advanced(t, t + self.dt, x, u, self._stepper(self._own(params)))


class HeldSystem(SteppedSystem):
    """The discrete-time system of a continuous Block, exact for inputs held over each step.

    Its states are those of the Block: ``x[k+1] = phi(x[k], u[k])`` with the flow phi of the Block over one
    step. The flow is computed with a relative tolerance of 1e-10, in machine code if there is a C compiler.
    """

    _solver = _HELD

    def _derivative_matrices(self, t: float, x: Array, u: Array) -> list[Array]:
        # A = dphi/dx, B = dphi/du over one step;  C = dg/dx, D = dg/du with the outputs g at its begin
        at = self.block, t, x, u, self._current_params
        outputs = [finite_jacobian(*at, "outputs", "states"), finite_jacobian(*at, "outputs", "inputs")]
        return [*step_jacobians(self.block, t, t + self.dt, x, u, self._current_params), *outputs]


class HybridSystem(SteppedSystem):
    """The discrete-time system of a hybrid Block, exact also between its steps.

    Over each step the Block is integrated with held inputs. Its ticks are executed when they are due, also
    between two steps.
    """

    _solver = _HYBRID

    def _outputs_are_states(self) -> bool:
        return False  # ticks are executed first

    def _out(self, t: float, x: Any, u: Any) -> Array:
        return super()._out(t, self._advanced(t, t, x, u), self._commanded(u))

    def _outputs(self, t: float, x: Any, u: Any, params: Mapping[str, float]) -> Array:
        states = self._advanced(t, t, x, u, self._stepper(self._own(params)))
        return super()._outputs(t, states, u, params)

    def linearize(self, *args: Any, **kwargs: Any) -> Any:
        """Raise :class:`InputError`: a step with ticks is not differentiated."""
        self.block.need_continuous("linearisation", hybrid=False)
        raise AssertionError


def step_jacobians(
    block: Block, t: float, until: float, x: Array, u: Array, params: Mapping[str, float] | None = None
) -> tuple[Array, Array]:
    """Return the Jacobians of the states after a step by the states before it and by the held inputs.

    Parameters
    ----------
    block : Block
        Continuous.
    t, until : float
        Begin and end of the step [s].
    x : ndarray, shape (n_states,)
        States at `t`.
    u : ndarray, shape (n_inputs,)
    params : mapping, optional
        Parameter values by key; others have their defaults.

    Returns
    -------
    ndarray, shape (n_states, n_states)
        Phi(until).
    ndarray, shape (n_states, n_inputs)
        Gamma(until).

    Raises
    ------
    InputError
        If the integration fails, or a derivative at the begin is not finite.

    Notes
    -----
    The variational equations along the solution of x' = f(t, x, u)::

        Phi' = A Phi,        Phi(t) = I,      A = df/dx
        Gamma' = A Gamma + B, Gamma(t) = 0,   B = df/du

    Source: E. Hairer, S. Norsett, G. Wanner, Solving Ordinary Differential Equations I, I.14.

    Examples
    --------
    >>> from hovercontrol import Signal
    >>> v, a, k = Signal("v", "m/s"), Signal("a", "m/s^2"), Signal("k", "1/s", start=2.0)
    >>> cart = Block("cart", [v], [a], [v], [k], {"v": a.symbol - k.symbol * v.symbol})
    >>> phi, gamma = step_jacobians(cart, 0.0, 0.5, np.array([1.0]), np.array([0.0]))
    >>> phi.round(6).item(), gamma.round(6).item()  # exp(-1), (1 - exp(-1)) / 2
    (0.367879, 0.31606)
    """
    n, m = len(block.states), len(block.inputs)
    if not n:
        return np.zeros((0, 0)), np.zeros((0, m))
    finite_jacobian(block, t, x, u, params)  # the flow has no derivative where its equations have none
    finite_jacobian(block, t, x, u, params, columns="inputs")
    f, values = numpy_functions(block), block.parameter_values(params, bounded=False)
    pair, held = f.scalar_pair("derivatives"), u.tolist()

    # z = (x, [Phi Gamma]),  [Phi Gamma]' = A [Phi Gamma] + [0 B],  [Phi Gamma](t) = [I 0]
    def rates(t: float, z: Array) -> Array:
        at, slopes = z[:n], z[n:].reshape(n, n + m)
        change = f.jacobian_values(t, at, u, values, "derivatives", "states") @ slopes
        if m:
            change[:, n:] += f.jacobian_values(t, at, u, values, "derivatives", "inputs")
        return np.concatenate([call_scalar(pair, t, at.tolist(), held, values), change.ravel()])

    z = np.concatenate([x, np.eye(n, n + m).ravel()])
    switches = [at for at in switching_times(block, params) if t < at < until]
    for begin, end in pairwise([t, *switches, until]):
        run = solve_ivp(rates, (begin, end), z, "DOP853", t_eval=[end], rtol=_RTOL, atol=_ATOL)
        if not run.success or not np.isfinite(run.y).all():
            raise InputError(
                block.where(f"no linearisation over the step from t = {begin:.6g} s: {run.message}")
            )
        z = run.y[:, -1]
    slopes = z[n:].reshape(n, n + m)
    return slopes[:, :n], slopes[:, n:]
