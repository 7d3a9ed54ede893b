"""C17 (18)-(19): which beta the Lyapunov function admits, and what decay it guarantees."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from hovercontrol.base.boundary import checked
from hovercontrol.base.tables import positive
from hovercontrol.control.analysis.lyapunov import decay, fastest_beta, lyapunov_function
from hovercontrol.control.analysis.output import Progress, quiet, save
from hovercontrol.control.analysis.regions import Region, axis, mesh
from hovercontrol.documents.printed import rebuilds


@checked
def beta_region(
    k1: float = 2.0,
    k2: tuple[float, float] = (0.05, 8.0),
    beta: tuple[float, float] = (0.01, 1.6),
    points: int = 200,
) -> Region:
    """Return which beta is admissible for each k2 at a given k1, and what decay it guarantees.

    Parameters
    ----------
    k1 : float, optional
        Position gain [1/s^2].
    k2, beta : tuple of float, optional
        Ranges [1/s].
    points : int, optional
        Along each axis.

    Returns
    -------
    Region
        Maps ``guaranteed`` (decay of the errors) [1/s] and ``admissible``; lines (18), (19), fastest beta.

    Raises
    ------
    InputError
        If a gain is not positive or a range is none.

    Examples
    --------
    >>> region = beta_region(points=10)
    >>> sorted(region.maps), float(region.maps["admissible"].mean().round(2))
    (['admissible', 'guaranteed'], 0.62)
    """
    k1 = positive("k1", k1)
    x = axis("k2", "1/s", k2, points, "velocity gain k2")
    y = axis("beta", "1/s", beta, points)
    ks, betas = mesh(x, y)
    found = decay(k1, ks, betas)
    shape = (points, points)
    inside = found.admissible.reshape(shape)
    rate = np.where(inside, found.guaranteed.reshape(shape), np.nan)
    along = decay(k1, x.values)
    return Region(
        f"C17: admissible beta and the decay it guarantees, k1 = {k1:g} 1/s^2",
        x,
        y,
        {"guaranteed": rate, "admissible": inside},
        units={"guaranteed": "1/s"},
        labels={"guaranteed": "guaranteed decay of the errors", "admissible": "V and W definite"},
        lines={
            "(18): beta < k1^(1/2), V positive definite": (x.values, along.bound_18),
            "(19): beta < 4 k1 k2/(4 k1 + k2^2), W positive definite": (x.values, along.bound_19),
            "fastest: guaranteed = true decay": (x.values, fastest_beta(k1, x.values)),
        },
    )


def main(out: Path, progress: Progress = quiet, *, k1: float = 2.0, points: int = 200) -> list[Path]:
    """Draw the admissible beta over k2 at one k1, beside the decay rate over beta at k2 = k1."""
    region = beta_region(k1, points=points)
    figure = Figure(figsize=(11.0, 6.0), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.6, 1.0))
    region.plot(axes=left)
    k2 = k1
    best = decay(k1, k2)
    beta = np.linspace(1e-3, 1.0, 400) * float(best.bound_19)
    right.plot(beta, decay(k1, k2, beta).guaranteed, "k-", label="guaranteed by V and W")
    right.axhline(float(best.true), color="black", ls="--", label="true: slowest pole of the error equation")
    right.axvline(float(best.bound_19), color="black", ls=":", label="(19)")
    right.set(xlabel="beta [1/s]", ylabel="decay rate of the errors [1/s]", ylim=(0.0, None))
    right.set_title(f"k1 = {k1:g} 1/s^2, k2 = {k2:g} 1/s", fontsize=10)
    right.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), frameon=False, fontsize="small")
    progress(1.0)
    findings = [
        f"(18)^2 - (19)^2 = {lyapunov_function().margin()}, never negative: (19) implies (18).",
        f"At k1 = {k1:g} 1/s^2, k2 = {k2:g} 1/s: beta < {float(best.bound_19):.4g} 1/s is admissible; "
        f"beta = {float(best.beta):.4g} 1/s guarantees a decay of {float(best.guaranteed):.4g} 1/s, the true "
        f"rate is {float(best.true):.4g} 1/s.",
        "With the best beta, min(k2/2, 2 k1/k2), the guaranteed rate is the true one for all gains.",
    ]
    return save(out, "c17_beta_region", figure, {"c17_beta_region": region.save}, findings)


@rebuilds("c17", "eq 19", lacks="C17 states both bounds; that (18) follows from (19) is ours")
def eq_19(folder: Path) -> Mapping[str, float]:
    """Whether (19) implies (18), at random gains."""
    k1, k2 = np.random.default_rng(0).uniform(0.01, 20.0, (2, 10_000))
    found = decay(k1, k2)
    return {
        "gains of 10,000 at which (18) is the tighter bound": float(np.sum(found.bound_18 < found.bound_19))
    }
