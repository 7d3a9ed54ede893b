"""Controllers as Blocks."""

from hovercontrol.controllers.integral import lqi
from hovercontrol.controllers.pid_controller import pid
from hovercontrol.controllers.scheduled import gain_scheduled
from hovercontrol.controllers.state_feedback import lqr, place
from hovercontrol.controllers.tracking import tracking_controller

__all__ = ["gain_scheduled", "lqi", "lqr", "pid", "place", "tracking_controller"]
