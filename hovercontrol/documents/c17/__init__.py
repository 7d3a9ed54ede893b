"""What is rebuilt of C17; importing it collects the items of its topics."""

from hovercontrol.documents.c17 import experiment, simulation, theory

__all__ = ["experiment", "simulation", "theory"]
