"""K06's forward and reverse laws: where their theorems hold, where they are stable, what delay costs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from pathlib import Path

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from hovercontrol.analysis.normal_form import symbol
from hovercontrol.analysis.regions import (
    Axis,
    Region,
    axis,
    mesh,
    positive_axis,
    refuse_large,
    subfolder,
    sweep_map,
)
from hovercontrol.controllers.k06 import force_to_command, forward, reverse
from hovercontrol.controllers.k06.laws import FORCE_X, FORCE_Y, SURGE_REF
from hovercontrol.core.block import Block
from hovercontrol.core.boundary import checked
from hovercontrol.core.delays import pade
from hovercontrol.core.interconnect import interconnect, rename
from hovercontrol.core.signals import Signal
from hovercontrol.errors import InputError
from hovercontrol.io.tables import positive
from hovercontrol.models.model import MOTION
from hovercontrol.models.vehicles import HOVERDEMON_BODY, hoverdemon

Array = NDArray[np.float64]

#: K06's mean round trip, table 5.1 [s].
ROUND_TRIP = 0.07754

#: Start of the simulations (u, v, r), beside the wanted motion; the other signs of v and r are mirror images.
STARTS = ((0.0, 0.5, 2.0), (0.0, -0.5, 2.0), (0.0, 0.05, 0.0))

#: A simulation ends well if the velocity at the rudder and at the centre is this close to the wanted [m/s].
CLOSE = 0.02

#: Seconds that a simulated second takes on one core: for the estimate before a sweep.
SECONDS_PER_SIMULATED = 3e-6

MOVING = MOTION[3:]


def force_craft() -> Block:
    """Return K06's reduced dynamics (2.10): states u, v, r of the HoverDemon, inputs force_x, force_y [N]."""
    whole = interconnect([hoverdemon().plant("craft"), force_to_command()], "whole")
    own = {symbol(f"craft.{s.name}"): s.symbol for s in MOVING}
    rates = {s.name: whole.expand(whole.derivatives[f"craft.{s.name}"]).xreplace(own) for s in MOVING}
    used = set().union(*(e.free_symbols for e in rates.values()))
    numbers = tuple(p for p in whole.parameters if p.symbol in used)
    return Block("craft", MOVING, (FORCE_X, FORCE_Y), MOVING, numbers, rates)


def delayed_force(seconds: float = ROUND_TRIP, order: int = 4) -> Block:
    """Return a delay of the force as a Block: Pade's approximation of this order, without feedthrough.

    Inputs ``sent_x, sent_y``, outputs ``force_x, force_y`` [N]; the delay is the parameter ``delay.seconds``.
    """
    late = Signal("seconds", "s", "delay of the force", start=seconds, lower=0.0)
    sent = {force.name: force.replace(name=f"sent_{way}") for way, force in (("x", FORCE_X), ("y", FORCE_Y))}
    pure = Block(
        "delay",
        inputs=tuple(sent.values()),
        outputs=(FORCE_X, FORCE_Y),
        parameters=(late,),
        output_expressions={name: s.symbol for name, s in sent.items()},
        delays={s.name: late.symbol for s in sent.values()},
    )
    return pade(pure, order)


def law_loop(law: Block, *, delay: bool = False) -> Block:
    """Return K06's craft under a law; output ``distance`` [m/s] from the wanted motion.

    Parameters
    ----------
    law : Block
        With inputs ``u, v, r, surge_ref``.
    delay : bool, optional
        Delay the force by the mean round trip of K06's link.
    """
    wanted = Signal("speed", "m/s", "wanted surge velocity", start=1.0)
    reference = Block(
        "reference",
        outputs=(SURGE_REF,),
        parameters=(wanted,),
        output_expressions={SURGE_REF.name: wanted.symbol},
    )
    u, v, r = (s.symbol for s in MOVING)
    arm = Signal("arm", "m", "rudder behind the centre of mass", start=HOVERDEMON_BODY.arm)
    watch = Block(
        "watch",
        inputs=(*MOVING, SURGE_REF),
        outputs=(Signal("distance", "m/s", "from the wanted motion"),),
        parameters=(arm,),
        output_expressions={"distance": sp.sqrt((u - SURGE_REF.symbol) ** 2 + v**2 + (arm.symbol * r) ** 2)},
    )
    law = law.named("law")
    law = law.unchecked(inputs=tuple(s.replace(lower=-sp.oo, upper=sp.oo) for s in law.inputs))
    parts = [force_craft(), reference, watch]
    if delay:
        law = rename(law, {"force_x": "sent_x", "force_y": "sent_y"})
        parts.append(delayed_force())
    return interconnect([*parts, law], "loop", outputs=["distance"])


