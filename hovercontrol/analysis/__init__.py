"""Analyses of Blocks: stability, observability, margins, regions."""

from hovercontrol.analysis.c17.arm_region import arm_region
from hovercontrol.analysis.c17.experiment_design import ExpectedErrors, ellipse_errors, expected_errors
from hovercontrol.analysis.c17.gains import beta_region, gain_region
from hovercontrol.analysis.c17.interconnection import clopper_pearson, region_of_attraction
from hovercontrol.analysis.c17.iss import (
    IssGain,
    iss_gain,
    lyapunov_gain,
    mismatch,
    peak_gain,
    simulated_errors,
)
from hovercontrol.analysis.c17.lyapunov import Decay, LyapunovFunction, decay, fastest_beta, lyapunov_function
from hovercontrol.analysis.c17.normal_form import NormalForm, normal_form
from hovercontrol.analysis.c17.zero_dynamics import ZeroDynamics, predict, zero_dynamics
from hovercontrol.analysis.common.directions import Direction
from hovercontrol.analysis.common.excitation import Excitation, FunctionSet, excitation, signals_of
from hovercontrol.analysis.common.frequency import Bode, Nyquist, bode, nyquist
from hovercontrol.analysis.common.loop_gain import loop_gain
from hovercontrol.analysis.common.loop_modes import OutsideModes
from hovercontrol.analysis.common.margins import FrozenMargins, Margins, loop_margins, margins, margins_along
from hovercontrol.analysis.common.observability import Gramian, SlidingGramian, observability_gramian
from hovercontrol.analysis.common.packet_loss import PacketLoop, packet_loop, packet_loop_along
from hovercontrol.analysis.common.regions import Axis, Region, axis
from hovercontrol.analysis.common.regions import mesh as mesh
from hovercontrol.analysis.common.regions import sweep_map as sweep_map
from hovercontrol.analysis.common.sensitivity import Sensitivity, sensitivity
from hovercontrol.analysis.common.stabilizability import Stabilizability, stabilizability
from hovercontrol.analysis.common.steering import steering_map, turning_modes
from hovercontrol.analysis.k06.basins import turn_basins
from hovercontrol.analysis.k06.law_regions import forward_region, reverse_region

__all__ = [
    "Direction", "Excitation", "FunctionSet", "excitation", "signals_of",
    "Gramian", "SlidingGramian", "observability_gramian",
    "ExpectedErrors", "expected_errors", "ellipse_errors",
    "NormalForm", "normal_form", "LyapunovFunction", "lyapunov_function", "Decay", "decay", "fastest_beta",
    "Axis", "axis", "Region", "beta_region", "gain_region",
    "ZeroDynamics", "zero_dynamics", "predict", "arm_region",
    "IssGain", "iss_gain", "mismatch", "peak_gain", "lyapunov_gain", "simulated_errors",
    "forward_region", "reverse_region",
    "clopper_pearson", "region_of_attraction",
    "turn_basins", "Margins", "FrozenMargins", "OutsideModes", "loop_margins", "margins", "margins_along",
    "Bode", "bode", "Nyquist", "nyquist", "Sensitivity", "sensitivity", "loop_gain",
    "PacketLoop", "packet_loop", "packet_loop_along",
    "Stabilizability", "stabilizability",
    "steering_map", "turning_modes",
]  # fmt: skip
