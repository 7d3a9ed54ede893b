"""The parts of an autopilot that can be exported by name, each with the defaults of its function."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from hovercontrol.blocks.block import Block
from hovercontrol.control.autopilot import autopilot, error_model
from hovercontrol.control.autopilot.limits import actuator_limits
from hovercontrol.control.autopilot.navigation import position_fix
from hovercontrol.control.controllers.k06 import turn
from hovercontrol.control.observers.ins import (
    aided_ins,
    coupled_filter,
    heading_filter,
    ins_mechanisation,
    range_filter,
    velocity_position_filter,
)
from hovercontrol.craft.hardware import actuators, links, sensors
from hovercontrol.craft.hardware.sensors.ranging import K06_UNITS
from hovercontrol.craft.models.motion import RUDDER, THRUST

#: What goes over a link that stands alone.
_COMMANDS = (THRUST.replace(unit="N", description="force of the propeller"), RUDDER)
#: From message to message of K06's two ways [s].
_WAYS = {"uplink": 0.02, "downlink": 0.006, "round_trip": 0.02}


@dataclass(frozen=True)
class Part:
    """A function of the package that makes a Block, and arguments that differ from its defaults.

    ``text`` is added to the first line of the function's docstring.
    """

    function: Callable[..., Block]
    given: dict[str, Any] = field(default_factory=dict)
    text: str = ""

    def block(self, name: str) -> Block:
        """Return the Block under a name."""
        given = {key: v() if isinstance(v, partial) else v for key, v in self.given.items()}
        return self.function(**given).named(re.sub(r"\W", "_", name))

    @property
    def says(self) -> str:
        """Description in one line."""
        line = (inspect.getdoc(self.function) or "").partition("\n")[0].rstrip(".").removeprefix("Return ")
        line = re.sub(r":\w+:`~?([^`]*)`", r"\1", line)
        return f"{line}; {self.text}" if self.text else line


_BEACONS = partial(sensors.k06_beacons)

#: By name.
PARTS: dict[str, Part] = {
    "force_command": Part(actuators.force_command),
    "saturation": Part(actuator_limits),
    "rudder_lookup": Part(actuators.rudder_lookup),
    "thrust_lookup": Part(actuators.thrust_lookup),
    "rudder_servo": Part(actuators.rudder_servo),
    "speed_controller": Part(actuators.speed_controller),
    "motor": Part(actuators.fan_motor, {"lag": 0.1}, "here with a time constant of 0.1 s"),
    "thrust_force": Part(actuators.thrust_force),
    "variable_pitch": Part(actuators.variable_pitch_propeller),
    "imu": Part(sensors.k06_imu),
    "gyro": Part(sensors.gyro_dynamics),
    "gyro_compensation": Part(sensors.gyro_compensation),
    "magnetometer": Part(sensors.k06_magnetometer),
    "magnetic_heading": Part(sensors.magnetic_heading),
    "cricket": Part(sensors.k06_cricket),
    "ranges": Part(sensors.cricket_ranges, {"beacons": _BEACONS}),
    "range_solver": Part(sensors.range_solver, {"beacons": _BEACONS}),
    "two_unit_heading": Part(sensors.two_unit_heading, {"units": K06_UNITS}),
    "mocap": Part(sensors.mocap),
    "position_fix": Part(position_fix),
    "navigation_errors": Part(error_model),
    "mechanisation": Part(ins_mechanisation),
    "heading_filter": Part(heading_filter),
    "velocity_position_filter": Part(velocity_position_filter),
    "aided_ins": Part(aided_ins),
    "coupled_filter": Part(coupled_filter),
    "range_filter": Part(range_filter, {"beacons": _BEACONS, "units": K06_UNITS}),
    "uplink": Part(links.k06_uplink, {"signals": _COMMANDS}),
    "downlink": Part(links.k06_downlink, {"signals": _COMMANDS}),
    "lossy_link": Part(
        links.lossy_link,
        {"signals": _COMMANDS, "loss": 0.1, "period": 0.02, "retransmissions": 2, "timeout": 0.005},
        "here 10 %, twice at most, 5 ms later",
    ),
    **{
        f"link_{row}": Part(
            links.empirical_delay,
            {
                "signals": _COMMANDS,
                "delays": partial(links.bluetooth_delays, row),
                "period": next(period for way, period in _WAYS.items() if row.endswith(way)),
            },
            f"K06 table 5.1, {mean:g} ms in the mean",
        )
        for row, (mean, *_) in links.TABLE_5_1.items()
    },
    "autopilot": Part(
        autopilot,
        {"law": partial(turn, k1=0.5, k2=3.5), "references": {"yaw_rate_ref": 3.0}, "start": {"r": 0.1}},
        "here a turn with K06's law and craft",
    ),
}
