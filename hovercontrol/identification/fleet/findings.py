"""What the results of all logs say together: coefficients by craft, changes over time, missing effects."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from hovercontrol.base.arrays import Array
from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.fleet import trends
from hovercontrol.identification.fleet.random_effects import (
    LEVEL,
    Craftwise,
    flagged,
    q_values,
    random_effects,
)
from hovercontrol.identification.fleet.trends import Trend

Result = Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Coefficient:
    """One coefficient in all craft.

    Attributes
    ----------
    name, unit : str
    craft : tuple of str
        The craft whose logs determine it, in the order of the arrays of `of`.
    logs : tuple of int
        Number of logs of each.
    of : Craftwise
    q : ndarray, shape (m,)
        False discovery rate at which each craft is set apart; NaN where that was not tested.
    q_differ : float
        The same, of any difference between craft.
    trends : mapping of str to Trend
        Significant changes over time, by craft.
    unlike : tuple of int
        Indices of results whose logs are unlike their neighbours in time.
    """

    name: str
    unit: str
    craft: tuple[str, ...]
    logs: tuple[int, ...]
    of: Craftwise
    q: Array
    q_differ: float
    trends: Mapping[str, Trend] = field(default_factory=dict)
    unlike: tuple[int, ...] = ()

    @property
    def off(self) -> tuple[str, ...]:
        """The craft that do not belong to the others."""
        return tuple(
            c for c, q, in_ in zip(self.craft, self.q, self.of.belongs, strict=True) if q <= LEVEL and not in_
        )

    @property
    def few(self) -> bool:
        """Whether its craft are several, and too few to set one apart by the others."""
        return len(self.craft) > 1 and not np.isfinite(self.q).any()

    @property
    def differs(self) -> bool:
        """Whether it differs between craft that are few; many craft of one kind always differ a little."""
        return self.few and self.q_differ <= LEVEL


def coefficients(results: Sequence[Result]) -> list[Coefficient]:
    """Return every coefficient that logs determine, with what differs between craft and over time."""
    names: dict[str, str] = {}
    for r in results:
        names |= {c["name"]: c["unit"] for c in r.get("coefficients", ()) if c["std"] is not None}
    found = [one for name, unit in names.items() if (one := _coefficient(name, unit, results)) is not None]
    # the false discovery rate is that of all coefficients and craft together
    q = iter(
        np.split(
            q_values(np.concatenate([c.of.p for c in found] or [np.empty(0)])),
            np.cumsum([len(c.craft) for c in found]),
        )
    )
    differ = q_values(np.array([c.of.p_differ for c in found]))
    significant = _significant(found)
    return [
        replace(
            c,
            q=next(q),
            q_differ=float(differ[k]),
            trends={n: t for n, t in c.trends.items() if (c.name, n) in significant},
        )
        for k, c in enumerate(found)
    ]


def scattered(results: Iterable[Result]) -> list[tuple[str, str, Array, str]]:
    """Return what differs between logs of one craft that are too few for a change over time.

    If all n logs had one value, the sum of their squared deviations over their variances would be chi-squared
    of n - 1 degrees of freedom. The level is shared by all tests (Bonferroni).

    Returns
    -------
    list of (str, str, ndarray, str)
        Craft, coefficient, its values in the logs, and their unit.
    """
    rows: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for r in results:
        for c in r.get("coefficients", ()):
            if c["std"]:
                rows.setdefault((r["craft"], c["name"]), []).append(c)
    few = {key: own for key, own in rows.items() if 1 < len(own) < trends.LEAST}
    found = []
    for (craft, name), own in few.items():
        y, std = (np.array([c[key] for c in own]) for key in ("value", "std"))
        mean = np.average(y, weights=std**-2)
        if stats.chi2.sf((((y - mean) / std) ** 2).sum(), y.size - 1) <= LEVEL / len(few):
            found.append((craft, name, y, own[0]["unit"]))
    return found


def _significant(found: Sequence[Coefficient]) -> set[tuple[str, str]]:
    every = [(c.name, craft) for c in found for craft in c.trends]
    p = np.array([c.trends[craft].p for c in found for craft in c.trends])
    return {one for one, ok in zip(every, flagged(p), strict=True) if ok}


class _Estimates:
    """What all logs say of one coefficient, an entry for each log that determines it."""

    def __init__(self, name: str, results: Sequence[Result]) -> None:
        every = [
            (k, r, c) for k, r in enumerate(results) for c in r.get("coefficients", ()) if c["name"] == name
        ]
        every = [(k, r, c) for k, r, c in every if c["std"] and c["noise_std"]]
        self.row = [k for k, _, _ in every]
        self.names = sorted({r["craft"] for _, r, _ in every})
        self.craft = np.array([self.names.index(r["craft"]) for _, r, _ in every], dtype=int)
        self.y, self.noise, self.std = (
            np.array([c[key] for *_, c in every]) for key in ("value", "noise_std", "std")
        )
        dates = [r["time"] for _, r, _ in every]
        if all(t is None for t in dates):  # the order of names, in each craft
            dates = [int((self.craft[:k] == i).sum()) for k, i in enumerate(self.craft)]
        self.time = np.array([np.nan if t is None else t for t in dates], dtype=float)
        self.dated = np.isfinite(self.time)

    def changes(self, d: Array, use: NDArray[np.bool_], dof: int) -> dict[str, Trend]:
        """Return the likeliest change of each craft that has enough logs."""
        found = {}
        for i, name in enumerate(self.names):
            own = np.flatnonzero((self.craft == i) & self.dated & use)
            own = own[np.argsort(self.time[own], kind="stable")]
            change = trends.trend(self.y[own], d[own], self.time[own], dof)
            if change is not None:
                found[name] = change
        return found


def _coefficient(name: str, unit: str, results: Sequence[Result]) -> Coefficient | None:
    of = _Estimates(name, results)
    if not of.row:
        return None
    dated = of.dated
    omega, dof = trends.scatter(of.y[dated], of.noise[dated] ** 2, of.craft[dated], of.time[dated])
    # Without several logs of a craft their scatter is not known: the error of other readings stands in.
    variance = of.noise**2 if dof else of.std**2
    d = variance + omega**2
    p = np.full(of.y.size, np.nan)
    p[dated] = trends.outlying(of.y[dated], d[dated], of.craft[dated], of.time[dated], dof)
    unlike = flagged(p)
    changes = of.changes(d, ~unlike, dof)
    use = ~unlike | ~np.isin(of.craft, of.craft[~unlike])  # a craft keeps its logs if all are unlike
    y, v, craft, varies = of.y[use], variance[use], of.craft[use], np.full(use.sum(), dof > 0)
    for one, change in changes.items():
        if change.p * len(of.names) <= LEVEL:  # one value, that at the end
            i = of.names.index(one)
            rest = craft != i
            y, v = np.r_[y[rest], change.now], np.r_[v[rest], change.now_std**2]
            craft, varies = np.r_[craft[rest], i], np.r_[varies[rest], False]
    found = random_effects(y, v, craft, varies)
    logs = tuple(np.bincount(of.craft, minlength=len(of.names)).tolist())
    outliers = tuple(of.row[k] for k in np.flatnonzero(unlike))
    return Coefficient(name, unit, tuple(of.names), logs, found, found.p, found.p_differ, changes, outliers)


# ---- missing effects --------------------------------------------------------------------------------------


def by_craft(results: Sequence[Result]) -> dict[str, list[Result]]:
    """Return the results of the logs that could be used, by craft, in order of the craft's names."""
    found: dict[str, list[Result]] = {}
    for r in sorted((r for r in results if "refused" not in r), key=lambda r: str(r["craft"])):
        found.setdefault(r["craft"], []).append(r)
    return found


