"""C17 Theorem 3: gains that bring the craft to the ellipse in time, promised, exact and simulated."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.tables import positive
from hovercontrol.control.analysis.loops import initial_errors, tracking_loop
from hovercontrol.control.analysis.lyapunov import decay, lyapunov_function
from hovercontrol.control.analysis.output import Progress, quiet, save
from hovercontrol.control.analysis.regions import Region, mesh, positive_axis, sweep_map
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.vehicles import c17_experiment, c17_simulation

#: Where the simulated loops begin: at rest but for 1 m/s of surge, 1 m inside C17's ellipse.
START = {"plant.y": 1.5, "plant.u": 1.0}

#: Runge-Kutta's step and the times that are looked at [s].
STEP, LOOK = 0.025, 0.2


@checked
def gain_region(
    k1: tuple[float, float] = (0.05, 8.0),
    k2: tuple[float, float] = (0.05, 8.0),
    points: int = 200,
    *,
    model: Model | None = None,
    duration: float = 20.0,
    tolerance: float = 0.01,
    start: Mapping[str, float] = START,
    progress: Callable[[int], None] | None = None,
) -> Region:
    """Return the gains with which the craft is on C17's ellipse in time: promised, exact, simulated.

    Parameters
    ----------
    k1, k2 : tuple of float, optional
        Ranges [1/s^2, 1/s].
    points : int, optional
        Along each axis: there are points^2 closed loops, simulated twice.
    model : Model, optional
        Default the craft of C17's simulation.
    duration : float, optional
        Of a simulation [s].
    tolerance : float, optional
        The error [m] to stay below during the last tenth of it.
    start : mapping, optional
        Initial state by ``plant.NAME``, over zero.
    progress
        As for :meth:`~hovercontrol.blocks.backends.compiled.CompiledBlock.sweep`.

    Returns
    -------
    Region
        Maps ``simulated``, ``with limits`` (thrust and rudder of C17's experiment), ``exact``: the
        solution of the error equation, and ``guaranteed``: by V with the best of all admissible beta.

    Raises
    ------
    InputError
        If a gain is not positive, a range is none, or the map is too large.

    Examples
    --------
    >>> region = gain_region((1.0, 3.0), (1.0, 3.0), points=2, duration=10.0)
    >>> list(region.maps)
    ['simulated', 'with limits', 'exact', 'guaranteed']
    """
    positive("duration", duration)
    positive("tolerance", tolerance)
    x = positive_axis("k1", "1/s^2", k1, points, "position gain k1")
    y = positive_axis("k2", "1/s", k2, points, "velocity gain k2")
    model = c17_simulation() if model is None else model
    limited = replace(model, thrust=c17_experiment().thrust, rudder=c17_experiment().rudder)
    last = 0.9 * duration
    settled = {}
    for name, craft, limits in (("simulated", model, False), ("with limits", limited, True)):
        loop = tracking_loop(craft, limits=limits, outputs=["tracking_error"])
        runs = sweep_map(
            loop.compile(friction="smooth"),
            x,
            y,
            lambda a, b: {"controller.k1": a, "controller.k2": b},
            np.linspace(0.0, duration, 1 + max(2, round(duration / LOOK))),
            x0=dict(start),
            start=last,
            method="rk4",
            step=STEP,
            progress=progress,
        )
        below = (runs.status == 0) & (runs["tracking_error"].maximum < tolerance)
        settled[name] = below.reshape(points, points)
    z = initial_errors(loop, start)
    gains = mesh(x, y)
    exact = _exact(*gains, z, last, duration) < tolerance
    promised = _promised(*gains, z, last) < tolerance
    turn = 2 * np.sqrt(x.values)
    return Region(
        f"C17: gains that bring the error below {100 * tolerance:g} cm in {last:g} s",
        x,
        y,
        {
            "simulated": settled["simulated"],
            "with limits": settled["with limits"],
            "exact": exact.reshape(points, points),
            "guaranteed": promised.reshape(points, points),
        },
        labels={
            "simulated": "simulated",
            "with limits": "simulated with thrust 0 to 6.1, rudder +-26 deg",
            "exact": "solution of the error equation",
            "guaranteed": "guaranteed by Theorem 3: V of (17), best beta of (18)-(19)",
        },
        lines={"k2^2 = 4 k1: (18) and (19) meet": (x.values, turn)},
        marks={"C17 simulation": (2.0, 2.0), "C17 experiment": (1.75, 1.5)},
    )


def _exact(k1: Array, k2: Array, z: Array, begin: float, end: float) -> Array:
    """Return the largest |z1| [m] between two times by the error equation, shape (n,)."""
    f = lyapunov_function()
    A = f.numbers(f.A, k1, k2, np.zeros_like(k1))
    largest = np.zeros(len(k1))
    for time in np.linspace(begin, end, 11):
        now = _transition(A, time) @ z
        largest = np.maximum(largest, np.hypot(now[:, 0, 0], now[:, 0, 1]))
    return largest


def _transition(A: Array, time: float) -> Array:
    """Return exp(A t) of many 2 x 2 matrices, shape (n, 2, 2), by Cayley-Hamilton: scipy takes 18 s."""
    mean = np.trace(A, axis1=1, axis2=2) / 2
    root = np.emath.sqrt(mean**2 - np.linalg.det(A) + 0j)
    slope = np.where(abs(root) > 1e-9, np.sinh(root * time) / np.where(root == 0, 1, root), time)
    rest = A - mean[:, None, None] * np.eye(2)
    cosh = np.cosh(root * time)[:, None, None] * np.eye(2)
    return (np.exp(mean * time)[:, None, None] * (cosh + slope[:, None, None] * rest)).real


def _promised(k1: Array, k2: Array, z: Array, time: float) -> Array:
    """Return the bound of |z1| [m] at a time by V and W with the best beta, shape (n,).

    V(t) <= V(0) exp(-2 rate t), and |z1|^2 <= V (P^-1)_11.
    """
    f, bound_19 = lyapunov_function(), decay(k1, k2).bound_19
    best = np.full(len(k1), np.inf)
    for share in np.linspace(0.02, 0.98, 25):
        d = decay(k1, k2, share * bound_19)
        P = f.numbers(f.P, k1, k2, d.beta)
        V = np.einsum("ia,nij,ja->n", z, P, z)
        bound = np.sqrt(V * np.linalg.inv(P)[:, 0, 0]) * np.exp(-d.guaranteed * time)
        best = np.minimum(best, bound)
    return best


def main(out: Path, progress: Progress = quiet, *, points: int = 200) -> list[Path]:
    """Draw the region over k1 and k2: each point is two closed loops of 20 s, without limits and with."""
    runs = points**2
    region = gain_region(points=points, progress=lambda n: progress(n / runs))
    against = len(region.outside("guaranteed", "simulated"))
    limited = len(region.outside("guaranteed", "with limits"))
    findings = [
        f"{runs} closed loops: the craft comes within 1 cm in {region['simulated'].mean():.1%} of them.",
        f"Theorem 3 guarantees {region.share('guaranteed', 'simulated'):.1%} of these; simulated "
        f"counter-examples inside its region: {against}.",
        f"With thrust within 0 to 6.1 and the rudder within +-26 deg, of which Theorem 3 knows nothing, "
        f"{limited / max(1, region['guaranteed'].sum()):.1%} of its region fails.",
    ]
    figure = Figure(figsize=(7.0, 5.8), layout="constrained")
    region.plot(axes=figure.subplots())
    return save(out, "c17_gain_region", figure, {"c17_gain_region": region.save}, findings)
