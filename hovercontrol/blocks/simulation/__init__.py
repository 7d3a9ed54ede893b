"""Simulation of Blocks in Python: integration between ticks, and runners for stepwise use."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hovercontrol.blocks.simulation.trajectory import simulate

__all__ = ["simulate"]


def __getattr__(name: str) -> Any:
    """Import :func:`simulate`, which needs python-control and SciPy, on first use."""
    if name == "simulate":
        from hovercontrol.blocks.simulation.trajectory import simulate

        return simulate
    raise AttributeError(f"module 'hovercontrol.blocks.simulation' has no attribute {name!r}")
