"""K06's velocity/position filter: it estimates the errors of velocity, position and accelerometers.

[K06 eq 3.22, 3.26, 3.27, 3.30, 3.32, 3.38]
"""

from __future__ import annotations

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.observers.ins.imu import (
    ACCELERATION_X,
    ACCELERATION_Y,
    FIX_X,
    FIX_Y,
    IMU_PERIOD,
    to_navigation,
    valid,
)
from hovercontrol.control.observers.ins.kalman import remember, variance_parameters
from hovercontrol.control.observers.ins.mechanisation import PSI_HAT, STARTED, clock
from hovercontrol.control.observers.ins.noise import K06_NOISE, InsNoise

_ERRORS = (
    Signal("dv_x", "m/s", "velocity error along x"),
    Signal("dv_y", "m/s", "velocity error along y"),
    Signal("dr_x", "m", "position error along x"),
    Signal("dr_y", "m", "position error along y"),
    Signal("b_ax", "m/s^2", "accelerometer bias along the bow"),
    Signal("b_ay", "m/s^2", "accelerometer bias to the side"),
)
_INS = (
    Signal("v_x_ins", "m/s", "velocity along x, integrated"),
    Signal("v_y_ins", "m/s", "velocity along y, integrated"),
    Signal("x_ins", "m", "position, integrated twice"),
    Signal("y_ins", "m", "position, integrated twice"),
)
_LAST_HEADING = PSI_HAT.replace(name="last_psi_hat", description="heading, estimated at the last tick")

#: Outputs of every navigation filter that describe the motion, apart from the heading.
MOTION_OUTPUTS = (
    Signal("x_hat", "m", "position, estimated"),
    Signal("y_hat", "m", "position, estimated"),
    Signal("u_hat", "m/s", "surge velocity, estimated"),
    Signal("v_hat", "m/s", "sway velocity, estimated"),
    Signal("v_x_hat", "m/s", "velocity along x, estimated"),
    Signal("v_y_hat", "m/s", "velocity along y, estimated"),
    Signal("force_x_hat", "m/s^2", "specific force along the bow, less its bias"),
    Signal("force_y_hat", "m/s^2", "specific force to the side, less its bias"),
    Signal("acceleration_x_bias_hat", "m/s^2", "bias of the accelerometer, estimated"),
    Signal("acceleration_y_bias_hat", "m/s^2", "bias of the accelerometer, estimated"),
)


