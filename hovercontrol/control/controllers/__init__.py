"""Controllers as Blocks."""

from hovercontrol.control.controllers.integral import lqi
from hovercontrol.control.controllers.pid_controller import pid
from hovercontrol.control.controllers.scheduled import gain_scheduled
from hovercontrol.control.controllers.state_feedback import lqr, place
from hovercontrol.control.controllers.tracking import tracking_controller

__all__ = ["gain_scheduled", "lqi", "lqr", "pid", "place", "tracking_controller"]
