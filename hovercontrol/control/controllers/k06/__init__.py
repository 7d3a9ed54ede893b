"""K06's controllers: laws on the body velocities, their references, and the actuation.

The laws (:mod:`.laws`) are continuous; the hybrid controllers of a heading (:mod:`.heading`) and of a pose
(:mod:`.origin`) are sampled and set the references of a law; :func:`setpoints` sets constant references, and
:func:`force_to_command` converts forces to commands.
"""

from hovercontrol.control.controllers.k06.heading import bang_bang_heading, proportional_heading
from hovercontrol.control.controllers.k06.laws import (
    both_ways,
    drive,
    forward,
    forward_alternate,
    reverse,
    stop,
    turn,
)
from hovercontrol.control.controllers.k06.origin import origin
from hovercontrol.control.controllers.k06.setpoints import setpoints
from hovercontrol.craft.hardware.actuators.force import force_driven, force_to_command

__all__ = [
    "bang_bang_heading",
    "both_ways",
    "drive",
    "force_driven",
    "force_to_command",
    "forward",
    "forward_alternate",
    "origin",
    "proportional_heading",
    "reverse",
    "setpoints",
    "stop",
    "turn",
]
