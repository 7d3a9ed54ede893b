"""The tracking loop in C17's error coordinates: what converges, and what the errors leave free.

The controller makes z1, z2 of (15)-(16) obey a linear equation; heading and yaw rate are the rest, the
zero dynamics. Both follow from the plant and the controller as they stand, by a change of coordinates.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass
from functools import wraps
from inspect import signature
from typing import Any, Concatenate, ParamSpec, TypeVar, cast

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.short_repr import short_repr
from hovercontrol.blocks.block import Block
from hovercontrol.control.controllers import tracking_controller
from hovercontrol.control.controllers.references import OUTPUTS as REFERENCE
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.motion import MOTION

P = ParamSpec("P")
Derived = TypeVar("Derived")

#: z1 and z2 of C17 (15)-(16), earth frame, as the controller names them.
ERRORS = ("error_x", "error_y", "error_rate_x", "error_rate_y")

#: The craft bears the controller's name, so that what the controller knows are the craft's own symbols.
OWNER = "controller"


def symbol(name: str) -> sp.Symbol:
    """Return the symbol of a signal by its name."""
    return sp.Symbol(name, real=True)


def coefficient(name: str) -> sp.Symbol:
    """Return the symbol of a coefficient of the craft, or of a gain (``k1``, ``control_point``)."""
    return symbol(f"{OWNER}.{name}")


@checked
@dataclass(frozen=True)
class NormalForm:
    """A craft under a tracking controller that knows it, in error coordinates.

    Attributes
    ----------
    errors : dict of str to sympy.Expr
        Time derivative of each of ``ERRORS``, in the errors, ``psi``, ``r``, the reference's signals, the
        coefficients and the gains (:func:`coefficient`).
    rest : dict of str to sympy.Expr
        Time derivatives of ``psi`` and ``r``, likewise.
    velocities : dict of str to sympy.Expr
        ``u`` and ``v`` in the same coordinates.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> form = normal_form(hc.vehicle("c17_simulation"))
    >>> list(form.errors), list(form.rest)
    (['error_x', 'error_y', 'error_rate_x', 'error_rate_y'], ['psi', 'r'])
    """

    errors: dict[str, sp.Expr]
    rest: dict[str, sp.Expr]
    velocities: dict[str, sp.Expr]

    __repr__ = short_repr


def once_for_equations(
    derive: Callable[Concatenate[Model, P], Derived],
) -> Callable[Concatenate[Model, P], Derived]:
    """Let a derivation be made once for models that differ in their numbers only."""
    known: dict[Hashable, Derived] = {}
    form = signature(derive)

    @wraps(derive)
    def derived(*args: Any, **kwargs: Any) -> Derived:
        given = form.bind(*args, **kwargs)
        given.apply_defaults()
        model, *others = given.arguments.values()
        key = (model.signature, *(tuple(one) if isinstance(one, list) else one for one in others))
        if key not in known:
            known[key] = derive(*given.args, **given.kwargs)
        return known[key]

    return cast("Callable[Concatenate[Model, P], Derived]", derived)


@checked
@once_for_equations
def normal_form(model: Model, side: bool = False) -> NormalForm:
    """Return the tracking loop of a craft in error coordinates.

    Parameters
    ----------
    model : Model
        The craft; the controller knows all of it.
    side : bool, optional
        Whether the control point may lie beside the centre line: its ``control_point_side`` is then a symbol.

    Returns
    -------
    NormalForm
        Valid wherever B of C17 (26) has an inverse; the control point stays a symbol.

    Raises
    ------
    InputError
        As :func:`~hovercontrol.control.controllers.tracking_controller`, or if the craft has states of its
        own beside the motion (lags).

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import c17_simulation
    >>> normal_form(c17_simulation()).errors["error_rate_x"]
    -controller.k1*error_x - controller.k2*error_rate_x
    """
    controller, flow = closed_loop(model, side=side)
    z = [controller.definitions[name] for name in ERRORS]
    position, velocity = [symbol(n) for n in "xy"], [symbol(n) for n in "uv"]
    rates = sp.Matrix(z[2:])
    turn = rates.jacobian(velocity)  # R: what turns u, v into the earth frame
    still = rates.xreplace(dict.fromkeys(velocity, sp.S.Zero))
    new = turn.T * (sp.Matrix([symbol(n) for n in ERRORS[2:]]) - still)
    back = dict(zip(velocity, new.applyfunc(sp.simplify), strict=True))
    back |= {p: p + symbol(n) - e for p, n, e in zip(position, ERRORS, z, strict=False)}
    changes = [sum((sp.diff(e, s) * f for s, f in flow.items()), sp.S.Zero) for e in z]
    return NormalForm(
        errors={n: sp.trigsimp(sp.expand(e.xreplace(back))) for n, e in zip(ERRORS, changes, strict=True)},
        rest={n: flow[symbol(n)].xreplace(back) for n in ("psi", "r")},
        velocities={n: back[symbol(n)] for n in "uv"},
    )


def closed_loop(
    model: Model, adapt: Iterable[str] = (), *, side: bool = False, steered: bool = True
) -> tuple[Block, dict[sp.Symbol, sp.Expr]]:
    """Return the tracking controller, and how motion and reference change under it.

    Parameters
    ----------
    model : Model
    adapt : iterable of str, optional
        Coefficients that the controller takes from estimates, ``NAME_hat``.
    side : bool, optional
        As for :func:`normal_form`.
    steered : bool, optional
        Whether the controller's commands act; else the force vector ``thrust_x, thrust_y`` stays as it is.

    Returns
    -------
    Block
        The controller, whose ``definitions`` are the errors; its gains under :func:`coefficient`.
    dict of sympy.Symbol to sympy.Expr
        Time derivatives of the motion and of the reference's position and velocity.
    """
    plant = model.plant(OWNER)
    plant.need_prompt_inputs("a normal form")
    if len(plant.states) > len(MOTION):
        more = ", ".join(s.name for s in plant.states[len(MOTION) :])
        raise InputError(f"normal form: model {model.name!r} has states beside its motion: {more}")
    ahead = _somewhere(model)
    controller = tracking_controller(
        model,
        control_point=ahead,
        control_point_side=ahead if side else 0.0,
        adapt=list(adapt),
        name=OWNER,
    )
    own = {p.name: f"{OWNER}.{p.name}" for p in controller.parameters if "." not in p.name}
    controller = controller.with_parameter_names(own)
    command = {symbol(n): controller.output_expressions[n] for n in ("thrust", "rudder")}
    push = {symbol(n): controller.definitions[n] for n in ("thrust_x", "thrust_y")}
    push |= {symbol(n): controller.definitions[n] for n in ERRORS}

    def closed(expression: sp.Expr) -> sp.Expr:
        forces = expression.xreplace(command)  # T cos(theta), T sin(theta) become the force vector
        if not steered:
            return forces
        return forces.xreplace(push).xreplace(push).xreplace({coefficient("adaptation"): sp.S.One})

    flow = {symbol(s.name): closed(plant.derivatives[s.name]) for s in plant.states}
    x, y, vx, vy, ax, ay = (s.symbol for s in REFERENCE)
    return controller, flow | {x: vx, y: vy, vx: ax, vy: ay}


def _somewhere(model: Model) -> float:
    """Return a control point at which B has an inverse: its place does not matter to the symbols."""
    values = model.coefficients()
    percussion = values.get("rudder_torque", 0.0) and values.get("thrust", 0.0) / values["rudder_torque"]
    return 0.5 * percussion
