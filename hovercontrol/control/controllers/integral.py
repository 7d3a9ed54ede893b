"""The linear-quadratic regulator with integral action and anti-windup."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cholesky

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import positive
from hovercontrol.blocks.backends.friction_slopes import Slope
from hovercontrol.blocks.block import Block
from hovercontrol.control.controllers.design import Design, by_name, design_of
from hovercontrol.control.controllers.feedback import Gains, state_feedback
from hovercontrol.control.controllers.state_feedback import form_of, named, optimal_gains, refuse_unsolvable
from hovercontrol.control.controllers.weights import Weights, chosen_weights, weight_matrix

if TYPE_CHECKING:
    import control

    from hovercontrol.blocks.backends.trim import Trim


@checked
def lqi(
    plant: Block,
    trim: Trim | control.OperatingPoint | Mapping[str, float],
    Q: Weights | None = None,
    R: Weights | None = None,
    *,
    integrate: str | Sequence[str],
    max_states: Mapping[str, float] | None = None,
    max_inputs: Mapping[str, float] | None = None,
    states: Sequence[str] | None = None,
    tracking_time: float | None = None,
    applied: bool = False,
    period: float | None = None,
    friction: Slope = "none",
    amplitude: Mapping[str, float] | None = None,
    compensate_friction: bool | None = None,
    limits: bool = True,
    measured: str = "{}",
    name: str = "controller",
) -> Block:
    """Return the linear-quadratic regulator with integral action: ``u = u0 - K (x - x_ref) - K_i z``.

    The integral ``z' = e + L (demand - applied)`` of an error e removes the offset that a constant
    disturbance leaves. While a command is limited, the second term brings the demand back to the limit with
    the time constant `tracking_time` (back-calculation), so that the integral does not wind up.

    Parameters
    ----------
    plant : Block
        Continuous or sampled.
    trim : Trim, control.OperatingPoint or mapping
        As for :func:`lqr`.
    Q : mapping or array_like, scalar, shape (n,) or (n, n), optional
        Weights of the states [1/unit^2] and, after them, of the integrals, by name ``integral_y`` [1/(unit
        s)^2].
    R : mapping or array_like, scalar, shape (n_inputs,) or (n_inputs, n_inputs), optional
        Weights of the inputs [1/unit^2]. Only inputs with a weight are commanded.
    integrate : str or sequence of str
        The states or outputs whose error is integrated; no more than there are inputs.
    max_states, max_inputs : mapping, optional
        In place of `Q` and `R`: the largest acceptable deviations [their units], as for :func:`lqr`.
    states : sequence of str, optional
        The states that are fed back, as for :func:`lqr`.
    tracking_time : float, optional
        Time constant of the anti-windup [s] (default: that of the loop, the inverse of the geometric mean of
        its poles' magnitudes).
    applied : bool, optional
        Whether the anti-windup reads the applied commands from inputs ``thrust_applied`` instead of using the
        commands within their limits for it.
    period, friction, amplitude, compensate_friction, limits, measured, name
        As for :func:`lqr` [s].

    Returns
    -------
    Block
        As of :func:`lqr`, with states ``integral_y`` and parameters ``K_rudder_integral_y``,
        ``L_integral_y_rudder``.

    Raises
    ------
    InputError
        As :func:`lqr`; if the inputs cannot hold what is integrated, or an integrated output depends on an
        input directly.

    References
    ----------
    Astrom & Murray, Feedback Systems, 2nd edition, sections 7.4, 7.5 and 11.4.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import c17_simulation
    >>> plant = c17_simulation().plant()
    >>> straight = plant.trim({"u": 1.0, "r": 0.0})
    >>> weights = {"u": 1.0, "integral_u": 4.0}
    >>> hold = lqi(plant, straight, weights, {"thrust": 1.0}, integrate="u")
    >>> print(hold.equations())
    error_u = u - u_ref
    thrust_demand = -K_thrust_integral_u*integral_u - K_thrust_u*error_u + thrust_trim
    thrust = thrust_demand
    integral_u' = error_u
    """
    integrate = [integrate] if isinstance(integrate, str) else list(integrate)
    if not integrate:
        raise InputError("lqi: integrate: expected one or more states or outputs, found none")
    Q = chosen_weights("lqi", Q, max_states, ("Q", "max_states"))
    R = chosen_weights("lqi", R, max_inputs, ("R", "max_inputs"))
    weighted = by_name(Q)
    if weighted is not None:
        weighted = [key for key in weighted if key not in {f"integral_{i}" for i in integrate}]
    design = design_of(
        "lqi",
        plant,
        trim,
        friction=friction,
        amplitude=amplitude,
        states=states,
        inputs=by_name(R),
        weighted=weighted,
        integrate=integrate,
        compensate=friction == "none" if compensate_friction is None else compensate_friction,
        estimated=measured != "{}",
    )
    if len(integrate) > len(design.inputs):
        raise InputError(
            f"lqi: {len(design.inputs)} inputs cannot hold {len(integrate)} setpoints; "
            "integrate no more quantities than there are inputs"
        )
    q = weight_matrix(
        "lqi: Q", named("lqi: Q", design, Q, plant), [*design.names, *design.integral_names], definite=False
    )
    r = weight_matrix("lqi: R", R, design.input_names, definite=True)
    refuse_unsolvable("lqi", design, q)
    design = design.over("lqi", period)
    K, F = optimal_gains("lqi", design, q, r)
    n = len(design.states)
    time = tracking_time if tracking_time is None else positive("lqi: tracking_time", tracking_time)
    time = time or _time_constant(design, K)
    if time < design.period:
        raise InputError(f"lqi: tracking_time must be the period {design.period:g} s or more, found {time:g}")
    windup = _back_calculation(K[:, n:], q[n:, n:], r) / time
    return state_feedback(
        design,
        Gains(K[:, :n], K[:, n:], windup, F),
        form_of("lqi", design, limits, measured, name),
        applied=applied,
    )


def _time_constant(design: Design, K: Array) -> float:
    """Return the inverse of the geometric mean of the loop's poles' magnitudes [s]; a period or more."""
    A, B = design.with_integrals()
    poles = np.linalg.eigvals(A - B @ K).astype(complex)
    with np.errstate(divide="ignore"):
        speeds = np.log(np.abs(np.log(poles) / design.period if design.period else poles))
    return max(float(np.exp(-np.mean(speeds))), design.period)


def _back_calculation(K_i: Array, Q_i: Array, R: Array) -> Array:
    """Return the matrix that changes the integrals so that ``K_i z`` follows, shape (n_integrals, n_inputs).

    ``K_i^+``, the pseudo-inverse in the units of the cost: ``S^-1 (V K_i S^-1)^+ V`` with ``V' V = R`` and S
    the square root of the integrals' weights.
    """
    S = np.sqrt(np.diag(Q_i))
    V = cholesky(R)
    return np.linalg.pinv(V @ K_i / S) @ V / S[:, None]
