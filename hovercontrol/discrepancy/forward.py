"""Effect by effect, forward: in short windows, then in longer ones."""

from __future__ import annotations

from collections.abc import Sequence

from hovercontrol.discrepancy.adding import add, again, from_short
from hovercontrol.discrepancy.candidates import Scored, Scores, Signatures, candidates
from hovercontrol.discrepancy.fit import Fit, noise_of
from hovercontrol.discrepancy.jumps import timed
from hovercontrol.discrepancy.probes import large_process
from hovercontrol.discrepancy.search import Search
from hovercontrol.discrepancy.weighing import APART, EXPLAINED, SETTLED, least_gain, top_gain

#: chi2 per degree of freedom beyond which longer windows only get lost.
GROSS = 1.3

#: Part of what an effect must bring that its score must promise to be tried if nothing else is missing: where
#: the craft sticks or slips it may bring more than any slope tells.
HOPE = 0.4


def short_windows(search: Search, always: bool = False) -> None:
    """Add effects in short windows as long as the misfit is gross, with process noise if that says more.

    With gusts the motion leaves the free run, and in long windows dry friction is then far from linear.
    Gusts that rival the model's own forces are the last resort: they would hide what is missing.
    """
    found = search.found
    while found.final.chi2_per_dof > EXPLAINED or always:
        current, search.tried = found.final, None
        signatures = Signatures(current, candidates(current, search.names))
        plain = Scores(current, signatures, search.plain)
        best = search.worth(plain, current.chi2_per_dof)
        noise = search.plain
        if not search.data.navigated and (always or not _explains(search, current, plain, best)):
            search.progress("estimating process noise")
            gusty = noise_of(current)
            scores = Scores(current, signatures, gusty)
            with_gusts = search.worth(scores, 1.0)
            better = scores.cost - top_gain(with_gusts) < plain.cost - top_gain(best) - APART
            room = bool(best) and len(found.effects) < search.max_effects
            if better and room:
                most = scores.cost - top_gain(with_gusts)
                alone, added = add(search, current, best, most)  # far from linear, gusts outdo any score
                if added:
                    found.final = alone
                    search.clean()
                    continue
            if better and not (room and large_process(current, gusty)):
                noise, best = gusty, with_gusts
        if noise is not current.noise:
            current = search.fit(current.model, current, noise=noise)
        room = len(found.effects) < search.max_effects
        found.final, added = add(search, current, best) if room else (current, False)
        if not added and room and noise is not search.plain:
            found.final, added = again(search, current)
        if not added:
            return
        search.clean()


def _explains(search: Search, current: Fit, scores: Scores, best: Sequence[Scored]) -> bool:
    """Whether the best effect takes nearly all the misfit: process noise need not be thought of."""
    if not best:
        return False
    count = int(current.windowed.seen.sum())
    whole = count * (current.chi2_per_dof - 1.0)
    return best[0].gain > 0.8 * whole


def climb(search: Search) -> None:
    """Add effects in longer and longer windows, where smaller ones show."""
    found = search.found
    for length in search.rungs:
        if length < found.final.windowed.length:
            continue
        if length > found.final.windowed.length:
            found.final = _longer(search, found.final, length)
        last = length == search.rungs[-1]
        while len(found.effects) < search.max_effects and (last or found.final.chi2_per_dof > EXPLAINED):
            current = found.final
            scores = search.scores(current)
            best = search.worth(scores, current.chi2_per_dof)
            if last and not best:
                best = [s for s in scores.best() if s.allowed and s.gain > HOPE * least_gain(s)]
            found.final, added = add(search, current, best)
            if not added:
                break
            search.clean()
        if found.final.chi2_per_dof > GROSS:
            break


def _longer(search: Search, short: Fit, length: float) -> Fit:
    """Return a fit in longer windows; if they get lost, with what the short ones see already."""
    long = timed(search, search.fit(short.model, short, length=length))
    while (
        long.chi2_per_dof > EXPLAINED > short.chi2_per_dof and len(search.found.effects) < search.max_effects
    ):
        best = search.worth(search.scores(short), short.chi2_per_dof)
        short, added = add(search, short, best)
        if not added:
            break
        long = timed(search, search.fit(short.model, short, length=length))
    return long


def once_more(search: Search) -> None:
    """Begin again in short windows, where the way was lost in long ones, and climb with what is found."""
    found = search.found
    found.slow = found.final.chi2_per_dof
    before = list(found.effects)
    found.final = search.fit(found.final.model, found.final, length=search.rungs[0], noise=search.plain)
    short_windows(search, always=True)
    if found.final.noise.has_process or found.effects == before:
        return
    short, named = found.final, list(found.effects)
    climb(search)
    if found.final.chi2_per_dof < EXPLAINED:
        found.slow = 0.0
    else:
        found.final, found.effects[:] = short, named


def settle(search: Search) -> None:
    """Come to the long windows once more from short ones: some may hang where the craft sticks."""
    final = search.found.final
    if not search.found.effects or (final.converged and final.chi2_per_dof < SETTLED):
        return
    search.found.final = from_short(search, final)
