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
from types import ModuleType

from hovercontrol._moved import find_former_modules
from hovercontrol.core.backends import register

TYPE_CHECKING = False  # as in typing, which takes a while to import

if TYPE_CHECKING:
    from typing import Any

    from hovercontrol.analysis.frequency import bode, nyquist
    from hovercontrol.analysis.margins import margins
    from hovercontrol.analysis.sensitivity import sensitivity
    from hovercontrol.animation.animate import animate
    from hovercontrol.animation.path import plot_path
    from hovercontrol.controllers import gain_scheduled, lqi, lqr, pid, place, tracking_controller
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
    from hovercontrol.simulation.trajectory import simulate
    from hovercontrol.targets.trim import Trim

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
    # controllers, references, estimators
    "tracking_controller",
    "lqr",
    "lqi",
    "place",
    "gain_scheduled",
    "pid",
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


#: Where each public name is defined. A module is imported when it is asked for: SymPy takes 0.7 s.
_PLACES = {
    "analysis.frequency": ("bode", "nyquist"),
    "analysis.margins": ("margins",),
    "analysis.sensitivity": ("sensitivity",),
    "controllers": ("gain_scheduled", "lqi", "lqr", "pid", "place", "tracking_controller"),
    "animation.animate": ("animate",),
    "animation.path": ("plot_path",),
    "controllers.references": ("circle", "ellipse", "figure_eight", "line", "waypoints"),
    "core.block": ("Block",),
    "core.interconnect": ("interconnect", "prefix", "rename"),
    "core.sgn": ("sgn",),
    "core.signals": ("Signal", "time"),
    "core.units": ("UnitError",),
    "discrepancy.diagnose": ("diagnose",),
    "effects": ("Coefficient", "Effect", "Shape", "effect", "effect_names"),
    "errors": ("InputError", "SmoothedFrictionWarning"),
    "estimators.disturbance": ("disturbance_observer", "with_disturbances"),
    "estimators.extended": ("extended_kalman",),
    "estimators.kalman_bucy": ("kalman_bucy",),
    "estimators.moving_horizon": ("moving_horizon",),
    "estimators.observability": ("observability",),
    "estimators.regression": ("regression",),
    "estimators.unscented": ("unscented_kalman",),
    "guidance": (
        "command_filter",
        "course_control",
        "line_of_sight",
        "path_tracker",
        "steering_law",
        "steering_reference",
        "weaving",
    ),
    "identify.fit": ("identify",),
    "log_check.check": ("check",),
    "logs.log": ("Log",),
    "logs.read": ("read_log",),
    "models.actuated": ("actuated",),
    "models.applied": ("applied_inputs",),
    "models.blockmodel": ("BlockModel",),
    "models.model": ("Fan", "Model"),
    "models.modelfile": ("load_model", "save_model"),
    "models.parameters": ("load_parameters", "save_parameters"),
    "models.vehicles": ("VEHICLES", "vehicle"),
    "simulation.trajectory": ("simulate",),
    "targets.trim": ("Trim",),
}
_PLACE = {name: module for module, names in _PLACES.items() for name in names}
_PACKAGES = {module.partition(".")[0] for module in _PLACES}


#: What a Block offers and others do.
for _name, _module, _function in (
    ("interconnect", "core.interconnect", "interconnect"),
    ("start", "simulation.python_runner", "start_block"),
    ("control", "targets.to_control", "to_control"),
    ("trim", "targets.trim", "trim"),
    ("linearize", "targets.linearization", "linearize"),
    ("compile", "targets.compiled", "compile_block"),
    ("fmu", "fmi.exporter.export", "export_fmu"),
    ("html", "notebook.systems", "block_html"),
):
    register(_name, f"{__name__}.{_module}", _function)


def __getattr__(name: str) -> Any:
    """Import what is asked for: a public name, or a package that defines some."""
    if name in _PLACE:
        found = getattr(importlib.import_module(f"{__name__}.{_PLACE[name]}"), name)
        globals()[name] = found
        return found
    if name in _PACKAGES:
        return importlib.import_module(f"{__name__}.{name}")
    raise AttributeError(f"module 'hovercontrol' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_PLACE})


class _Package(ModuleType):
    """The package itself: a name that is a function and a module, ``hovercontrol.identify``, is the function.

    Importing a module sets it as an attribute of its package; ``from hovercontrol.identify import ...`` does
    not look there.
    """

    def __setattr__(self, name: str, value: Any) -> None:
        own = isinstance(value, ModuleType) and name in _PLACE
        super().__setattr__(name, getattr(value, name) if own else value)


sys.modules[__name__].__class__ = _Package
find_former_modules()
