"""Whether an effect that scored well is worth its numbers, from fits that are taken to their ends."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hovercontrol.discrepancy.candidates import Scored, Scores, Signatures, candidates, zoom
from hovercontrol.discrepancy.fit import Fit, fit
from hovercontrol.discrepancy.jumps import timed
from hovercontrol.discrepancy.search import Search
from hovercontrol.discrepancy.weighing import (
    DOUBTFUL,
    EXPLAINED,
    SETTLED,
    are_kin,
    by_chance,
    charged,
    least_gain,
    less,
)
from hovercontrol.errors import InputError

#: Effects at most that are fitted to find the best.
MOST_TRIES = 4

#: Times at most that a fit is begun again where it stopped.
AGAIN = 3

#: Times at most that sub-steps are halved, and the part of a gain by which that may move a cost.
FINER, MATTERS = 4, 0.25

#: How much more than its due an effect must bring beside process noise that no score asked for.
FAR = 2.0

#: Part of an effect's likeliest size at which it changes next to nothing.
FAINT = 1e-3


def add(search: Search, current: Fit, worth: Sequence[Scored], most: float = np.inf) -> tuple[Fit, bool]:
    """Return the fit with the effect that takes most, and whether it takes enough, to a cost of `most`.

    Where the craft may stick or slip a fit can hang, and a coarse step costs likelihood: a small gain is
    counted again, in finer steps, from the best of several fits without the effect. They begin where that
    with it ended, in short windows, and at the coefficients given; from there that with it begins again.
    """
    tries: list[tuple[Scored, Fit]] = []
    for scored in worth[:MOST_TRIES]:
        explained = tries and min(f.chi2_per_dof for _, f in tries) < SETTLED
        kin = are_kin(scored.candidate.trial, worth[0].candidate.trial)
        if tries and scored.gain < (0.9 if explained and not kin else 0.4) * worth[0].gain:
            continue
        search.progress(f"trying {scored.candidate.name}")
        near = zoom(current, scored)
        new = timed(search, search.fit(current.model.with_effects([near.effect]), current))
        if new.cost > current.cost and near.candidate.amplitudes:  # it hung: begin where nothing is added
            faint = near.candidate.at((FAINT * near.parts).tolist())
            new = min(new, search.fit(current.model.with_effects([faint]), current), key=lambda f: f.cost)
        if not new.noise.has_process and not (new.converged and new.chi2_per_dof < SETTLED):
            new = _from_given(search, current, near, from_short(search, new))
        tries.append((near, new))
    if not tries:
        return current, False
    scored, new = min(tries, key=lambda t: charged(t[1]) + by_chance(t[1], current))
    cost = new.cost + by_chance(new, current)
    gain = current.cost - cost
    if gain > least_gain(scored) and (gain < DOUBTFUL or _may_hang(search, current)):
        current, new = _checked(search, current, scored, new)
        cost = new.cost + by_chance(new, current)
    if not cost < min(current.cost - least_gain(scored), most):
        if not current.noise.has_process:
            search.tried = scored, new
        return current, False
    return _taken(search, scored, new)


def _may_hang(search: Search, current: Fit) -> bool:
    """Whether what is left of the misfit may be that of a fit that hung: short windows see none."""
    return current.windowed.length > search.rungs[0] and current.chi2_per_dof < EXPLAINED


def _checked(search: Search, current: Fit, scored: Scored, new: Fit) -> tuple[Fit, Fit]:
    """Return fits without and with an effect from several starts, in steps too fine to matter to its gain."""
    for k in range(FINER):
        before = current.cost
        new = search.fit(new.model, new, finer=2)
        current = search.fit(current.model, new)
        if k == 0 and not current.noise.has_process:
            current, new = _both_ended(search, current, new, scored.candidate.name)
        gain = current.cost - new.cost - by_chance(new, current)
        if gain < least_gain(scored) or abs(before - current.cost) < MATTERS * gain:
            break
    return current, new


def _both_ended(search: Search, current: Fit, new: Fit, name: str) -> tuple[Fit, Fit]:
    """Return the likeliest fits without and with an effect, each from several starts."""
    starts = (
        current.model.with_coefficients(search.model.coefficients()),
        less(new.model, name),
    )
    tries = [from_short(search, current), *(search.fit(model, current) for model in starts)]
    least = ended(search, min(tries, key=lambda f: f.cost))
    if least.cost > current.cost - 1.0:
        return current, new
    both = ended(search, search.fit(least.model.with_effects([new.model.effect(name)]), least))
    return least, min(new, both, key=lambda f: f.cost)


def _taken(search: Search, scored: Scored, new: Fit) -> tuple[Fit, bool]:
    """Note that an effect is named, and return its fit."""
    search.tried = None
    search.found.steps.append((scored.candidate.name, scored.gain))
    search.found.effects.append(scored.candidate.name)
    return new, True


def again(search: Search, current: Fit) -> tuple[Fit, bool]:
    """Try beside process noise what without it took most: no score tells what is far from linear."""
    if search.tried is None:
        return current, False
    scored, plain = search.tried
    search.tried = None
    new = search.fit(plain.model, plain, noise=current.noise)
    if current.cost - new.cost - by_chance(new, current) < FAR * least_gain(scored):
        return current, False
    return _taken(search, scored, new)


def from_short(search: Search, hung: Fit) -> Fit:
    """Return the better of a fit, taken to its end, and one that comes to its windows from short ones."""
    if not hung.converged:
        hung = ended(search, hung)
        if hung.converged and hung.chi2_per_dof < SETTLED:
            return hung
    if hung.windowed.length == search.rungs[0]:
        return hung
    new = fit(hung.model, search.data, search.rungs[0], search.plain, prior_model=search.model)
    for length in search.rungs[1:]:
        if length <= hung.windowed.length:
            new = search.fit(new.model, new, length=length)
    return min(hung, new, key=lambda f: f.cost)


def _from_given(search: Search, current: Fit, scored: Scored, hung: Fit) -> Fit:
    """Return the better of a fit with an effect and one that begins at the coefficients given.

    Where the fit without the effect hung, its coefficients make up for what lacks. The effect begins with
    the size that shorter windows see beside the given ones.
    """
    length = current.windowed.length
    if length == search.rungs[0]:
        return hung
    shorter = search.rungs[search.rungs.index(length) - 1]
    given = current.model.with_coefficients(search.model.coefficients())
    try:
        start = search.fit(given, current, length=shorter, frozen=True)
        there = candidates(start, [scored.candidate.name])
        best = zoom(start, Scores(start, Signatures(start, there)).best()[0])
        new = ended(search, search.fit(given.with_effects([best.effect]), start, length=length))
    except InputError:  # from there it runs away
        return hung
    return min(hung, new, key=lambda f: f.cost)


def ended(search: Search, found: Fit) -> Fit:
    """Return a fit that is taken to its end: kinks of dry friction may stop one before."""
    for _ in range(AGAIN):
        if found.converged:
            break
        found = min(found, search.fit(found.model, found), key=lambda f: f.cost)
    return found
