"""Links between craft and controller: delay lines, random delays, lost packets."""

from hovercontrol.blocks.delay_line import constant_delay
from hovercontrol.craft.hardware.links.constant import k06_downlink, k06_uplink
from hovercontrol.craft.hardware.links.csma import Csma
from hovercontrol.craft.hardware.links.distributions import BoundedDelays, Delays
from hovercontrol.craft.hardware.links.failsafe import failsafe
from hovercontrol.craft.hardware.links.table_5_1 import TABLE_5_1, bluetooth_delays
from hovercontrol.craft.hardware.links.wireless import empirical_delay, lossy_link

__all__ = [
    "BoundedDelays",
    "Csma",
    "Delays",
    "TABLE_5_1",
    "bluetooth_delays",
    "constant_delay",
    "empirical_delay",
    "failsafe",
    "k06_downlink",
    "k06_uplink",
    "lossy_link",
]
