"""K06's six-step controller for a pose (section 2.3.1): point at the goal, drive, stop, turn, repeat."""

from __future__ import annotations

import math

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.tables import not_negative, positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.controllers.k06.energy import body_signals, kinetic_energy
from hovercontrol.control.controllers.k06.heading import HEADING_REF, TICK, bang_bang_heading
from hovercontrol.control.controllers.k06.laws import SURGE_REF
from hovercontrol.craft.models.motion import MOTION
from hovercontrol.craft.models.vehicles import HOVERDEMON_BODY, Body

#: The goal: where the pose controller takes the craft.
GOAL = (
    Signal("goal_x_ref", "m", "goal, earth frame"),
    Signal("goal_y_ref", "m", "goal, earth frame"),
    Signal("goal_heading_ref", "rad", "heading reference at the goal"),
)

#: K06's steps (1)-(2), (3), (4), (5) and the end.
MODE = Signal(
    "mode", description="step of the pose controller", modes=("point", "drive", "halt", "orient", "rest")
)

_LAST = MODE.replace(name="last_mode", description="step at the last tick")


@checked
def origin(
    *,
    surge: float = 0.4,
    slow_down: float = 0.4,
    position_tolerance: float = 0.15,
    heading_tolerance: float = math.radians(3.0),
    rest_energy: float = 3e-3,
    yaw_rate: float = 0.8,
    reverse_surge: float = 0.0,
    period: float = TICK,
    body: Body = HOVERDEMON_BODY,
    name: str = "guidance",
) -> Block:
    """Return the pose controller: its steps, and the heading controller that two of them use.

    It tells :func:`~hovercontrol.control.controllers.k06.drive` its velocities, or, if it may drive astern,
    :func:`~hovercontrol.control.controllers.k06.both_ways`: where the stern is nearer to the goal than the
    bow, it points the stern ("forward (or backward)", K06 step 3). The heading is held by
    :func:`~hovercontrol.control.controllers.k06.bang_bang_heading`, which while driving and halting is told
    the heading that the craft has.

    Parameters
    ----------
    surge : float, optional
        Fastest drive [m/s].
    slow_down : float, optional
        Wanted surge per distance ahead [1/s], so that the craft slows down near the goal.
    position_tolerance, heading_tolerance : float, optional
        [m, rad]
    rest_energy : float, optional
        Kinetic energy [J] below which the craft counts as stopped.
    yaw_rate : float, optional
        Of turns on the spot [rad/s].
    reverse_surge : float, optional
        Fastest drive astern [m/s]; 0: it never does.
    period : float, optional
        [s]
    body : Body, optional
    name : str, optional

    Returns
    -------
    Block
        Sampled. Inputs the motion and the goal; outputs ``surge_ref``, ``yaw_rate_ref``, ``mode`` (point,
        drive, halt, orient, rest), ``distance`` [m], and those of the heading controller.

    Raises
    ------
    InputError
        If a number is not positive, or `reverse_surge` is negative.

    Examples
    --------
    >>> [s.name for s in origin().outputs][:4]
    ['surge_ref', 'heading_ref', 'mode', 'distance']
    """
    not_negative("guidance: reverse_surge", reverse_surge)
    astern = {"reverse_surge": (reverse_surge, "m/s")} if reverse_surge else {}
    steps = _steps(
        {
            "surge": (surge, "m/s"),
            "slow_down": (slow_down, "1/s"),
            "position_tolerance": (position_tolerance, "m"),
            "heading_tolerance": (heading_tolerance, "rad"),
            "rest_energy": (rest_energy, "J"),
            **astern,
        },
        period,
        body,
    )
    heading = bang_bang_heading(
        yaw_rate=yaw_rate, tolerance=heading_tolerance / 2, period=period, body=body, name="heading"
    )
    return interconnect([steps, heading], name)


def _steps(numbers: dict[str, tuple[float, str]], period: float, body: Body) -> Block:
    """Return the state machine of the six steps."""
    own = {
        key: Signal(key, unit, key.replace("_", " "), start=positive(f"guidance: {key}", value))
        for key, (value, unit) in numbers.items()
    }
    mass, inertia, _ = body_signals(body)
    surge, slow_down, near, aligned, rest = (own[key].symbol for key in list(own)[:5])
    x, y, psi, u, v, r = (s.symbol for s in MOTION)
    goal_x, goal_y, goal_heading = (s.symbol for s in GOAL)
    distance, ahead, energy = sp.symbols("distance ahead energy", real=True)
    turn_to_goal, turn_to_end = sp.symbols("turn_to_goal turn_to_end", real=True)

    def wrapped(angle: sp.Expr) -> sp.Expr:
        return sp.atan2(sp.sin(angle), sp.cos(angle))

    def last(step: str) -> sp.Basic:
        return sp.Eq(_LAST.symbol, _LAST.mode(step))

    # With the bow to the goal, or the stern where that is nearer: how far it is that way, and how to turn.
    bearing = sp.atan2(goal_y - y, goal_x - x) - psi
    way, turn, speed = ahead, wrapped(bearing), sp.Min(surge, slow_down * ahead)
    if "reverse_surge" in own:
        way, back = sp.Abs(ahead), ahead < 0
        turn = wrapped(bearing + sp.Piecewise((sp.pi, back), (0, True)))
        speed = sp.Piecewise((sp.Max(-own["reverse_surge"].symbol, slow_down * ahead), back), (speed, True))
    calm, there, passed = energy < rest, distance <= near, way <= near / 2
    oriented = sp.Abs(turn_to_end) <= aligned
    off = sp.Or(distance > 2 * near, sp.Abs(turn_to_end) > 2 * aligned)  # twice, lest it chatter
    point, drive, halt, orient, still = (MODE.mode(step) for step in MODE.modes)

    def choose(otherwise: sp.Expr | int, *cases: tuple[sp.Expr | int, sp.Basic]) -> sp.Expr:
        return sp.Piecewise(*cases, (otherwise, True))

    mode = sp.Piecewise(
        (choose(point, (halt, there), (drive, calm & (sp.Abs(turn_to_goal) <= aligned))), last("point")),
        (choose(drive, (halt, there | passed)), last("drive")),
        (choose(point, (halt, ~calm), (orient, there)), last("halt")),
        (choose(point, (orient, ~calm | ~oriented), (still, there)), last("orient")),
        (choose(still, (halt, off)), True),
    )
    now = MODE.symbol
    lowest = own["reverse_surge"].start if "reverse_surge" in own else 0.0
    wanted = choose(psi, (psi + turn_to_goal, sp.Eq(now, point)), (psi + turn_to_end, sp.Eq(now, orient)))
    return Block(
        "steps",
        states=(_LAST,),
        inputs=(*MOTION, *GOAL),
        outputs=(
            SURGE_REF.replace(lower=-lowest),
            HEADING_REF,
            MODE,
            Signal("distance", "m", "distance from the goal"),
        ),
        parameters=(*own.values(), mass, inertia),
        definitions={
            "distance": sp.sqrt((goal_x - x) ** 2 + (goal_y - y) ** 2),
            "ahead": (goal_x - x) * sp.cos(psi) + (goal_y - y) * sp.sin(psi),
            "turn_to_goal": turn,
            "turn_to_end": wrapped(goal_heading - psi),
            "energy": kinetic_energy(mass.symbol, inertia.symbol, u, v, r),
            "mode": mode,
        },
        definition_signals=(MODE,),
        derivatives={"last_mode": now},
        output_expressions={
            "surge_ref": choose(sp.S.Zero, (speed, sp.Eq(now, drive))),
            "heading_ref": wanted,
        },
        period=period,
    )
