"""The sections of a scenario file, their keys and types.

The loader and the JSON Schema of scenarios use these. ``object`` is a value with its own rule, ``list`` a
list of names.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import Any

Keys = dict[str, type]

#: All sections.
SECTIONS = (
    "scenario",
    "plant",
    "body",
    "reference",
    "guidance",
    "controller",
    "actuation",
    "estimator",
    "commands",
    "sampling",
    "autopilot",
    "phase",
    "metric",
)

#: ``base`` is taken off before the rest is checked: see :mod:`hovercontrol.documents.scenarios.base`.
HEAD: Keys = {"base": str, "title": str, "source": str, "step": float}
PLANT: Keys = {
    "vehicle": str,
    "model": str,
    "limited": bool,
    "start": dict,
    "coefficients": dict,
    "effects": dict,
}
#: What ``plant.start`` may set.
STATES = ("x", "y", "psi", "u", "v", "r")
BODY: Keys = {"mass": float, "inertia": float, "arm": float}
#: Of C17's tracking law; others have a ``kind`` and their arguments.
CONTROLLER: Keys = {"control_point": float, "k1": float, "k2": float, "adapt": list, "limits": bool}
ACTUATION: Keys = {"dead_zone": float, "reversing": bool}
ESTIMATOR: Keys = {
    "R": object,
    "Q": object,
    "P0": object,
    "estimate": list,
    "start": float,
    "first": dict,
}
SAMPLING: Keys = {
    "measurement": float,
    "command": float,
    "position_noise": float,
    "heading_noise": float,
    "velocity_noise": float,
    "rate_noise": float,
    "log": float,
    "seed": int,
    "poor_view": dict,
}
#: Of ``sampling.poor_view``.
POOR_VIEW: Keys = {
    "centre": object,
    "radius": float,
    "position_noise": float,
    "heading_noise": float,
    "outlier_share": float,
    "outlier_noise": float,
}
PHASE: Keys = {"name": str, "until": float, "scale": dict, "adaptation": float, "set": dict}
METRIC: Keys = {
    "name": str,
    "of": str,
    "from": float,
    "to": float,
    "low": float,
    "high": float,
    "unit": str,
    "paper": str,
    "statistic": str,
    "target": float,
    "within": float,
}
METRIC_NEEDS = ("name", "of", "from", "to")


def arguments(maker: Callable[..., Any], without: Sequence[str] = ()) -> tuple[list[str], tuple[str, ...]]:
    """Return the keys of a section whose ``kind`` names a function: all arguments, and the required ones.

    Examples
    --------
    >>> from hovercontrol.control.controllers.references import circle
    >>> arguments(circle, ("name",))[1]
    ('radius',)
    """
    accepted = {k: p for k, p in inspect.signature(maker).parameters.items() if k not in without}
    return list(accepted), tuple(k for k, p in accepted.items() if p.default is inspect.Parameter.empty)
