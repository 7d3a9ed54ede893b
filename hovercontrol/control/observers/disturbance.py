"""Disturbance observers: unknown accelerations of a plant, estimated together with its state.

An unknown disturbance d_s is added to the derivative of each chosen state s,

    s' = f_s(x, u) + d_s,   d_s' = -d_s/tau + w;
    of a sampled plant    s+ = f_s(x, u) + d_s,   d_s+ = exp(-h/tau) d_s + w.

With a correlation time tau the disturbance is an Ornstein-Uhlenbeck process (gusts). Without one it is a
random walk driven by the noise w: constant apart from w (a slope, a trim error, a wrong coefficient). The
extended Kalman filter of the augmented plant estimates d together with x.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known, shown
from hovercontrol.base.tables import positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delay_line import fixed
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.observers.extended import extended_kalman
from hovercontrol.control.observers.observed import plant_of, unit_over
from hovercontrol.craft.models.interface import AnyModel


@checked
def with_disturbances(
    plant: AnyModel, on: Sequence[str] = ("u", "v", "r"), *, correlation_time: float | None = None
) -> Block:
    """Return a plant augmented with disturbance states that are added to its derivatives.

    Parameters
    ----------
    plant : Model, BlockModel or Block
        Continuous or sampled; a disturbance of a sampled plant is added to the next value.
    on : sequence of str, optional
        States whose derivatives are disturbed.
    correlation_time : float, optional
        tau, the time in which a disturbance decays to 1/e [s]; None: it does not decay.

    Returns
    -------
    Block
        The plant with additional states and outputs ``disturbance_NAME`` [unit of the state / s; of a sampled
        plant unit of the state], starting at 0, after the plant's own. With `correlation_time` it has a
        parameter of that name.

    Raises
    ------
    InputError
        If the plant has parts that tick or late inputs, a state is unknown, or the correlation time is not
        positive.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> plant = with_disturbances(hc.vehicle("hoverdemon"), ["u"])
    >>> print(plant.equations().splitlines()[3])
    u' = disturbance_u + plant.thrust*thrust*cos(rudder) + r*v
    """
    name = "with_disturbances"
    block = plant_of(plant, name, "plant with disturbances")
    signals = {key: _signal(block, key, name) for key in _different(on, name)}
    parameters = list(block.parameters)
    decay: sp.Expr = sp.S.One if block.period else sp.S.Zero  # d+ = d or d' = 0
    if correlation_time is not None:
        tau = Signal(
            "correlation_time", "s", "of the disturbances",
            start=positive(f"{name}: correlation_time", correlation_time), lower=0.0,
        )  # fmt: skip
        parameters.append(tau)
        decay = -1 / tau.symbol
        if block.period:
            step = fixed("disturbance_step", block.period, "of the plant")
            parameters.append(step)
            decay = sp.exp(-step.symbol / tau.symbol)
    rates = dict(block.derivatives)
    for state, d in signals.items():
        rates[state] = rates[state] + d.symbol
        rates[d.name] = d.symbol * decay
    added = tuple(signals.values())
    return Block(
        block.name,
        states=(*block.states, *added),
        inputs=block.inputs,
        outputs=(*block.outputs, *added),
        parameters=tuple(parameters),
        derivatives=Expressions(rates),
        output_expressions=block.output_expressions,
        definitions=block.definitions,
        definition_signals=block.definition_signals,
        period=block.period,
    )


@checked
def disturbance_observer(
    plant: AnyModel,
    measured: Sequence[str] | None = None,
    *,
    disturbance_noise: Mapping[str, float],
    measurement_noise: Mapping[str, float],
    process_noise: Mapping[str, float] | None = None,
    correlation_time: float | None = None,
    period: float | None = None,
    start_std: Mapping[str, float] | None = None,
    lost_samples: bool | Sequence[str] = False,
    substeps: int | None = None,
    name: str = "observer",
) -> Block:
    """Return an observer of a plant's state and of the disturbances acting on it.

    Parameters
    ----------
    plant : Model, BlockModel or Block
        Continuous or sampled. Its start values are the first estimate; disturbances start at 0.
    measured : sequence of str, optional
        Outputs, or states, of the plant (default: the keys of `measurement_noise`, in their order).
    disturbance_noise : mapping of str to float
        By the names of the states whose derivatives are disturbed: the square root of the spectral density of
        the disturbance's derivative [unit of the state / s / s^(1/2)]. With ``{"u": 0.1}`` the disturbance of
        u' changes by 0.1 m/s^2 in 1 s (standard deviation). A larger value gives a higher bandwidth and more
        noise in the estimate. Of a sampled plant: what each of its steps adds to the disturbance [unit of the
        state].
    measurement_noise, process_noise, start_std : mapping of str to float
        As for :func:`~hovercontrol.control.observers.extended.extended_kalman` [unit or unit s^(1/2),
        unit/s^(1/2), unit]; `start_std` may name ``disturbance_NAME`` [unit/s], 1 by default.
    correlation_time : float, optional
        Correlation time of the disturbances [s]; None: they are constant apart from their noise.
    period : float, optional
        Sampling period [s]. None: the observer is continuous, or has the period of a sampled plant.
    lost_samples : bool or sequence of str, optional
        Add an input ``fresh``, or ``fresh_NAME`` for these measured outputs: 0 means that there is no sample.
    substeps : int, optional
        Runge-Kutta steps per period (default: chosen from the plant's fastest mode).
    name : str, optional

    Returns
    -------
    Block
        Signals as of :func:`~hovercontrol.control.observers.extended.extended_kalman`, and
        ``disturbance_NAME_hat`` and ``disturbance_NAME_std`` [unit/s].

    Raises
    ------
    InputError
        As :func:`~hovercontrol.control.observers.extended.extended_kalman` and :func:`with_disturbances`.

    Warns
    -----
    UserWarning
        If the measurements do not determine state and disturbances at the plant's start values.

    Notes
    -----
    Suppose that a position is measured with a standard deviation s every h seconds, and that the disturbance
    of the velocity's derivative has the root spectral density q. The observer's poles are then those of a
    Butterworth filter of bandwidth ``(q/(s h**0.5))**(1/3)`` [rad/s], if drag is slower than that.

    While dry friction holds the craft at rest, a disturbance is not observable. The filter's smooth friction
    lets the model creep, so the estimate goes to 0. Estimates are valid while the craft moves.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> observer = disturbance_observer(
    ...     hc.vehicle("hoverdemon"), disturbance_noise={"u": 0.1, "v": 0.1}, period=0.02,
    ...     measurement_noise={"x": 0.01, "y": 0.01, "psi": 0.02}, process_noise={"r": 0.1},
    ... )
    >>> [s.name for s in observer.outputs[6:8]]
    ['disturbance_u_hat', 'disturbance_v_hat']
    """
    larger = with_disturbances(plant, list(disturbance_noise), correlation_time=correlation_time)
    noise = dict(process_noise or {}) | {
        disturbance_name(state): value for state, value in disturbance_noise.items()
    }
    return extended_kalman(
        larger,
        measured,
        process_noise=noise,
        measurement_noise=measurement_noise,
        period=period,
        start_std=start_std,
        lost_samples=lost_samples,
        substeps=substeps,
        name=name,
    )


def disturbance_name(state: str) -> str:
    """Return the name of the disturbance of a state's derivative.

    Examples
    --------
    >>> disturbance_name("u"), disturbance_name("plant.u")
    ('disturbance_u', 'plant.disturbance_u')
    """
    part, dot, own = state.rpartition(".")
    return f"{part}{dot}disturbance_{own}"


def _different(on: Sequence[str], name: str) -> list[str]:
    if isinstance(on, str) or not len(on) or len(set(on)) < len(on):
        raise InputError(f"{name}: on: expected different names of states, found {shown(on)}")
    return list(on)


def _signal(block: Block, state: str, name: str) -> Signal:
    states = {s.name: s for s in block.states}
    check_known(state, states, f"{name}: block {block.name!r} has no state {shown(state)}")
    text = f"disturbance of {block.update_text(state)}"
    return Signal(disturbance_name(state), unit_over(block, state, "s"), text)