def linearly_stable(loop: Block, params: Mapping[str, Array]) -> NDArray[np.bool_]:
    """Return where the linearisation about the wanted motion is stable, shape (n,).

    Parameters
    ----------
    loop : Block
        As :func:`law_loop` makes it.
    params : mapping of str to ndarray, shape (n,)
        By key; ``reference.speed`` among them.
    """
    keys = {s.symbol: loop.parameter_key(s.name) for s in loop.parameters}
    rest = {s: loop.default_parameters[key] for s, key in keys.items() if key not in params}
    rest |= {s.symbol: 0.0 for s in loop.states if s.name != "craft.u"}
    J = loop.jacobian().xreplace({s: sp.Float(v) for s, v in rest.items()})
    wanted = symbol("reference.speed")
    J = J.xreplace({symbol("craft.u"): wanted})
    given = [s for s, key in keys.items() if key in params]
    values = [np.asarray(params[keys[s]], dtype=float) for s in given]
    entries = sp.lambdify(given, list(J))(*values)
    size = len(values[0])
    full = np.stack([np.broadcast_to(np.asarray(e, dtype=float), size) for e in entries], axis=-1)
    return np.linalg.eigvals(full.reshape(size, *J.shape)).real.max(axis=-1) < 0


@checked
def forward_region(
    speed: tuple[float, float] = (0.05, 3.0),
    k2: tuple[float, float] = (0.1, 30.0),
    points: int = 60,
    *,
    k1: float = 1.0,
    duration: float = 120.0,
    executor: Executor | None = None,
    checkpoint: str | Path | None = None,
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
    executor : concurrent.futures.Executor, optional
        Where the simulations are done; default threads of this machine.
    checkpoint : path, optional
        Folder from which the same map resumes.
    progress : callable, optional
        Called now and then with the number of runs done.

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
    maps = _judged(
        forward(k1=positive("k1", k1), k2=1.0),
        x,
        y,
        lambda a, b: {"reference.speed": a, "law.k2": b},
        duration,
        executor=executor,
        checkpoint=checkpoint,
        progress=progress,
    )
    theorem = mesh(x, y)[1] > np.tile(ratio, points)
    return _region(
        "K06 forward law", x, y, {**maps, "theorem": theorem},
        {"theorem": "theorem: k2 > m u_ref/d, after (2.24)"},
        {"(2.24): k2 = m u_ref/d": (x.values, ratio), "(2.29): k2 = m u_ref/(2 d)": (x.values, ratio / 2)},
        {"K06 table 6.2": (1.1, 4.0)},
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
    executor: Executor | None = None,
    checkpoint: str | Path | None = None,
    progress: Callable[[int], None] | None = None,
) -> Region:
    """Return the speeds and weights alpha with which K06's reverse law is stable.

    Parameters
    ----------
    speed : tuple of float, optional
        Range of u_ref [m/s], negative.
    alpha : tuple of float, optional
        Range, positive.
    points, executor, checkpoint, progress
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
    maps = _judged(
        reverse(k1=positive("k1", k1), k2=positive("k2", k2), alpha=1.0),
        x,
        y,
        lambda a, b: {"reference.speed": a, "law.alpha": b},
        duration,
        executor=executor,
        checkpoint=checkpoint,
        progress=progress,
    )
    return _region(
        "K06 reverse law", x, y, {**maps, "theorem": mesh(x, y)[1] > least},
        {"theorem": "theorem (local): alpha > J/(d^2 m), after (2.30)"},
        {"(2.30): alpha = J/(d^2 m)": (x.values, np.full(points, least))},
        {"K06 table 6.3 (k2 = 1)": (-0.76, 1.44)},
    )  # fmt: skip


def _judged(
    law: Block,
    x: Axis,
    y: Axis,
    params: Callable[[Array, Array], dict[str, Array]],
    duration: float,
    *,
    executor: Executor | None,
    checkpoint: str | Path | None,
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
        for k, start in enumerate(STARTS):
            x0 = {f"craft.{s.name}": value for s, value in zip(MOVING, start, strict=True)}
            runs = sweep_map(
                ready, x, y, params, times, x0=x0, start=0.9 * duration, method="rk4", step=0.02,
                executor=executor, checkpoint=subfolder(checkpoint, f"{'late' if late else 'prompt'}_{k}"),
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
