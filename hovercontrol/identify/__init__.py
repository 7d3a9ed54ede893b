"""Identification of a model's coefficients from logs, and how well the model then predicts them."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from hovercontrol.identify.measure import Measured, measure

if TYPE_CHECKING:
    from hovercontrol.identify.fit import identify
    from hovercontrol.identify.plot import plot_free_run
    from hovercontrol.identify.predict import FreeRun, Prediction, free_run, window_prediction
    from hovercontrol.identify.result import Fitted, Identified, Remaining

__all__ = [
    "identify", "Identified", "Fitted", "Remaining",
    "measure", "Measured",
    "free_run", "FreeRun", "window_prediction", "Prediction",
    "plot_free_run",
]  # fmt: skip

_MODULES = {
    "fit": ("identify",),
    "plot": ("plot_free_run",),
    "predict": ("free_run", "FreeRun", "window_prediction", "Prediction"),
    "result": ("Identified", "Fitted", "Remaining"),
}


def __getattr__(name: str) -> Any:
    """Import what is asked for: estimation reads logs by :mod:`.measure`, fits stand on estimation."""
    for module, names in _MODULES.items():
        if name in names:
            globals().update({n: getattr(import_module(f"{__name__}.{module}"), n) for n in names})
            return globals()[name]
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
