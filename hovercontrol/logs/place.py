"""Positions on the floor from latitude and longitude: metres east and north of the first fix."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.units import conversion_factor
from hovercontrol.logs.log import Floats

#: Semi-major axis [m] and squared eccentricity of the ellipsoid (WGS 84, NGA.STND.0036).
_A, _E2 = 6_378_137.0, 6.694379990141316e-3

#: Largest latitude and longitude [deg].
_MOST = (90.0, 360.0)


@dataclass
class Place:
    """Computes the distance east or north of the first fix, piece by piece.

    Attributes
    ----------
    file : str
        For error messages.
    names : tuple of str
        Columns of latitude and longitude.
    units : tuple of str
        Their units.
    axis : str
        ``east`` or ``north``.
    """

    file: str
    names: tuple[str, str]
    units: tuple[str, str]
    axis: str
    origin: Floats | None = None

    def values(self, parts: list[pa.Array], rows: range) -> Floats:
        """Return the distance [m] of each row; NaN where there is no fix.

        Raises
        ------
        InputError
            If a value is no latitude or longitude.
        """
        raw = [p.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False) for p in parts]
        angles = np.array([v * conversion_factor(u, "rad") for v, u in zip(raw, self.units, strict=True)])
        for name, values, most in zip(self.names, np.degrees(angles), _MOST, strict=True):
            bad = np.flatnonzero(np.abs(values) > most)
            if bad.size:
                raise InputError(
                    f"{self.file}: row {rows.start + bad[0] + 1}, column {name!r}: expected degrees up to "
                    f"{most:g}, found {values[bad[0]]:g}; in another unit: --columns "
                    f"x=LAT:UNIT,LON:UNIT:{self.axis}"
                )
        angles[:, (raw[0] == 0.0) & (raw[1] == 0.0)] = np.nan  # receivers write 0, 0 before the first fix
        known = np.flatnonzero(np.isfinite(angles).all(axis=0))
        if self.origin is None and known.size:
            self.origin = angles[:, known[0]]
        if self.origin is None:
            return np.full(len(raw[0]), np.nan)
        east, north = local(*angles, *self.origin)
        return east if self.axis == "east" else north


def local(lat: Floats, lon: Floats, lat0: float, lon0: float) -> tuple[Floats, Floats]:
    """Return the distances east and north [m] of points of the ellipsoid in the plane tangent at another.

    Parameters
    ----------
    lat, lon : ndarray (n,)
        Geodetic latitude and longitude [rad].
    lat0, lon0 : float
        Those of the point of the plane [rad].

    Examples
    --------
    >>> east, north = local(np.radians([54.0, 54.001]), np.radians([10.001, 10.0]), *np.radians([54.0, 10.0]))
    >>> east.round(2).tolist(), north.round(2).tolist()
    ([65.58, 0.0], [0.0, 111.31])
    """
    # N = a / sqrt(1 - e^2 sin^2 lat);  X = N cos lat cos dlon,  Y = N cos lat sin dlon,
    # Z = N (1 - e^2) sin lat, with dlon = lon - lon0; east = Y, north = cos lat0 dZ - sin lat0 dX
    # (Misra and Enge, Global Positioning System, 4.A).
    radius, radius0 = (_A / np.sqrt(1.0 - _E2 * np.sin(p) ** 2) for p in (lat, lat0))
    x, y = (radius * np.cos(lat) * f(lon - lon0) for f in (np.cos, np.sin))
    z = radius * (1.0 - _E2) * np.sin(lat)
    dx, dz = x - radius0 * np.cos(lat0), z - radius0 * (1.0 - _E2) * np.sin(lat0)
    return y, np.cos(lat0) * dz - np.sin(lat0) * dx
