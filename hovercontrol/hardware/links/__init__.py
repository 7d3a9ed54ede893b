"""Links between craft and controller: delay lines, random delays, lost packets."""

from hovercontrol.core.delay_line import constant_delay
from hovercontrol.hardware.links.constant import k06_downlink, k06_uplink
from hovercontrol.hardware.links.csma import Csma
from hovercontrol.hardware.links.distributions import BoundedDelays, Delays
from hovercontrol.hardware.links.failsafe import failsafe
from hovercontrol.hardware.links.measured import MeasuredDelays, read_delays
from hovercontrol.hardware.links.table_5_1 import TABLE_5_1, bluetooth_delays
from hovercontrol.hardware.links.wireless import empirical_delay, lossy_link

__all__ = [
    "BoundedDelays",
    "Csma",
    "Delays",
    "MeasuredDelays",
    "TABLE_5_1",
    "bluetooth_delays",
    "constant_delay",
    "empirical_delay",
    "failsafe",
    "k06_downlink",
    "k06_uplink",
    "lossy_link",
    "read_delays",
]
