"""The solution of a predictive problem at one sample: one step of SQP by OSQP, or IPOPT.

At each sample the problem of :mod:`hovercontrol.control.controllers.shooting` is linearised at the previous
solution, shifted by one period, and one quadratic program is solved (real-time iteration: Diehl, Bock and
Schloeder, SIAM Journal on Control and Optimization 43 (2005)). All derivatives are exact, by CasADi.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.backends.casadi import import_casadi
from hovercontrol.control.controllers.shooting import Problem

Solver = Literal["rti", "ipopt"]

#: Absolute and relative tolerance of OSQP on the residuals of a quadratic program.
TOLERANCE = 1e-5

#: What OSQP says of residuals within ten times its tolerance; the plan is judged by its predicted cost.
ACCEPTED = ("solved inaccurate",)

#: Options of OSQP, the quickest of CasADi's quadratic solvers on C17's craft (`python -m benchmarks mpc`).
_OSQP = {
    "osqp": {"verbose": False, "eps_abs": TOLERANCE, "eps_rel": TOLERANCE, "max_iter": 10000},
    "error_on_fail": False,
}
_IPOPT = {
    "ipopt": {"print_level": 0, "sb": "yes", "max_iter": 200},
    "print_time": False,
    "error_on_fail": False,
}


class Memory(NamedTuple):
    """What the controller keeps from sample to sample.

    Parameters
    ----------
    w : ndarray
        The last solution, shape (n_unknowns,).
    u : ndarray, shape (n_inputs,)
        The last input [unit].
    progress : float
        Length along the waypoints' path [m].
    samples : int
        Number of samples so far.
    failures : int
        Number of samples at which the solver failed and the last plan went on.
    """

    w: Array
    u: Array
    progress: float
    samples: int
    failures: int


class UnsolvedError(Exception):
    """The solver has no solution; the text says why."""


class Optimizer:
    """Solves a problem from a guess, for the present state and input.

    Parameters
    ----------
    problem : Problem
    solver : {"rti", "ipopt"}
    scalar : bool
        Whether the plant's functions consist of scalar operations; they are then expanded.
    """

    def __init__(self, problem: Problem, solver: Solver, scalar: bool) -> None:
        ca = import_casadi()
        self._problem, self._solver, nlp = problem, solver, problem.nlp
        if solver == "ipopt":
            self._ipopt = ca.nlpsol("mpc", "ipopt", nlp, _IPOPT)
            return
        hessian, gradient = ca.hessian(nlp["f"], nlp["x"])
        jacobian = ca.jacobian(nlp["g"], nlp["x"])
        # f is quadratic and its Hessian constant; f = f(0) + c'w + w'Hw/2 with c = f'(w) - H w
        self._hessian = ca.Function("h", [], [hessian])()["o0"]
        linear = ca.Function(
            "linear", [nlp["x"], nlp["p"]],
            [gradient - hessian @ nlp["x"], nlp["g"] - jacobian @ nlp["x"], jacobian],
        )  # fmt: skip
        self._linear = linear.expand() if scalar else linear  # nearly twice as fast
        shapes = {"h": self._hessian.sparsity(), "a": jacobian.sparsity()}
        self._qp = ca.conic("qp", "osqp", shapes, _OSQP)

    def optimum(self, w: Array, start: Array, p: Array) -> Array:
        """Return the solution from a guess.

        Parameters
        ----------
        w : ndarray, shape (n_w,)
            Guess of the unknowns.
        start : ndarray, shape (n_states + n_inputs,)
            The present state and input [unit].
        p : ndarray, shape (n_p,)
            The references, column by column.

        Returns
        -------
        ndarray, shape (n_w,)

        Raises
        ------
        UnsolvedError
            If the solver fails, or a derivative of the problem is not finite.
        """
        q, n = self._problem, start.size
        lower, upper = q.lbx.copy(), q.ubx.copy()
        lower[:n] = upper[:n] = start
        if self._solver == "ipopt":
            return self._solved(self._ipopt, x0=w, p=p, lbx=lower, ubx=upper, lbg=q.lbg, ubg=q.ubg)
        gradient, rest, jacobian = self._linear(w, p)
        rest = np.asarray(rest).ravel()
        if not (np.isfinite(rest).all() and np.isfinite(jacobian.nonzeros()).all()):
            raise UnsolvedError("no finite derivatives along the plan")
        return self._solved(
            self._qp, h=self._hessian, g=gradient, a=jacobian, lba=q.lbg - rest, uba=q.ubg - rest,
            lbx=lower, ubx=upper, x0=w,
        )  # fmt: skip

    def _solved(self, solver: Any, **problem: Any) -> Array:
        """Return the solution if the solver has one; after a failure it returns any numbers."""
        try:
            result = solver(**problem)
        except RuntimeError as error:  # numbers that the solver refuses
            raise UnsolvedError(f"{self._solver}: {str(error).strip().splitlines()[-1]}") from None
        status, found = solver.stats(), np.asarray(result["x"]).ravel()
        if not (status["success"] or status["return_status"] in ACCEPTED) or not np.isfinite(found).all():
            raise UnsolvedError(f"{self._solver}: {status['return_status']}")
        return found
