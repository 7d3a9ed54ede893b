"""One extended Kalman filter for heading, velocity, position and biases, with any set of aids.

K06's two filters estimate the errors of the integration. This filter estimates the motion itself: its
corrections are fed back into the integration, which K06 section 3.3.3.6 asks for where no heading aid exists.
Its Jacobians are the exact derivatives of (3.42).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.observers.ins.imu import HEADING_AID, IMU, YAW_RATE, to_navigation, valid
from hovercontrol.control.observers.ins.kalman import (
    Equations,
    Estimate,
    Memory,
    remember,
    variance_parameters,
    wrapped,
)
from hovercontrol.control.observers.ins.mechanisation import (
    HELD_IMU,
    PSI_HAT,
    STARTED,
    clock,
    finite,
    integrated_heading,
    integrated_motion,
)
from hovercontrol.control.observers.ins.noise import InsNoise
from hovercontrol.control.observers.ins.velocity_position import (
    MOTION_OUTPUTS,
    innovation_outputs,
    motion_outputs,
)

#: The estimated quantities, in the order of ``xhat[i]``.
QUANTITIES = (
    Signal("psi", "rad", "heading"),
    Signal("v_x", "m/s", "velocity along x"),
    Signal("v_y", "m/s", "velocity along y"),
    Signal("x", "m", "position x"),
    Signal("y", "m", "position y"),
    Signal("b_g", "rad/s", "gyro bias"),
    Signal("b_ax", "m/s^2", "accelerometer bias along the bow"),
    Signal("b_ay", "m/s^2", "accelerometer bias to the side"),
)
#: Time constant [s] of the average of the specific force that decides whether the craft accelerates.
AVERAGING = 1.0

_PUSH = tuple(
    Signal(f"push_{axis}", "m/s^2", f"specific force along {axis}, averaged over the last second")
    for axis in "xy"
)
ESTIMATE = sp.Matrix([sp.Symbol(f"{s.name}_", real=True) for s in QUANTITIES])
PSI, VELOCITY, POSITION = ESTIMATE[0], ESTIMATE[1:3, 0], ESTIMATE[3:5, 0]


@dataclass(frozen=True)
class Aid:
    """A scalar measurement and its expected value as a function of the estimate.

    Parameters
    ----------
    signal : Signal
        Input with the measured value.
    valid : Signal
        Input that is 1 at a tick with a measurement.
    expected : sympy.Expr
        Expected value, an expression in :data:`PSI`, :data:`POSITION`, the symbols of `extra` quantities and
        the parameters.
    variance : Signal
        Parameter: variance of the measurement noise.
    angle : bool, optional
        Whether the measurement is an angle; its innovation is then wrapped.
    shows_heading : bool, optional
        Whether it makes the heading observable by itself, not only while the craft accelerates.
    """

    signal: Signal
    valid: Signal
    expected: sp.Expr
    variance: Signal
    angle: bool = False
    shows_heading: bool = False


def heading_aid(noise: InsNoise) -> Aid:
    """Return the aid that measures the heading."""
    (R,) = variance_parameters("R1", ["rad"], [noise.R1])
    return Aid(HEADING_AID, valid("heading_aid"), PSI, R, angle=True, shows_heading=True)


def navigation_filter(
    name: str,
    aids: Sequence[Aid],
    parameters: Sequence[Signal],
    *,
    noise: InsNoise,
    pose: Sequence[float],
    velocity: Sequence[float],
    period: float,
    excitation: float,
    extra: Sequence[Signal] = (),
    extra_variances: Sequence[float] = (),
    inputs: Sequence[Signal] = (),
    definitions: Mapping[str, sp.Expr] | None = None,
) -> Block:
    """Return the extended Kalman filter for given measurements.

    Parameters
    ----------
    aids : sequence of Aid
        Processed in this order, each linearised at the estimate that the previous one left.
    parameters : sequence of Signal
        Parameters in the aids' expressions.
    noise, pose, velocity, period, excitation
        As for :func:`coupled_filter`.
    extra : sequence of Signal, optional
        Constants that are estimated too; the aids' expressions use their own symbols.
    extra_variances : sequence of float, optional
        Initial variances of `extra`.
    inputs : sequence of Signal, optional
        Further inputs in the aids' expressions.
    definitions : mapping of str to sympy.Expr, optional
        Further definitions in the aids' expressions, in terms of inputs and parameters.
    """
    x, y, psi = finite(f"{name}: pose", pose, 3)
    start = [psi, *finite(f"{name}: velocity", velocity, 2), x, y]
    quantities = (*QUANTITIES, *extra)
    symbols = sp.Matrix([*ESTIMATE, *(s.symbol for s in extra)])
    dt, elapsed, equations = clock(name, period)
    memory = stored_estimate(quantities, start, noise, extra_variances)
    units = [QUANTITIES[i].unit for i in (0, 1, 2, 5, 6, 7)]
    Q = variance_parameters("Q", units, added_variances(noise))

    # x+ = f(x, w), F = df/dx and G = df/dw at w = 0:  P+ = F P F^T + G diag(Q) G^T.
    w = sp.Matrix([sp.Dummy(real=True) for _ in Q])
    moved = sp.Matrix([*next_estimate(elapsed, w), *(s.symbol for s in extra)])
    calm = dict.fromkeys(w, 0)
    here = dict(zip(symbols, memory.estimate.x, strict=True))
    G = moved.jacobian(w).subs(calm).xreplace(here)
    process = STARTED.symbol * G * sp.diag(*(q.symbol for q in Q)) * G.T
    F = moved.jacobian(symbols).subs(calm).xreplace(here)
    new = equations.predict("expected", moved.subs(calm).xreplace(here), F, memory.estimate.P, process)
    least = Signal(
        "excitation",
        "m/s^2",
        "average force above which motion shows the heading",
        start=excitation,
        lower=0.0,
    )
    averaging = Signal("averaging", "s", "time of that average", start=AVERAGING, lower=0.0)
    pushed, excited = _excitation(equations, memory.estimate, elapsed, least.symbol, averaging.symbol)
    for aid in aids:
        new = _corrected(equations, new, aid, symbols, 1 if aid.shows_heading else excited)

    told, values = outputs_of_estimate(new.x, extra)
    measured = dict.fromkeys(signal for aid in aids for signal in (aid.signal, aid.valid))
    return Block(
        name,
        states=(*memory.states, *HELD_IMU, *_PUSH, STARTED),
        inputs=(*IMU, *measured, *inputs),
        outputs=(
            *told,
            *innovation_outputs(tuple(aid.signal for aid in aids)),
            *memory.outputs(),
        ),
        parameters=(*Q, *dict.fromkeys(aid.variance for aid in aids), *parameters, least, averaging, dt),
        derivatives={
            **memory.next_values(new),
            **{held.name: s.symbol for held, s in zip(HELD_IMU, IMU, strict=True)},
            **{s.name: e for s, e in zip(_PUSH, pushed, strict=True)},
            STARTED.name: 1,
        },
        output_expressions={
            **values,
            **memory.output_values(new),
        },
        definitions={**(definitions or {}), **equations.definitions},
        period=period,
    )


def stored_estimate(
    quantities: Sequence[Signal], start: Sequence[float], noise: InsNoise, extra: Sequence[float]
) -> Memory:
    """Return the stored estimate; it starts at psi, v_x, v_y, x, y of `start` and zero biases."""
    started = [s.replace(start=v) for s, v in zip(quantities, [*start, *[0.0] * 9], strict=False)]
    return remember("xhat", "P", started, [noise.P1[0], *noise.P2[:4], noise.P1[1], *noise.P2[4:], *extra])


def added_variances(noise: InsNoise) -> list[float]:
    """Return the process noise variances of one tick: heading, velocity forward and sideways, biases."""
    return [noise.Q1[0], *noise.Q2[:2], noise.Q1[1], *noise.Q2[2:]]


def outputs_of_estimate(
    x: sp.Matrix, extra: Sequence[Signal]
) -> tuple[tuple[Signal, ...], dict[str, sp.Expr]]:
    """Return the outputs of an estimate, and their expressions."""
    extras = tuple(s.replace(name=f"{s.name}_hat", description=f"{s.description}, estimated") for s in extra)
    outputs = (
        PSI_HAT,
        Signal("r_hat", "rad/s", "yaw rate, estimated"),
        Signal("gyro_bias_hat", "rad/s", "bias of the gyro, estimated"),
        *MOTION_OUTPUTS,
        *extras,
    )
    return outputs, {
        "psi_hat": x[0],
        "r_hat": YAW_RATE.symbol - x[5],
        "gyro_bias_hat": x[5],
        **motion_outputs(x[0], x[1:3, 0], x[3:5, 0], x[6:8, 0]),
        **{s.name: e for s, e in zip(extras, x[8:, 0], strict=True)},
    }


def next_estimate(elapsed: sp.Expr, w: sp.Matrix) -> sp.Matrix:
    """Return the estimate one tick later by (3.42); w is the noise that K06's discrete model adds."""
    # psi+ = psi + dt/2 (r0 + r1 - 2 b_g) + w_psi,  f0 = B(psi) (f_0 - b_a),  f1 = B(psi+) (f_1 - b_a),
    # v+ = v + dt/2 (f0 + f1) + B(psi) w_v,  p+ = p + v dt + dt^2/6 (2 f0 + f1),  b+ = b + w_b.
    # psi+ in f1 is taken without w_psi.
    b_g, b_a = ESTIMATE[5], ESTIMATE[6:8, 0]
    before, now = (sp.Matrix([s.symbol for s in group]) for group in (HELD_IMU, IMU))
    psi = integrated_heading(PSI, before[2] - b_g, now[2] - b_g, elapsed)
    f0 = to_navigation(PSI, before[0:2, 0] - b_a)
    f1 = to_navigation(psi, now[0:2, 0] - b_a)
    motion = integrated_motion(VELOCITY, POSITION, f0, f1, elapsed)
    motion += sp.Matrix.vstack(to_navigation(PSI, w[1:3, 0]), sp.zeros(2, 1))
    return sp.Matrix([psi + w[0], *motion, b_g + w[3], *(b_a + w[4:6, 0])])


