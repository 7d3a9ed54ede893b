"""From wrong coefficients to a tracking error: the input-to-state gain behind Theorem 5 [C17 eq 27].

What the controller believes wrongly of the drag acts on the error equation as an acceleration d, linear in
the coefficients' errors: z1'' + k2 z1' + k1 z1 = R M (c_hat - c). C17 prints (27) with factors 1/zeta_7 and
1/(zeta_7 - zeta_8 delta_x) before the rows of M, which B cancels, with zeta_5 without its tilde, and with the
sign of c - c_hat. The loop as it stands gives M alone, times c_hat - c.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp
from matplotlib.figure import Figure
from numpy.typing import ArrayLike
from scipy.optimize import minimize_scalar

from hovercontrol.base.arguments import as_row, at_least
from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.figure_style import BLUE, VERMILION
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.base.tables import positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.sgn import regularise
from hovercontrol.control.analysis.byrnes_isidori import (
    ERRORS,
    OWNER,
    closed_loop,
    coefficient,
    once_for_equations,
    symbol,
)
from hovercontrol.control.analysis.loops import c17_ellipse, on_reference, tracking_loop
from hovercontrol.control.analysis.lyapunov import decay
from hovercontrol.craft.models.model import Model

#: The coefficients that C17 lets the controller take from the estimator, c1 to c6.
DRAG = (
    "surge_coulomb",
    "surge_linear_drag",
    "sway_coulomb",
    "sway_linear_drag",
    "yaw_coulomb",
    "yaw_linear_drag",
)


@checked
@once_for_equations
def mismatch(model: Model, adapt: tuple[str, ...] = DRAG) -> sp.ImmutableMatrix:
    """Return M of the acceleration ``R M (c_hat - c)`` that wrong coefficients put on the error equation.

    Parameters
    ----------
    model : Model
    adapt : tuple of str, optional
        The coefficients, in the order of the columns.

    Returns
    -------
    sympy.ImmutableMatrix, shape (2, m)
        In ``u``, ``v``, ``r`` and the control point; rows along the craft and across.

    Raises
    ------
    InputError
        As :func:`~hovercontrol.control.controllers.tracking_controller`.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import c17_simulation
    >>> mismatch(c17_simulation(), ("surge_linear_drag", "yaw_linear_drag"))
    Matrix([
    [u,                          0],
    [0, controller.control_point*r]])
    """
    controller, flow = closed_loop(model, adapt)
    believed = [symbol(f"{name}_hat") for name in adapt]
    rates = sp.Matrix([controller.definitions[name] for name in ERRORS[2:]])
    turn = rates.jacobian([symbol("u"), symbol("v")])  # R
    slope = sp.zeros(2, len(adapt))
    for s, rate in flow.items():
        by_belief = sp.Matrix([[sp.diff(rate, b) for b in believed]])
        slope += rates.diff(s) * by_belief
    return sp.ImmutableMatrix((turn.T * slope).applyfunc(sp.simplify))


@checked
def peak_gain(k1: ArrayLike, k2: ArrayLike) -> Array:
    """Return the exact gain from the largest acceleration d to the largest error z1 [s^2].

    Parameters
    ----------
    k1, k2 : array_like, of shapes that broadcast
        Gains [1/s^2, 1/s], positive.

    Returns
    -------
    ndarray, of their common shape

    Notes
    -----
    The integral of the impulse response's size: ``1/k1`` where the poles are real, else
    ``coth(pi z/(2 (1 - z^2)^(1/2)))/k1`` with the damping ratio z = k2/(2 k1^(1/2)).

    Examples
    --------
    >>> peak_gain(2.0, [2.0, 3.0]).round(4).tolist()
    [0.5452, 0.5]
    """
    k1, k2 = np.broadcast_arrays(np.asarray(k1, dtype=float), np.asarray(k2, dtype=float))
    ratio = k2 / (2 * np.sqrt(k1))
    inner = np.sqrt(np.where(ratio < 1, 1 - ratio**2, 1.0))
    with np.errstate(over="ignore"):
        swing = np.where(ratio < 1, 1 / np.tanh(np.pi * ratio / (2 * inner)), 1.0)
    return swing / k1


@checked
def lyapunov_gain(k1: float, k2: float) -> float:
    """Return the same gain [s^2] as V and W guarantee it, with the best beta.

    From ``V' <= -2 rate V + (2 V)^(1/2) |d|`` and ``|z1|^2 <= 2 V/(k1 - beta^2)``:
    ``|z1| <= |d|/(rate (k1 - beta^2)^(1/2))``.

    Parameters
    ----------
    k1, k2 : float
        Gains [1/s^2, 1/s].

    Raises
    ------
    InputError
        If a gain is not positive.

    Examples
    --------
    >>> round(lyapunov_gain(2.0, 2.0), 3)
    1.0
    """
    bound = float(decay(k1, k2).bound_19)

    def gain(beta: float) -> float:
        return 1.0 / (float(decay(k1, k2, beta).guaranteed) * np.sqrt(k1 - beta**2))

    found = minimize_scalar(gain, bounds=(1e-3 * bound, (1 - 1e-6) * bound), method="bounded")
    return float(found.fun)


@checked
@dataclass(frozen=True, eq=False)
class IssGain:
    """What wrong coefficients cost along a reference, to first order.

    Attributes
    ----------
    coefficients, units : tuple of str
    regressor : dict of str to float
        Largest size of each column of M along the motion, in m/s^2 per unit of the coefficient.
    together : float
        Largest size of d [m/s^2] where each coefficient is wrong by 1 in its own unit, signs at their worst.
    exact, guaranteed : float
        Gain from d to z1 [s^2]: :func:`peak_gain` and :func:`lyapunov_gain`.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> found = iss_gain(hc.vehicle("c17_simulation"), adapt=["surge_linear_drag"])
    >>> found.units, round(found.regressor["surge_linear_drag"], 2)
    (('1/s',), 2.27)
    """

    coefficients: tuple[str, ...]
    units: tuple[str, ...]
    regressor: dict[str, float]
    together: float
    exact: float
    guaranteed: float

    def __repr__(self) -> str:
        return self.table()

    def error(self, coefficient_error: float) -> float:
        """Return the bound of |z1| [m] where each coefficient is wrong by at most this, in its own unit.

        Parameters
        ----------
        coefficient_error : float
            Largest error of a coefficient, in the coefficient's unit.
        """
        return self.exact * self.together * coefficient_error

    def plot(self) -> Figure:
        """Return the bound of the error per unit of each coefficient as a picture."""
        return open_in_pyplot(iss_figure(self))

    def table(self) -> str:
        """Return the bound of the error per unit of each coefficient as text."""
        wide = max(len(n) for n in self.coefficients)
        rows = []
        for name, unit in zip(self.coefficients, self.units, strict=True):
            exact, guaranteed = (gain * self.regressor[name] for gain in (self.exact, self.guaranteed))
            rows.append(f"{name:{wide}} {exact:8.3f} {guaranteed:10.3f}  m per {unit}")
        return "\n".join([f"{'coefficient':{wide}} {'exact':>8} {'guaranteed':>10}", *rows])


@checked
def iss_gain(
    model: Model,
    *,
    k1: float = 2.0,
    k2: float = 2.0,
    control_point: float = 0.2,
    reference: Block | None = None,
    period: float = 2 * np.pi,
    adapt: Sequence[str] = DRAG,
) -> IssGain:
    """Return the gain of C17 (27) from errors of the coefficients to the tracking error.

    Parameters
    ----------
    model : Model
    k1, k2 : float, optional
        Gains [1/s^2, 1/s].
    control_point : float, optional
        [m]
    reference : Block, optional
        Default C17's ellipse.
    period : float, optional
        Of the reference [s]: the motion is looked at for one period after ten.
    adapt : sequence of str, optional
        The coefficients that may be wrong.

    Returns
    -------
    IssGain

    Raises
    ------
    InputError
        If a gain or the period is not positive, or as :func:`mismatch`.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> found = iss_gain(hc.vehicle("c17_simulation"), adapt=["surge_linear_drag"])
    >>> round(found.exact, 3), round(found.guaranteed, 3)
    (0.545, 1.0)
    """
    positive("period", period)
    reference = c17_ellipse() if reference is None else reference
    names = tuple(adapt)
    M = mismatch(model, names)
    loop = tracking_loop(model, reference, outputs=["u", "v", "r"], k1=k1, k2=k2, control_point=control_point)
    times = np.linspace(0.0, 11 * period, 2201)
    motion = loop.compile(friction="smooth").simulate(times, x0=on_reference(reference, control_point))
    u, v, r = motion.outputs[:, times >= 10 * period]
    size = np.abs(mismatch_numbers(M, model, control_point, u, v, r))
    units = {p.name: p.unit for p in model.parameters(OWNER)}
    return IssGain(
        names,
        tuple(units[f"{OWNER}.{name}"] for name in names),
        {name: float(np.hypot(*size[:, k]).max()) for k, name in enumerate(names)},
        float(np.hypot(*size.sum(axis=1)).max()),
        float(peak_gain(k1, k2)),
        lyapunov_gain(k1, k2),
    )


def mismatch_numbers(M: sp.Matrix, model: Model, control_point: float, u: Array, v: Array, r: Array) -> Array:
    """Return M along a motion, shape (2, m, n), of body velocities of shape (n,)."""
    numbers = {p.symbol: p.start for p in model.parameters(OWNER)}
    numbers[coefficient("control_point")] = control_point
    entries = [regularise(e).xreplace(numbers) for e in M]
    found = sp.lambdify([symbol(n) for n in "uvr"], entries)(u, v, r)
    full = [np.broadcast_to(np.asarray(e, dtype=float), u.shape) for e in found]
    return np.array(full).reshape(*M.shape, len(u))


@checked
def simulated_errors(
    model: Model, sizes: ArrayLike, runs: int = 100, *, duration: float = 30.0, seed: int = 0
) -> Array:
    """Return the largest |z1| [m] of loops on C17's ellipse whose controller believes wrong drag.

    Parameters
    ----------
    model : Model
    sizes : array_like, shape (n,)
        Each coefficient c1..c6 is wrong by up to this, in its own unit, and not negative.
    runs : int, optional
        Random draws at each size.
    duration : float, optional
        [s], from a start on the reference.
    seed : int, optional

    Returns
    -------
    ndarray, shape (n, runs)
        Infinite where the craft spins away.

    Raises
    ------
    InputError
        If there is no run, or the seed is negative.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> simulated_errors(hc.vehicle("c17_simulation"), [0.0, 0.1], runs=2, duration=5.0).shape
    (2, 2)
    """
    each = np.repeat(
        as_row("simulated_errors: sizes", sizes), at_least("simulated_errors: runs", runs, least=1)
    )
    at_least("simulated_errors: seed", seed)
    truth = np.array([model.coefficients()[name] for name in DRAG])
    draw = np.random.default_rng(seed).uniform(-1.0, 1.0, (len(DRAG), each.size))
    believed = np.maximum(truth[:, None] + each * draw, 0.0)
    loop = tracking_loop(model, outputs=["tracking_error"]).compile(friction="smooth")
    found = loop.sweep(
        np.linspace(0.0, duration, 1 + max(2, round(10 * duration))),
        params={f"controller.{name}": believed[k] for k, name in enumerate(DRAG)},
        x0=on_reference(c17_ellipse(), 0.2),
        method="rk4",
        step=0.01,
    )
    error = np.where(found.status == 0, found["tracking_error"].maximum, np.inf)
    return error.reshape(-1, runs)


def iss_figure(found: IssGain) -> Figure:
    """Return how far the craft strays per unit of each wrong coefficient: exact, and by Lyapunov's bound."""
    names = found.coefficients
    figure = Figure(figsize=(7.0, 1.4 + 0.4 * len(names)), layout="constrained")
    axis = figure.subplots()
    at = np.arange(len(names))
    sizes = np.array([found.regressor[n] for n in names])
    axis.barh(at - 0.2, found.exact * sizes, 0.38, color=BLUE, label="exact")
    axis.barh(at + 0.2, found.guaranteed * sizes, 0.38, color=VERMILION, hatch="//", label="guaranteed")
    axis.set_yticks(at, [f"{n} [{u}]" for n, u in zip(names, found.units, strict=True)])
    axis.invert_yaxis()
    axis.set_xscale("log")
    axis.set_xlabel("bound of the tracking error per unit of the coefficient [m]")
    axis.grid(alpha=0.3, axis="x")
    figure.legend(loc="outside lower center", ncols=2, frameon=False)
    return figure
