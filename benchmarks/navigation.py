"""How well a position is found from ranges: K06's table 5.2, Bancroft's solution, fixes of a unit at rest."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hovercontrol.craft.hardware.sensors import Beacons, corrected_range, k06_beacons, locate

Row = tuple[str, str, str, bool | None]

#: K06 table 5.2: true and measured ranges [m] under a beacon 2.7048 m up.
TRUE = (2.7048, 2.7465, 2.8784, 3.1232, 3.3020)
MEASURED = (2.7048, 2.7483, 2.8883, 3.1507, 3.3425)
HEIGHT = 2.7048

#: Noise of one range [m]: K06 prints none; this is the package's.
RANGE_NOISE = 0.0035


def rows() -> Iterator[Row]:
    off = np.abs(corrected_range(MEASURED, HEIGHT) - np.array(TRUE)).max()
    yield "table 5.2 after correction, worst", f"{1e3 * off:.2f} mm", "at most 1 mm", bool(off <= 1e-3)
    rng = np.random.default_rng(0)
    worst = 0.0
    for _ in range(3):  # each is a Block of its own
        beacons = Beacons(rng.uniform(-4, 4, (5, 2)), rng.uniform(1.5, 4.0, 5))
        place, bias = rng.uniform(-4, 4, (2, 3000)), rng.uniform(-0.1, 0.1, 3000)
        found = locate(_ranges(beacons, place) + bias, beacons, cone=(0.0, 0.0))
        worst = max(worst, float(np.abs(found - [*place, bias]).max()))
    yield "Bancroft, 3 times 3,000 random places, worst", f"{worst:.1e} m", "at most 1e-9 m", worst <= 1e-9
    beacons = k06_beacons()
    place = np.full((2, 20_000), 1.0)
    noisy = _ranges(beacons, place) + RANGE_NOISE * rng.normal(size=(4, 20_000))
    found = locate(noisy, beacons, cone=(0.0, 0.0))
    circle = float(np.median(np.hypot(*(found[:2] - place))))
    yield "half of all fixes of a unit at rest lie within", f"{1e2 * circle:.2f} cm", "about 0.5 cm", None


def _ranges(beacons: Beacons, place: np.ndarray) -> np.ndarray:
    at, up = np.array(beacons.positions), np.array(beacons.heights)
    away = place[:, None, :] - at.T[:, :, None]
    ranges: np.ndarray = np.sqrt((away**2).sum(axis=0) + up[:, None] ** 2)
    return ranges
