"""How far a model is from a motion: predictions over half a second, its coefficients fitted again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hovercontrol.craft.models.model import Model

if TYPE_CHECKING:
    from .disturbances import Motion

Array = NDArray[np.float64]

#: Length of a window, longest step of Runge-Kutta within it [s].
SECONDS, STEP = 0.5, 0.005


#: Effects that shift commands by a time.
LATE = ("input_delay", "time_offset", "fan_delay")


def late(model: Model) -> float:
    """Return how late the commands of a craft show in its log [s]."""
    return sum(e.values["seconds"] for e in model.effects if e.name in LATE)


def misfit(
    model: Model, motions: Sequence[Motion], channels: Sequence[str], noise: Mapping[str, float]
) -> float:
    """Return the root mean square error of predictions, in standard deviations of the noise.

    Each window starts at the true states; the model's coefficients are first moved, to first order, to where
    that error is least. Zero for the model that made the motions.
    """
    parts = [_errors(model, motion, channels, noise) for motion in motions]
    error, slopes = (np.concatenate(rows, axis=-1) for rows in zip(*parts, strict=True))
    moved, *_ = np.linalg.lstsq(slopes.T, error, rcond=1e-8)
    return float(np.sqrt(np.mean((error - slopes.T @ moved) ** 2)))


def _errors(
    model: Model, motion: Motion, channels: Sequence[str], noise: Mapping[str, float]
) -> tuple[Array, Array]:
    """Return the errors in all windows, shape (n,), and the predictions' slopes by coefficients (k, n)."""
    block = model.plant(late=True)
    derivatives, outputs = block.to_numpy().array_derivatives, block.to_numpy().array_outputs
    t, drive = motion.drive.time, motion.drive
    dt = t[1] - t[0]
    rows, pieces = round(SECONDS / dt), max(1, round(dt / STEP))
    starts = np.arange(0, t.size - rows, rows)
    keys = [f"plant.{name}" for name in model.coefficients() if not name.endswith(("_width", "_seconds"))]
    order = list(block.default_parameters)
    values = np.array(list(block.default_parameters.values()))
    keys = [key for key in keys if key in order]
    steps = np.array([1e-4 * max(abs(values[order.index(key)]), 0.1) for key in keys])
    p = np.repeat(values[:, None, None], len(keys) + 1, axis=1)
    for k, key in enumerate(keys):
        p[order.index(key), k + 1] += steps[k]
    shape = (len(keys) + 1, starts.size)
    x = np.array([np.broadcast_to(motion.states[s.name][starts], shape) for s in block.states])
    labels = [s.name for s in block.outputs]
    picked = [labels.index(f"{c}_measured" if f"{c}_measured" in labels else c) for c in channels]
    h = dt / pieces
    delay = late(model)

    def rates(at: Array, x: Array, u: Array) -> Array:
        return np.array([np.broadcast_to(d, shape) for d in derivatives(at, x, u, p)])

    found = []
    for row in range(rows):
        for piece in range(pieces):
            at = t[starts + row] + piece * h
            held = np.searchsorted(t, at + 0.5 * h - delay, side="right") - 1
            u = np.array(
                [np.where(held >= 0, drive.commands[s.name][np.maximum(held, 0)], 0.0) for s in block.inputs]
            )
            k1 = rates(at, x, u)
            k2 = rates(at + h / 2, x + h / 2 * k1, u)
            k3 = rates(at + h / 2, x + h / 2 * k2, u)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + rates(at + h, x + h * k3, u))
        y = outputs(t[starts + row + 1], x, u, p)
        predicted = np.array([np.broadcast_to(y[k], shape) for k in picked])
        true = np.array([motion.seen[c][starts + row + 1] for c in channels])
        sigma = np.array([noise[c] for c in channels])[:, None]
        found.append(
            np.stack([(true - predicted[:, 0]) / sigma, *_slopes(predicted, sigma, steps)])
        )  # (1 + k, channels, windows)
    all_rows = np.stack(found, axis=-1).reshape(len(keys) + 1, -1)
    return all_rows[0], all_rows[1:]


def _slopes(predicted: Array, sigma: Array, steps: Array) -> list[Array]:
    return [(predicted[:, k + 1] - predicted[:, 0]) / sigma / step for k, step in enumerate(steps)]
