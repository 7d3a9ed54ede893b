"""Laws that the pilot can choose: the stick, or one of K06's laws with the gains of its trials."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import sympy as sp

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.controllers.k06 import both_ways, force_to_command
from hovercontrol.control.controllers.k06.energy import body_signals, kinetic_energy
from hovercontrol.control.controllers.k06.heading import HEADING_REF, TICK
from hovercontrol.control.controllers.k06.laws import SURGE_REF, YAW_RATE_REF
from hovercontrol.control.controllers.k06.origin import GOAL
from hovercontrol.control.guidance import steering_law, weaving
from hovercontrol.craft.models.model import Fan, Model
from hovercontrol.craft.models.motion import MOTION, THRUST
from hovercontrol.craft.models.vehicles import HOVERDEMON_BODY, hoverdemon

#: Full stick where a model states no bounds: the ends of K06's table of forces (figure 4.5), in N and rad.
FULL_THRUST, FULL_RUDDER = 2.0, math.radians(35.0)

#: Force components no larger than this [N] count as zero: a rudder without thrust has no direction.
DEAD_ZONE = 0.002

STICK = (
    Signal("stick_ahead", "1", "stick, forward", lower=-1.0, upper=1.0),
    Signal("stick_right", "1", "stick, to the right", lower=-1.0, upper=1.0),
)


@dataclass(frozen=True)
class Choice:
    """A law that the pilot can choose.

    Parameters
    ----------
    title : str
        Name on the page.
    scenario : str
        The scenario with its gains; ``""`` if it is not one of K06's trials.
    stick : bool, optional
        Whether it uses the stick.
    references : tuple of Signal, optional
        The references set by the pilot, with the bounds of the sliders.
    """

    title: str
    scenario: str = ""
    references: tuple[Signal, ...] = ()
    stick: bool = False


_HEADING = HEADING_REF.replace(description="heading reference", lower=-math.pi, upper=math.pi)
_GOAL = (
    GOAL[0].replace(lower=-20.0, upper=20.0),
    GOAL[1].replace(lower=-20.0, upper=20.0),
    GOAL[2].replace(lower=-math.pi, upper=math.pi),
)

#: Every choice by its key.
CHOICES: dict[str, Choice] = {
    "manual": Choice("Manual", stick=True),
    "motion": Choice("Stick sets motion", stick=True),
    "steer": Choice("Stick steers under way", stick=True),
    "stop": Choice("Stop", "k06-stop"),
    "forward": Choice("Forward", "k06-forward", (SURGE_REF.replace(start=1.1, lower=0.0, upper=1.5),)),
    "reverse": Choice("Reverse", "k06-reverse", (SURGE_REF.replace(start=-0.76, lower=-1.0, upper=0.0),)),
    "turn": Choice("Turn", "k06-turn", (YAW_RATE_REF.replace(start=1.5, lower=-4.0, upper=4.0),)),
    "goal": Choice("Goal", "k06-origin", _GOAL),
    "heading": Choice("Heading, bang-bang", "k06-heading-bangbang", (_HEADING,)),
    "heading_proportional": Choice("Heading, proportional", "k06-heading-proportional", (_HEADING,)),
}


def choices(model: Model) -> dict[str, Choice]:
    """Return the laws for a craft: K06's laws need a rudder and a thrust in newton."""
    if {"thrust", "rudder"} <= {s.name for s in model.plant().inputs} and model.thrust.unit == "N":
        return CHOICES
    return {"manual": CHOICES["manual"]}


def law(key: str, model: Model) -> Block:
    """Return a choice as one Block, from motion, stick and references to the craft's commands.

    Parameters
    ----------
    key : str
        Of :data:`CHOICES`.

    Returns
    -------
    Block
        Sampled where the law has a guidance, else without states. The references are parameters
        ``reference.NAME``; the outputs include the plant's inputs. The laws use the mass and inertia of K06's
        craft.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import vehicle
    >>> [s.name for s in law("forward", vehicle("hoverdemon")).outputs]
    ['surge_ref', 'force_x', 'force_y', 'thrust', 'rudder']
    """
    if key == "manual":
        return manual(model)
    actuation = force_to_command(dead_zone=DEAD_ZONE, reversing=True, name="actuation")
    return interconnect([*force_parts(key), actuation], "law")


@cache
def force_parts(key: str) -> tuple[Block, ...]:
    """Return the Blocks of a law: references, guidance, controller."""
    from hovercontrol.documents.scenarios import load_scenario
    from hovercontrol.documents.scenarios.parts import loop_parts

    if key == "motion":
        return tuple(stick_motion())
    if key == "steer":
        return tuple(stick_steering())
    parts = loop_parts(load_scenario(CHOICES[key].scenario))
    return tuple(block for role, block in parts.items() if role not in ("plant", "actuation"))


