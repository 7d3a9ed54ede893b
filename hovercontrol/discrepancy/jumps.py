"""When something jumps: a time that no slope leads to."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from scipy.optimize import minimize_scalar

from hovercontrol.discrepancy.fit import SMALL, Fit
from hovercontrol.discrepancy.search import Search
from hovercontrol.effects import Shape


def timed(search: Search, found: Fit) -> Fit:
    """Return a fit with the time of each jump where its cost is least.

    No slope leads there. Candidates have it to a row at best, from short windows not even that; half a
    row costs more than a small effect brings.
    """
    for e in found.model.effects:
        key = next((k for k, n in e.numbers.items() if isinstance(n, Shape) and n.of == "time"), None)
        if key is not None:
            found = _jump(search, found, e.name, key)
    return found


def _jump(search: Search, found: Fit, name: str, key: str) -> Fit:
    """Return a fit whose jump is where the cost is least: downhill in growing steps, then by Brent."""
    fits = {found.model.effect(name).values[key]: found}

    def cost(at: float) -> float:
        best = min(fits.values(), key=lambda f: f.cost)
        e = best.model.effect(name)
        at = float(np.clip(at, e.numbers[key].lower, e.numbers[key].upper))
        if at not in fits:
            fits[at] = search.fit(best.model.with_effects([type(e)(**{**e.values, key: at})]), best)
        return fits[at].cost

    (begin,) = fits
    row = float(np.median(found.response.dt))
    if max(abs(cost(begin + side) - found.cost) for side in (-0.5 * row, 0.5 * row)) < SMALL:
        return min(fits.values(), key=lambda f: f.cost)  # such windows do not tell when
    precise = {"xtol": 0.02 * row / max(begin, row), "maxiter": 6}
    with suppress(RuntimeError):  # no bracket
        minimize_scalar(cost, (begin, begin + 0.5 * row), method="brent", options=precise)
    return min(fits.values(), key=lambda f: f.cost)
