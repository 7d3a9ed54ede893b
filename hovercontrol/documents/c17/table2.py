"""C17 Table II: how its three errors depend on P0, R, noise and drag, of which the paper prints only R."""

from __future__ import annotations

import csv
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.base.short_repr import short_repr
from hovercontrol.control.analysis.output import Progress, quiet, save
from hovercontrol.documents.c17.mean_errors import mean_errors
from hovercontrol.documents.printed import printed
from hovercontrol.documents.scenarios import Scenario, load_scenario

#: The error that the paper states with the estimator on [m].
PRINTED = printed("c17", "table 2")["mean error, estimator on"].value


@dataclass(frozen=True, eq=False)
class TableTwo:
    """Mean tracking errors [m] of the three phases over what is not printed; see :func:`table_two`.

    Attributes
    ----------
    seeds : int
        Runs of each point, with different noise.
    P0 : ndarray, shape (p,)
        Initial variances of the coefficients.
    R : ndarray, shape (s,)
        Factors on the printed R.
    search : ndarray, shape (p, s, seeds)
        Error with the estimator on.
    position_noise, heading_noise : ndarray, shapes (n,), (h,)
        [m, rad]
    noise : ndarray, shape (n, h, seeds, 3)
    factor : ndarray, shape (f,)
        On the drag coefficients of the craft, c1 to c6.
    fitted : ndarray, shape (f, seeds, 2)
        Errors before the estimator, with the drag of both phases at that factor.
    estimated : ndarray, shape (2, p, seeds)
        Error with the estimator on, where it estimates all eight coefficients, and only c1 to c6.
    """

    seeds: int
    P0: Array
    R: Array
    search: Array
    position_noise: Array
    heading_noise: Array
    noise: Array
    factor: Array
    fitted: Array
    estimated: Array

    __repr__ = short_repr

    @property
    def least(self) -> float:
        """The least P0 tried that leaves the printed error with each seed, R as printed; NaN if none does."""
        met = (self.search[:, np.argmin(np.abs(self.R - 1.0))] < PRINTED).all(axis=-1)
        return float(self.P0[met][0]) if met.any() else float("nan")


def table_two(
    scenario: Scenario | None = None,
    *,
    P0: ArrayLike = (0.01, 0.1, 1.0, 10.0, 100.0, 1000.0),
    R: ArrayLike = (0.1, 1.0, 10.0),
    position_noise: ArrayLike = (0.0, 3e-4, 1e-3, 3e-3),
    heading_noise: ArrayLike = (0.0, 1e-3, 2e-3, 5e-3),
    factor: ArrayLike = (1.0, 1.05, 1.1, 1.13, 1.2, 1.25, 1.3),
    seeds: int = 4,
    progress: Progress = quiet,
) -> TableTwo:
    """Return how the three errors of C17's Table II depend on what the paper does not print.

    Parameters
    ----------
    scenario : Scenario, optional
        Default ``table2``.
    P0, R, position_noise, heading_noise, factor : array_like, optional
        What is tried; of P0 and R every pair, of the noises, too.
    seeds : int, optional
        Runs of each point, with different noise.
    progress : callable, optional
        Called with the share that is done.
    """
    scenario = load_scenario("table2") if scenario is None else scenario
    seed = np.arange(1.0, seeds + 1.0)
    p, r, pn, hn, f = (np.asarray(v, dtype=float) for v in (P0, R, position_noise, heading_noise, factor))
    R_printed = (scenario.estimator or {})["R"]
    given: dict[str, Array] = {"sensor.seed": seed}
    given |= {f"estimator.R[{i},{i}]": r[:, None] * v for i, v in enumerate(R_printed)}
    search = mean_errors(scenario, given | _variances(p[:, None, None], 3, 11))[..., 2]
    progress(0.4)
    noise = mean_errors(
        scenario,
        {
            "sensor.seed": seed,
            "sensor.position_noise": pn[:, None, None],
            "sensor.heading_noise": hn[:, None],
        },
    )
    progress(0.7)
    fitted = np.array([mean_errors(_with_drag(scenario, v), {"sensor.seed": seed})[..., :2] for v in f])
    progress(0.8)
    drag = list((scenario.controller or {})["adapt"])
    six = replace(scenario, estimator={**(scenario.estimator or {}), "estimate": drag})
    few = mean_errors(six, {"sensor.seed": seed} | _variances(p[:, None], 3, 9))[..., 2]
    return TableTwo(
        seeds, p, r, search, pn, hn, noise, f, fitted,
        np.array([search[:, np.argmin(np.abs(r - 1.0))], few]),
    )  # fmt: skip


def _variances(values: Array, first: int, last: int) -> dict[str, Array]:
    """Return the initial variances of the coefficients, by the estimator's states."""
    return {f"computer.estimator.last_P[{i},{i}]": values for i in range(first, last)}


def _with_drag(scenario: Scenario, factor: float) -> Scenario:
    phases = [replace(p, scale=dict.fromkeys(p.scale, factor)) for p in scenario.phases]
    return replace(scenario, phases=tuple(phases))


#: Line styles of curves side by side.
LINES = ("k-", "k--", "k:", "k-.")


