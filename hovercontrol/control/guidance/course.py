"""Course control by the yaw rate: between line-of-sight guidance and the steering law."""

from __future__ import annotations

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.tables import positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.controllers.k06.laws import YAW_RATE_REF
from hovercontrol.control.guidance.waypoints import COURSE_REF
from hovercontrol.craft.models.motion import MOTION

_SEEN = tuple(s for s in MOTION if s.name in ("psi", "u", "v"))


@checked
def course_control(
    *,
    gain: float = 1.0,
    yaw_rate: float = 0.8,
    slow: float = 0.1,
    sideslip: bool = False,
    name: str = "course",
) -> Block:
    """Return the course controller ``yaw_rate_ref = limit tanh(gain e/limit)``, e the course error.

    The course is the heading, or the heading plus the sideslip ``beta = atan(v/sqrt(u^2 + slow^2))``
    of a craft that goes ahead; e is taken between -pi and pi. A craft with its rudder astern first slides
    outwards, so that its course has a zero in the right half-plane: with sideslip, gains must be smaller.

    Parameters
    ----------
    gain : float, optional
        Yaw rate per course error [1/s].
    yaw_rate : float, optional
        Largest yaw rate command [rad/s].
    slow : float, optional
        Surge velocity below which the sideslip counts less [m/s].
    sideslip : bool, optional
        Control the course itself, not the heading.
    name : str, optional

    Returns
    -------
    Block
        Inputs ``course_ref``, ``psi`` [rad], with sideslip ``u``, ``v`` [m/s]; outputs ``yaw_rate_ref``
        [rad/s] and ``course_error`` [rad].

    Raises
    ------
    InputError
        If a number is not positive.

    Examples
    --------
    >>> held = course_control(gain=2.0, yaw_rate=10.0).to_numpy()
    >>> round(float(held.outputs(0.0, (), [0.1, 0.0])[0]), 3)  # course_ref, psi
    0.2
    """
    given = (
        Signal("gain", "1/s", "gain from course error to yaw rate", start=positive(f"{name}: gain", gain)),
        Signal(
            "yaw_rate", "rad/s", "largest yaw rate command", start=positive(f"{name}: yaw_rate", yaw_rate)
        ),
        Signal(
            "slow",
            "m/s",
            "surge velocity below which sideslip counts less",
            start=positive(f"{name}: slow", slow),
        ),
    )
    k, most, least = (s.symbol for s in given)
    psi, u, v = (s.symbol for s in _SEEN)
    course = psi + sp.atan(v / sp.sqrt(u**2 + least**2)) if sideslip else psi
    off = COURSE_REF.symbol - course
    error = Signal("course_error", "rad", "course reference minus course")
    return Block(
        name,
        inputs=(COURSE_REF, *(_SEEN if sideslip else _SEEN[:1])),
        outputs=(YAW_RATE_REF, error),
        parameters=given if sideslip else given[:2],
        definitions={error.name: sp.atan2(sp.sin(off), sp.cos(off))},
        definition_signals=(error,),
        output_expressions={YAW_RATE_REF.name: most * sp.tanh(k * error.symbol / most)},
    )
