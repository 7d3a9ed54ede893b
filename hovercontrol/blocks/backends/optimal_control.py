"""python-control's optimal control with gradients: each simulation also gives its sensitivities.

The optimiser gets the gradient of the cost and the Jacobians of the constraints. The plant's part is exact;
python-control takes the cost and nonlinear constraints as functions of Python, whose partial derivatives are
central differences without a simulation.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np
import sympy as sp
from control import optimal
from control.flatsys import BasisFamily
from numpy.typing import ArrayLike
from scipy.optimize import LinearConstraint, NonlinearConstraint

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.caller import caller_level
from hovercontrol.base.errors import InputError, shown
from hovercontrol.blocks.backends.control import BlockSystem
from hovercontrol.blocks.backends.discrete import step_jacobians
from hovercontrol.blocks.backends.shoot import Columns, shoot_with_slopes
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.constant_inputs import SIZES, constant_inputs
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.singular import finite_jacobian
from hovercontrol.blocks.switching import switching_conditions

Cost = Callable[..., Any]
Constraint: TypeAlias = LinearConstraint | NonlinearConstraint | tuple[Any, ...]

#: Step of central differences of a cost or constraint, relative to a value of 1 or more: the cube root of the
#: rounding, 1e-16, where it and the step's square have like parts in the error.
DIFFERENCE = 6e-6
#: Violation of a constraint that counts as none, as in SLSQP; share by which constant inputs must cost less.
VIOLATION, MARGIN = 1e-6, 1e-3
#: Runge-Kutta steps of the sensitivities: per step of the system at least, and per time constant.
LEAST, PER_TIME_CONSTANT = 8, 8


@checked
def solve_ocp(
    system: Any,
    timepts: ArrayLike,
    initial_state: ArrayLike,
    integral_cost: Cost,
    trajectory_constraints: Constraint | Sequence[Constraint] | None = None,
    terminal_cost: Cost | None = None,
    terminal_constraints: Constraint | Sequence[Constraint] | None = None,
    initial_guess: ArrayLike | tuple[ArrayLike, ArrayLike] | None = None,
    basis: BasisFamily | None = None,
    *,
    squeeze: bool | None = None,
    transpose: bool | None = None,
    return_states: bool = True,
    print_summary: bool = False,
    **options: Any,
) -> Any:
    """Solve an optimal control problem as :func:`control.optimal.solve_ocp`, with gradients.

    python-control passes no gradients on to SciPy, which then simulates once for each unknown. Here each
    simulation also gives its sensitivities to the inputs. The result is python-control's.

    Where a derivative by an input vanishes, SciPy finds a stationary point that is no minimum: no motion at
    all, of a thrust ``k n abs(n)`` from n = 0. So the result is compared with constant inputs within their
    bounds; if one of them costs less, the problem is solved again from there.

    Parameters
    ----------
    system : control.InputOutputSystem
        From ``block.to_control(step=h)`` or of a sampled Block, by shooting, or from ``block.to_control()``
        of a continuous Block, by collocation.
    timepts : array_like, shape (n,)
        Times of the inputs [s]; for shooting h apart.
    initial_state : array_like, shape (n_states,)
    integral_cost : callable
        ``integral_cost(x, u)``, such as :func:`control.optimal.quadratic_cost`.
    trajectory_constraints, terminal_constraints : constraint or list of constraints, optional
        As for python-control.
    terminal_cost : callable, optional
        ``terminal_cost(x, u)``.
    initial_guess : array_like, shape (n_inputs,) or (n_inputs, n), optional
        Inputs; for collocation also a tuple of states and inputs.
    basis : control.flatsys.BasisFamily, optional
        Functions of which the inputs are sums.
    squeeze, transpose, return_states, print_summary
        As for python-control (print_summary: default False).
    **options
        ``minimize_method``, ``minimize_options``, ``minimize_kwargs``, ``log`` of python-control.

    Returns
    -------
    control.optimal.OptimalControlResult
        ``time``, ``inputs``, ``states``, ``cost``, ``success``.

    Raises
    ------
    InputError
        If the system is not that of a continuous or sampled Block, or its time points are not its steps
        apart.

    Examples
    --------
    >>> import control, hovercontrol as hc
    >>> v, a = hc.Signal("v", "m/s"), hc.Signal("a", "m/s^2")
    >>> cart = hc.Block("cart", [v], [a], [v], derivatives={"v": a.symbol}).to_control(step=0.5)
    >>> cost = control.optimal.quadratic_cost(cart, [[1.0]], [[1.0]])
    >>> found = solve_ocp(cart, np.arange(3) * 0.5, [1.0], cost, terminal_cost=cost)
    >>> found.inputs.round(3).tolist(), found.problem.system_simulations <= 20
    ([-0.621, -0.276, 0.0], True)
    """
    try:
        problem = GradientProblem(
            system,
            np.asarray(timepts, dtype=float),
            integral_cost,
            trajectory_constraints=_listed("trajectory_constraints", trajectory_constraints),
            terminal_cost=terminal_cost,
            terminal_constraints=_listed("terminal_constraints", terminal_constraints),
            initial_guess=initial_guess,
            basis=basis,
            **options,
        )
    except ValueError as error:
        if initial_guess is None:
            raise
        raise InputError(f"solve_ocp: initial_guess: {str(error).splitlines()[0]}") from None
    start = np.asarray(initial_state, dtype=float)
    if start.shape != (system.nstates,):
        n = system.nstates
        raise InputError(f"solve_ocp: initial_state: expected {n} values, found shape {start.shape}")
    for name, cost in (("integral_cost", integral_cost), ("terminal_cost", terminal_cost)):
        if cost is not None:
            _refuse_no_cost(name, cost, start, np.zeros(system.ninputs))
    options = {
        "squeeze": squeeze, "transpose": transpose, "return_states": return_states, "print_summary": False,
    }  # fmt: skip
    try:
        found = problem.compute_trajectory(start, **options)
        guess = problem.cheaper(found.x)
        if guess is not None:
            again = problem.compute_trajectory(start, initial_guess=guess, **options)
            found = again if problem.merit(again.x) < problem.merit(found.x) else found
    except RuntimeError as error:  # of python-control's simulation
        raise InputError(f"solve_ocp: {str(error).splitlines()[0]}") from None
    if guess is not None and problem.cheaper(found.x) is not None:
        warnings.warn(
            "solve_ocp: constant inputs cost less than the result, a stationary point: try other guesses",
            stacklevel=caller_level(),
        )
    if print_summary:
        problem._print_statistics()
        print("* Final cost:", found.cost)
    return found


def _refuse_no_cost(name: str, cost: Cost, x: Array, u: Array) -> None:
    """Raise if a cost is not a function of x and u that returns a number."""
    wanted = f"solve_ocp: {name}: expected a function of x and u that returns a number"
    try:
        found = cost(x, u)
    except Exception as error:
        raise InputError(f"{wanted}, found {shown(cost)}: {type(error).__name__}: {error}") from error
    if np.size(found) != 1 or not np.isrealobj(found) or np.asarray(found).dtype.kind not in "fiub":
        raise InputError(f"{wanted}, found {shown(found)}")


def _listed(name: str, given: Constraint | Sequence[Constraint] | None) -> list[Constraint]:
    """Return a list of SciPy's constraints, or of python-control's tuples (class, function, lower, upper)."""
    classes = (LinearConstraint, NonlinearConstraint)

    def is_one(thing: Any) -> bool:
        told = isinstance(thing, tuple) and len(thing) == 4 and any(thing[0] is c for c in classes)
        return told or isinstance(thing, classes)

    every: list[Any] = [] if given is None else [given] if is_one(given) else list(given)
    for one in every:
        if not is_one(one):
            wanted = "LinearConstraint or NonlinearConstraint of SciPy"
            raise InputError(f"solve_ocp: {name}: expected {wanted}, found {shown(one)}")
    return every


class GradientProblem(optimal.OptimalControlProblem):
    """A problem of python-control with gradients; arguments as for that class.

    Parameters
    ----------
    system : control.InputOutputSystem
        Of a continuous or sampled Block.
    timepts : ndarray, shape (n,)
        [s]
    *args, **options
        As for :class:`control.optimal.OptimalControlProblem`.
    """

    def __init__(self, system: Any, timepts: Array, *args: Any, **options: Any) -> None:
        _check(system, timepts)
        way = "shooting" if system.dt else "collocation"
        if options.setdefault("trajectory_method", way) != way:
            kind = "stepped" if way == "shooting" else "continuous"
            raise InputError(
                f"system {system.name!r}: gradients of a {kind} system are for {way}, found "
                f"{shown(options['trajectory_method'])}; by shooting use to_control(step=...)"
            )
        super().__init__(system, timepts, *args, **options)
        self.minimize_kwargs.setdefault("jac", self._gradient)
        jacobians = {
            self._constraint_function: lambda c: self._jacobian(c, equal=False),
            self._eqconst_function: lambda c: self._jacobian(c, equal=True),
        }
        if self.collocation:
            jacobians[self._collocation_constraint] = self._collocation_jacobian
        without: list[Any] = self.constraints  # type: ignore[has-type]
        self.constraints = [
            NonlinearConstraint(one.fun, one.lb, one.ub, jac=jacobians[one.fun]) for one in without
        ]
        self._held: Block | None = None
        self._at: tuple[bytes, tuple[Array, Array]] | None = None

    def _simulate_states(self, x0: Any, inputs: Any) -> Any:
        if self.collocation:
            return super()._simulate_states(x0, inputs)
        states = [np.array(x0, dtype=float)]
        for t, u in zip(self.timepts[:-1], np.asarray(inputs).T, strict=False):
            states.append(self.system._rhs(t, states[-1], u))
        self.system_simulations += 1
        return np.array(states).T

    # ---- constant inputs, compared with a result ---------------------------------------------------------

    def merit(self, c: Array) -> tuple[float, float]:
        """Return by how much the coefficients c violate the constraints on the motion, and their cost."""
        off = [0.0]
        for one in self.constraints:
            if one.fun != self._collocation_constraint:
                value = np.ravel(one.fun(c))
                off.append(float(np.max([one.lb - value, value - one.ub], initial=0.0)))
        violation = max(off)
        return (violation if violation > VIOLATION else 0.0), float(self._cost_function(c))

    def cheaper(self, c: Array) -> Array | tuple[Array, Array] | None:
        """Return the best constant inputs as a guess, if they are better than the coefficients c."""
        violation, cost = self.merit(c)
        best, least = None, (violation, cost - MARGIN * abs(cost))
        for level in self._constants():
            inputs = np.tile(level[:, None], self.timepts.size)
            guess = (self._simulate_states(self.x, inputs), inputs) if self.collocation else inputs
            merit = self.merit(self._process_initial_guess(guess))
            if merit < least:
                best, least = guess, merit
        return best

    def _constants(self) -> Array:
        """Return constant inputs of several sizes within their bounds, shape (n, n_inputs)."""
        signals, n = self.system.block.inputs, self.system.nstates
        low, high = (np.array([getattr(s, side) for s in signals]) for side in ("lower", "upper"))
        for kind, of, below, above in self.trajectory_constraints:
            for row, a, b in (
                zip(np.atleast_2d(of), below, above, strict=True) if kind == LinearConstraint else ()
            ):
                if np.count_nonzero(row) == 1 and row[n:].any():  # a bound of one input
                    j = int(np.flatnonzero(row[n:])[0])
                    a, b = sorted((a / row[n + j], b / row[n + j]))
                    low[j], high[j] = max(low[j], a), min(high[j], b)
        nominal = np.array([s.nominal for s in signals])
        return constant_inputs(low, high, nominal, sizes=SIZES[::2]).reshape(-1, len(signals))

    # ---- dx/dc and du/dc of the coefficients c -------------------------------------------------------------

    def _sensitivities(self, c: Array) -> tuple[Array, Array]:
        """Return dx/dc, shape (times, n_states, n_c), and du/dc, shape (times, n_inputs, n_c)."""
        key = np.r_[c, self.x].tobytes()
        if self._at is None or self._at[0] != key:
            self._at = key, self._new_sensitivities(c)
        return self._at[1]

    def _new_sensitivities(self, c: Array) -> tuple[Array, Array]:
        n, m, times = self.system.nstates, self.system.ninputs, len(self.timepts)
        states, inputs = self._compute_states_inputs(c)
        own = c.size - (n * times if self.collocation else 0)
        du = np.zeros((times, m, c.size))
        for j, unit in enumerate(np.eye(own)):
            du[:, :, j] = (self._coeffs_to_inputs(unit) if self.basis else unit.reshape(m, -1)).T
        dx = np.zeros((times, n, c.size))
        if self.collocation:  # the states are unknowns, row by row after the inputs
            row, state = np.meshgrid(np.arange(times), np.arange(n), indexing="ij")
            dx[row, state, own + state * times + row] = 1.0
            return dx, du
        # x_k+1 = phi(x_k, u_k):  dx_k+1 = A_k dx_k + B_k du_k
        for k, (A, B) in enumerate(zip(*self._steps(states, inputs), strict=True)):
            dx[k + 1] = A @ dx[k] + B @ du[k]
        return dx, du

    def _steps(self, x: Array, u: Array) -> tuple[Array, Array]:
        """Return A_k = dphi/dx and B_k = dphi/du of all steps, shapes (steps, n_states, ...)."""
        block, n, t = self.system.block, self.system.nstates, self.timepts[:-1]
        x, u, h = x[:, :-1], u[:, :-1], self.system.dt
        params = getattr(self.system, "_current_params", None) or self.system.block_params
        if block.period:
            by_x = finite_jacobian(block, t, x, u, params)
            by_u = finite_jacobian(block, t, x, u, params, columns="inputs")
            return np.moveaxis(by_x, -1, 0), np.moveaxis(by_u, -1, 0)
        if switching_conditions(block):
            rows = zip(t, x.T, u.T, strict=True)
            found = [step_jacobians(block, a, a + h, b, c, params) for a, b, c in rows]
            return np.array([A for A, _ in found]), np.array([B for _, B in found])
        if self._held is None:
            self._held = _with_held_inputs(block)
        J = finite_jacobian(block, t, x, u, params)
        finite_jacobian(block, t, x, u, params, columns="inputs")
        fastest = np.abs(np.linalg.eigvals(np.moveaxis(J, -1, 0))).max(initial=0.0)
        pieces = max(LEAST, int(np.ceil(PER_TIME_CONSTANT * fastest * h)))
        begin = t + np.arange(pieces)[:, None, None] * (h / pieces)
        step = np.full(begin.shape, h / pieces)
        start = np.concatenate([x, u])
        values = block.parameter_values(params, bounded=False)
        columns = Columns(range(len(start)), [-1] * len(values))
        nothing = np.zeros((0, *begin.shape))
        _, slopes = shoot_with_slopes(self._held, begin, step, nothing, {}, values, start, columns)
        by_step = np.moveaxis(slopes, -1, 0)[:, :n]
        return by_step[:, :, :n], by_step[:, :, n:]

    # ---- gradients -----------------------------------------------------------------------------------------

    def _gradient(self, c: Array) -> Array:
        """Return the gradient of the cost, shape (n_c,)."""
        states, inputs = self._compute_states_inputs(c)
        dx, du = self._sensitivities(c)
        # a sum over all but the last time, or the integral by the trapezoidal rule
        weights = np.append(np.ones(len(self.timepts) - 1), 0.0)
        if self.system.isctime():
            weights = np.convolve(np.diff(self.timepts), [0.5, 0.5])
        total = np.zeros(c.size)
        for k in np.flatnonzero(weights):
            by_x, by_u = _slopes(self.integral_cost, states[:, k], inputs[:, k])
            total += weights[k] * (by_x @ dx[k] + by_u @ du[k])[0]
        if self.terminal_cost is not None:
            by_x, by_u = _slopes(self.terminal_cost, states[:, -1], inputs[:, -1])
            total += (by_x @ dx[-1] + by_u @ du[-1])[0]
        return total

    def _jacobian(self, c: Array, *, equal: bool) -> Array:
        """Return the Jacobian of the equality or inequality constraints, in python-control's order."""
        states, inputs = self._compute_states_inputs(c)
        dx, du = self._sensitivities(c)
        every = [(k, one) for k in range(len(self.timepts)) for one in self.trajectory_constraints]
        every += [(-1, one) for one in self.terminal_constraints]
        rows = []
        for k, (kind, of, low, high) in every:
            if bool(np.all(low == high)) != equal:
                continue
            if kind == LinearConstraint:
                by_x, by_u = np.hsplit(np.atleast_2d(of), [self.system.nstates])
            else:
                by_x, by_u = _slopes(of, states[:, k], inputs[:, k])
            rows.append(by_x @ dx[k] + by_u @ du[k])
        return np.concatenate(rows)

    def _collocation_jacobian(self, c: Array) -> Array:
        """Return the Jacobian of the collocation conditions, row by row of the states."""
        states, inputs = self._compute_states_inputs(c)
        dx, du = self._sensitivities(c)
        t = self.timepts
        at = self.system.block, t, states, inputs, self.system.block_params
        by_state, by_input = finite_jacobian(*at), finite_jacobian(*at, columns="inputs")
        A, B = np.moveaxis(by_state, -1, 0), np.moveaxis(by_input, -1, 0)
        rates = A @ dx + B @ du
        # x_k - x_k-1 - h/2 (f_k + f_k-1) = 0,  x_0 given
        rows = dx.copy()
        rows[1:] -= dx[:-1] + np.diff(t)[:, None, None] / 2 * (rates[1:] + rates[:-1])
        return np.moveaxis(rows, 0, 1).reshape(-1, c.size)


