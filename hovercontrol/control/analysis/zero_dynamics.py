"""The zero dynamics of C17's tracking controller [C17 theorem 4]: heading and yaw rate on the reference.

All is read off the loop in error coordinates (:mod:`.normal_form`) with the errors at zero.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.short_repr import short_repr
from hovercontrol.base.tables import positive
from hovercontrol.blocks.sgn import sgn
from hovercontrol.control.analysis.byrnes_isidori import (
    ERRORS,
    coefficient,
    normal_form,
    once_for_equations,
    symbol,
)
from hovercontrol.control.analysis.regions import as_numbers
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.vehicles import c17_simulation


@checked
@dataclass(frozen=True)
class ZeroDynamics:
    """Heading and yaw rate while the control point follows the reference exactly, without dry friction.

    Attributes
    ----------
    yaw : sympy.Expr
        r' in ``psi``, ``r``, the reference's velocity and acceleration.
    growth : sympy.Expr
        The coefficient of r^2 in [C17 eq 23], the derivative of r^2/2 [1/s]: Theorem 4 asks that it is
        negative.
    cubic : sympy.Expr
        The coefficient of r^3 there [1/rad]: 0 for a control point on the centre line. Where it is not, r
        escapes in finite time from far enough to one side, and Theorem 4 has no Delta.
    nose, stern : tuple of sympy.Expr
        Coefficients (a1, a0) of ``s^2 + a1 s + a0``, the equation of small turns about straight motion at the
        speed ``U``, bow or stern ahead: stable where both are positive.
    """

    yaw: sp.Expr
    growth: sp.Expr
    cubic: sp.Expr
    nose: tuple[sp.Expr, sp.Expr]
    stern: tuple[sp.Expr, sp.Expr]

    __repr__ = short_repr

    def condition_24(self) -> sp.Expr:
        """Return (24), corrected [C17 eq 24]: J^-1 d_r is larger than this.

        Examples
        --------
        >>> zero_dynamics(c17_simulation()).condition_24()
        c8*delta_x*(c4 - c6)/(c7 - c8*delta_x)
        """
        short = {coefficient(name): c for name, c in _short().items()}
        return sp.factor(sp.simplify(self.growth.xreplace(short) + _short()["yaw_linear_drag"]))

    def margin(self) -> sp.Expr:
        """Return Delta of Theorem 4: (24) holds for every control point nearer than this [m].

        It is the nearer of two distances: where the growth is zero, and where B has no inverse, at which the
        growth changes sign, too. Infinite where neither exists.

        Examples
        --------
        >>> zero_dynamics(c17_simulation()).margin()
        Min(Abs(c7/c8), Abs(c6*c7/(c4*c8)))
        """
        short = {coefficient(name): c for name, c in _short().items()}
        top, bottom = sp.fraction(sp.together(self.growth.xreplace(short)))
        ends = [end for part in (top, bottom) for end in sp.solve(part, sp.Symbol("delta_x", real=True))]
        return sp.Min(*(sp.Abs(end) for end in ends)) if ends else sp.oo


def _short() -> dict[str, sp.Symbol]:
    """Return C17's symbols of the coefficients that Theorem 4 needs, by name."""
    c4, c6, c7, c8, dx = sp.symbols("c4 c6 c7 c8 delta_x", real=True)
    return {
        "sway_linear_drag": c4,
        "yaw_linear_drag": c6,
        "thrust": c7,
        "rudder_torque": c8,
        "control_point": dx,
    }


def theorem_4_margin(model: Model) -> float:
    """Return Delta of Theorem 4 [m] for a craft: with a nearer control point its velocities stay bounded.

    Examples
    --------
    >>> round(theorem_4_margin(c17_simulation()), 4)
    0.0488
    """
    values = {c: model.coefficients().get(name, 0.0) for name, c in _short().items()}
    found = zero_dynamics(model).margin().subs(values)
    return float(found) if found.is_finite else math.inf


@once_for_equations
def kinetic_energy_rate(model: Model) -> sp.Expr:
    """Return Z' of C17 (23), Z = r^2/2, in the error coordinates and with dry friction.

    C17 prints (23) with a bracket missing: the sign is that of ``e2' R'(z2 + p_d') - delta_x r``, the whole
    sway velocity.

    Parameters
    ----------
    model : Model
    """
    return symbol("r") * normal_form(model).rest["r"]


