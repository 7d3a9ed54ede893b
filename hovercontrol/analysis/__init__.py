"""Analyses of Blocks and of what logs can tell about them."""

from hovercontrol.analysis.directions import Direction
from hovercontrol.analysis.excitation import Excitation, FunctionSet, excitation, signals_of
from hovercontrol.analysis.observability import Gramian, SlidingGramian, observability_gramian

__all__ = [
    "Direction", "Excitation", "FunctionSet", "excitation", "signals_of",
    "Gramian", "SlidingGramian", "observability_gramian",
]  # fmt: skip