def lacking(results: Sequence[Result]) -> dict[str, list[str]]:
    """Return the craft that lack each effect: it is among the likeliest in more than half of their logs."""
    found: dict[str, list[str]] = {}
    for craft, own in by_craft(results).items():
        counts: dict[str, int] = {}
        for r in own:
            for name in {e["name"] for e in r["missing"]}:
                counts[name] = counts.get(name, 0) + 1
        for name in sorted(n for n, count in counts.items() if 2 * count > len(own)):
            found.setdefault(name, []).append(craft)
    return found


def common(results: Sequence[Result]) -> list[str]:
    """Return the effects that more than half of the craft lack: faults of the model, not of a craft."""
    craft = len(by_craft(results))
    return [name for name, own in lacking(results).items() if 2 * len(own) > craft]


def middle_values(name: str, results: Sequence[Result]) -> dict[str, float]:
    """Return the medians over logs of the fitted numbers of an effect."""
    every = [e["values"] for r in results for e in r.get("missing", ()) if e["name"] == name]
    return {key: float(np.median([v[key] for v in every])) for key in every[0]}


def suspects(results: Sequence[Result]) -> dict[str, list[Result]]:
    """Return the craft that lack an effect more often than the others, with the logs that show it.

    The number of logs with a missing effect is compared with the rate in the other craft, at least the
    level at which a name is false: the upper tail of the binomial distribution.
    """
    every = by_craft(results)
    named = {craft: [r for r in own if r["missing"]] for craft, own in every.items()}
    rate = {craft: len(named[craft]) / len(own) for craft, own in every.items()}
    usual = [c for c in every if rate[c] <= 0.5] or list(every)
    found = {}
    for craft, own in every.items():
        others = [c for c in usual if c != craft]
        k, n = sum(len(named[c]) for c in others), sum(len(every[c]) for c in others)
        p = stats.binom.sf(len(named[craft]) - 1, len(own), max(CRITERIA.level, k / n if n else 0.0))
        if named[craft] and p <= LEVEL:
            found[craft] = sorted(named[craft], key=lambda r: -r["gain"])
    return found


def left(results: Iterable[Result]) -> dict[str, tuple[float, float, str]]:
    """Return for each equation the missing acceleration of all logs, that seen (rms), and the unit."""
    every: dict[str, list[Mapping[str, Any]]] = {}
    for r in results:
        for equation, one in r.get("remaining", {}).items():
            every.setdefault(equation, []).append(one)
    found = {}
    for equation, own in every.items():
        rms, seen = (float(np.sqrt(np.mean([o[key] ** 2 for o in own]))) for key in ("rms", "seen"))
        found[equation] = (rms, seen, own[0]["unit"])
    return found
