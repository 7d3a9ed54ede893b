"""FMUs: a Block for everyone else's tools, and everyone else's models as python-control systems."""

from typing import TYPE_CHECKING, Any

from hovercontrol.fmi.exporter.export import export_fmu

if TYPE_CHECKING:
    from hovercontrol.fmi.importer.imported import load

__all__ = ["export_fmu", "load"]


def __getattr__(name: str) -> Any:
    """Import what needs python-control and FMPy (1 s) only when it is asked for."""
    if name == "load":
        from hovercontrol.fmi.importer.imported import load

        return load
    raise AttributeError(f"module 'hovercontrol.fmi' has no attribute {name!r}")
