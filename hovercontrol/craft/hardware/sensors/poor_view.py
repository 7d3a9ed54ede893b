"""A part of the floor with poor motion capture: outliers of the pose (C17 section VIII-C)."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import number, positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.random_numbers import random_numbers
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.hardware.sensors._parts import offset, pair, size, tick
from hovercontrol.craft.models.motion import MOTION


@checked
def poor_view(
    *,
    centre: Sequence[float] = (0.0, 0.0),
    radius: float = 0.5,
    position_noise: float = 0.0,
    heading_noise: float = 0.0,
    outlier_share: float = 0.0,
    outlier_noise: float = 0.0,
    period: float = 0.01,
    seed: int = 1,
    name: str = "view",
) -> Block:
    """Return noise added to the pose inside a circle, in front of a motion capture system.

    C17 reports "higher periodic spikes in T, as well as the two outliers above 6.1 A" of measurements that
    are "ill-conditioned and especially noisy" where the vehicle is less visible [C17 fig 17].

    Parameters
    ----------
    centre : (float, float), optional
        Of the circle [m].
    radius : float, optional
        [m]
    position_noise, heading_noise : float, optional
        Standard deviations inside [m, rad].
    outlier_share : float, optional
        Probability that a reading inside is an outlier, 0 to 1.
    outlier_noise : float, optional
        Standard deviation of an outlier's coordinates [m], in addition to the other noise.
    period : float, optional
        Period of the motion capture system [s].
    seed : int, optional
    name : str, optional

    Returns
    -------
    Block
        Inputs ``x, y, psi``; outputs ``x_viewed, y_viewed`` [m], ``psi_viewed`` [rad].

    Raises
    ------
    InputError
        If the centre is not two numbers, a noise negative, the share not between 0 and 1, or radius or period
        not positive.

    Examples
    --------
    >>> from hovercontrol.blocks.simulation.sampled import Ticking
    >>> view = Ticking(poor_view(centre=(1.0, 0.0), radius=0.5, position_noise=0.1))
    >>> view.tick(0.0, {"x": 0.0, "y": 0.0, "psi": 0.0})["x_viewed"]
    0.0
    >>> view.tick(0.01, {"x": 1.2, "y": 0.0, "psi": 0.0})["x_viewed"] == 1.2
    False
    """
    every = tick(name, period).start
    at = pair(f"{name}: centre", centre)
    noise = random_numbers(5, salt=name, seed=seed)
    pick = random_numbers(1, salt=f"{name} outlier", kind="uniform", seed=seed, prefix="pick")
    middle = [
        offset(f"centre_{s.name}", "m", "centre of the circle", name, v)
        for s, v in zip(MOTION, at, strict=False)
    ]
    around = Signal(
        "radius", "m", "radius of the circle", start=positive(f"{name}: radius", radius), lower=0.0
    )
    position = size("position_noise", "m", "standard deviation inside the circle", name, position_noise)
    heading = size("heading_noise", "rad", "standard deviation inside the circle", name, heading_noise)
    if not 0 <= number(f"{name}: outlier_share", outlier_share) <= 1:
        raise InputError(f"{name}: outlier_share must be between 0 and 1, found {outlier_share!r}")
    share = Signal(
        "outlier_share", "1", "share of outliers inside the circle", start=outlier_share, lower=0.0, upper=1.0
    )
    gross = size("outlier_noise", "m", "standard deviation of an outlier", name, outlier_noise)
    pose = MOTION[:3]
    away = [s.symbol - m.symbol for s, m in zip(pose, middle, strict=False)]
    inside = away[0] ** 2 + away[1] ** 2 < around.symbol**2
    *usual, far_x, far_y = noise.values
    is_outlier = pick.values[0] < share.symbol
    off = [sp.Piecewise((gross.symbol * far, is_outlier), (0, True)) for far in (far_x, far_y)] + [sp.S.Zero]
    told = {
        f"{s.name}_viewed": s.symbol + sp.Piecewise((sigma.symbol * n + o, inside), (0, True))
        for s, sigma, n, o in zip(pose, (position, position, heading), usual, off, strict=True)
    }
    return Block(
        name,
        states=(*noise.states, *pick.states),
        inputs=pose,
        outputs=tuple(s.replace(name=f"{s.name}_viewed") for s in pose),
        parameters=(*middle, around, position, heading, share, gross, *noise.parameters),
        derivatives={**noise.next_values, **pick.next_values},
        output_expressions=told,
        definitions={**noise.definitions, **pick.definitions},
        period=every,
    )
