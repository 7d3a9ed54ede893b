"""Controllers as Blocks."""

from hovercontrol.controllers.tracking import tracking_controller

__all__ = ["tracking_controller"]
