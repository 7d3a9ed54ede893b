"""The speed of sound in air, for ultrasonic ranges (K06 section 5.5.3).

O. Cramer, "The variation of the specific heat ratio and the speed of sound in air with temperature, pressure,
humidity, and CO2 concentration", J. Acoust. Soc. Am. 93(5), 1993, K06's reference 27: equations (14) and
(15).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hovercontrol.base.arguments import broadcastable
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError

#: Of Cramer's (15), a0 ... a15: powers of the temperature [degree Celsius] by columns; plain, times the mole
#: fraction of water, the pressure [Pa], the mole fraction of carbon dioxide by rows.
_BY_TEMPERATURE = (
    (331.5024, 0.603055, -0.000528),
    (51.471935, 0.1495874, -0.000782),
    (-1.82e-7, 3.73e-8, -2.93e-10),
    (-85.20931, -0.228525, 5.91e-5),
)
_SQUARES = (-2.835149, -2.15e-13, 29.179762, 0.000486)

#: Where Cramer's polynomial holds [degree Celsius].
COLDEST, WARMEST = 0.0, 30.0


@checked
def speed_of_sound(
    temperature: ArrayLike,
    *,
    humidity: ArrayLike = 0.5,
    pressure: ArrayLike = 101_325.0,
    carbon_dioxide: ArrayLike = 4e-4,
) -> NDArray[np.float64]:
    """Return the speed of sound in air [m/s]; arguments broadcast.

    Parameters
    ----------
    temperature : array_like
        [degree Celsius], 0 to 30.
    humidity : array_like, optional
        Relative, 0 to 1.
    pressure : array_like, optional
        [Pa]
    carbon_dioxide : array_like, optional
        Mole fraction.

    Raises
    ------
    InputError
        If a temperature or a humidity is out of its range, or shapes do not go together.

    Examples
    --------
    A range of 2.7 m is 4.9 mm too short if the air is 1 degree warmer than it is taken for:

    >>> cold, warm = speed_of_sound([20.0, 21.0])
    >>> round(float(cold), 1), round(float(2700 * (1 - cold / warm)), 1)
    (344.0, 4.9)
    """
    t, h, p, c = broadcastable(
        "speed_of_sound",
        temperature=temperature,
        humidity=humidity,
        pressure=pressure,
        carbon_dioxide=carbon_dioxide,
    )
    for what, values, low, high in (("temperature", t, COLDEST, WARMEST), ("humidity", h, 0.0, 1.0)):
        if not ((values >= low) & (values <= high)).all():
            raise InputError(f"{what}: expected {low:g} to {high:g}, found {np.ravel(values)[0]:g}")
    kelvin = t + 273.15
    vapour = np.exp(1.2811805e-5 * kelvin**2 - 1.9509874e-2 * kelvin + 34.04926034 - 6.3536311e3 / kelvin)
    water = h * (1.00062 + 3.14e-8 * p + 5.6e-7 * t**2) * vapour / p
    plain, wet, pressed, carbon = (a + b * t + d * t**2 for a, b, d in _BY_TEMPERATURE)
    bend = _SQUARES[0] * water**2 + _SQUARES[1] * p**2 + _SQUARES[2] * c**2 + _SQUARES[3] * water * p * c
    found: NDArray[np.float64] = np.asarray(plain + wet * water + pressed * p + carbon * c + bend)
    return found
