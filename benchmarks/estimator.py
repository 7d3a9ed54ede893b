"""One sample through the sampled estimator of a rudder craft: 3 measured states, 8 coefficients."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from hovercontrol.control.observers import SampledEstimator
from hovercontrol.craft.models.vehicles import vehicle


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    estimator = SampledEstimator(vehicle("c17_experiment").plant(), dt=0.01)
    samples = np.random.default_rng(4).normal(size=(300, 5)).tolist()
    spent = []
    for _ in range(9):
        begin = time.perf_counter()
        for k, sample in enumerate(samples):
            estimator.step(0.01 * k, sample[:3], sample[3:])
        spent.append((time.perf_counter() - begin) / len(samples))
    yield "one step, median of 9 times 300", f"{1e6 * float(np.median(spent)):.0f} us", "", None
