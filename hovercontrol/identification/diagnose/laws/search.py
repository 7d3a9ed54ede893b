"""The search for laws that are in no catalogue.

The catalogue is searched first. Where it leaves more than noise, or needs several effects in one equation
(quadratic drag and dry friction may stand for one cubic drag), all forms of the grammar are screened on one
table (:mod:`.screen`), and the few best are searched beside the catalogue by the same steps: fit, confirm,
challenge, hold out. The same forms in the other equations are searched with them: a law that differs from one
of the few in its place only is told from it or told as its rival, and a force off the centre of mass acts in
two equations. Laws that the screening does not tell apart are compared by fits, each with its own noise.

A law stands in place of what the catalogue named, where it is surely likelier, and not beside it in the same
equation: beside a true name a form may stand for what has none. In an equation of its own it stands beside.
A name that a law of as few numbers surely beats is no name, whether the law is named or not; one that a law
only beats by less has the law for a rival. A law that promises less than half of what the names took, and of
what they promised on its table, is not fitted, unless it acts in an equation of its own.

Among hundreds of forms one may stand for what has no form there: a load that swings makes thrust seem weaker
in surge than in sway. Such a remainder is told from noise by its innovations
(:func:`.whiteness.random_remainder`). Where they are white, process noise holds all that the law leaves, as
gusts do, and likelihood decides as where only measurement noise is left. Where they are not, the held-out
logs, on which the choice did not depend, must show the law by themselves (:func:`.searched.shown`), and it
must take at least half (`criteria.most`) of the mean square of what is missing in its equation; else it is a
lead, and the search goes on from what stays. A law with a memory always is one there: a filter of first order
takes part of whatever answers a command, as of a load on a spring that is shaken by the thrust.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from hovercontrol.craft.effects.law import FILTERED, MemoryLaw, is_law, law_text
from hovercontrol.identification.diagnose.criteria import CRITERIA, Criteria
from hovercontrol.identification.diagnose.evidence.effect_evidence import Evidence
from hovercontrol.identification.diagnose.evidence.remainder import remainders
from hovercontrol.identification.diagnose.evidence.sensors import only_noise
from hovercontrol.identification.diagnose.evidence.whiteness import random_remainder
from hovercontrol.identification.diagnose.laws.grammar import law_names
from hovercontrol.identification.diagnose.laws.screen import LikelyLaw, screened
from hovercontrol.identification.diagnose.places import acts_in
from hovercontrol.identification.diagnose.search.candidates import catalogue
from hovercontrol.identification.diagnose.search.challenge import alike, surely
from hovercontrol.identification.diagnose.search.confirm import Rival, Selection
from hovercontrol.identification.diagnose.search.fit import TRIALS, Made, Search, beside, try_effect
from hovercontrol.identification.diagnose.search.hold_out import HeldOut, held_out, without
from hovercontrol.identification.diagnose.search.leads import Lead
from hovercontrol.identification.diagnose.search.searched import shown
from hovercontrol.identification.diagnose.search.select import select
from hovercontrol.identification.diagnose.search.trace import Decision
from hovercontrol.identification.engine.data import Data
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.subject import Subject


def with_laws(
    found: HeldOut,
    model: Subject,
    data: Data | None,
    *,
    max_effects: int = 3,
    criteria: Criteria = CRITERIA,
    report: Callable[[str], None] = lambda what: None,
    trace: list[Decision] | None = None,
    made: Made | None = None,
) -> HeldOut:
    """Return a search that went on with laws; the given one if no law is named.

    Parameters
    ----------
    found : HeldOut
        What the search of the catalogue found.
    model : Model or BlockModel
        The given model.
    data : Data, optional
        The held-out logs; None if there are none.
    max_effects, criteria, report, trace, made
        As for :func:`.select`.
    """
    selection, base = found.selection, found.selection.base
    if only_noise(selection.final, criteria) and not _together(selection):
        return found
    names = law_names(base.problem.model)
    report(f"screening {len(names)} laws")
    screening = screened(base, names, criteria, model)
    few = screening.laws
    rows = [] if trace is None else trace
    rule, least = "cross-validated gain of the law, at least", criteria.least
    rows.extend(Decision("score", s.name, rule, s.gain, least, s.gain >= least) for s in few)
    beside = in_own_equations(few, selection)
    taken = base.cost - selection.final.cost
    promised = max((g for n, g in screening.forces.items() if n in selection.effects), default=taken)
    if not few or (few[0].gain < TRIALS.half * min(taken, promised) and not beside):
        return found
    known = [cls.name for cls in catalogue(base.problem.model) if beside or cls.name not in selection.effects]
    asked = [*known, *(s.name for s in few), *screening.elsewhere]
    strict = _among(criteria, len(asked), len(known) + screening.tests)
    search = Search(model, None, strict, report, rows)
    begin: Selection | None = None
    leads: list[Lead] = []
    while True:
        more = select(
            base, model, names=asked, max_effects=max_effects, criteria=strict, report=report, trace=trace,
            made=made, begin=begin,
        )  # fmt: skip
        if not any(is_law(n) for n in more.effects):
            break
        if not _replaces(selection, more, criteria, rows):
            return replace(found, selection=_with_rivals(selection, more, criteria))
        report("predicting the held-out logs with the laws")
        noise = only_noise(more.final, criteria) or _random(more, criteria, rows)
        more = _with_same(search, more, few)
        more = _decided(more, criteria) if noise else more
        again = held_out(more, data, strict, trace, found)
        named = [n for n in again.selection.effects if is_law(n)]
        doubtful = [] if noise else [n for n in named if not sound(again, n, base, criteria)]
        if not doubtful:
            return again if named else found
        leads += [_unshown(again.evidence[n], n) for n in doubtful]
        stays = [n for n in again.selection.effects if n not in doubtful]
        if not stays:
            found = _without_beaten(found, more)
            break
        begin = without(again, doubtful, "").selection if len(doubtful) == 1 else None
        asked = [n for n in asked if n not in doubtful]
    return replace(found, selection=replace(found.selection, leads=(*leads, *found.selection.leads)))


def in_own_equations(few: Sequence[LikelyLaw], selection: Selection) -> bool:
    """Return whether a law acts in an equation in which nothing acts that is named, nor through a command."""
    acting = [acts_in(selection.final, n).split() for n in selection.effects]
    taken = {equation for where in acting for equation in where}
    reaching = any(not equation.endswith("'") for equation in taken)  # a command or a sensor
    return bool(acting) and not reaching and any(f"{s.trials[s.name].equation}'" not in taken for s in few)


def _together(selection: Selection) -> bool:
    """Return whether two named effects act in one equation, so that both may stand for one law there."""
    acting = [set(acts_in(selection.final, n).split()) for n in selection.effects]
    return sum(map(len, acting)) > len(set().union(*acting))


def _random(more: Selection, criteria: Criteria, rows: list[Decision]) -> bool:
    """Return whether what a selection leaves is noise to it."""
    passed = random_remainder(more.final, criteria.level)
    rule = "innovations are white beside it"
    rows += [Decision("hold out", n, rule, passed=passed) for n in more.effects if is_law(n)]
    return passed


def sound(again: HeldOut, name: str, base: Fit, criteria: Criteria) -> bool:
    """Return whether a law beside something else is shown by held-out logs and takes most of its equation.

    A law with a memory is not: a filter of first order takes part of whatever answers a command.
    """
    final = again.selection.final
    if isinstance(final.model.effect(name), MemoryLaw):
        return False
    equation = f"{final.model.effect(name).equation}'"
    share = next((r.share_explained for r in remainders(base, final) if r.equation == equation), 0.0)
    return share >= criteria.most and shown(again.evidence[name], criteria)


def _decided(selection: Selection, criteria: Criteria) -> Selection:
    """Return a selection without the rivals of its laws that are much less likely.

    What is left is noise to the model, so that likelihood ratios mean what they say; their scatter over
    blocks is asked for where the model is wrong in other ways too.
    """
    rivals = (r for r in selection.rivals if r.behind < criteria.apart or not is_law(r.instead_of))
    return replace(selection, rivals=tuple(rivals))


def _with_rivals(selection: Selection, more: Selection, criteria: Criteria) -> Selection:
    """Return a selection of the catalogue with a likelier law as the rival of its one name, or of several."""
    gained = criteria.penalised(selection.final) - criteria.penalised(more.final)
    if gained <= 0.0 or len(more.effects) > 1:
        return selection
    (law,), t = more.effects, -surely(selection.final, more.final)
    rivals = (Rival(law, name, -gained, t, more.final) for name in selection.effects)
    return replace(selection, rivals=(*selection.rivals, *rivals))


def _without_beaten(found: HeldOut, more: Selection) -> HeldOut:
    """Return a search without the one name that a law of as few numbers surely beats."""
    selection = found.selection
    if not len(selection.effects) == len(more.effects) == 1 or len(more.final.p) > len(selection.final.p):
        return found
    gain = selection.final.cost - more.final.cost
    (law,) = more.effects
    reason = f"{law_text(law)} in its place gains {gain:.3g} more in twice the log likelihood"
    return without(found, selection.effects, reason)


def _unshown(own: Evidence, name: str) -> Lead:
    """Return a law that the held-out logs do not show by themselves, as one that is not named."""
    gain = own.gained.gain if own.gained else 0.0
    told = "held-out logs do not show it by themselves"
    told = "a lag is reported only if the residuals are white" if f"{FILTERED}_" in name else told
    reason = f"more is missing than this law, and {told} (gain {gain:.3g})"
    return Lead(name, own.gain, own.blocks.t, reason, own.blocks.n)


def _replaces(named: Selection, more: Selection, criteria: Criteria, rows: list[Decision]) -> bool:
    """Return whether laws are surely likelier than what the catalogue named; as in a challenge."""
    if not named.effects:
        return True
    gained = criteria.penalised(named.final) - criteria.penalised(more.final)
    passed = gained > criteria.apart and surely(named.final, more.final) > criteria.apart_t
    rule = f"gain in place of {', '.join(named.effects)}, over"
    rows += [Decision("challenge", n, rule, gained, criteria.apart, passed) for n in more.effects]
    return passed


def _among(criteria: Criteria, asked: int, tests: float) -> Criteria:
    """Return criteria whose levels are shared among all that was screened, not only what is asked for."""
    part = min(asked / tests, 1.0)
    return replace(criteria, level=criteria.level * part, other_sign=criteria.other_sign * part)


def _with_same(search: Search, selection: Selection, few: Sequence[LikelyLaw]) -> Selection:
    """Return a selection whose laws are compared with those that the screening does not tell from them."""
    for one in few:
        if one.same and one.name in selection.effects:
            selection = _likeliest_of_same(search, selection, one)
    return selection


def _likeliest_of_same(search: Search, selection: Selection, law: LikelyLaw) -> Selection:
    """Return a selection with the likeliest of laws that are alike, and with the others as its rivals.

    Each is fitted in the law's place, its noise as well as the law's. One that breaks more symmetries of the
    model is named only if it is surely likelier; else it is told as the same in these logs, which makes
    nothing ambiguous.
    """
    criteria, name, less = search.criteria, law.name, selection.without[law.name]
    told = {r.name for r in selection.rivals if r.instead_of == name}
    own = {name: beside(selection.final, less, name)}
    for other in (n for n in law.same if n not in told):
        t = try_effect(search, less, law.trials[other].neutral())
        if t is not None:
            own[other] = alike(search, t, own[name])
    cost = {n: criteria.penalised(t.fit) for n, t in own.items()}

    def near(n: str, best: str) -> bool:
        far = cost[n] - cost[best] >= criteria.apart
        return not (far and surely(own[n].fit, own[best].fit) >= criteria.apart_t)

    breaks_more = {n: law.same.get(n, False) for n in own}
    best = min((n for n in own if not breaks_more[n]), key=lambda n: cost[n] - TRIALS.level * (n == name))
    likeliest = min(own, key=lambda n: cost[n])
    best = best if near(best, likeliest) else likeliest
    final = own[best].fit
    fresh = [
        Rival(n, best, cost[n] - cost[best], surely(t.fit, final), t.fit, breaks_more[n] > breaks_more[best])
        for n, t in own.items()
        if n != best and near(n, best)
    ]
    moved = [
        replace(r, instead_of=best, behind=r.behind + cost[name] - cost[best], t=surely(r.fit, final))
        if r.instead_of == name and best != name
        else r
        for r in selection.rivals
    ]
    called = {n: best if n == name else n for n in selection.effects}
    return replace(
        selection,
        final=final,
        effects=tuple(called.values()),
        gains={called[n]: v for n, v in selection.gains.items()} | {best: own[best].gain},
        blocks={called[n]: v for n, v in selection.blocks.items()} | {best: own[best].blocks},
        without={called[n]: v for n, v in selection.without.items()},
        rivals=(*moved, *fresh),
        alternatives=tuple((called[n], t) for n, t in selection.alternatives if n in called),
    )
