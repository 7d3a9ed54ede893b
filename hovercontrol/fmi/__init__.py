"""FMUs and systems of FMUs (SSP): out, in, fitted to logs, corrected.

May import ``control``, ``craft``, ``logs``, ``blocks`` and ``base``. Begin with ``exporter/export.py`` and
``importer/imported.py``; ``replay/`` runs an FMU along logs, ``corrected/`` wraps effects around one. What
runs inside an FMU is C99 in ``fmu/``.
"""

from typing import TYPE_CHECKING, Any

from hovercontrol.fmi.corrected.corrected import corrected_fmu
from hovercontrol.fmi.exporter.export import export_fmu
from hovercontrol.fmi.ssp.write import export_ssp

if TYPE_CHECKING:
    from hovercontrol.fmi.importer.imported import load

__all__ = ["corrected_fmu", "export_fmu", "export_ssp", "load"]


def __getattr__(name: str) -> Any:
    """Import the parts that need python-control and FMPy (1 s) on first use."""
    if name == "load":
        from hovercontrol.fmi.importer.imported import load

        return load
    raise AttributeError(f"module 'hovercontrol.fmi' has no attribute {name!r}")
