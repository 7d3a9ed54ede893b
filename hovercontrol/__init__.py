"""Model-based control of hovercraft: one symbolic definition, many backends.

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

from __future__ import annotations

import importlib
import sys
from functools import cache
from types import ModuleType

TYPE_CHECKING = False  # as in typing, which takes a while to import

if TYPE_CHECKING:
    from typing import Any

    from hovercontrol.analysis.frequency import bode, nyquist
    from hovercontrol.analysis.margins import margins
    from hovercontrol.analysis.sensitivity import sensitivity
    from hovercontrol.animation.animate import animate
    from hovercontrol.animation.path import plot_path
    from hovercontrol.controllers import gain_scheduled, lqi, lqr, pid, place, tracking_controller
    from hovercontrol.controllers.minimum_time import minimum_time
    from hovercontrol.controllers.mpc import mpc
    from hovercontrol.controllers.references import circle, ellipse, figure_eight, line, waypoints
    from hovercontrol.core.block import Block
    from hovercontrol.core.interconnect import interconnect, prefix, rename
    from hovercontrol.core.sgn import sgn
    from hovercontrol.core.signals import Signal, time
    from hovercontrol.core.units import UnitError
    from hovercontrol.discrepancy.diagnose import diagnose
    from hovercontrol.effects import Coefficient, Effect, Shape, effect, effect_names
    from hovercontrol.errors import InputError, SmoothedFrictionWarning
    from hovercontrol.estimators.disturbance import disturbance_observer, with_disturbances
    from hovercontrol.estimators.extended import extended_kalman
    from hovercontrol.estimators.kalman_bucy import kalman_bucy
    from hovercontrol.estimators.moving_horizon import moving_horizon
    from hovercontrol.estimators.observability import observability
    from hovercontrol.estimators.regression import regression
    from hovercontrol.estimators.unscented import unscented_kalman
    from hovercontrol.fmi.replay.opened import fmu_plant
    from hovercontrol.fmi.replay.plant import FmuPlant
    from hovercontrol.guidance import (
        command_filter,
        course_control,
        line_of_sight,
        path_tracker,
        steering_law,
        steering_reference,
        weaving,
    )
    from hovercontrol.identify.fit import identify
    from hovercontrol.log_check.check import check
    from hovercontrol.logs.log import Log
    from hovercontrol.logs.read import read_log
    from hovercontrol.models.actuated import actuated
    from hovercontrol.models.applied import applied_inputs
    from hovercontrol.models.blockmodel import BlockModel
    from hovercontrol.models.model import Fan, Model
    from hovercontrol.models.modelfile import load_model, save_model
    from hovercontrol.models.parameters import load_parameters, save_parameters
    from hovercontrol.models.vehicles import VEHICLES, vehicle
    from hovercontrol.monitor.monitor import monitor
    from hovercontrol.monitor.replay import replay
    from hovercontrol.simulation.trajectory import simulate
    from hovercontrol.targets.from_control import from_control
    from hovercontrol.targets.optimal_control import solve_ocp
    from hovercontrol.targets.trim import Trim

__version__ = "0.1.0"

__all__ = [
    # the definition and the wiring
    "Block",
    "from_control",
    "Signal",
    "time",
    "sgn",
    "interconnect",
    "rename",
    "prefix",
    # models of craft
    "Model",
    "BlockModel",
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
    "load_parameters",
    "save_parameters",
    "actuated",
    "applied_inputs",
    # operating points and loops in the frequency domain
    "Trim",
    "bode",
    "nyquist",
    "margins",
    "sensitivity",
    # measured logs
    "Log",
    "read_log",
    "check",
    "identify",
    "diagnose",
    "fmu_plant",
    "FmuPlant",
    # controllers, references, estimators
    "tracking_controller",
    "lqr",
    "lqi",
    "place",
    "gain_scheduled",
    "pid",
    "mpc",
    "minimum_time",
    "solve_ocp",
    "ellipse",
    "circle",
    "line",
    "figure_eight",
    "waypoints",
    "kalman_bucy",
    "extended_kalman",
    "unscented_kalman",
    "moving_horizon",
    "disturbance_observer",
    "with_disturbances",
    "observability",
    "regression",
    "monitor",
    "replay",
    "simulate",
    # guidance
    "line_of_sight",
    "course_control",
    "command_filter",
    "steering_law",
    "steering_reference",
    "weaving",
    "path_tracker",
    # pictures of a motion
    "plot_path",
    "animate",
    # errors
    "InputError",
    "SmoothedFrictionWarning",
    "UnitError",
]


@cache
def _places() -> dict[str, str]:
    """Return the module of each public name, read from the imports above: they are the only list.

    A module is imported when a name of it is used; importing all of them takes seconds.
    """
    import ast

    with open(__file__, encoding="utf-8") as source:
        found = [node for node in ast.walk(ast.parse(source.read())) if isinstance(node, ast.ImportFrom)]
    return {one.name: str(node.module) for node in found for one in node.names if one.name in __all__}


def __getattr__(name: str) -> Any:
    """Import a public name, or a package that defines some."""
    places = _places()
    if name in places:
        found = getattr(importlib.import_module(places[name]), name)
        globals()[name] = found
        return found
    if name in {module.split(".")[1] for module in places.values()}:
        return importlib.import_module(f"{__name__}.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


class _Package(ModuleType):
    """Keeps ``hovercontrol.identify`` the function: importing the package of that name would replace it."""

    def __setattr__(self, name: str, value: Any) -> None:
        hidden = isinstance(value, ModuleType) and name in __all__
        super().__setattr__(name, getattr(value, name) if hidden else value)


sys.modules[__name__].__class__ = _Package
