"""A plant over one step of an estimator, with its process noise as inputs."""

from __future__ import annotations

import sympy as sp

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delay_line import fixed
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.signals import Signal, suffixed, time
from hovercontrol.control.observers.ins.kalman import Equations
from hovercontrol.control.observers.observed import Observed, measured_expressions, unit_over
from hovercontrol.control.observers.propagation import Dynamics, runge_kutta


def over_one_step(model: Observed, step: float, substeps: int) -> Block:
    """Return the plant over one step as a sampled Block.

    It integrates ``x' = f(x, u, t) + w`` with the inputs u and the process noise w held; of a sampled plant
    w is added to the next values, ``x+ = f(x, u, t) + w``, at each of its steps.

    Parameters
    ----------
    step : float
        Length of the step [s].
    substeps : int
        Number of Runge-Kutta steps, or of a sampled plant's own.
    """
    plant = measured_expressions(model.plant, model.measured)
    noise = {
        state.name: Signal(
            suffixed(state.name, "noise"),
            unit_over(plant, state.name, "s"),
            f"process noise in {plant.update_text(state.name)}",
        )
        for state in (plant.states[i] for i in model.process)
    }
    disturbed = plant.unchecked(
        derivatives=Expressions(
            (key, e + noise[key].symbol if key in noise else e) for key, e in plant.derivatives.items()
        )
    )
    period = fixed("step", float(step), "of the estimator")
    write, dynamics = Equations(), Dynamics(disturbed)
    h = write.define("substep", period.symbol / substeps)
    x = sp.Matrix([s.symbol for s in plant.states])
    for k in range(substeps):
        x = runge_kutta(dynamics, write, f"step_{k}", x, time + k * h, h, jacobian=False).x
    return Block(
        model.name,
        states=plant.states,
        inputs=(*plant.inputs, *noise.values()),
        outputs=plant.outputs,
        parameters=(period, *plant.parameters),
        derivatives={s.name: e for s, e in zip(plant.states, x, strict=True)},
        output_expressions=plant.output_expressions,
        definitions={**plant.definitions, **write.definitions},
        period=float(step),
    )
