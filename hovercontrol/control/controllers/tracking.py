"""The tracking controller of C17 [C17 eq 22, 25].

It makes a fixed point of the craft, ``control_point`` ahead of the centre of mass, follow a reference with
``z1'' + k2 z1' + k1 z1 = 0``. The drag it cancels and the matrix B it inverts are taken from the model's own
effects, so that a model with other drag needs no other controller.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known, shown
from hovercontrol.base.tables import finite, positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.controllers.references import OUTPUTS as REFERENCE
from hovercontrol.control.controllers.thrust_limits import within_limits
from hovercontrol.craft.models.effect_equations import accelerations, own_states
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.motion import MOTION, motion_symbols


@checked
def tracking_controller(
    model: Model,
    *,
    control_point: float = 0.2,
    control_point_side: float = 0.0,
    k1: float = 2.0,
    k2: float = 2.0,
    adapt: Sequence[str] = (),
    limits: bool | None = None,
    name: str = "controller",
) -> Block:
    """Return the tracking controller for a model with a propeller and a rudder.

    Parameters
    ----------
    model : Model
        The controller's model of the craft; its coefficients become the Block's parameters.
    control_point : float, optional
        delta_x [m], distance of the tracking point ahead of the centre of mass.
    control_point_side : float, optional
        delta_y [m], distance of the tracking point to the left of the centre line. C17's laws allow it, but
        its Theorem 4 does not: r' then has a term in r^2, so that the yaw rate escapes in finite time to one
        side (:func:`~hovercontrol.control.analysis.zero_dynamics`). A parameter of the Block only where it is
        not 0.
    k1, k2 : float, optional
        Gains [1/s^2, 1/s], positive.
    adapt : sequence of str, optional
        Coefficients that are taken from inputs ``NAME_hat`` (an estimator's outputs). The parameter
        ``adaptation`` blends: 0 is the model's value, 1 (the default) the estimate.
    limits : bool, optional
        Keep the commands within the model's input bounds, which become parameters: the side force, which
        turns the craft, is kept where the rudder reaches a limit, the direction where the thrust does
        (:mod:`hovercontrol.control.controllers.thrust_limits`). Default: as ``model.limited`` says.
    name : str, optional

    Returns
    -------
    Block
        Inputs: the motion, the reference, the estimates. Outputs: ``thrust``, ``rudder``, and the tracking
        error ``error_x, error_y`` [m] (z1, earth frame).

    Raises
    ------
    InputError
        If a gain is not positive, ``a dx = J/m`` (B is singular), a coefficient to adapt is unknown or
        enters B, or an effect is not affine in the thrust vector.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import c17_simulation
    >>> [s.name for s in tracking_controller(c17_simulation()).outputs]
    ['thrust', 'rudder', 'error_x', 'error_y']
    """
    if not isinstance(model, Model):
        raise InputError(f"controller: expected a Model (hovercontrol.vehicle(...)), found {shown(model)}")
    if isinstance(adapt, str):
        raise InputError(f"controller: adapt must be a list of coefficients, found the text {adapt!r}")
    for key, gain in (("k1", k1), ("k2", k2)):
        positive(f"controller: {key}", gain)
    for key, value in (("control_point", control_point), ("control_point_side", control_point_side)):
        finite(f"controller: {key}", value)
    force, B, s = affine_dynamics(model, name)
    _refuse_singular(model, name, B, control_point)
    dx = Signal("control_point", "m", "delta_x: tracking point ahead of the centre", start=control_point)
    text = "delta_y: to the left of the centre line"
    dy = Signal("control_point_side", "m", text, start=control_point_side)
    gains = (
        Signal("k1", "1/s^2", "position gain", start=k1, lower=0.0),
        Signal("k2", "1/s", "velocity gain", start=k2, lower=0.0),
    )
    estimates, blended, adaptation = _adaptation(model, name, adapt, B)
    cos, sin = sp.cos(s.psi), sp.sin(s.psi)
    xr, yr, vxr, vyr, axr, ayr = (r.symbol for r in REFERENCE)
    K1, K2 = (g.symbol for g in gains)
    d, b = dx.symbol, dy.symbol if control_point_side else sp.S.Zero
    # [C17 eq 15, 16]: z1 = p - p_d + R delta, z2 = R v - p_d' + R S delta r
    z1 = [s.x - xr + d * cos - b * sin, s.y - yr + d * sin + b * cos]
    along, side = s.u - b * s.r, s.v + d * s.r
    z2 = [cos * along - sin * side - vxr, sin * along + cos * side - vyr]
    e1, e2, w1, w2 = sp.symbols("error_x error_y error_rate_x error_rate_y", real=True)
    want_x = axr - K1 * e1 - K2 * w1
    want_y = ayr - K1 * e2 - K2 * w2
    # [C17 eq 25]: B T [cos, sin] = R'(p_d'' - k1 z1 - k2 z2) - drag - S delta (yaw drag) + delta r^2
    demand = sp.Matrix(
        [
            cos * want_x + sin * want_y - force["u"] + b * force["r"] + d * s.r**2,
            -sin * want_x + cos * want_y - force["v"] - d * force["r"] + b * s.r**2,
        ]
    )
    fx, fy = sp.symbols("thrust_x thrust_y", real=True)
    solution = (B(d, b).inv() * demand).xreplace(blended)
    thrust, rudder, bounds = polar(model, fx, fy, model.limited if limits is None else limits)
    used = demand.free_symbols | B(d, b).free_symbols
    return Block(
        name,
        inputs=(*MOTION, *REFERENCE, *estimates),
        outputs=(
            model.thrust,
            model.rudder,
            *(Signal(f"error_{axis}", "m", "tracking error of the control point") for axis in "xy"),
        ),
        parameters=(
            dx,
            *([dy] if control_point_side else []),
            *gains,
            *adaptation,
            *(p for p in model.parameters(name) if p.symbol in used),
            *bounds,
        ),
        definitions={
            "error_x": z1[0],
            "error_y": z1[1],
            "error_rate_x": z2[0],
            "error_rate_y": z2[1],
            "thrust_x": solution[0],
            "thrust_y": solution[1],
        },
        output_expressions={"thrust": thrust, "rudder": rudder},
    )


class ThrustMatrix:
    """B [C17 eq 21, 26] as a function of the control point: how T [cos, sin] accelerates it, body frame."""

    def __init__(self, gain: sp.Matrix) -> None:
        self.gain = gain  # rows u', v', r'; columns T cos(theta), T sin(theta)

    def __call__(self, ahead: sp.Expr, side: sp.Expr = sp.S.Zero) -> sp.Matrix:
        """Return B for a control point `ahead` of the centre of mass and to the left of it by `side` [m]."""
        u, v, r = (self.gain.row(i) for i in range(3))
        return sp.Matrix([u - side * r, v + ahead * r])


def affine_dynamics(model: Model, name: str) -> tuple[dict[str, sp.Expr], ThrustMatrix, SimpleNamespace]:
    """Return the effects' accelerations without thrust, and their gain on the thrust vector."""
    s = motion_symbols(model.fans)
    s.thrust_x, s.thrust_y = vector = sp.symbols("thrust_x thrust_y", real=True)
    commands = {s.thrust, s.rudder, *(f.command().symbol for f in model.fans)}
    for effect in model.effects:
        for term in effect.terms(effect.symbols(name), s).values():
            bent = any(sp.diff(term, a, b) != 0 for a in vector for b in vector)
            if bent or term.free_symbols & commands:
                raise InputError(
                    f"controller: the effect {effect.name!r} of model {model.name!r} is not a linear "
                    "function of T cos(theta), T sin(theta), so the thrust cannot be solved for"
                )
    for state in own_states(model.effects, name, s):
        raise InputError(
            f"controller: model {model.name!r} has friction with the internal state {state.name!r}, which "
            f"a controller cannot know: leave the effect out of the controller's model"
        )
    total = accelerations(model.effects, name, s)
    gain = sp.Matrix([[sp.diff(total[axis], a) for a in vector] for axis in ("u", "v", "r")])
    rest = {axis: e.xreplace(dict.fromkeys(vector, sp.S.Zero)) for axis, e in total.items()}
    return rest, ThrustMatrix(gain), s


def _refuse_singular(model: Model, name: str, B: ThrustMatrix, control_point: float) -> None:
    values = {p.symbol: p.start for p in model.parameters(name)}
    gain = B.gain.subs(values)
    centre = ThrustMatrix(gain)(sp.S.Zero)
    if abs(centre.det()) < 1e-12:
        raise InputError(f"controller: model {model.name!r} needs the effect 'thrust' > 0")
    here = ThrustMatrix(gain)(sp.Float(control_point))
    if abs(here.det()) < 1e-6 * abs(centre.det()):
        raise InputError(
            f"controller: control_point = {control_point:g} m gives a dx = J/m "
            f"(rudder_torque * control_point = thrust): B of C17 (26) has no inverse there"
        )


def _adaptation(
    model: Model, name: str, adapt: Sequence[str], B: ThrustMatrix
) -> tuple[list[Signal], dict[sp.Symbol, sp.Expr], list[Signal]]:
    named = {p.name.removeprefix(f"{name}."): p for p in model.parameters(name)}
    signals = {c: named[c] for c in model.linear_coefficients()}
    share = Signal(
        "adaptation", "1", "0: the model's coefficients, 1: the estimates", start=1.0, lower=0.0, upper=1.0
    )
    estimates, blended = [], {}
    for coefficient in adapt:
        check_known(coefficient, signals, f"controller: cannot adapt unknown coefficient {coefficient!r}")
        own = signals[coefficient]
        if own.symbol in B.gain.free_symbols:
            raise InputError(
                f"controller: {coefficient!r} enters B and stays at its prior value, so that B keeps its "
                "inverse (C17 Theorem 5)"
            )
        estimate = own.replace(name=f"{coefficient}_hat", lower=-sp.oo, upper=sp.oo)
        estimates.append(estimate)
        blended[own.symbol] = own.symbol + share.symbol * (estimate.symbol - own.symbol)
    return estimates, blended, [share] if estimates else []


def polar(model: Model, fx: sp.Symbol, fy: sp.Symbol, limits: bool) -> tuple[sp.Expr, sp.Expr, list[Signal]]:
    """Return thrust and rudder of a force vector: T = norm, theta = atan2, within bounds if wanted."""
    if limits:
        return within_limits(fx, fy, model.thrust, model.rudder)
    return sp.sqrt(fx**2 + fy**2), sp.atan2(fy, fx), []