@checked
@once_for_equations
def zero_dynamics(model: Model, side: bool = False) -> ZeroDynamics:
    """Return the zero dynamics of a craft under the tracking controller.

    Parameters
    ----------
    model : Model
    side : bool, optional
        Whether the control point may lie beside the centre line (``control_point_side``).

    Returns
    -------
    ZeroDynamics

    Raises
    ------
    InputError
        As :func:`~hovercontrol.control.analysis.byrnes_isidori.normal_form`.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> zero_dynamics(hc.vehicle("c17_simulation")).cubic  # no term in r^3: the yaw rate stays bounded
    0
    """
    form = normal_form(model, side)
    exact = {symbol(name): sp.S.Zero for name in ERRORS}
    yaw = form.rest["r"].xreplace(exact).replace(sgn, lambda v, w: sp.S.Zero)
    psi, r, U = symbol("psi"), symbol("r"), sp.Symbol("U", positive=True)
    straight = {symbol("vx_ref"): U}
    straight |= {symbol(name): sp.S.Zero for name in ("vy_ref", "ax_ref", "ay_ref", "r")}

    def about(heading: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
        slopes = (sp.diff(yaw, by).xreplace(straight).subs(psi, heading) for by in (r, psi))
        a1, a0 = (sp.factor(sp.simplify(-slope)) for slope in slopes)
        return a1, a0

    powers = sp.Poly(sp.expand(yaw), r)
    growth, cubic = (sp.factor(sp.simplify(powers.coeff_monomial(r**k))) for k in (1, 2))
    return ZeroDynamics(yaw, growth, cubic, about(sp.S.Zero), about(sp.pi))


@dataclass(frozen=True, eq=False)
class Prediction:
    """What theory says of control points and rudder arms; arrays of one shape.

    Attributes
    ----------
    bounded : ndarray of bool
        Theorem 4 with (24) corrected.
    printed : ndarray of bool
        Theorem 4 with (24) as printed, whose right side lacks a factor J^-1.
    nose, stern : ndarray of bool
        Whether straight motion with bow or stern ahead is stable.
    """

    bounded: NDArray[np.bool_]
    printed: NDArray[np.bool_]
    nose: NDArray[np.bool_]
    stern: NDArray[np.bool_]

    __repr__ = short_repr


@checked
def predict(
    arm: ArrayLike,
    control_point: ArrayLike,
    *,
    model: Model | None = None,
    mass: float = 0.585,
    inertia: float = 0.01,
    speed: float = 2.0,
) -> Prediction:
    """Return what the zero dynamics promise.

    Parameters
    ----------
    arm : array_like
        From the centre of mass back to the rudder [m]; negative for a rudder ahead of it.
    control_point : array_like
        delta_x [m].
    model : Model, optional
        Drag and thrust; its ``rudder_torque`` becomes ``arm * thrust * mass/inertia``. Default C17's
        simulation.
    mass, inertia : float, optional
        [kg, kg m^2]
    speed : float, optional
        Of straight motion [m/s]; where it is positive it does not matter.

    Raises
    ------
    InputError
        If mass, inertia or speed is not positive, a length is not finite, or ``arm * control_point =
        inertia/mass`` at a point.

    Examples
    --------
    >>> p = predict(0.14, [0.03, 0.09, 0.2])
    >>> p.nose.tolist(), p.stern.tolist(), p.bounded.tolist()
    ([False, False, True], [True, False, False], [True, False, True])
    """
    model = c17_simulation() if model is None else model
    mass, inertia, speed = positive("mass", mass), positive("inertia", inertia), positive("speed", speed)
    a, dx = np.broadcast_arrays(as_numbers("arm", arm), as_numbers("control point", control_point))
    if not (np.isfinite(a).all() and np.isfinite(dx).all()):
        raise InputError("zero dynamics: arm and control point must be finite")
    near = np.abs(a * dx * mass / inertia - 1) < 1e-9
    if near.any():
        k = np.unravel_index(int(near.argmax()), near.shape)
        raise InputError(
            f"zero dynamics: arm = {a[k]:g} m with control point {dx[k]:g} m gives a dx = J/m = "
            f"{inertia / mass:g} m^2, where B of C17 (21) has no inverse"
        )
    dynamics, values = zero_dynamics(model), model.coefficients()
    numbers: dict[sp.Symbol, Any] = {coefficient(n): v for n, v in values.items()}
    numbers |= {
        coefficient("rudder_torque"): a * values["thrust"] * mass / inertia,
        coefficient("control_point"): dx,
        sp.Symbol("U", positive=True): speed,
    }

    def positive_everywhere(*expressions: sp.Expr) -> NDArray[np.bool_]:
        found = [sp.lambdify(list(numbers), e)(*numbers.values()) for e in expressions]
        return np.all([np.broadcast_to(f, a.shape) > 0 for f in found], axis=0)

    c6 = coefficient("yaw_linear_drag")
    right_side = dynamics.growth + c6  # of (24): kappa (c4 - c6)
    return Prediction(
        bounded=positive_everywhere(-dynamics.growth),
        printed=positive_everywhere(c6 - inertia * right_side),
        nose=positive_everywhere(*dynamics.nose),
        stern=positive_everywhere(*dynamics.stern),
    )
