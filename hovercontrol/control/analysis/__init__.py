"""Analyses of Blocks: stability, observability, margins, regions."""

from hovercontrol.control.analysis.byrnes_isidori import NormalForm, normal_form
from hovercontrol.control.analysis.directions import Direction
from hovercontrol.control.analysis.excitation import Excitation, FunctionSet, excitation, signals_of
from hovercontrol.control.analysis.experiment_design import ExpectedErrors, ellipse_errors, expected_errors
from hovercontrol.control.analysis.frequency import Bode, Nyquist, bode, nyquist
from hovercontrol.control.analysis.intervals import clopper_pearson
from hovercontrol.control.analysis.iss import (
    IssGain,
    iss_gain,
    lyapunov_gain,
    mismatch,
    peak_gain,
    simulated_errors,
)
from hovercontrol.control.analysis.loop_modes import OutsideModes
from hovercontrol.control.analysis.lyapunov import (
    Decay,
    LyapunovFunction,
    decay,
    fastest_beta,
    lyapunov_function,
)
from hovercontrol.control.analysis.observability import Gramian, SlidingGramian, observability_gramian
from hovercontrol.control.analysis.open_loop import loop_gain
from hovercontrol.control.analysis.packet_loss import PacketLoop, packet_loop, packet_loop_along
from hovercontrol.control.analysis.regions import Axis, Region, axis, mesh, sweep_map
from hovercontrol.control.analysis.sensitivity_functions import Sensitivity, sensitivity
from hovercontrol.control.analysis.stability_margins import (
    FrozenMargins,
    Margins,
    loop_margins,
    margins,
    margins_along,
)
from hovercontrol.control.analysis.stabilizability import Stabilizability, stabilizability
from hovercontrol.control.analysis.steering import steering_map, turning_modes
from hovercontrol.control.analysis.zero_dynamics import ZeroDynamics, predict, zero_dynamics

__all__ = [
    "Direction", "Excitation", "FunctionSet", "excitation", "signals_of",
    "Gramian", "SlidingGramian", "observability_gramian",
    "ExpectedErrors", "expected_errors", "ellipse_errors",
    "NormalForm", "normal_form", "LyapunovFunction", "lyapunov_function", "Decay", "decay", "fastest_beta",
    "Axis", "axis", "Region", "mesh", "sweep_map", "clopper_pearson",
    "ZeroDynamics", "zero_dynamics", "predict",
    "IssGain", "iss_gain", "mismatch", "peak_gain", "lyapunov_gain", "simulated_errors",
    "Margins", "FrozenMargins", "OutsideModes", "loop_margins", "margins", "margins_along",
    "Bode", "bode", "Nyquist", "nyquist", "Sensitivity", "sensitivity", "loop_gain",
    "PacketLoop", "packet_loop", "packet_loop_along",
    "Stabilizability", "stabilizability",
    "steering_map", "turning_modes",
]  # fmt: skip