def main(out: Path, progress: Progress = quiet, *, seeds: int = 4, **tried: Any) -> list[Path]:
    """Draw the error with the estimator on over P0 and over the noise, and the two before over the drag."""
    found = table_two(seeds=seeds, progress=progress, **tried)
    figure = Figure(figsize=(12.0, 8.5), layout="constrained")
    axes = figure.subplots(2, 2)
    _search(found, axes[0, 0])
    _estimated(found, axes[0, 1])
    _noise(found, axes[1, 0])
    _drag(found, axes[1, 1])
    figure.suptitle(f"C17 Table II: mean tracking errors, each point the mean of {seeds} noise seeds")
    progress(1.0)
    return save(out, "c17_table2", figure, {"c17_table2": lambda path: _table(found, path)}, _said(found))


def _said(found: TableTwo) -> list[str]:
    """Return what was found, in words."""
    one = np.argmin(np.abs(found.R - 1.0))
    eight, six = found.estimated.mean(axis=-1)
    fitted = found.fitted.mean(axis=1)
    row = [f"  P0 = {p:g}: {found.search[k, one].mean():.3f} m" for k, p in enumerate(found.P0)]
    noise = found.noise.mean(axis=2)
    listed = [
        f"  {1e3 * a:g} mm, {1e3 * b:g} mrad: {' / '.join(f'{v:.3f}' for v in noise[i, j])} m"
        for i, a in enumerate(found.position_noise)
        for j, b in enumerate(found.heading_noise)
    ]
    return [
        "The first two errors are fitted: by the factors on c1 to c6 of the craft, which the paper does not "
        f"print. With factor {found.factor[0]:g} they are {fitted[0, 0]:.4f} and {fitted[0, 1]:.4f} m. Only "
        "the third, with the estimator on, is a test.",
        f"Error from 65 to 100 s, estimator on from 60 s, R as printed, by P0 (paper: under {PRINTED:g} m):",
        *row,
        f"P0 = {found.least:g} is the least tried that leaves less than {PRINTED:g} m with each of "
        f"{found.seeds} seeds.",
        "That is where the filter estimates all eight coefficients, of which the controller takes c1 to c6 "
        f"({eight.min():.3f} to {eight.max():.3f} m). Where c7 and c8 are known and only c1 to c6 are "
        f"estimated, it leaves {six.min():.3f} to {six.max():.3f} m with every P0 tried.",
        "The noise of the motion capture is not printed. Errors of the three phases by noise of position and "
        "heading:",
        *listed,
    ]


def _search(found: TableTwo, axes: Axes) -> None:
    for k, scale in enumerate(found.R):
        axes.loglog(found.P0, found.search[:, k].mean(axis=-1), LINES[k], marker=".", label=f"{scale:g}")
    _limit(axes)
    axes.set(xlabel="P0 of the coefficients [their units squared]", ylabel="mean error 65-100 s [m]")
    axes.set_title("estimator on at 60 s; curves: factor on the printed R", fontsize=10)
    axes.legend(title="factor on R", fontsize=8)


def _estimated(found: TableTwo, axes: Axes) -> None:
    for k, label in enumerate(("all eight coefficients", "c1 to c6, c7 and c8 known")):
        axes.loglog(found.P0, found.estimated[k].mean(axis=-1), LINES[k], marker=".", label=label)
    _limit(axes)
    axes.set(xlabel="P0 of the coefficients [their units squared]", ylabel="mean error 65-100 s [m]")
    axes.set_title("what is estimated, R as printed", fontsize=10)
    axes.legend(fontsize=8)


def _noise(found: TableTwo, axes: Axes) -> None:
    for k, heading in enumerate(found.heading_noise):
        mean = found.noise[:, k, :, 2].mean(axis=-1)
        label = f"heading {1e3 * heading:g} mrad"
        axes.plot(1e3 * found.position_noise, mean, LINES[k], marker=".", label=label)
    _limit(axes)
    axes.set(xlabel="noise of the position [mm]", ylabel="mean error 65-100 s [m]", ylim=(0.0, None))
    axes.set_title("noise of the motion capture, not printed", fontsize=10)
    axes.legend(fontsize=8)


def _drag(found: TableTwo, axes: Axes) -> None:
    for k, (label, said) in enumerate((("10-30 s", 0.10), ("40-60 s", 0.20))):
        axes.plot(found.factor, found.fitted[:, :, k].mean(axis=-1), LINES[k], marker=".", label=label)
        axes.axhline(said, color="0.6", linewidth=0.8)
    axes.set(xlabel="factor on c1 to c6 of the craft [1]", ylabel="mean error, controller nominal [m]")
    axes.set_title("what fits the first two errors; grey: printed (0.10, almost 0.20 m)", fontsize=10)
    axes.legend(fontsize=8)


def _limit(axes: Axes) -> None:
    axes.axhline(PRINTED, color="0.6", linewidth=0.8, label="printed: under 0.05 m")
    axes.grid(alpha=0.3)


def _table(found: TableTwo, path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(
            ["what", "first [-, m]", "second [-, rad]", "nominal [m]", "altered [m]", "estimator_on [m]"]
        )
        for i, p in enumerate(found.P0):
            for j, r in enumerate(found.R):
                rows.writerow(["P0, factor on R", p, r, "", "", f"{found.search[i, j].mean():.5f}"])
        for i, a in enumerate(found.position_noise):
            for j, b in enumerate(found.heading_noise):
                rows.writerow(["noise", a, b, *(f"{v:.5f}" for v in found.noise[i, j].mean(axis=0))])
        for i, f in enumerate(found.factor):
            rows.writerow(
                ["factor on c1..c6", f, "", *(f"{v:.5f}" for v in found.fitted[i].mean(axis=0)), ""]
            )
