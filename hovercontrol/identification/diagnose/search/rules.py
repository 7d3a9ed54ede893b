"""What is asked of a fitted effect before it may be named."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from hovercontrol.identification.diagnose.criteria import Criteria
from hovercontrol.identification.diagnose.evidence.blocks import Blocks
from hovercontrol.identification.diagnose.evidence.sensors import only_noise
from hovercontrol.identification.diagnose.search.candidates import catalogue
from hovercontrol.identification.diagnose.search.fit import Search, Tried
from hovercontrol.identification.diagnose.search.trace import Decision
from hovercontrol.identification.engine.excitation import EXCITATION


def passes(t: Tried, looked_at: int, criteria: Criteria) -> bool:
    """Return whether an effect passes all tests: gain, agreement of blocks, the same size in all blocks."""
    return not why_not(t, looked_at, criteria)


def why_not(t: Tried, looked_at: int, criteria: Criteria) -> str:
    """Return the reason why an effect is not named; empty if it may be named."""
    return next((reason for row, reason in tested(t, looked_at, criteria) if not row.passed), "")


def tested(t: Tried, looked_at: int, criteria: Criteria) -> list[tuple[Decision, str]]:
    """Return the tests of an effect, each with the reason to tell if it fails.

    Where the fit with the effect leaves only noise, likelihood alone decides. Where something else remains,
    the effect could stand for a part of it, so blocks must also agree on its sign and size.

    Parameters
    ----------
    t : Tried
    looked_at : int
        Number of candidates among which it was chosen.
    criteria : Criteria
    """
    left = not only_noise(t.fit, criteria)
    rows = tests_of(t.name, t.gain, t.numbers, t.blocks, looked_at, criteria, left, t.effect.flexible)
    if key := untold(t):
        rule = "numbers of it that the logs tell nothing of, at most"
        rows.append(
            (Decision("confirm", t.name, rule, 1.0, 0.0, False), f"the logs tell nothing of its {key}")
        )
    return rows


def untold(t: Tried) -> str:
    """Return a number of a fitted effect of which the logs tell nothing; empty if there is none.

    An effect in a limit of one of its numbers is another one: a hysteresis whose play exceeds all commands is
    a gain.
    """
    fit, e = t.fit, t.effect
    std, known = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0)), np.einsum("wjj->j", fit.S)
    for key in e.numbers:
        name = e.parameter(key)
        if name not in fit.problem.names or name == e.friction_width():
            continue
        j = fit.problem.names.index(name)
        if not known[j] > 0.0 or std[j] > EXCITATION.no_information * abs(fit.p[j]) > 0.0:
            return key
    return ""


def tests_of(
    name: str,
    gain: float,
    numbers: int,
    b: Blocks,
    looked_at: int,
    criteria: Criteria,
    left: bool,
    flexible: bool = False,
) -> list[tuple[Decision, str]]:
    """Return the tests of an effect with so much gain and agreement of blocks; see :func:`tested`.

    Parameters
    ----------
    name : str
    gain : float
        Reduction of twice the negative log likelihood.
    numbers : int
        Number of unknowns of the effect.
    b : Blocks
    looked_at : int
        Number of candidates among which it was chosen.
    criteria : Criteria
    left : bool
        Whether the fit with the effect leaves more than noise.
    flexible : bool, optional
        Whether it has so many numbers that it could stand for others.
    """

    def row(rule: str, value: float, limit: float, passed: bool, reason: str) -> tuple[Decision, str]:
        return Decision("confirm", name, rule, float(value), float(limit), bool(passed)), reason

    asked = criteria.least + criteria.each * numbers
    reason = f"gains {gain:.3g} in twice the log likelihood, {asked:g} are asked for"
    rows = [row("gain in twice the log likelihood, at least", gain, asked, gain >= asked, reason)]
    if not left:
        return rows
    if flexible:
        rule = "an effect of many numbers must leave only noise"
        rows.append(row(rule, math.nan, math.nan, False, "its many numbers do not explain all"))
    p, spread = criteria.level / max(looked_at, 1), criteria.spread(looked_at)
    reason = f"segments of the logs do not agree on it (t = {b.t:.1f}, {b.same_sign} of {b.n} with its sign)"
    rows.append(row("p-value of its size over segments, at most", b.p_value, p, b.p_value <= p, reason))
    if b.n >= criteria.blocks:
        reason = f"its size differs from segment to segment by {100 * b.spread:.0f} %"
        rule = "spread of its size from segment to segment, at most"
        rows.append(row(rule, b.spread, spread, b.spread <= spread, reason))
    return rows


def passes_all_tests(search: Search, t: Tried, looked_at: int) -> bool:
    """Return whether an effect passes all tests, each of which becomes a row of the trace."""
    rows = [row for row, _ in tested(t, looked_at, search.criteria)]
    search.trace.extend(rows)
    return all(row.passed for row in rows)


def candidate_count(search: Search, t: Tried, known: Iterable[Tried], looked_at: int) -> int:
    """Return the number of candidates among which an effect is chosen.

    Once a drag along an axis passes all tests, something is known to be missing there. Another drag along
    that axis is then chosen among these few, any other effect among all candidates.
    """
    if not any(t.name != o.name and t.effect.kin(o.effect) for o in known):
        return looked_at
    return sum(cls.axis == t.effect.axis for cls in catalogue(search.model, search.names))


def is_redundant(t: Tried, simpler: Tried, criteria: Criteria) -> bool:
    """Whether an effect of many numbers contains a simpler one that leaves only noise."""
    return t.effect.flexible and t.effect.becomes(simpler.effect) and only_noise(simpler.fit, criteria)
