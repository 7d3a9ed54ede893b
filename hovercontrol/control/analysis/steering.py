"""Steering under way: the stability of steady turns under C17's controller, and maps over the stick."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.sgn import sgn
from hovercontrol.control.analysis.byrnes_isidori import symbol
from hovercontrol.control.analysis.regions import Region, axis
from hovercontrol.control.controllers import tracking_controller
from hovercontrol.craft.models.model import Model

#: Weaves that pass before the mean is taken, and the step of simulations and samples [s].
SETTLING, STEP = 3, 0.02

#: Smallest yaw rate to which an error is related [rad/s].
LEAST_YAW_RATE = 0.05


@checked
def turning_modes(
    model: Model, surge: float, yaw_rate: float, *, control_point: float = 0.2
) -> NDArray[np.complex128]:
    """Return the eigenvalues of C17's zero dynamics about a steady turn.

    While the control point follows the circle exactly, heading and yaw rate obey ``r' = F(psi - chi, r)``,
    chi the direction of the circle; linearised at the steady turn, ``s^2 - F_r s - F_psi = 0``. Dry friction
    keeps its sign there and drops out of the derivatives.

    Parameters
    ----------
    model : Model
        With sway drag.
    surge : float
        [m/s]
    yaw_rate : float
        [rad/s]
    control_point : float, optional
        delta_x [m]

    Returns
    -------
    ndarray of complex, shape (2,)
        [1/s]; the turn is stable under the tracking controller where both real parts are negative.

    Raises
    ------
    InputError
        If the craft has no such steady turn.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import vehicle
    >>> craft = vehicle("c17_simulation")
    >>> [bool(turning_modes(craft, 0.7, 0.3, control_point=d).real.max() < 0) for d in (0.09, 0.2)]
    [False, True]
    """
    turn = model.plant().trim({"u": surge, "r": yaw_rate})
    side = turn.states["v"] + control_point * yaw_rate
    V = float(np.hypot(surge, side))
    loop = interconnect([model.plant(), tracking_controller(model, control_point=control_point)])
    # On the circle, chi = 0: p = -R delta, R [u, v + dx r] = [V, 0], p_d'' = [0, V r_ref].
    psi, r = sp.symbols("psi r", real=True)
    exact: dict[sp.Symbol, sp.Expr] = {
        symbol("plant.psi"): psi,
        symbol("plant.r"): r,
        symbol("plant.x"): -control_point * sp.cos(psi),
        symbol("plant.y"): -control_point * sp.sin(psi),
        symbol("plant.u"): V * sp.cos(psi),
        symbol("plant.v"): -V * sp.sin(psi) - control_point * r,
    }
    exact |= {s.symbol: sp.S.Zero for s in loop.inputs}
    exact |= {symbol("vx_ref"): sp.Float(V), symbol("ay_ref"): sp.Float(V * yaw_rate)}
    exact |= {p.symbol: sp.Float(p.start) for p in loop.parameters}
    slope = loop.expand(loop.derivatives["plant.r"]).replace(sgn, lambda v, w: sp.S.Zero).xreplace(exact)
    here = {psi: -float(np.arctan2(side, surge)), r: yaw_rate}
    by_heading, by_rate = (float(sp.diff(slope, by).subs(here)) for by in (psi, r))
    modes: NDArray[np.complex128] = np.linalg.eigvals(np.array([[0.0, 1.0], [by_heading, by_rate]])).astype(
        complex
    )
    return modes


@checked
def steering_map(
    loop: Block,
    *,
    surge: tuple[float, float] = (0.3, 1.1),
    yaw_rate: tuple[float, float] = (-0.5, 0.5),
    points: int = 9,
    weaves: int = 6,
    least_time: float = 60.0,
    progress: Callable[[float], None] | None = None,
) -> Region:
    """Return how far the mean surge velocity and yaw rate are from the stick's, by simulation.

    Parameters
    ----------
    loop : Block
        Outputs ``u`` and ``r``; ``surge_ref`` and ``yaw_rate_ref`` are its inputs, or parameters
        ``reference.surge_ref`` and ``reference.yaw_rate_ref``. A parameter ``guidance.ratio`` is taken for
        that of :func:`~hovercontrol.control.guidance.weaving`; a parameter ``navigation.seed`` gets another
        seed at each point.
    surge, yaw_rate : tuple of 2 float, optional
        Ends of the grid [m/s, rad/s].
    points : int, optional
        Along either axis.
    weaves : int, optional
        Whole periods of the modulation over which is averaged, after three that are not.
    least_time : float, optional
        Shortest time that is averaged, and that passes before [s].
    progress : callable, optional
        Called with the share that is done.

    Returns
    -------
    Region
        Maps ``surge_error`` and ``yaw_rate_error``: (mean - command)/command, of the yaw rate over at least
        0.05 rad/s; ``within``: 5 % and 10 % are kept.

    Raises
    ------
    InputError
        If the loop has neither such inputs nor such parameters, or a range is none.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> craft = hc.vehicle("c17_simulation")
    >>> loop = hc.interconnect([craft.plant(), hc.command_filter(), hc.steering_law(craft)])
    >>> bool(steering_map(loop, points=2, least_time=10.0)["within"].all())
    True
    """
    compiled, known = loop.compile(), loop.default_parameters
    inputs = {s.name for s in loop.inputs}
    names = [d if d in inputs else f"reference.{d}" for d in ("surge_ref", "yaw_rate_ref")]
    for name in names:
        if name not in inputs and name not in known:
            short = name.rpartition(".")[2]
            raise InputError(
                loop.where(f"expected an input {short!r} or a parameter {name!r}, found neither")
            )
    x = axis("yaw_rate_ref", "rad/s", yaw_rate, points, "yaw rate command")
    y = axis("surge_ref", "m/s", surge, points, "surge command")
    pace, fading = known.get("guidance.ratio", 1.0), known.get("guidance.least_rate", 0.1)
    errors = np.full((2, points, points), np.nan)
    for k in range(points**2):
        i, j = divmod(k, points)
        told = (float(y.values[i]), float(x.values[j]))
        weave = 2 * np.pi / (pace * np.hypot(told[1], fading)) if told[1] else least_time
        settled = max(least_time, SETTLING * weave)
        end = settled + weave * np.ceil(max(weaves if told[1] else 1, least_time / weave))
        t = np.linspace(0.0, end, round(end / STEP) + 1)
        pairs = dict(zip(names, told, strict=True))
        params = {n: v for n, v in pairs.items() if n not in inputs}
        params |= {key: float(k + 1) for key in known if key.endswith(".seed")}
        given = {n: np.full(t.size, v) for n, v in pairs.items() if n in inputs}
        response = compiled.simulate(t, given or None, params=params, method="rk4", step=STEP)
        late = t >= settled
        u, r = (response.outputs[response.output_labels.index(n)][late].mean() for n in ("u", "r"))
        errors[:, i, j] = u / told[0] - 1.0, (r - told[1]) / max(abs(told[1]), LEAST_YAW_RATE)
        if progress is not None:
            progress((k + 1) / points**2)
    maps = {
        "within": (np.abs(errors[0]) <= 0.05) & (np.abs(errors[1]) <= 0.10),
        "surge_error": errors[0],
        "yaw_rate_error": errors[1],
    }
    return Region(f"{loop.name}: mean motion against the stick", x, y, maps)
