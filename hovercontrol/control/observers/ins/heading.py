"""K06's heading filter: the errors of the integrated heading and of the gyro [K06 eq 3.31, 3.35]."""

from __future__ import annotations

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.observers.ins.imu import HEADING_AID, IMU_PERIOD, YAW_RATE, valid
from hovercontrol.control.observers.ins.kalman import remember, variance_parameters, wrapped
from hovercontrol.control.observers.ins.mechanisation import PSI_HAT, STARTED, clock
from hovercontrol.control.observers.ins.noise import K06_NOISE, InsNoise

_ERRORS = (Signal("dpsi", "rad", "heading error"), Signal("b_g", "rad/s", "gyro bias"))


@checked
def heading_filter(
    *, noise: InsNoise = K06_NOISE, period: float = IMU_PERIOD, name: str = "heading_filter"
) -> Block:
    """Return K06's heading filter, x1 = [dpsi, b_g] (section 5.4.5), in feedforward form [K06 fig 3.2].

    Feedforward: the estimated errors are subtracted from the outputs and not fed back into the integration.

    Parameters
    ----------
    noise : InsNoise, optional
        Only Q1, R1 and P1 are used.
    period : float, optional
        Period of the IMU [s].
    name : str, optional

    Returns
    -------
    Block
        Sampled. Inputs ``psi_ins``, ``yaw_rate``, ``heading_aid``, ``heading_aid_valid``; outputs
        ``psi_hat``, ``r_hat``, ``gyro_bias_hat``, ``heading_aid_innovation`` [rad] (0 without a measurement),
        its variance ``heading_aid_innovation_variance``, and ``P1[i,j]``, i <= j: the covariance of
        ``psi_hat - psi`` and ``b_g - gyro_bias_hat`` (with these signs). Parameters ``Q1[i,i]``,
        ``R1[0,0]``, ``dt``.

    Raises
    ------
    InputError
        If the period is not positive.

    Examples
    --------
    >>> [s.name for s in heading_filter().outputs[:3]]
    ['psi_hat', 'r_hat', 'gyro_bias_hat']
    """
    psi_ins = Signal("psi_ins", "rad", "heading, integrated from the gyro")
    use = valid("heading_aid")
    dt, elapsed, equations = clock(name, period)
    memory = remember("x1", "P1", _ERRORS, noise.P1)
    Q = variance_parameters("Q1", [s.unit for s in _ERRORS], noise.Q1)
    (R,) = variance_parameters("R1", ["rad"], [noise.R1])

    # dpsi+ = dpsi + b_g dt + w_1,  b_g+ = b_g + w_2,  cov w = diag Q1 [K06 section 5.4.5].
    dpsi, b_g = memory.estimate.x
    error = sp.Matrix([dpsi + b_g * elapsed, b_g])
    process = STARTED.symbol * sp.diag(*(q.symbol for q in Q))
    expected = equations.predict("expected", error, error.jacobian([dpsi, b_g]), memory.estimate.P, process)
    # z = psi_ins - psi_aid measures the heading error: H = [1, 0] [K06 eq 3.20, 3.21, 3.33, 3.34].
    # The outputs are psi_hat = psi_ins - dpsi and r_hat = r - b_g.
    seen = wrapped(psi_ins.symbol - HEADING_AID.symbol - expected.x[0])
    H = sp.Matrix([dpsi]).jacobian([dpsi, b_g])
    new = equations.correct("heading_aid", expected, H, seen, R.symbol, use.symbol).estimate
    outputs = (
        PSI_HAT,
        Signal("r_hat", "rad/s", "yaw rate, estimated"),
        Signal("gyro_bias_hat", "rad/s", "bias of the gyro, estimated"),
        Signal("heading_aid_innovation", "rad", "heading measured, as an error, less expected"),
        Signal("heading_aid_innovation_variance", "rad^2", "its variance"),
        *memory.outputs(),
    )
    return Block(
        name,
        states=(*memory.states, STARTED),
        inputs=(psi_ins, YAW_RATE, HEADING_AID, use),
        outputs=outputs,
        parameters=(*Q, R, dt),
        derivatives={**memory.next_values(new), STARTED.name: 1},
        output_expressions={
            "psi_hat": psi_ins.symbol - new.x[0],
            "r_hat": YAW_RATE.symbol - new.x[1],
            "gyro_bias_hat": new.x[1],
            **memory.output_values(new),
        },
        definitions=equations.definitions,
        period=period,
    )
