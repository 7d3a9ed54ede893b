"""Analyses of Blocks and of what logs can tell about them."""

from hovercontrol.analysis.basins import turn_basins
from hovercontrol.analysis.directions import Direction
from hovercontrol.analysis.excitation import Excitation, FunctionSet, excitation, signals_of
from hovercontrol.analysis.experiment_design import ExpectedErrors, ellipse_errors, expected_errors
from hovercontrol.analysis.gains import beta_region, gain_region
from hovercontrol.analysis.interconnection import clopper_pearson, region_of_attraction
from hovercontrol.analysis.iss import IssGain, iss_gain, lyapunov_gain, mismatch, peak_gain, simulated_errors
from hovercontrol.analysis.law_regions import forward_region, reverse_region
from hovercontrol.analysis.lyapunov import Decay, LyapunovFunction, decay, fastest_beta, lyapunov_function
from hovercontrol.analysis.margins import FrozenMargins, Margins, loop_margins, margins, margins_along
from hovercontrol.analysis.normal_form import NormalForm, normal_form
from hovercontrol.analysis.observability import Gramian, SlidingGramian, observability_gramian
from hovercontrol.analysis.packet_loss import PacketLoop, packet_loop, packet_loop_along
from hovercontrol.analysis.regions import Axis, Region, axis
from hovercontrol.analysis.stabilizability import Stabilizability, stabilizability
from hovercontrol.analysis.zero_dynamics import ZeroDynamics, arm_region, predict, zero_dynamics

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
    "turn_basins", "Margins", "FrozenMargins", "loop_margins", "margins", "margins_along",
    "PacketLoop", "packet_loop", "packet_loop_along",
    "Stabilizability", "stabilizability",
]  # fmt: skip