@checked
def velocity_position_filter(
    *, noise: InsNoise = K06_NOISE, period: float = IMU_PERIOD, name: str = "velocity_position_filter"
) -> Block:
    """Return K06's filter x2 = [dv_x, dv_y, dr_x, dr_y, b_ax, b_ay] (section 5.4.5), in feedforward form.

    The filter treats the estimated heading as exact.

    Parameters
    ----------
    noise : InsNoise, optional
        Only Q2, R2 and P2 are used.
    period : float, optional
        Period of the IMU [s].
    name : str, optional

    Returns
    -------
    Block
        Sampled. Inputs ``psi_hat``, ``v_x_ins``, ``v_y_ins``, ``x_ins``, ``y_ins``, ``acceleration_x``,
        ``acceleration_y``, ``fix_x``, ``fix_y``, ``fix_valid``; outputs ``x_hat``, ``y_hat``, ``u_hat``,
        ``v_hat``, ``v_x_hat``, ``v_y_hat``, the specific force less its bias ``force_x_hat``,
        ``force_y_hat``, the biases, ``fix_x_innovation``, ``fix_y_innovation`` [m] (0 without a fix), their
        variances, and ``P2[i,j]``, i <= j: the covariance of estimated minus true velocity and position, and
        of true minus estimated biases. Parameters ``Q2[i,i]``, ``R2[i,i]``, ``dt``.

    Raises
    ------
    InputError
        If the period is not positive.

    Examples
    --------
    >>> len(velocity_position_filter().states)  # 6 errors, 21 covariances, the last heading, started
    29
    """
    use = valid("fix")
    dt, elapsed, equations = clock(name, period)
    memory = remember("x2", "P2", _ERRORS, noise.P2)
    Q = variance_parameters("Q2", [_ERRORS[i].unit for i in (0, 1, 4, 5)], noise.Q2)
    R = variance_parameters("R2", ["m", "m"], noise.R2)

    # dv+ = dv + dt B(psi) b_a + B(psi) w_v,  dr+ = dr + dt dv + dt^2/2 B(psi) b_a,  b_a+ = b_a + w_b
    # with psi of the last tick and cov w = diag Q2; F and G are the derivatives with respect to x and w,
    # and the process noise is G Q2 G^T [K06 section 5.4.5].
    x = memory.estimate.x
    dv, dr, b_a = x[0:2, 0], x[2:4, 0], x[4:6, 0]
    w = sp.Matrix([sp.Dummy(real=True) for _ in Q])
    push = to_navigation(_LAST_HEADING.symbol, b_a)
    error = sp.Matrix.vstack(
        dv + elapsed * push + to_navigation(_LAST_HEADING.symbol, w[0:2, 0]),
        dr + elapsed * dv + elapsed**2 / 2 * push,
        b_a + w[2:4, 0],
    )
    G = error.jacobian(w)
    process = STARTED.symbol * G * sp.diag(*(q.symbol for q in Q)) * G.T
    calm = error.subs(dict.fromkeys(w, 0))
    expected = equations.predict("expected", calm, calm.jacobian(x), memory.estimate.P, process)
    new = expected
    for axis, aid in enumerate((FIX_X, FIX_Y)):
        H = sp.Matrix([dr[axis]]).jacobian(x)
        # [K06 eq 3.36, 3.37] The position error is measured as z = r_ins - r_fix; the innovation is z - dr.
        seen = _INS[2 + axis].symbol - aid.symbol - new.x[2 + axis]
        new = equations.correct(aid.name, new, H, seen, R[axis].symbol, use.symbol).estimate
    v = sp.Matrix([_INS[i].symbol - new.x[i] for i in (0, 1)])
    r = sp.Matrix([_INS[2 + i].symbol - new.x[2 + i] for i in (0, 1)])
    told = motion_outputs(PSI_HAT.symbol, v, r, new.x[4:6, 0])
    return Block(
        name,
        states=(*memory.states, _LAST_HEADING, STARTED),
        inputs=(PSI_HAT, *_INS, ACCELERATION_X, ACCELERATION_Y, FIX_X, FIX_Y, use),
        outputs=(*MOTION_OUTPUTS, *innovation_outputs((FIX_X, FIX_Y)), *memory.outputs()),
        parameters=(*Q, *R, dt),
        derivatives={**memory.next_values(new), _LAST_HEADING.name: PSI_HAT.symbol, STARTED.name: 1},
        output_expressions={**told, **memory.output_values(new)},
        definitions=equations.definitions,
        period=period,
    )


def motion_outputs(psi: sp.Expr, v: sp.Matrix, r: sp.Matrix, bias: sp.Matrix) -> dict[str, sp.Expr]:
    """Return the expressions of :data:`MOTION_OUTPUTS`, given v and r in navigation axes."""
    # [u_hat, v_hat] = B(psi)^T v,  force_hat = f - b_a.
    u, sway = to_navigation(-psi, v)
    force = [ACCELERATION_X.symbol - bias[0], ACCELERATION_Y.symbol - bias[1]]
    values = [*r, u, sway, *v, *force, *bias]
    return {s.name: e for s, e in zip(MOTION_OUTPUTS, values, strict=True)}


def innovation_outputs(aids: tuple[Signal, ...]) -> tuple[Signal, ...]:
    """Return the outputs ``AID_innovation`` and ``AID_innovation_variance`` of each aid."""
    return tuple(
        signal
        for aid in aids
        for signal in (
            Signal(f"{aid.name}_innovation", aid.unit, "measured less expected, 0 without a measurement"),
            Signal(f"{aid.name}_innovation_variance", f"({aid.unit})^2", "its variance"),
        )
    )
