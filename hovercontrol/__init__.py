"""Model-based control of hovercraft: one symbolic definition, many faces.

A :class:`Block` is written once, in SymPy; python-control systems, NumPy functions and exact Jacobians are
derived from it. ``interconnect`` wires Blocks by signal name; ``vehicle`` gives the source documents' craft.

Examples
--------
>>> import hovercontrol as hc
>>> craft = hc.vehicle("c17_simulation")
>>> loop = hc.interconnect([
...     craft.plant(), hc.tracking_controller(craft), hc.ellipse(1.5, 2.5, rate=-1.0),
... ])
>>> loop.to_control().nstates
6
"""

from typing import TYPE_CHECKING, Any

from hovercontrol.block import Block
from hovercontrol.controllers import tracking_controller
from hovercontrol.effects import Coefficient, Effect, Shape, effect, effect_names
from hovercontrol.errors import InputError
from hovercontrol.estimators.kalman_bucy import kalman_bucy
from hovercontrol.estimators.regression import regression
from hovercontrol.interconnect import interconnect, prefix, rename
from hovercontrol.model import Fan, Model
from hovercontrol.modelfile import load_model, save_model
from hovercontrol.references import circle, ellipse, figure_eight, line, waypoints
from hovercontrol.sgn import sgn
from hovercontrol.signals import Signal, time
from hovercontrol.units import UnitError
from hovercontrol.vehicles import VEHICLES, vehicle

if TYPE_CHECKING:
    from hovercontrol.simulation import simulate

__version__ = "0.1.0"

__all__ = [
    # the definition and the wiring
    "Block",
    "Signal",
    "time",
    "sgn",
    "interconnect",
    "rename",
    "prefix",
    # models of craft
    "Model",
    "Fan",
    "Effect",
    "Coefficient",
    "Shape",
    "effect",
    "effect_names",
    "vehicle",
    "VEHICLES",
    "load_model",
    "save_model",
    # controllers, references, estimators
    "tracking_controller",
    "ellipse",
    "circle",
    "line",
    "figure_eight",
    "waypoints",
    "kalman_bucy",
    "regression",
    "simulate",
    # errors
    "InputError",
    "UnitError",
]


def __getattr__(name: str) -> Any:
    """Import what needs python-control (1 s) only when it is asked for."""
    if name == "simulate":
        from hovercontrol.simulation import simulate

        return simulate
    raise AttributeError(f"module 'hovercontrol' has no attribute {name!r}")
