"""Disturbance observers: a plant with unknown accelerations, estimated with its state.

To the derivative of each chosen state s an unknown d_s is added,

    s' = f_s(x, u) + d_s,   d_s' = -d_s/tau + w,

With a correlation time tau it is an Ornstein-Uhlenbeck process (gusts), without one it is constant but for
the noise w (a slope, a trim error, a wrong coefficient). The extended Kalman filter of the larger plant
estimates d together with x.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp

from hovercontrol.core.block import Block
from hovercontrol.core.boundary import checked
from hovercontrol.core.expressions import Expressions
from hovercontrol.core.signals import Signal
from hovercontrol.errors import InputError, did_you_mean, shown
from hovercontrol.estimators.extended import extended_kalman
from hovercontrol.estimators.observed import plant_of
from hovercontrol.io.tables import positive
from hovercontrol.models.interface import AnyModel


@checked
def with_disturbances(
    plant: AnyModel, on: Sequence[str] = ("u", "v", "r"), *, correlation_time: float | None = None
) -> Block:
    """Return a plant with unknown disturbances added to derivatives, as further states.

    Parameters
    ----------
    plant : Model, BlockModel or Block
        Continuous.
    on : sequence of str, optional
        States whose derivatives are disturbed.
    correlation_time : float, optional
        tau, after which a disturbance has decayed to 1/e [s]; None: it stays as it is.

    Returns
    -------
    Block
        With states and outputs ``disturbance_NAME`` [unit of the state / s], starting at 0, after the plant's
        own; with `correlation_time` a parameter of that name.

    Raises
    ------
    InputError
        If the plant is sampled or has late inputs, a state is unknown, or the correlation time is not
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
    decay: sp.Expr = sp.S.Zero
    if correlation_time is not None:
        tau = Signal(
            "correlation_time", "s", "of the disturbances",
            start=positive(f"{name}: correlation_time", correlation_time), lower=0.0,
        )  # fmt: skip
        parameters.append(tau)
        decay = 1 / tau.symbol
    rates = dict(block.derivatives)
    for state, d in signals.items():
        rates[state] = rates[state] + d.symbol
        rates[d.name] = -d.symbol * decay
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
    )


@checked
def disturbance_observer(
    plant: AnyModel,
    measured: Sequence[str] = ("x", "y", "psi"),
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
    """Return an observer of a plant's state and of the disturbances that act on it.

    Parameters
    ----------
    plant : Model, BlockModel or Block
        Continuous. Its start values are the first estimate; disturbances start at 0.
    measured : sequence of str, optional
        Outputs, or states, of the plant.
    disturbance_noise : mapping of str to float
        Which states' derivatives are disturbed, and how fast each disturbance may wander: the root of the
        spectral density of its derivative, [unit of the state / s / s^(1/2)]. ``{"u": 0.1}``: in 1 s the
        disturbance of u' wanders 0.1 m/s^2. Larger is a higher bandwidth, and more noise in the estimate.
    measurement_noise, process_noise, start_std : mapping of str to float
        As for :func:`~hovercontrol.estimators.extended.extended_kalman` [unit or unit s^(1/2), unit/s^(1/2),
        unit]; `start_std` may name ``disturbance_NAME`` [unit/s], 1 by default.
    correlation_time : float, optional
        Of the disturbances [s]; None: they are constant but for their noise.
    period : float, optional
        Of the samples [s]. None: the observer is continuous.
    lost_samples : bool or sequence of str, optional
        Add an input ``fresh``, or ``fresh_NAME`` of these measured outputs: where it is 0 there is no sample.
    substeps : int, optional
        Runge-Kutta steps from tick to tick (default: by the plant's fastest mode).
    name : str, optional

    Returns
    -------
    Block
        Signals as of :func:`~hovercontrol.estimators.extended.extended_kalman`, and ``disturbance_NAME_hat``
        and ``disturbance_NAME_std`` [unit/s].

    Raises
    ------
    InputError
        As :func:`~hovercontrol.estimators.extended.extended_kalman` and :func:`with_disturbances`.

    Warns
    -----
    UserWarning
        If the measurements do not determine state and disturbances at the plant's start values.

    Notes
    -----
    If a position is measured with a standard deviation s every h seconds, and the disturbance of the
    velocity's derivative has the root spectral density q, the observer's poles are those of a Butterworth
    filter of bandwidth ``(q/(s h**0.5))**(1/3)`` [rad/s], where drag is slower than that.

    A craft that dry friction holds at rest does not show a disturbance. The filter's smooth friction lets it
    creep, so that the estimate goes to 0 there. Estimates are valid while the craft moves.

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
    if state not in states:
        raise InputError(
            f"{name}: block {block.name!r} has no state {shown(state)}{did_you_mean(state, states)}"
        )
    unit = states[state].unit
    return Signal(disturbance_name(state), f"({unit})/s", f"disturbance of {state}'")
