"""Confirmation of added effects: each must be needed with the others in the model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from hovercontrol.base.short_repr import short_repr
from hovercontrol.identification.diagnose.evidence.blocks import Blocks
from hovercontrol.identification.diagnose.search.fit import Search, Tried, beside
from hovercontrol.identification.diagnose.search.leads import Lead
from hovercontrol.identification.diagnose.search.rules import passes_all_tests, why_not
from hovercontrol.identification.engine.fit import Fit

if TYPE_CHECKING:
    from hovercontrol.identification.diagnose.laws.scan import Local


@dataclass(frozen=True, eq=False)
class Rival:
    """An effect that the logs do not distinguish from a named one.

    Attributes
    ----------
    name, instead_of : str
    behind : float
        By how much its penalised cost (twice the negative log likelihood) exceeds that of the named effect.
    t : float
        Difference in cost over its standard error over blocks.
    fit : Fit
        Fit with this effect in place of the other.
    same : bool
        Whether the two are equivalent in every log (a delay of commands, a clock that is late); of laws,
        whether it breaks a symmetry of the model that the named one keeps, and is nearly as likely.
    """

    name: str
    instead_of: str
    behind: float
    t: float
    fit: Fit
    same: bool = False


@dataclass(frozen=True, eq=False)
class Selection:
    """The effects that a search selected, with their evidence.

    Attributes
    ----------
    base, final : Fit
        Fits of the given and of the amended model, by the same method.
    effects : tuple of str
        Effects added, in order.
    gains : dict of str to float
        Reduction of twice the negative log likelihood by each effect, with the others in the model.
    blocks : dict of str to Blocks
    rivals : tuple of Rival
    leads : tuple of Lead
    steps : tuple of (str, float)
        Effects in the order in which they were added, with the gain of each fit.
    among : dict of str to int
        The number of candidates from which each step was chosen.
    candidates : int
        Number of effects considered.
    without : dict of str to Fit
        Fits of the amended model without each effect.
    dropped : tuple of Lead
        Effects added and dropped again: not needed with the others in the model, or blocks do not agree.
    alternatives : tuple of (str, Tried)
        A named effect and another that passes all tests in its place.
    undecided : tuple of Tried
        Fits of the amended model with one more effect that is not named, and not refuted by likelihood.
    regions : tuple of Local
        Functions of one signal that are missing and not named, with where they act.
    """

    base: Fit
    final: Fit
    effects: tuple[str, ...] = ()
    gains: dict[str, float] = field(default_factory=dict)
    blocks: dict[str, Blocks] = field(default_factory=dict)
    rivals: tuple[Rival, ...] = ()
    leads: tuple[Lead, ...] = ()
    steps: tuple[tuple[str, float], ...] = ()
    among: dict[str, int] = field(default_factory=dict)
    candidates: int = 0
    without: dict[str, Fit] = field(default_factory=dict)
    dropped: tuple[Lead, ...] = ()
    alternatives: tuple[tuple[str, Tried], ...] = ()
    undecided: tuple[Tried, ...] = ()
    regions: tuple[Local, ...] = ()

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class Confirmed:
    """Effects that are needed, each compared with the model without it.

    Attributes
    ----------
    final : Fit
        Fit with all of them.
    own : dict of str to Tried
        What each brings, with the others in the model.
    without : dict of str to Fit
        Fits of the model without each.
    dropped : tuple of Lead
        Effects that are not needed, or on which blocks do not agree.
    """

    final: Fit
    own: dict[str, Tried]
    without: dict[str, Fit]
    dropped: tuple[Lead, ...] = ()


def confirmed(
    search: Search, base: Fit, final: Fit, effects: Sequence[str], among: Mapping[str, int]
) -> Confirmed:
    """Return the effects that pass all tests with the others in the model.

    The one that brings least of those that fail is taken out, and the others are tested again.

    Parameters
    ----------
    search : Search
    base, final : Fit
        Fits of the given model and of the model with the effects.
    effects : sequence of str
    among : mapping of str to int
        The number of candidates from which each was chosen.
    """
    dropped: list[Lead] = []
    while True:
        without = {
            n: base if len(effects) == 1 else search.fit(final, final.model.without_effects(n), times=True)
            for n in effects
        }
        own = {n: beside(final, without[n], n) for n in effects}
        unneeded = [n for n in effects if not passes_all_tests(search, own[n], among[n])]
        if not unneeded:
            return Confirmed(final, own, without, tuple(dropped))
        least = min(unneeded, key=lambda n: own[n].gain)
        dropped.append(lead_of(own[least], why_not(own[least], among[least], search.criteria)))
        effects = [n for n in effects if n != least]
        final = without[least]


def lead_of(t: Tried, reason: str) -> Lead:
    """Return a fitted effect as one that is not named, with the reason."""
    return Lead(t.name, t.gain, t.blocks.t, reason, t.blocks.n)