def _check(system: Any, timepts: Array) -> None:
    if not isinstance(system, BlockSystem) or not system.block.states:
        raise InputError(
            "solve_ocp: expected the system of a Block with states (block.to_control()), "
            f"found {shown(system)}"
        )
    system.block.need_no_ticks("gradient")
    if timepts.ndim != 1 or len(timepts) < 2 or not (np.diff(timepts) > 0).all():
        raise InputError(f"solve_ocp: timepts: expected increasing times, found shape {timepts.shape}")
    if system.dt and not np.allclose(np.diff(timepts), system.dt, rtol=1e-6):
        raise InputError(
            f"solve_ocp: timepts: expected times {system.dt:g} s apart, the step of {system.name!r}, "
            f"found {np.diff(timepts).min():g} to {np.diff(timepts).max():g} s"
        )


def _with_held_inputs(block: Block) -> Block:
    """Return the Block with its inputs as further states that stay."""
    rates = {s.name: block.derivatives[s.name] for s in block.states}
    rates |= {s.name: sp.S.Zero for s in block.inputs}
    return block.unchecked(
        states=(*block.states, *block.inputs),
        inputs=(),
        derivatives=Expressions(rates),
        outputs=(),
        output_expressions=Expressions({}),
    )


def _slopes(of: Cost, x: Array, u: Array) -> tuple[Array, Array]:
    """Return the partial derivatives of a function of x and u by central differences, two matrices."""
    at = np.concatenate([x, u])
    columns = []
    for j, value in enumerate(at):
        step = DIFFERENCE * max(1.0, abs(value))
        ends = []
        for sign in (1.0, -1.0):
            moved = at.copy()
            moved[j] += sign * step
            ends.append(np.atleast_1d(np.asarray(of(*np.split(moved, [x.size])), dtype=float)).ravel())
        columns.append((ends[0] - ends[1]) / (2 * step))
    found = np.array(columns).T
    return found[:, : x.size], found[:, x.size :]
