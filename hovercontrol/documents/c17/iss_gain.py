"""C17 Theorem 5 and (27): what wrong coefficients cost, by the input-to-state gain and simulated."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from hovercontrol.control.analysis import iss_gain, simulated_errors
from hovercontrol.control.analysis.output import Progress, quiet, save
from hovercontrol.craft.models.vehicles import c17_simulation


def main(
    out: Path, progress: Progress = quiet, *, sizes: int = 25, runs: int = 200, seed: int = 0
) -> list[Path]:
    """Draw the largest |z1| over the size of the coefficients' errors."""
    craft = c17_simulation()
    gain, size = iss_gain(craft), np.geomspace(0.01, 1.0, sizes)
    error = simulated_errors(craft, size, runs, seed=seed)
    exact = gain.error(1.0) * size
    guaranteed = exact * gain.guaranteed / gain.exact
    finite = np.where(np.isfinite(error), error, np.nan)
    worst = np.where(np.isnan(finite).all(axis=1), np.nan, np.nanmax(np.nan_to_num(finite, nan=-1.0), axis=1))
    figure = Figure(figsize=(7.5, 6.0), layout="constrained")
    axes = figure.subplots()
    axes.loglog(np.repeat(size, runs), finite.ravel(), ".", color="0.7", ms=3, label="simulated")
    axes.loglog(size, worst, "k.-", lw=0.8, label="simulated, worst")
    axes.loglog(size, exact, "k--", label="exact gain of the error equation, regressors of the ellipse")
    axes.loglog(size, guaranteed, "k:", label="gain guaranteed by V and W of Theorem 5")
    axes.set(
        xlabel="largest error of the coefficients c1..c6 [SI units]", ylabel="largest |z1| in 30 s [m]",
        title="C17 (27): tracking error caused by wrong coefficients",
    )  # fmt: skip
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), frameon=False, fontsize="small")
    lost = ~np.isfinite(error)
    first = size[lost.any(axis=1)]
    over = np.asarray((error > exact[:, None]).any(axis=1))
    findings = [
        gain.table(),
        f"All six wrong by e: |z1| <= {gain.error(1.0):.3g} e by the exact gain "
        f"({gain.exact:.3g} s^2 from d to z1), {gain.guaranteed / gain.exact:.2f} times that by V and W.",
        "The bound is one to first order: it is passed "
        + (f"from e = {size[over][0]:.2g} on; " if over.any() else f"nowhere up to e = {size[-1]:.2g}; ")
        + f"below, the worst loop reaches {np.max((worst / exact)[: first_over(over)]):.0%} of it.",
        f"{lost.sum()} of {error.size} loops spin away"
        + (f", the first at e = {first[0]:.2g}." if first.size else "."),
    ]
    progress(1.0)
    table = {
        "coefficient_error [SI]": size,
        "worst_z1 [m]": worst,
        "exact_gain [m]": exact,
        "guaranteed [m]": guaranteed,
        "lost": lost.sum(axis=1),
    }
    return save(out, "c17_iss_gain", figure, {"c17_iss_gain": table}, findings)


def first_over(over: NDArray[np.bool_]) -> int:
    """Return how many sizes come before the first that passes the bound."""
    return int(over.argmax()) if over.any() else len(over)
