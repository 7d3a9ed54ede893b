"""Which effects a model lacks: forward by score, confirmed by refitting, dropped, swapped, or not named."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from hovercontrol.discrepancy.data import Data
from hovercontrol.discrepancy.forward import climb, once_more, settle, short_windows
from hovercontrol.discrepancy.rivals import drop, lead, simplify, swap
from hovercontrol.discrepancy.search import Search
from hovercontrol.discrepancy.selection import Selection
from hovercontrol.discrepancy.subject import Subject
from hovercontrol.discrepancy.weighing import EXPLAINED

#: Times at most that better effects are looked for in place of the named ones.
ROUNDS = 3


def select(
    model: Subject,
    data: Data,
    *,
    names: Sequence[str] | None = None,
    max_effects: int = 3,
    tell: Callable[[float, str], None] = lambda part, what: None,
) -> Selection:
    """Return which effects a model lacks.

    Parameters
    ----------
    model : Model or BlockModel
    data : Data
    names : sequence of str, optional
        Effects to consider; default: the whole catalogue.
    max_effects : int, optional
    tell : callable, optional
        Progress.
    """
    search = Search(model, data, names, max_effects, tell)
    found = search.found
    short_windows(search)
    if found.final.noise.has_process and found.final.chi2_per_dof < EXPLAINED:
        found.final = search.fit(found.final.model, found.final, noise=search.plain)  # no gusts after all
    if not found.final.noise.has_process:
        climb(search)
        if found.final.chi2_per_dof > EXPLAINED and found.effects:
            swap(search)
            climb(search)
        if found.final.chi2_per_dof > EXPLAINED:
            once_more(search)
        settle(search)
    found.process = found.final.noise.has_process
    if found.process:
        found.slow = 0.0
    drop(search)
    simplify(search)
    for _ in range(ROUNDS):
        before = list(found.effects)
        found.rivals.clear()
        swap(search)
        if found.effects == before:
            break
        drop(search)  # with a better one in its place another may not be needed
    for name in list(found.effects):
        lead(search, name)
    return found
