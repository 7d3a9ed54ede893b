"""A variable-pitch propeller, suggested by K06 chapter 7: constant speed, blades turned by a servo.

It pushes both ways alike and needs no reversing speed controller, whose delay K06 calls problematic.

Blade-element momentum theory of a static propeller (Leishman, "Principles of Helicopter
Aerodynamics", section 3.3) gives the blades' pitch at three quarters of the radius as ``6 C_T / (sigma a) +
3/2 sqrt(C_T / 2)``: a term proportional to the thrust, and the term of the inflow. With p = pitch/full pitch,
f = thrust/full thrust and i the inflow's share of the full pitch, ``p = (1 - i) f + i sqrt(f)``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import not_negative, number, positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect, rename
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.hardware.actuators.k06 import (
    HIGHEST_SPEED,
    RUDDER_OFFSET,
    RUDDER_SLOPE,
    force_angle_of_rudder,
    forward_thrust,
)
from hovercontrol.craft.hardware.actuators.rudder import clipped, regression_signals
from hovercontrol.craft.hardware.actuators.signals import (
    DEGREE,
    RUDDER_ANGLE,
    RUDDER_ANGLE_COMMAND,
    THRUST_COMMAND,
    UPDATE,
)
from hovercontrol.craft.models.motion import RUDDER, THRUST

PITCH_COMMAND = Signal("pitch_command", "rad", "wanted pitch of the blades, negative astern", nominal=0.1)
BLADE_PITCH = Signal("blade_pitch", "rad", "pitch of the blades, negative astern", nominal=0.1)


@checked
@dataclass(frozen=True)
class VariablePitch:
    """Data of a variable-pitch propeller; the defaults are a stand-in for K06's craft, which had none.

    Parameters
    ----------
    thrust : float, optional
        Thrust at full pitch, in both directions [N]. Default: K06's fan at 12 000 RPM.
    pitch : float, optional
        Full pitch [rad]. Default: blade-element theory for K06's two blades of 7 in diameter (section 4.2),
        15 mm wide, at 12 000 RPM.
    inflow : float, optional
        Share of the full pitch that the inflow takes, by the same theory; 0: thrust proportional to pitch.
    lag : float, optional
        Time constant of the pitch's servo [s]; 0: no lag. The default is an assumption.
    rudder_loss : float, optional
        Share of the thrust lost with the rudder at 35 degrees, besides the cosine, as for the fan.
    ideal : bool, optional
        Without the loss by the rudder.

    Raises
    ------
    InputError
        If thrust or pitch is not positive, the lag negative or a share not at least 0 and less than 1.

    Examples
    --------
    >>> round(VariablePitch(lag=0.0).thrust, 3)
    1.944
    """

    thrust: float = float(forward_thrust(HIGHEST_SPEED))
    pitch: float = 0.128
    inflow: float = 0.6
    lag: float = 0.05
    rudder_loss: float = 0.0
    ideal: bool = False

    def __post_init__(self) -> None:
        for key in ("thrust", "pitch"):
            positive(f"variable pitch: {key}", getattr(self, key))
        not_negative("variable pitch: lag", self.lag)
        for key in ("inflow", "rudder_loss"):
            if not 0 <= number(f"variable pitch: {key}", getattr(self, key)) < 1:
                raise InputError(
                    f"variable pitch: {key} must be at least 0 and less than 1, found {getattr(self, key)!r}"
                )

    def signals(self) -> tuple[Signal, Signal, Signal, Signal]:
        """Return full thrust, full pitch, the inflow's share and the rudder's loss as parameters."""
        return (
            Signal("full_thrust", "N", "thrust at full pitch", start=self.thrust, lower=0.0),
            Signal("full_pitch", "rad", "largest pitch", start=self.pitch, lower=0.0, nominal=0.1),
            Signal(
                "inflow", "1", "inflow's share of the full pitch", start=self.inflow, lower=0.0, upper=1.0
            ),
            Signal(
                "rudder_loss",
                "1",
                "share of the thrust lost at a rudder of 35 degrees",
                start=self.rudder_loss,
                lower=0.0,
                upper=1.0,
            ),
        )

    def left(self, rudder: float | sp.Expr, loss: float | sp.Expr) -> Any:
        """Return the share of the thrust that `rudder` [rad] leaves; `loss` is that at 35 degrees."""
        return sp.S.One if self.ideal else sp.cos(rudder) * (1 - loss * (rudder / (35 * DEGREE)) ** 2)


@checked
def pitch_lookup(propeller: VariablePitch | None = None, *, name: str = "pitch_lookup") -> Block:
    """Return the lookup of the pitch for a thrust command at a rudder angle, limited to full pitch.

    Parameters
    ----------
    propeller : VariablePitch, optional
    name : str, optional

    Returns
    -------
    Block
        Without states. Inputs ``thrust_command`` [N], ``rudder_angle_command`` [rad]; outputs
        ``pitch_command`` [rad] and ``thrust_outside``, 1 where the command exceeds the thrust at full pitch.

    Examples
    --------
    >>> pitch, outside = pitch_lookup().to_numpy().outputs(0.0, (), [-1.944, 0.0])
    >>> round(float(pitch), 6), float(outside)
    (-0.128, 0.0)
    """
    made = propeller or VariablePitch()
    parameters = made.signals()
    full, most, inflow, loss = (p.symbol for p in parameters)
    F = THRUST_COMMAND.symbol
    share = Signal("share", "1", "share of the full thrust")
    wanted = F / (full * made.left(RUDDER_ANGLE_COMMAND.symbol, loss))
    size = sp.Min(sp.Abs(share.symbol), 1)
    turned = most * ((1 - inflow) * size + inflow * sp.sqrt(size))
    flag, outside = clipped(sp.Abs(share.symbol) > 1 + 1e-9, "thrust")
    return Block(
        name,
        inputs=(THRUST_COMMAND, RUDDER_ANGLE_COMMAND),
        outputs=(PITCH_COMMAND, flag),
        parameters=parameters,
        definitions={share.name: wanted},
        definition_signals=(share,),
        output_expressions={
            PITCH_COMMAND.name: sp.Piecewise((-turned, F < 0), (turned, True)),
            flag.name: outside,
        },
    )


@checked
def pitch_servo(*, lag: float = 0.05, period: float = UPDATE, name: str = "pitch_servo") -> Block:
    """Return the servo of the blades: a sampled command and a first-order lag.

    Parameters
    ----------
    lag : float, optional
        Time constant [s]; 0: no lag.
    period : float, optional
        [s]
    name : str, optional

    Returns
    -------
    Block
        Sampled. Input ``pitch_command`` [rad]; output ``blade_pitch`` [rad].

    Raises
    ------
    InputError
        If the lag is negative or the period not positive.

    Examples
    --------
    >>> from hovercontrol.blocks.simulation.sampled import Ticking
    >>> servo = Ticking(pitch_servo(lag=0.02))
    >>> [round(servo.tick(0.02 * k, {"pitch_command": 0.1})["blade_pitch"], 4) for k in range(3)]
    [0.0632, 0.0865, 0.095]
    """
    positive(f"{name}: period", period)
    late = Signal(
        "lag", "s", "time constant", start=not_negative(f"{name}: lag", lag), lower=0.0, nominal=0.1
    )
    step = Signal("update", "s", "time between two commands", start=period, lower=0.0)
    last = BLADE_PITCH.replace(name="last_blade_pitch", description="pitch before this command")
    kept = sp.exp(-step.symbol / sp.Max(late.symbol, step.symbol / 1000))
    return Block(
        name,
        states=(last,),
        inputs=(PITCH_COMMAND,),
        outputs=(BLADE_PITCH,),
        parameters=(late, step),
        definitions={BLADE_PITCH.name: PITCH_COMMAND.symbol + kept * (last.symbol - PITCH_COMMAND.symbol)},
        definition_signals=(BLADE_PITCH,),
        derivatives={last.name: BLADE_PITCH.symbol},
        period=period,
    )


@checked
def pitch_thrust(
    propeller: VariablePitch | None = None,
    *,
    slope: float = RUDDER_SLOPE,
    offset: float = RUDDER_OFFSET,
    name: str = "pitch_thrust",
) -> Block:
    """Return the force of blades and rudder, by the inverse of the theory and of (4.3).

    Parameters
    ----------
    propeller : VariablePitch, optional
    slope, offset : float, optional
        Of (4.3), as for :func:`~hovercontrol.craft.hardware.actuators.rudder_lookup`.
    name : str, optional

    Returns
    -------
    Block
        Without states. Inputs ``blade_pitch``, ``rudder_angle`` [rad]; outputs ``thrust`` [N], negative
        astern, and ``rudder`` [rad], the angle of the force from the bow.

    Raises
    ------
    InputError
        If the slope is zero.

    Examples
    --------
    >>> pitch_thrust().to_numpy().outputs(0.0, (), [-0.128, 0.0]).round(3).tolist()
    [-1.944, -0.007]
    """
    made = propeller or VariablePitch()
    parameters = (*regression_signals(slope, offset, name), *made.signals())
    K, b, full, most, inflow, loss = (p.symbol for p in parameters)
    pitch = BLADE_PITCH.symbol
    share = Signal("share", "1", "share of the full pitch")
    p, straight = share.symbol, 1 - inflow
    root = 2 * p / (inflow + sp.sqrt(inflow**2 + 4 * straight * p))  # of (1 - i) s^2 + i s = p
    root = sp.Piecewise((root, p > 0), (0, True))
    size = full * made.left(RUDDER_ANGLE.symbol, loss) * root**2
    return Block(
        name,
        inputs=(BLADE_PITCH, RUDDER_ANGLE),
        outputs=(
            THRUST.replace(unit="N", description="force of the propeller"),
            RUDDER.replace(description="angle of the force from the bow"),
        ),
        parameters=parameters,
        definitions={share.name: sp.Min(sp.Abs(pitch) / most, 1)},
        definition_signals=(share,),
        output_expressions={
            "thrust": sp.Piecewise((-size, pitch < 0), (size, True)),
            "rudder": force_angle_of_rudder(RUDDER_ANGLE.symbol, K, b),
        },
    )


@checked
def variable_pitch_propeller(
    propeller: VariablePitch | None = None, *, period: float = UPDATE, name: str = "variable_pitch"
) -> Block:
    """Return the complete variable-pitch propeller: lookup of the pitch, servo, blades.

    Parameters
    ----------
    propeller : VariablePitch, optional
    period : float, optional
        Time between two commands to the servo [s].
    name : str, optional

    Returns
    -------
    Block
        Hybrid. Inputs ``thrust_command`` [N], ``rudder_angle`` [rad]; outputs ``thrust`` [N], ``rudder``
        [rad], ``blade_pitch`` [rad] and ``thrust_outside``.

    Raises
    ------
    InputError
        If the period is not positive.

    Examples
    --------
    >>> block = variable_pitch_propeller()
    >>> run = block.start(inputs={"thrust_command": -1.0})
    >>> [round(float(run.step(None, 0.1)[0]), 2) for _ in range(4)]
    [-0.87, -0.98, -1.0, -1.0]
    """
    made = propeller or VariablePitch()
    lookup = rename(pitch_lookup(made), {RUDDER_ANGLE_COMMAND.name: RUDDER_ANGLE.name})
    parts = [lookup, pitch_servo(lag=made.lag, period=period), pitch_thrust(made)]
    return interconnect(parts, name, outputs=["thrust", "rudder", BLADE_PITCH.name, "thrust_outside"])


@checked
def blade_element(
    thrust: float, radius: float, speed: float, chord: float, *, blades: int = 2, air: float = 1.2
) -> tuple[float, float]:
    """Return the full pitch [rad] and the inflow's share of it, by blade-element momentum theory.

    Parameters
    ----------
    thrust : float
        [N]
    radius, chord : float
        Of the blades [m].
    speed : float
        [rad/s]
    blades : int, optional
    air : float, optional
        Density [kg/m^3].

    Raises
    ------
    InputError
        If a value is not positive.

    Examples
    --------
    >>> pitch, inflow = blade_element(1.944, 0.0889, 1256.6, 0.015)  # 7 in, 12 000 RPM
    >>> round(pitch, 3), round(inflow, 2)
    (0.128, 0.6)
    """
    given = {"thrust": thrust, "radius": radius, "speed": speed, "chord": chord, "air": air, "blades": blades}
    for key, value in given.items():
        positive(f"blade_element: {key}", value)
    coefficient = thrust / (air * math.pi * radius**2 * (speed * radius) ** 2)
    solidity = blades * chord / (math.pi * radius)
    inflow = 1.5 * math.sqrt(coefficient / 2)
    pitch = 6 * coefficient / (solidity * 5.7) + inflow  # 5.7 per rad: lift slope of a thin blade
    return pitch, inflow / pitch
