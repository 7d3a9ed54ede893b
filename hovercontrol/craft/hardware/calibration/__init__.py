"""Calibration of the actuators: coefficients with errors and lookup tables from bench data (K06 4.3).

Fits come as :class:`Fit`: coefficients, standard errors, residuals, ``.plot()``.
"""

from hovercontrol.craft.hardware.calibration.bench import (
    FanCalibration,
    read_fan_bench,
    thrust_table_from_bench,
)
from hovercontrol.craft.hardware.calibration.fits import (
    fit_inertia,
    fit_reverse_ratio,
    fit_rudder,
    fit_thrust,
    mean_inertia,
)
from hovercontrol.craft.hardware.calibration.result import Axis, Fit

__all__ = [
    "fit_thrust",
    "fit_rudder",
    "fit_reverse_ratio",
    "fit_inertia",
    "mean_inertia",
    "Fit",
    "Axis",
    "thrust_table_from_bench",
    "read_fan_bench",
    "FanCalibration",
]
