"""The extended Kalman filter of any Block, with exact Jacobians, as a Block.

Continuous-discrete: between ticks the plant's equations propagate the estimate and its covariance
(:mod:`.propagation`), a sampled plant's by its own steps. At a tick the measurements correct them one after
the other, in Joseph's form (:class:`.Equations`). Continuous-continuous: the extended Kalman-Bucy filter,

    xhat' = f(xhat, u) + K (y - h(xhat, u)),  K = P H' R^-1,  P' = F P + P F' + Q - K R K',

with F = df/dx and H = dh/dx at the estimate (Gelb, Applied Optimal Estimation, 1974, section 6.1).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delay_line import fixed
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.control.observers.filter_equations import (
    corrected,
    estimate_of,
    expected,
    filter_states,
    innovations,
    sampled_block,
    shares,
)
from hovercontrol.control.observers.ins.kalman import Equations, Estimate
from hovercontrol.control.observers.observability import warn_if_undetectable
from hovercontrol.control.observers.observed import Observed, observed, plant_of, tick_of
from hovercontrol.control.observers.propagation import Dynamics, predict, steps_between
from hovercontrol.craft.models.interface import AnyModel


@checked
def extended_kalman(
    plant: AnyModel,
    measured: Sequence[str] | None = None,
    *,
    process_noise: Mapping[str, float],
    measurement_noise: Mapping[str, float],
    period: float | None = None,
    start_std: Mapping[str, float] | None = None,
    lost_samples: bool | Sequence[str] = False,
    substeps: int | None = None,
    name: str = "estimator",
) -> Block:
    """Return the extended Kalman filter of a plant.

    Parameters
    ----------
    plant : Model, BlockModel or Block
        Continuous or sampled. Its start values are the first estimate.
    measured : sequence of str, optional
        Outputs, or states, of the plant (default: the keys of `measurement_noise`, in their order).
        Innovations in rad are wrapped to -pi ... pi.
    process_noise : mapping of str to float
        White noise in the derivatives of states, by the states' names: the square root of its spectral
        density [unit of the state / s^(1/2)]. ``{"u": 0.1}`` [m/s^(3/2)] alone gives u a random walk with a
        standard deviation of 0.1 m/s after 1 s. Of a sampled plant: standard deviation of what each of its
        steps adds [unit of the state].
    measurement_noise : mapping of str to float
        For each measured output. With `period`: standard deviation of a sample [unit]. Without: square root
        of the spectral density [unit s^(1/2)], ``s h**0.5`` for samples of standard deviation s every h
        seconds.
    period : float, optional
        Sampling period [s]. None: the filter is continuous. Of a sampled plant a multiple of its period
        (default: its period).
    start_std : mapping of str to float, optional
        Standard deviation of the first estimate's error, by the states' names [unit] (default: the state's
        nominal size).
    lost_samples : bool or sequence of str, optional
        True adds an input ``fresh``: where it is 0 the measurements are not used and the filter only
        predicts. Names of measured outputs add an input ``fresh_NAME`` for each, for sensors of different
        rates.
    substeps : int, optional
        Runge-Kutta steps per period (default: chosen from the plant's fastest mode at its start values
        and at rest, where dry friction is stiffest).
    name : str, optional

    Returns
    -------
    Block
        Sampled with `period`, else continuous. Inputs: the measured outputs and the plant's inputs, under
        their names. Outputs: ``NAME_hat`` and ``NAME_std`` [unit] for each state of the plant; at a tick they
        include the samples of that tick. States: ``xhat[i]``, ``P[i,j]``, i <= j, predicted for the next
        tick.
        Parameters: the plant's, ``process_noise_NAME`` and ``measurement_noise_NAME``.

    Raises
    ------
    InputError
        If the plant has parts that tick or late inputs, a name is unknown, a noise is missing or negative, or
        the period is not positive, too long for the plant's fastest mode or no multiple of a sampled plant's.

    Warns
    -----
    UserWarning
        If the measurements do not determine the state at the plant's start values
        (:func:`~hovercontrol.control.observers.observability.observability`).

    Notes
    -----
    Dry friction is modelled in its smooth form, tanh(v/w). Where the error of the velocity is larger than the
    width w, the linearisation takes friction at rest for a stiff linear drag. A larger width (the parameter
    ``..._width``) or :func:`~hovercontrol.control.observers.unscented.unscented_kalman` is more cautious
    there.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> craft = hc.vehicle("c17_simulation")
    >>> estimator = extended_kalman(
    ...     craft, process_noise={"u": 0.1, "v": 0.1, "r": 0.1},
    ...     measurement_noise={"x": 0.01, "y": 0.01, "psi": 0.02}, period=0.02,
    ... )
    >>> [s.name for s in estimator.inputs], [s.name for s in estimator.outputs[3:6]]
    (['x', 'y', 'psi', 'thrust', 'rudder'], ['u_hat', 'v_hat', 'r_hat'])
    """
    block = plant_of(plant, name, "extended Kalman filter")
    model = observed(
        block,
        measured,
        process_noise,
        measurement_noise,
        start_std,
        name,
        continuous=period is None and not block.period,
        lost_samples=lost_samples,
    )
    warn_if_undetectable(block, [s.name for s in model.measured], name)
    states = filter_states(model)
    estimate = estimate_of(states, len(block.states))
    if period is None and not block.period:
        if substeps is not None:
            raise InputError(f"{name}: substeps are of a sampled filter: give a period, too")
        return _continuous(model, states, estimate)
    tick = tick_of(block, period, f"{name}: period")
    n = steps_between(block, tick, name, substeps)
    step = fixed("period", tick, "of the samples")
    write = Equations()
    now = corrected(model, write, estimate)
    then, dynamics, h = now, Dynamics(model.plant), write.define("substep", step.symbol / n)
    for k in range(n):
        then = predict(dynamics, write, f"step_{k}", then, model.intensities, time + k * h, h).estimate
    return sampled_block(model, states, write, now, then, step)


def _continuous(model: Observed, states: Sequence[Signal], estimate: Estimate) -> Block:
    """Return the extended Kalman-Bucy filter."""
    write, n = Equations(), len(model.plant.states)
    x, P = estimate.x, estimate.P
    f, F = Dynamics(model.plant).at(write, "plant", list(x), time)
    h, H = expected(model, write, x)
    R = [s.symbol**2 for s in model.noise]
    used = shares(model)
    # K = P H' R^-1
    PH = write.matrix("PH", P * H.T)
    gain = sp.Matrix(n, len(R), lambda i, k: PH[i, k] / R[k] * used[k])
    seen = sp.Matrix(innovations(model, write, h))
    correction, FP, Q = gain * seen, F * P, model.intensities
    # P' = F P + P F' + Q - P H' R^-1 H P
    rates = {states[i].name: f[i] + correction[i] for i in range(n)}
    upper = [(i, j) for i in range(n) for j in range(i, n)]
    for (i, j), s in zip(upper, states[n:], strict=True):
        loss = sum(gain[i, k] * PH[j, k] for k in range(len(R)))
        rates[s.name] = FP[i, j] + FP[j, i] + (Q[i] if i == j and i in Q else 0) - loss
    return Block(
        model.name,
        states=tuple(states),
        inputs=model.inputs,
        outputs=(*model.estimates, *model.deviations),
        parameters=model.parameters,
        derivatives=rates,
        output_expressions=model.output_values(list(x), P),
        definitions=write.definitions,
    )
