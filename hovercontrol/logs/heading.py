"""The heading of a body from its rotation: a quaternion, a rotation vector or Euler angles.

The heading is the angle about the vertical axis from a horizontal axis of the frame to the same axis of the
body, projected on the floor. This is the x axis if y or z is up (for z it is the yaw angle of roll, pitch and
yaw), and the y axis if x is up. The heading is positive by the right-hand rule about the axis that points up:
for ``z-up`` from x to y, for ``y-up`` from x to -z.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import pyarrow as pa
from scipy.spatial.transform import Rotation

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.units import conversion_factor
from hovercontrol.logs.log import Floats


@dataclass(frozen=True)
class RotationLimits:
    """Thresholds for columns that are not the rotation they are read as.

    No published source. Logs round components to three decimals at worst, which changes the length by 0.002.

    Attributes
    ----------
    length : float
        Largest difference of the length of a quaternion from 1; a length of 0 is a lost sample.
    tilt : float
        Largest tilt of a body [rad] that passes without a check of other readings.
    level : float
        Fraction of that tilt below which another reading is more plausible.
    """

    length: float = 0.1
    tilt: float = 0.35
    level: float = 0.25


#: The values in use.
ROTATION = RotationLimits()


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
class _Turned:
    """The turn of a body about one axis in a reading of its rotations: heading and tilt [rad]."""

    axis: int
    first: Floats | None = None
    last: float = float("nan")
    low: float = float("inf")
    high: float = -float("inf")
    level: float = 1.0

    def heading(self, q: Floats) -> Floats:
        """Return the heading about the axis, continuous over full turns, of quaternions of shape (4, n)."""
        # Rotation matrix R of q, x_i = R_ik b_k. For z up: psi = atan2(R_10, R_00),
        # R_10 = 2 (q_x q_y + q_w q_z),  R_00 = q_w^2 + q_x^2 - q_y^2 - q_z^2; other axes likewise, with the
        # sign `turn`.
        axis = self.axis
        first = 1 if axis == 0 else 0
        x, y, z, w = q[first], q[3 - first - axis], q[axis], q[3]
        turn = 1.0 if (axis, first) in ((2, 0), (0, 1)) else -1.0  # first x second = turn up
        psi = turn * np.arctan2(2.0 * (x * y + turn * w * z), w * w + x * x - y * y - z * z)
        known = np.flatnonzero(np.isfinite(psi))
        if known.size:
            start = [self.last] if np.isfinite(self.last) else []
            whole = np.unwrap(np.concatenate([start, psi[known]]))
            psi[known] = whole[len(start) :]
            self.last = float(whole[-1])
            self.low, self.high = min(self.low, whole.min()), max(self.high, whole.max())
            self._tilt(q[:, known])
        return psi

    def _tilt(self, q: Floats) -> None:
        # The vertical in the body's axes is a row of the matrix: R_ak = 2 (q_a q_k +- q_w q_j), k != a, and
        # R_aa = q_w^2 + q_a^2 - q_j^2 - q_k^2; the cosine of the tilt is its product with the first row's.
        a, j, k = self.axis, (self.axis + 1) % 3, (self.axis + 2) % 3
        w = q[3]
        up = np.array(
            [
                w * w + q[a] ** 2 - q[j] ** 2 - q[k] ** 2,
                2.0 * (q[a] * q[j] - w * q[k]),
                2.0 * (q[a] * q[k] + w * q[j]),
            ]
        ) / np.sum(q * q, axis=0)
        if self.first is None:
            self.first = up[:, 0]
        self.level = min(self.level, float((self.first @ up).min()))

    @property
    def tilt(self) -> float:
        """The largest angle [rad] of the vertical from that of the first row, in the body's axes."""
        return float(np.arccos(np.clip(self.level, -1.0, 1.0)))

    @property
    def turn(self) -> float:
        """The range of the heading [deg]."""
        return float(np.degrees(max(self.high - self.low, 0.0)))