def _excitation(
    equations: Equations, estimate: Estimate, elapsed: sp.Expr, least: sp.Expr, averaging: sp.Expr
) -> tuple[sp.Matrix, sp.Expr]:
    """Return the averaged specific force, and 1 while it is large enough to observe the heading, else 0.

    At rest the filter would take the accelerometers' noise for motion that makes the heading observable, and
    reduce its heading variance although nothing was learned.
    """
    # First-order average a+ = a + dt/tau (B(psi) (f - b_a) - a);  excited = 1 if |a+| >= least.
    push = sp.Matrix([s.symbol for s in _PUSH])
    body = sp.Matrix([s.symbol for s in IMU[:2]]) - estimate.x[6:8, 0]
    force = to_navigation(estimate.x[0], body)
    average = equations.matrix("pushed", push + elapsed / averaging * (force - push))
    return average, equations.define(
        "excited", sp.Piecewise((1, average.dot(average) >= least**2), (0, True))
    )


def _corrected(
    equations: Equations, estimate: Estimate, aid: Aid, symbols: sp.Matrix, excited: sp.Expr
) -> Estimate:
    here = dict(zip(symbols, estimate.x, strict=True))
    H = sp.Matrix([aid.expected]).jacobian(symbols).xreplace(here)
    seen = aid.signal.symbol - aid.expected.xreplace(here)
    return equations.correct(
        aid.signal.name,
        estimate,
        H,
        wrapped(seen) if aid.angle else seen,
        aid.variance.symbol,
        aid.valid.symbol,
        considered={0: excited, 5: excited},
    ).estimate
