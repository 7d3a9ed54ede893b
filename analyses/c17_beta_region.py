"""C17 (18)-(19): which beta the Lyapunov function admits, and what decay it guarantees."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from hovercontrol.analysis import decay, lyapunov_function
from hovercontrol.analysis.output import Progress, save, script
from hovercontrol.documents.c17.gains import beta_region


def main(out: Path, progress: Progress | None = None, *, k1: float = 2.0, points: int = 200) -> list[Path]:
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
    if progress:
        progress(1.0)
    findings = [
        f"(18)^2 - (19)^2 = {lyapunov_function().margin()}, never negative: (19) implies (18).",
        f"At k1 = {k1:g} 1/s^2, k2 = {k2:g} 1/s: beta < {float(best.bound_19):.4g} 1/s is admissible; "
        f"beta = {float(best.beta):.4g} 1/s guarantees a decay of {float(best.guaranteed):.4g} 1/s, the true "
        f"rate is {float(best.true):.4g} 1/s.",
        "With the best beta, min(k2/2, 2 k1/k2), the guaranteed rate is the true one for all gains.",
    ]
    return save(out, "c17_beta_region", figure, {"c17_beta_region": region.save}, findings)


if __name__ == "__main__":
    script(main, __doc__ or "")
