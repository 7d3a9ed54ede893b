"""Model-based control of hovercraft and other machines: one symbolic definition, many backends.

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

import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, _ = lazy_loader.attach_stub(__name__, __file__)  # from __init__.pyi (SPEC 1)

__all__ = [
    # the definition and the wiring
    "Block",
    "from_control",
    "Signal",
    "time",
    "sgn",
    "unknown",
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
    "fleet",
    "experiment",
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
