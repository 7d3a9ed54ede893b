"""Moving-horizon estimation of any Block, by python-control's optimal estimation.

The states x_k and the process noise w_k over the last N samples minimise

    (x_0 - xbar)' P0^-1 (x_0 - xbar) + sum w_k' Q_k^-1 w_k + sum (y_k - h(x_k))' R^-1 (y_k - h(x_k))

subject to ``x_k+1 = F(x_k, u_k, w_k)`` and to bounds on w (Rao, Rawlings and Mayne, IEEE TAC 48 (2003)). F
integrates the plant over one step by the Runge-Kutta method, with u and w held; its Jacobians are exact.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import control.optimal
import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import LinearConstraint, NonlinearConstraint

from hovercontrol.base.arguments import at_least
from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known, shown
from hovercontrol.base.tables import positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.functions import numpy_functions
from hovercontrol.control.observers.observability import warn_if_undetectable
from hovercontrol.control.observers.observed import Observed, observed, plant_of, tick_of
from hovercontrol.control.observers.one_step import over_one_step
from hovercontrol.control.observers.propagation import steps_between
from hovercontrol.craft.models.interface import AnyModel


class MovingHorizon(control.optimal.OptimalEstimationProblem):
    """python-control's estimation problem of a Block, with exact Jacobians; made by :func:`moving_horizon`.

    Parameters
    ----------
    model : Observed
        The plant, its measured outputs and the noise.
    sampled : Block
        The plant over one step; its last inputs are the process noise.
    horizon : int
        Number of samples, N.
    bounds : ndarray, shape (n_noise,)
        Maximum absolute value of each noise; infinite for no bound.

    Attributes
    ----------
    sampled : Block
        The plant over one step.
    start : ndarray, shape (n_states,)
        The plant's start values, the state expected at the first sample.
    """

    constraints: list[Any]

    def __init__(self, model: Observed, sampled: Block, horizon: int, bounds: Array) -> None:
        self.sampled, self.start = sampled, np.array([s.start for s in sampled.states])
        self._functions = numpy_functions(sampled)
        q = np.array([s.start for s in model.process.values()])
        # White noise of root spectral density q, held over a step h, has the variance Q_k = q^2/h.
        # Of standard deviation q per step h_p of a sampled plant, held over h/h_p of them, it has q^2 h_p/h.
        self._noise = sampled.period / (q**2 * (model.plant.period or 1.0))
        self._accuracy = np.array([s.start for s in model.noise]) ** -2.0
        self._prior = np.array(model.start_std) ** -2.0
        self._angles = np.array([s.unit == "rad" for s in model.measured])
        system = sampled.to_control()
        every = control.optimal.disturbance_range_constraint(system, -bounds, bounds)
        self._bounded = np.flatnonzero(np.isfinite(bounds))
        rows = (every.A[self._bounded], every.lb[self._bounded], every.ub[self._bounded])
        super().__init__(
            system,
            np.arange(horizon) * sampled.period,
            self._stage_cost,
            terminal_cost=lambda x, expected: float(self._prior @ (x - expected) ** 2),
            trajectory_constraints=[LinearConstraint(*rows)] if self._bounded.size else [],
            control_indices=list(range(len(model.plant.inputs))),
            disturbance_indices=list(range(len(model.plant.inputs), len(sampled.inputs))),
            minimize_kwargs={"jac": self._gradient},
        )
        slopes = [self._bound_slopes, self._step_slopes][-len(self.constraints) :]
        self.constraints = [
            NonlinearConstraint(given.fun, given.lb, given.ub, jac=slope)
            for given, slope in zip(self.constraints, slopes, strict=True)
        ]

    def __repr__(self) -> str:
        plant, samples = self.sampled, len(self.timepts)
        return f"MovingHorizon of block {plant.name!r}: {samples} samples of {plant.period:g} s"

    def compute_estimate(
        self,
        outputs: ArrayLike | None = None,
        inputs: ArrayLike | None = None,
        initial_state: ArrayLike | None = None,
        initial_guess: tuple[Array, Array] | None = None,
        squeeze: bool | None = None,
        print_summary: bool = False,
        **kwargs: Any,
    ) -> control.optimal.OptimalEstimationResult:
        """Return the estimate over the horizon, as python-control does, with defaults from the plant.

        Parameters
        ----------
        outputs : array_like, shape (n_measured, N)
            Samples [unit]; NaN where there is none.
        inputs : array_like, shape (n_inputs, N)
            The plant's inputs, each held from its sample to the next.
        initial_state : array_like, shape (n_states,), optional
            Expected state at the first sample, xbar (default: the plant's start values).
        initial_guess : tuple of ndarray, optional
            Initial guess of the optimisation: states, shape (n_states, N), and noise, shape (n_noise, N)
            (default: the plant's motion without noise).
        squeeze, print_summary, **kwargs
            As for :meth:`control.optimal.OptimalEstimationProblem.compute_estimate`.

        Returns
        -------
        control.optimal.OptimalEstimationResult
            ``states``, shape (n_states, N), ``inputs`` (the noise) and ``outputs`` (measured minus expected).
        """
        expected = self.start if initial_state is None else np.asarray(initial_state, dtype=float)
        if initial_guess is None and inputs is not None:
            initial_guess = self._motion(expected, np.atleast_2d(np.asarray(inputs, dtype=float)))
        return super().compute_estimate(
            outputs, inputs, expected, initial_guess, squeeze, print_summary, **kwargs
        )

    def _motion(self, x: Array, u: Array) -> tuple[Array, Array]:
        noise = np.zeros((self._noise.size, self.timepts.size))
        motion = [x]
        for k, t in enumerate(self.timepts[:-1]):
            motion.append(self._functions.derivatives(t, motion[-1], np.r_[u[:, k], noise[:, k]]))
        return np.array(motion).T, noise

    def _stage_cost(self, x: Array, u: Array, v: Array, w: Array) -> float:
        # v' Q^-1 v + w' R^-1 w
        return float(self._noise @ v**2 + self._accuracy @ self._seen(w) ** 2)

    def _seen(self, w: Array) -> Array:
        """Return the residuals: angles wrapped to -pi ... pi, and 0 without a sample."""
        turned = np.where(self._angles, (w + np.pi) % (2 * np.pi) - np.pi, w)
        return np.where(np.isnan(turned), 0.0, turned)

    # ---- exact derivatives; the unknowns are the states, then the noise, stored signal by signal over time

    def _given(self, unknowns: Array) -> tuple[Array, Array, Array]:
        n, N = self.start.size, self.timepts.size
        x, v = unknowns[: n * N].reshape(n, N), unknowns[n * N :].reshape(-1, N)
        return x, v, np.vstack([np.reshape(self.u, (-1, N)), v])

    def _gradient(self, unknowns: Array) -> Array:
        # dJ/dx_k = -2 C' R^-1 e_k (+ 2 P0^-1 (x_0 - xbar) for k = 0),  dJ/dw_k = 2 Q_k^-1 w_k - 2 D' R^-1 e_k
        # with e_k = y_k - h(x_k), C = dh/dx and D = dh/dw; v stands for w here, and w for the residuals.
        x, v, inputs = self._given(unknowns)
        t, first = self.timepts, len(inputs) - len(v)
        w = self.y - self._functions.outputs(t, x, inputs)
        weighted = self._accuracy[:, None] * np.array([self._seen(one) for one in w.T]).T
        C = self._functions.jacobian(t, x, inputs, rows="outputs")
        D = self._functions.jacobian(t, x, inputs, rows="outputs", columns="inputs")[:, first:]
        by_x = -2 * np.einsum("ijk,ik->jk", C, weighted)
        by_v = 2 * self._noise[:, None] * v - 2 * np.einsum("ijk,ik->jk", D, weighted)
        by_x[:, 0] += 2 * self._prior * (x[:, 0] - self.x0)
        return np.concatenate([by_x.ravel(), by_v.ravel()])

    def _step_slopes(self, unknowns: Array) -> Array:
        """Return the derivative of ``x_k+1 - F(x_k, u_k, w_k)``: I by x_k+1, -dF/dx by x_k, -dF/dw by w_k."""
        x, v, inputs = self._given(unknowns)
        n, N, m = len(x), self.timepts.size, len(v)
        at = self.timepts[:-1], x[:, :-1], inputs[:, :-1]
        A = self._functions.jacobian(*at)
        B = self._functions.jacobian(*at, columns="inputs")[:, len(inputs) - m :]
        slopes = np.zeros((n, N - 1, n + m, N))  # of state i at k + 1, by signal j at time l
        k = np.arange(N - 1)
        for i in range(n):
            slopes[i, k, i, k + 1] = 1.0
            slopes[i, k, :n, k] -= A[i].T
            slopes[i, k, n:, k] -= B[i].T
        return slopes.reshape(n * (N - 1), -1)

    def _bound_slopes(self, unknowns: Array) -> Array:
        """Return the derivative of the bounded noises with respect to the unknowns, at each time."""
        N, first = self.timepts.size, self.start.size * self.timepts.size
        slopes = np.zeros((N, self._bounded.size, unknowns.size))
        for row, j in enumerate(self._bounded):
            slopes[np.arange(N), row, first + j * N + np.arange(N)] = 1.0
        return slopes.reshape(-1, unknowns.size)


@checked
def moving_horizon(
    plant: AnyModel,
    measured: Sequence[str] | None = None,
    *,
    step: float | None = None,
    horizon: int = 10,
    process_noise: Mapping[str, float],
    measurement_noise: Mapping[str, float],
    start_std: Mapping[str, float] | None = None,
    noise_bounds: Mapping[str, float] | None = None,
    substeps: int | None = None,
    name: str = "estimator",
) -> MovingHorizon:
    """Return the moving-horizon estimator of a plant, as an estimation problem of python-control.

    It solves an optimisation problem at every sample and is therefore not a Block. ``compute_estimate(Y, U)``
    estimates over one horizon; ``create_mhe_iosystem()`` makes a discrete-time system for use in a loop.

    Parameters
    ----------
    plant : Model, BlockModel or Block
        Continuous or sampled. Its start values are the expected state at the first sample.
    measured : sequence of str, optional
        Outputs, or states, of the plant (default: the keys of `measurement_noise`, in their order).
        Residuals in rad are wrapped to -pi ... pi.
    step : float, optional
        Time between samples [s]; of a sampled plant a multiple of its period (default: its period).
    horizon : int, optional
        Number of samples, 2 or more.
    process_noise, measurement_noise, start_std : mapping of str to float
        As for :func:`~hovercontrol.control.observers.extended.extended_kalman` with a period [unit/s^(1/2),
        unit, unit]; the process noise has at least one positive entry and is held over a step.
    noise_bounds : mapping of str to float, optional
        Maximum absolute value of the process noise, by the states' names [unit/s; of a sampled plant unit].
    substeps : int, optional
        Runge-Kutta steps per sample (default: chosen from the plant's fastest mode).
    name : str, optional

    Returns
    -------
    MovingHorizon
        A :class:`control.optimal.OptimalEstimationProblem`; inputs of its system: the plant's, then
        ``NAME_noise`` [unit/s; of a sampled plant unit].

    Raises
    ------
    InputError
        As :func:`~hovercontrol.control.observers.extended.extended_kalman`; or if the horizon is shorter than
        2, there is no process noise, or a bound is not positive or for a state without noise.

    Warns
    -----
    UserWarning
        If the measurements do not determine the state at the plant's start values.

    Examples
    --------
    >>> import numpy as np
    >>> import hovercontrol as hc
    >>> v = hc.Signal("v", "m/s")
    >>> drifting = hc.Block("drifting", [v], [], [v], derivatives={"v": 0})
    >>> problem = moving_horizon(
    ...     drifting, ["v"], step=0.1, horizon=3, process_noise={"v": 1e-3}, measurement_noise={"v": 0.1},
    ...     start_std={"v": 100.0},
    ... )
    >>> estimate = problem.compute_estimate([[0.9, 1.0, 1.1]], np.zeros((0, 3)))
    >>> estimate.states.round(3)[0].tolist()
    [1.0, 1.0, 1.0]
    """
    block = plant_of(plant, name, "moving-horizon estimate")
    step = tick_of(block, step, f"{name}: step")
    at_least(f"{name}: horizon", horizon, 2)
    given = {key: value for key, value in process_noise.items() if value != 0}
    model = observed(block, measured, given, measurement_noise, start_std, name, continuous=False)
    if not model.process:
        raise InputError(f"{name}: process_noise: expected a positive number for at least one state")
    for state, std in zip(block.states, model.start_std, strict=True):
        if not std:
            raise InputError(f"{name}: start_std: expected a positive number for {state.name!r}, found 0")
    noisy = [block.states[i].name for i in model.process]
    bounds = np.full(len(noisy), np.inf)
    for key, value in (noise_bounds or {}).items():
        check_known(key, noisy, f"{name}: noise_bounds: no process noise of {shown(key)}")
        bounds[noisy.index(key)] = positive(f"{name}: noise_bounds: {key}", value)
    warn_if_undetectable(block, [s.name for s in model.measured], name)
    n = steps_between(block, step, name, substeps)
    return MovingHorizon(model, over_one_step(model, step, n), horizon, bounds)
