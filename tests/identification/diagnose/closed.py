"""Commands of laps: a craft under the tracking controller of C17 on an ellipse."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.control.controllers import tracking_controller
from hovercontrol.control.controllers.references import ellipse
from hovercontrol.craft.models.model import Model

Array = NDArray[np.float64]


def tracked(
    believed: Model, truth: Model, rng: np.random.Generator, duration: float, dt: float
) -> dict[str, Array]:
    """Return the commands that keep a craft, of which the controller believes another model, on an ellipse.

    The controller is sampled like the log.
    """
    semi_x, semi_y = rng.uniform(1.0, 1.8), rng.uniform(1.5, 2.5)
    way = ellipse(
        semi_x, semi_y, float(rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 0.9)), rng.uniform(0.0, 6.28)
    )
    controller = tracking_controller(believed, control_point=0.6, k1=1.0, k2=1.5)
    law = interconnect([way, controller], outputs=["thrust", "rudder"], name="law")
    motion = [s.name for s in law.inputs]
    outputs, values = law.to_numpy().outputs, law.default_parameters
    plant = truth.plant("plant", late=True)
    step = plant.compile(friction="smooth").simulate
    rows = {s.name: k for k, s in enumerate(plant.states)}
    at = [rows[name] for name in motion]
    x = np.array([s.start for s in plant.states])
    commands = []
    for t in np.arange(0.0, duration, dt).tolist():
        thrust, rudder = np.ravel(outputs(t, np.empty(0), x[at], values))
        u = [float(np.clip(thrust, -1.5, 3.5)), float(np.clip(rudder, -0.45, 0.45))]
        commands.append(u)
        x = step([t, t + dt], [[c, c] for c in u], x, rtol=1e-4, atol=1e-6).states[:, -1]
    return dict(zip(("thrust", "rudder"), np.array(commands).T, strict=True))
