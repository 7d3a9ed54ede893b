"""K06's forward and reverse laws: where their theorems hold, where they are stable, what delay costs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import positive
from hovercontrol.blocks.block import Block
from hovercontrol.control.analysis.output import Progress, quiet, save
from hovercontrol.control.analysis.regions import (
    Axis,
    Region,
    axis,
    mesh,
    positive_axis,
    refuse_large,
    sweep_map,
)
from hovercontrol.control.controllers.k06 import forward, reverse
from hovercontrol.craft.models.vehicles import HOVERDEMON_BODY
from hovercontrol.documents.k06.law_loop import (
    MOVING,
    ROUND_TRIP,
    law_loop,
    linearly_stable,
    trial_numbers,
)

#: Initial (u, v, r) of the simulations [m/s, m/s, rad/s]; the other signs of v and r are mirror images.
STARTS = ((0.0, 0.5, 2.0), (0.0, -0.5, 2.0), (0.0, 0.05, 0.0))

#: A simulation converges if the velocity ends within this distance of the wanted motion [m/s].
CLOSE = 0.02

#: Computing time per simulated second on one core, for the estimate before a sweep [1].
SECONDS_PER_SIMULATED = 3e-6


@checked
def forward_region(
    speed: tuple[float, float] = (0.05, 3.0),
    k2: tuple[float, float] = (0.1, 30.0),
    points: int = 60,
    *,
    k1: float = 1.0,
    duration: float = 120.0,
    progress: Callable[[int], None] | None = None,
) -> Region:
    """Return the speeds and gains with which K06's forward law is stable: by theorem, linearly, simulated.

    Parameters
    ----------
    speed, k2 : tuple of float, optional
        Ranges of u_ref [m/s] and k2 [kg/s], positive.
    points : int, optional
        Along each axis.
    k1 : float, optional
        [kg/s]
    duration : float, optional
        Of each simulation [s].
    progress
        As for :meth:`~hovercontrol.blocks.backends.compiled.CompiledBlock.sweep`.

    Returns
    -------
    Region
        Maps ``simulated``, ``delayed`` (by the mean round trip of K06's link), ``linear``,
        ``linear delayed``, ``theorem`` (2.24); lines (2.24) and (2.29).

    Raises
    ------
    InputError
        If a speed or gain is not positive, a range is none, or the map is too large.

    Examples
    --------
    >>> region = forward_region((0.5, 1.0), (1.0, 20.0), points=2, duration=20.0)
    >>> region.maps["theorem"].tolist()
    [[False, False], [True, True]]
    """
    x = axis("speed", "m/s", speed, points, "wanted surge velocity u_ref")
    _refuse_sign("forward", x.values, 1)
    y = positive_axis("k2", "kg/s", k2, points, "gain k2")
    body = HOVERDEMON_BODY
    ratio = body.mass * x.values / body.arm
    ahead = trial_numbers("forward")
    maps = _judged(
        forward(k1=positive("k1", k1), k2=1.0),
        x,
        y,
        lambda a, b: {"reference.speed": a, "law.k2": b},
        duration,
        progress=progress,
    )
    theorem = mesh(x, y)[1] > np.tile(ratio, points)
    return _region(
        "K06 forward law", x, y, {**maps, "theorem": theorem},
        {"theorem": "theorem: k2 > m u_ref/d, after (2.24)"},
        {"(2.24): k2 = m u_ref/d": (x.values, ratio), "(2.29): k2 = m u_ref/(2 d)": (x.values, ratio / 2)},
        {"K06 table 6.2": (ahead["surge_ref"], ahead["k2"])},
    )  # fmt: skip


@checked
def reverse_region(
    speed: tuple[float, float] = (-2.0, -0.05),
    alpha: tuple[float, float] = (0.05, 3.0),
    points: int = 60,
    *,
    k1: float = 1.5,
    k2: float = 1.0,
    duration: float = 600.0,
    progress: Callable[[int], None] | None = None,
) -> Region:
    """Return the speeds and weights alpha with which K06's reverse law is stable.

    Parameters
    ----------
    speed : tuple of float, optional
        Range of u_ref [m/s], negative.
    alpha : tuple of float, optional
        Range, positive.
    points, progress
        As for :func:`forward_region`.
    k1, k2 : float, optional
        [kg/s]
    duration : float, optional
        Of each simulation [s]: just above the least alpha the law is very slow.

    Returns
    -------
    Region
        Maps as for :func:`forward_region`; the theorem is local: alpha > J/(d^2 m).

    Raises
    ------
    InputError
        If the law is asked to go forward, a gain is not positive, a range is none, or the map is too large.

    Examples
    --------
    >>> region = reverse_region((-1.0, -0.5), (0.1, 2.0), points=2, duration=20.0)
    >>> region.maps["theorem"].tolist()
    [[False, False], [True, True]]
    """
    x = axis("speed", "m/s", speed, points, "wanted surge velocity u_ref")
    _refuse_sign("reverse", x.values, -1)
    y = positive_axis("alpha", "1", alpha, points, "weight alpha of the yaw rate")
    body = HOVERDEMON_BODY
    least = body.inertia / (body.arm**2 * body.mass)
    astern = trial_numbers("reverse")
    maps = _judged(
        reverse(k1=positive("k1", k1), k2=positive("k2", k2), alpha=1.0),
        x,
        y,
        lambda a, b: {"reference.speed": a, "law.alpha": b},
        duration,
        progress=progress,
    )
    return _region(
        "K06 reverse law", x, y, {**maps, "theorem": mesh(x, y)[1] > least},
        {"theorem": "theorem (local): alpha > J/(d^2 m), after (2.30)"},
        {"(2.30): alpha = J/(d^2 m)": (x.values, np.full(points, least))},
        {"K06 table 6.3 (k2 = 1)": (astern["surge_ref"], astern["alpha"])},
    )  # fmt: skip


def _judged(
    law: Block,
    x: Axis,
    y: Axis,
    params: Callable[[Array, Array], dict[str, Array]],
    duration: float,
    *,
    progress: Callable[[int], None] | None,
) -> dict[str, NDArray[np.bool_]]:
    """Return where the law is stable, simulated and linearly, with and without delay, each (n,)."""
    positive("duration", duration)
    every = 2 * len(STARTS) * len(x.values) * len(y.values)
    refuse_large(law_loop(law, delay=True).compile(), every, SECONDS_PER_SIMULATED * duration)
    times = np.linspace(0.0, duration, 1 + max(10, round(2 * duration)))
    found: dict[str, NDArray[np.bool_]] = {}
    linear: dict[str, NDArray[np.bool_]] = {}
    for late in (False, True):
        loop = law_loop(law, delay=late)
        linear["linear delayed" if late else "linear"] = linearly_stable(loop, params(*mesh(x, y)))
        ready, well = loop.compile(), np.ones(len(x.values) * len(y.values), dtype=bool)
        for start in STARTS:
            x0 = {f"craft.{s.name}": value for s, value in zip(MOVING, start, strict=True)}
            runs = sweep_map(
                ready, x, y, params, times, x0=x0, start=0.9 * duration, method="rk4", step=0.02,
                progress=progress,
            )  # fmt: skip
            well &= (runs.status == 0) & (runs["distance"].maximum < CLOSE)
        found["delayed" if late else "simulated"] = well
    return found | linear


def _region(
    title: str,
    x: Axis,
    y: Axis,
    maps: Mapping[str, NDArray[np.bool_]],
    labels: Mapping[str, str],
    lines: Mapping[str, tuple[Array, Array]],
    marks: Mapping[str, tuple[float, float]],
) -> Region:
    said = {
        "simulated": "simulated: reaches u_ref",
        "delayed": f"simulated with {1000 * ROUND_TRIP:.0f} ms delay",
        "linear": "linearisation stable",
        "linear delayed": "linearisation with delay stable",
        **labels,
    }
    shape = (len(y.values), len(x.values))
    both = {n: m.reshape(shape) for n, m in maps.items()}
    return Region(title, x, y, both, labels=said, lines=lines, marks=marks)


def _refuse_sign(law: str, speed: Array, sign: int) -> None:
    worst = float((sign * speed).min())
    if worst <= 0:
        wanted = "positive" if sign > 0 else "negative"
        raise InputError(f"{law} law: u_ref must be {wanted}, found {sign * worst:g} m/s")


# ---- pictures -----------------------------------------------------------------------------------


def main_forward(out: Path, progress: Progress = quiet, *, points: int = 60) -> list[Path]:
    """Draw the region of the forward law; each point is six simulations of 120 s."""
    region = forward_region(points=points)
    against = len(region.outside("theorem", "simulated"))
    return _leave(
        out, "k06_forward_region", region, progress,
        f"Without delay: {against} simulated counter-examples inside the theorem's region",
    )  # fmt: skip


def main_reverse(out: Path, progress: Progress = quiet, *, points: int = 40) -> list[Path]:
    """Draw the region of the reverse law; each point is six simulations of 600 s."""
    region = reverse_region(points=points)
    against = len(region.outside("theorem", "simulated"))
    return _leave(
        out, "k06_reverse_region", region, progress,
        f"Without delay: {against} points inside the theorem's region do not reach u_ref (the theorem "
        "is local, the starts are up to 0.5 m/s and 2 rad/s off)",
    )  # fmt: skip


def _leave(out: Path, name: str, region: Region, progress: Progress, against: str) -> list[Path]:
    late = len(region.outside("theorem", "delayed")) / region["theorem"].sum()
    linear, delayed = (
        (region[f"linear{end}"] == region[judge]).mean()
        for end, judge in (("", "simulated"), (" delayed", "delayed"))
    )
    findings = [
        f"{against}; it covers {region.share('theorem', 'simulated'):.1%} of the simulated one.",
        "With the mean round trip of the link, which the theorem does not consider, "
        f"{late:.1%} of its region fails.",
        f"Linearisation and simulation agree at {linear:.1%} of the points, {delayed:.1%} with delay.",
    ]
    figure = Figure(figsize=(7.0, 5.8), layout="constrained")
    region.plot(axes=figure.subplots())
    files = save(out, name, figure, {name: region.save}, findings)
    progress(1.0)
    return files
