"""A monitor that runs beside a craft and says what has changed."""

from hovercontrol.identification.monitor.monitor import monitor

__all__ = ["monitor"]
