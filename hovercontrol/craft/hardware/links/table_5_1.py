"""K06's measured Bluetooth delays (table 5.1), as distributions for a link."""

from __future__ import annotations

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import check_known
from hovercontrol.craft.hardware.links.distributions import BoundedDelays

#: K06 table 5.1: mean, standard deviation, least and most [ms]. The name says the radio at the controller
#: (that of the craft is a Free2Move), the downlink's rate in kbit/s (the uplink's is 2.9), and the way.
TABLE_5_1: dict[str, tuple[float, float, float, float]] = {
    "linksys_41.0_uplink": (51.04, 15.09, 22, 118),
    "linksys_41.0_downlink": (39.02, 9.23, 20, 74),
    "linksys_41.0_round_trip": (95.48, 18.01, 58, 157),
    "free2move_41.0_uplink": (66.01, 10.22, 40, 102),
    "free2move_41.0_downlink": (95.36, 12.02, 59, 141),
    "free2move_41.0_round_trip": (160.21, 13.86, 124, 194),
    "linksys_22.0_uplink": (40.81, 10.61, 22, 90),
    "linksys_22.0_downlink": (34.32, 8.18, 19, 67),
    "linksys_22.0_round_trip": (77.54, 14.44, 46, 110),
    "free2move_22.0_uplink": (62.76, 11.13, 40, 106),
    "free2move_22.0_downlink": (100.01, 13.64, 53, 161),
    "free2move_22.0_round_trip": (162.98, 16.58, 113, 208),
    "linksys_16.2_uplink": (38.83, 8.80, 20, 68),
    "linksys_16.2_downlink": (32.62, 8.49, 14, 65),
    "linksys_16.2_round_trip": (75.69, 13.82, 49, 126),
}


@checked
def bluetooth_delays(name: str) -> BoundedDelays:
    """Return the distribution of the delays in one row of K06's table 5.1 (whole milliseconds).

    Parameters
    ----------
    name : str
        A key of :data:`TABLE_5_1`; K06's autopilot uses ``linksys_22.0_uplink`` and ``..._downlink``.

    Raises
    ------
    InputError
        If there is no such row; the message names the nearest one.

    Examples
    --------
    >>> bluetooth_delays("linksys_22.0_uplink").mean
    0.04081
    """
    check_known(name, TABLE_5_1, f"unknown row of table 5.1 {name!r}")
    return BoundedDelays(*(round(value / 1000, 6) for value in TABLE_5_1[name]))
