"""The heading of a body from its rotation: a quaternion or a rotation vector.

The heading is the angle about the vertical axis from a horizontal axis of the frame to the same axis of the
body, projected on the floor. This is the x axis if y or z is up (for z it is the yaw angle of roll, pitch and
yaw), and the y axis if x is up. The heading is positive by the right-hand rule about the axis that points up:
for ``z-up`` from x to y, for ``y-up`` from x to -z.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from hovercontrol.core.units import conversion_factor
from hovercontrol.errors import InputError
from hovercontrol.logs.log import Floats


@dataclass(frozen=True)
class QuaternionLimits:
    """Threshold for four columns that are not a quaternion.

    No published source. Logs round components to three decimals at worst, which changes the length by 0.002.

    Attributes
    ----------
    length : float
        Largest difference of the length of a quaternion from 1; a length of 0 is a lost sample.
    """

    length: float = 0.1


#: The values in use.
QUATERNION = QuaternionLimits()


def parse_up(text: str) -> tuple[int, float]:
    """Return the index of the vertical axis (0, 1, 2) and the sign of the heading about it.

    Examples
    --------
    >>> parse_up("y-up"), parse_up("z-down")
    ((1, 1.0), (2, -1.0))
    """
    plain = text.strip().removeprefix("-")
    sign = -1.0 if text.strip().startswith("-") else 1.0
    return "xyz".index(plain[0]), sign if plain.endswith("up") else -sign


@dataclass
class Heading:
    """Computes the heading from rotations, piece by piece; it is continuous over full turns.

    Attributes
    ----------
    file : str
        For error messages.
    names : tuple of str
        Four columns: qx, qy, qz, qw, the scalar last. Three: a rotation vector [rad].
    up : tuple of int and float
        See :func:`parse_up`.
    units : sequence of str
        Units of the columns.
    """

    file: str
    names: tuple[str, ...]
    up: tuple[int, float]
    units: Sequence[str]
    last: float = float("nan")

    def values(self, parts: list[pa.Array], row: int) -> Floats:
        """Return the heading [rad] of each row; NaN where a component is missing.

        Raises
        ------
        InputError
            If the components are not a quaternion.
        """
        raw = [p.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False) for p in parts]
        scales = [conversion_factor(unit, "rad") if unit and len(raw) == 3 else 1.0 for unit in self.units]
        # A rotation vector rho of angle a = |rho| is the quaternion [rho sin(a/2) / a, cos(a/2)].
        q = np.array([values * scale for values, scale in zip(raw, scales, strict=True)], dtype=float)
        if len(q) == 3:
            angle = np.linalg.norm(q, axis=0)
            q = np.vstack([0.5 * np.sinc(angle / (2.0 * np.pi)) * q, np.cos(angle / 2.0)])
        length = np.linalg.norm(q, axis=0)
        q[:, length == 0.0] = np.nan
        off = np.flatnonzero(np.abs(length - 1.0) > QUATERNION.length)
        off = off[length[off] > 0.0]
        if off.size:
            raise InputError(
                f"{self.file}: row {row + off[0] + 1}, columns {', '.join(self.names)}: expected a "
                f"quaternion of length 1, found length {length[off[0]]:.4g}"
            )
        axis, sign = self.up
        # Rotation matrix R of q, x_i = R_ik b_k. For z up: psi = atan2(R_10, R_00),
        # R_10 = 2 (q_x q_y + q_w q_z),  R_00 = q_w^2 + q_x^2 - q_y^2 - q_z^2; other axes likewise, with the
        # sign `turn`.
        first = 1 if axis == 0 else 0
        x, y, w = q[first], q[3 - first - axis], q[3]
        z = q[axis]
        turn = 1.0 if (axis, first) in ((2, 0), (0, 1)) else -1.0  # first x second = turn up
        psi = turn * np.arctan2(2.0 * (x * y + turn * w * z), w * w + x * x - y * y - z * z)
        return self._unwrapped(sign * psi)

    def _unwrapped(self, psi: Floats) -> Floats:
        known = np.flatnonzero(np.isfinite(psi))
        if known.size:
            start = [self.last] if np.isfinite(self.last) else []
            whole = np.unwrap(np.concatenate([start, psi[known]]))
            psi[known] = whole[len(start) :]
            self.last = float(whole[-1])
        return psi