@dataclass
class Heading:
    """Computes the heading from rotations, piece by piece; it is continuous over full turns.

    Attributes
    ----------
    file : str
        For error messages.
    names : tuple of str
        Four columns: qx, qy, qz, qw, the scalar last. Three: a rotation vector, or Euler angles.
    up : tuple of int and float
        See :func:`parse_up`.
    units : sequence of str
        Units of the columns; an empty unit of an angle is rad.
    euler : str
        Order of the axes of Euler angles about the axes of the body, such as ``xyz``; empty for a rotation
        vector.
    """

    file: str
    names: tuple[str, ...]
    up: tuple[int, float]
    units: Sequence[str]
    euler: str = ""
    _readings: dict[tuple[bool, int], _Turned] = field(default_factory=dict, repr=False)

    def begin(self) -> Callable[[list[pa.Array], range], Floats]:
        """Return :meth:`values` for a new pass through the file."""
        orders = (False, True) if len(self.names) == 4 else (False,)
        self._readings = {(first, axis): _Turned(axis) for first in orders for axis in range(3)}
        return self.values

    def values(self, parts: list[pa.Array], rows: range) -> Floats:
        """Return the heading [rad] of each row; NaN where a component is missing.

        Raises
        ------
        InputError
            If the components are not a quaternion.
        """
        raw = [p.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False) for p in parts]
        q = np.array(raw, dtype=float) if len(raw) == 4 else self._quaternion(raw)
        length = np.linalg.norm(q, axis=0)
        q[:, length == 0.0] = np.nan
        off = np.flatnonzero(np.abs(length - 1.0) > ROTATION.length)
        off = off[length[off] > 0.0]
        if off.size:
            raise InputError(
                f"{self.file}: row {rows.start + off[0] + 1}, columns {', '.join(self.names)}: expected a "
                f"quaternion of length 1, found length {length[off[0]]:.4g}"
            )
        axis, sign = self.up
        found = {
            key: turned.heading(q[[1, 2, 3, 0]] if key[0] else q) for key, turned in self._readings.items()
        }
        return sign * found[False, axis]

    def _quaternion(self, raw: list[Floats]) -> Floats:
        scale = [conversion_factor(unit or "rad", "rad") for unit in self.units]
        angles = np.array([values * factor for values, factor in zip(raw, scale, strict=True)], dtype=float)
        if not self.euler:
            # A rotation vector rho of angle a = |rho| is the quaternion [rho sin(a/2) / a, cos(a/2)].
            angle = np.linalg.norm(angles, axis=0)
            return np.vstack([0.5 * np.sinc(angle / (2.0 * np.pi)) * angles, np.cos(angle / 2.0)])
        # R = R_1(a_1) R_2(a_2) R_3(a_3): each rotation is about an axis of the body as turned before.
        q = np.full((4, angles.shape[1]), np.nan)
        known = np.isfinite(angles).all(axis=0)
        order = ["xyz".index(axis) for axis in self.euler]
        q[:, known] = Rotation.from_euler(self.euler.upper(), angles[order][:, known].T).as_quat().T
        return q

    def remark(self) -> str:
        """Return a text if another order of columns or another vertical leaves the body level."""
        axis, sign = self.up
        own = self._readings.get((False, axis))
        if own is None or own.tilt < ROTATION.tilt:
            return ""
        level = [key for key, turned in self._readings.items() if turned.tilt <= ROTATION.level * own.tilt]
        if not level:
            return ""
        first, up = min(level, key=lambda key: (key[1] != axis, self._readings[key].tilt))
        other = self._readings[first, up]
        names = [*self.names[1:], self.names[0]] if first else list(self.names)
        how = [*(["the scalar is first"] if first else []), *([f"{'xyz'[up]} is up"] if up != axis else [])]
        said = ",".join(names) + (f":{'-' if sign < 0 else ''}{'xyz'[up]}-up" if up != 2 or sign < 0 else "")
        return (
            f"column 'psi': the body tilts by {np.degrees(own.tilt):.0f} deg while psi turns by "
            f"{own.turn:.0f} deg; if {' and '.join(how)}, the attitude turns by {other.turn:.0f} deg "
            f"and the body tilts by {np.degrees(other.tilt):.0f} deg: --columns psi={said}"
        )