def manual(model: Model) -> Block:
    """Return the stick: forward is thrust; right turns the bow to the right while there is thrust.

    Parameters
    ----------
    model : Model
        Full stick gives the bounds of the commands, or without bounds those of K06's force table.

    Returns
    -------
    Block
        Inputs ``stick_ahead, stick_right`` (-1 to 1); outputs the plant's inputs.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import vehicle
    >>> manual(vehicle("four_fan")).to_numpy().outputs(0.0, (), [0.0, 1.0]).tolist()  # turns to the right
    [0.0, 0.1, 0.1, 0.0]
    """
    ahead, right = (s.symbol for s in STICK)
    inputs = model.plant().inputs
    wanted = {"thrust": ahead, "rudder": right} | {f.name: _share(f, ahead, right) for f in model.fans}
    full = {s.name: Signal(f"manual.{s.name}", s.unit, "at full stick", start=full_stick(s)) for s in inputs}
    return Block(
        "manual",
        inputs=STICK,
        outputs=inputs,
        parameters=tuple(full.values()),
        output_expressions={s.name: full[s.name].symbol * wanted[s.name] for s in inputs},
    )


def stick_motion() -> list[Block]:
    """Return the parts of the law in which the stick commands velocity or yaw rate.

    It is K06's pilot in the loop (chapter 7): the pilot plans the path, and
    :func:`~hovercontrol.control.controllers.k06.both_ways` follows these commands, with the gains of K06's
    trials. Reverse is commanded only after the craft has stopped. K06 has no law for turning under way, and
    the ideal craft has no such steady motion: with both commands it slips. :func:`stick_steering` follows
    both in the mean.

    Returns
    -------
    list of Block
        Commands of the stick, and the law.

    Examples
    --------
    >>> [s.name for s in interconnect(stick_motion()).inputs]
    ['stick_ahead', 'stick_right', 'u', 'v', 'r']
    """
    ahead, right = (s.symbol for s in STICK)
    full = (
        Signal("ahead", "m/s", "surge at full stick ahead", start=1.1),
        Signal("astern", "m/s", "surge at full stick back", start=0.76),
        Signal("turning", "rad/s", "yaw rate at full stick aside", start=1.5),
        Signal("slow", "m/s", "surge velocity below which reverse is commanded", start=0.15),
    )
    fast, back, turning, slow = (s.symbol for s in full)
    surge = next(s for s in MOTION if s.name == "u")
    wish = Block(
        "wish",
        inputs=(*STICK, surge),
        outputs=(SURGE_REF, YAW_RATE_REF),
        parameters=full,
        output_expressions={
            "surge_ref": sp.Piecewise(
                (fast * ahead, ahead >= 0), (back * ahead, surge.symbol < slow), (0, True)
            ),
            "yaw_rate_ref": -turning * right,
        },
    )
    return [wish, both_ways(k1=1.0, k2=4.0, reverse_k1=1.5, reverse_k2=1.0, alpha=1.44)]


def stick_steering() -> list[Block]:
    """Return the parts of the law in which the stick commands surge velocity and yaw rate together.

    The craft has no sway drag, so it weaves: both are followed in the mean over a weave
    (:func:`~hovercontrol.control.guidance.weaving`), 23 s at full stick to one side.

    Returns
    -------
    list of Block
        Commands of the stick, the weave, and the steering law.

    Examples
    --------
    >>> [part.name for part in stick_steering()]
    ['wish', 'weave', 'controller']
    """
    ahead, right = (s.symbol for s in STICK)
    full = (
        Signal("ahead", "m/s", "surge at full stick ahead", start=1.1),
        Signal("astern", "m/s", "surge at full stick back", start=0.76),
        Signal("turning", "rad/s", "yaw rate at full stick aside", start=0.5),
    )
    fast, back, turning = (s.symbol for s in full)
    wish = Block(
        "wish",
        inputs=STICK,
        outputs=(SURGE_REF, YAW_RATE_REF),
        parameters=full,
        output_expressions={
            "surge_ref": sp.Piecewise((fast * ahead, ahead >= 0), (back * ahead, True)),
            "yaw_rate_ref": -turning * right,
        },
    )
    law = steering_law(hoverdemon(), yaw_gain=1.5, forces=True)
    return [wish, weaving(period=TICK, name="weave"), law]


def full_stick(command: Signal) -> float:
    """Return a command at full stick."""
    if math.isfinite(command.upper):
        return command.upper
    if command.unit == "rad":
        return FULL_RUDDER
    return FULL_THRUST if command.name == THRUST.name else command.nominal


def _share(fan: Fan, ahead: sp.Expr, right: sp.Expr) -> sp.Expr:
    """Return a fan's share of its full force: the fans that push or turn in the stick's direction run."""
    turning = sp.sign(fan.lever_arm("manual").start)
    return sp.Min(1, sp.Max(0, round(math.cos(fan.direction)) * ahead - turning * right))


def energy() -> Block:
    """Return the kinetic energy of K06's craft as a Block (K06 (2.40))."""
    mass, inertia, arm = body_signals(HOVERDEMON_BODY)
    moving = tuple(s for s in MOTION if s.name in ("u", "v", "r"))
    value = kinetic_energy(mass.symbol, inertia.symbol, *(s.symbol for s in moving))
    return Block(
        "energy",
        inputs=moving,
        outputs=(Signal("energy", "J", "kinetic energy"),),
        parameters=(mass, inertia, arm),
        output_expressions={"energy": value},
    )
