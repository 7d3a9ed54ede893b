"""A form must fit where it acts; what acts in one regime only is a function, or a form with a limit.

For each named effect the flexible yardstick of its own signals is asked: if a function of them still gains
significantly on left-out blocks (:mod:`.scan`), its form is wrong, and the function takes its place. What an
equation then lacks is taken as a function of the signal that tells most of it, zero where it does not act, so
that all other coefficients are fitted where nothing is missing. A form of few numbers stands in its place if
it is as likely. Both are laws, fitted, confirmed and held out like any other effect; beside a remainder that
is not random they are asked what a law is asked there (:func:`.search.sound`). A function of a craft's place,
heading or time says where something acts and not what: it is a region without a name. Laws everywhere are
searched first.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from hovercontrol.base.arrays import Array
from hovercontrol.craft.effects import Effect
from hovercontrol.craft.effects.law import TableLaw
from hovercontrol.identification.diagnose.criteria import CRITERIA, Criteria
from hovercontrol.identification.diagnose.evidence.sensors import only_noise
from hovercontrol.identification.diagnose.evidence.whiteness import random_remainder
from hovercontrol.identification.diagnose.laws.grammar import law_names, signals_of
from hovercontrol.identification.diagnose.laws.nearest import nearest
from hovercontrol.identification.diagnose.laws.scan import Local, Scan
from hovercontrol.identification.diagnose.laws.screen import best_gains
from hovercontrol.identification.diagnose.laws.search import sound
from hovercontrol.identification.diagnose.places import inputs_of
from hovercontrol.identification.diagnose.search.confirm import Selection, confirmed
from hovercontrol.identification.diagnose.search.fit import Search, Tried, beside, try_effect
from hovercontrol.identification.diagnose.search.hold_out import HeldOut, held_out, without
from hovercontrol.identification.diagnose.search.searched import shown
from hovercontrol.identification.diagnose.search.trace import Decision
from hovercontrol.identification.engine.data import Data
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.subject import Subject, structure

#: Forms of few numbers that are fitted in place of a table.
FORMS = 2

#: Standard deviation of a given coefficient, as a part of that of the prior, when readings of the same logs
#: are compared.
TRUSTED = 0.1


def with_functions(
    found: HeldOut,
    model: Subject,
    data: Data | None,
    *,
    criteria: Criteria = CRITERIA,
    report: Callable[[str], None] = lambda what: None,
    trace: list[Decision] | None = None,
) -> HeldOut:
    """Return a search without names of a wrong form, and with what acts in one regime only.

    Parameters
    ----------
    found : HeldOut
        What the search of the catalogue and of laws found.
    model : Model or BlockModel
        The given model.
    data : Data, optional
        The held-out logs; None if there are none.
    criteria, report, trace
        As for :func:`.select`.
    """
    given, rows, final = found, [] if trace is None else trace, found.selection.final
    flexible = [n for n in found.selection.effects if final.model.effect(n).flexible]
    if only_noise(final, criteria) and not flexible:
        return found
    search = Search(model, None, criteria, report, rows)
    wrong = _of_wrong_form(found.selection, criteria, rows)
    found = _without_doubtful(found, wrong, flexible)
    report("looking for what acts in one regime only")
    again, seen = _with_found(search, given, found, data, model)
    if again is None and wrong and found.selection.effects:  # these were found beside names that are wrong
        found = without(given, given.selection.effects, "its form, or that of an effect beside it, is wrong")
        again, more = _with_found(search, given, found, data, model)
        seen = seen or more
    if again is not None:
        return again
    regions = () if only_noise(final, criteria) else tuple(same[0][0] for same in seen)
    return replace(given, selection=replace(given.selection, regions=regions))


def _with_found(
    search: Search, given: HeldOut, found: HeldOut, data: Data | None, model: Subject
) -> tuple[HeldOut | None, list[list[tuple[Local, Array]]]]:
    """Return a search with the functions that it lacks, None if none is named; and all that gain."""
    criteria, rows = search.criteria, search.trace
    final, added = found.selection.final, dict[str, int]()
    seen = _locals(final, criteria, rows)
    likely = function_names(final, [one for same in seen for one in same], model, criteria, rows)
    for equation in dict.fromkeys(local.equation for local, _ in likely):
        t = _fitted(search, final, [one for one in likely if one[0].equation == equation])
        if t is not None:
            final, added[t.name] = t.fit, likely[0][0].among
    if not added:
        return None, seen
    more = _selected(search, found.selection, final, added)
    search.report("predicting the held-out logs with the functions")
    again = _shown(held_out(more, data, criteria, rows), added, found.selection.final, criteria)
    before = given.selection.final
    flexible = any(before.model.effect(n).flexible for n in given.selection.effects)
    likelier = _cost(again.selection.final, criteria) < _cost(before, criteria)
    named = any(n in added for n in again.selection.effects) and (likelier or not flexible)
    return (again if named else None), seen


def _without_doubtful(found: HeldOut, wrong: Mapping[str, float], flexible: Sequence[str]) -> HeldOut:
    """Return a search without the names whose form is wrong, or whose many numbers may stand for others."""
    if wrong:
        reason = f"its form is wrong: a function of its own signals gains {max(wrong.values()):.3g} more"
        return without(found, list(wrong), reason)
    reason = "a function of one signal is as likely as its many numbers"
    return without(found, flexible, reason) if flexible else found


def _shown(again: HeldOut, added: Mapping[str, int], base: Fit, criteria: Criteria) -> HeldOut:
    """Return a search without the functions that held-out logs do not show."""
    final, named = again.selection.final, [n for n in again.selection.effects if n in added]
    if only_noise(final, criteria) or random_remainder(final, criteria.level):
        doubtful = [n for n in named if again.before and not shown(again.evidence[n], criteria)]
    else:
        doubtful = [n for n in named if not sound(again, n, base, criteria)]
    reason = "held-out logs do not show it, or it explains little of what is missing"
    return without(again, doubtful, reason) if doubtful else again


def _of_wrong_form(selection: Selection, criteria: Criteria, rows: list[Decision]) -> dict[str, float]:
    """Return the named effects of whose own signals a function still gains, with that gain."""
    final = selection.final
    wrong = {}
    for name in selection.effects:
        signals, equations = own_signals(final, name)
        gains = [
            Scan(final, e, signals).yardstick().gain
            for e, left in zip(final.problem.driven_names, criteria.left(final), strict=True)
            if left and e in equations
        ]
        gain, rule = max(gains, default=0.0), "gain of functions of its own signals beside it, below"
        rows.append(Decision("challenge", name, rule, gain, criteria.least, gain < criteria.least))
        if gain >= criteria.least:
            wrong[name] = gain
    return wrong


def own_signals(fit: Fit, name: str) -> tuple[set[str], set[str]]:
    """Return the signals in an effect's terms, and the states in whose equations they stand.

    Of one that changes commands they are these commands, and all equations.
    """
    problem, block = fit.problem, structure(fit.problem.model)
    e = fit.problem.model.effect(name)
    if e.place() in ("sensor", "clock"):
        return set(), set()
    if e.place() != "force":
        return set(inputs_of(e, block, craft=problem.model.is_craft)), set(problem.driven_names)
    own = {block.parameter(e.parameter(k)).symbol for k in e.numbers}
    signals, equations = set[str](), set[str]()
    for state in problem.driven_names:
        terms = block.expand(block.derivatives[state]).expand().as_ordered_terms()
        mine = [term for term in terms if term.free_symbols & own]
        if mine:
            equations.add(state)
            signals |= {str(s) for term in mine for s in term.free_symbols}
    return signals & set(problem.model.law_units()), equations


def _locals(final: Fit, criteria: Criteria, rows: list[Decision]) -> list[list[tuple[Local, Array]]]:
    """Return the functions that gain most in each equation with more than noise, the best first.

    With their signals along the logs.
    """
    found = []
    for equation, left in zip(final.problem.driven_names, criteria.left(final), strict=True):
        scan = Scan(final, equation) if left else None
        same = []
        for local in scan.found() if scan else ():
            rule, passed = "gain of the function on left-out segments, at least", local.gain >= criteria.least
            if local.ends:
                rows.append(Decision("score", local.table(), rule, local.gain, criteria.least, passed))
            same += [(local, scan.values[local.of.signal])] if scan and passed else []
        found += [same] if same else []
    return sorted(found, key=lambda same: -same[0][0].gain)


def function_names(
    final: Fit, seen: list[tuple[Local, Array]], given: Subject, criteria: Criteria, rows: list[Decision]
) -> list[tuple[Local, Array]]:
    """Return the functions that may be what an equation lacks.

    One of place, heading or time only says where; one that gains less than a single law stands for that.
    """
    acting = set(signals_of(final.problem.model).moving)
    own = [one for one in seen if one[0].signals <= acting]
    laws = best_gains(final, law_names(final.problem.model), criteria, given) if own else {}
    found = []
    for one in own:
        ahead, rule = (
            laws.get(one[0].equation, 0.0) - one[0].gain,
            "gain of a law above the function's, below",
        )
        rows.append(
            Decision("challenge", one[0].table(), rule, ahead, criteria.apart, ahead < criteria.apart)
        )
        found += [one] if ahead < criteria.apart else []
    return found


def _fitted(search: Search, final: Fit, found: Sequence[tuple[Local, Array]]) -> Tried | None:
    """Return the fit with the likeliest of functions, or with a form of few numbers that is as likely.

    The noise of a fit without them holds part of what they add, and tells little of where they end. So their
    ends are sought once more under the noise of the likeliest.
    """
    criteria = search.criteria
    fits = _of_functions(search, final, found)
    if not fits:
        return None
    best, local, _ = fits[0]
    along = {one.of.signal: values for one, values in found}
    scan = Scan(replace(final, noise=best.fit.noise), local.equation)
    kinds = {(one.by, one.of): one for one, _ in found}
    fits += _of_functions(
        search, final, [(one, along[one.of.signal]) for one in scan.placed([*kinds.values()])]
    )
    fits.sort(key=lambda one: _cost(one[0].fit, criteria))
    pool = [t for t, _, _ in fits]
    least = criteria.penalised(fits[0][0].fit) + criteria.apart
    ranges = [one for t, one, _ in fits if one.complement() and criteria.penalised(t.fit) < least]
    pool += [other for one in ranges[:1] for way in one.complement() if (other := _added(search, final, way))]
    tables = {
        one.kind: (t, one, values) for t, one, values in reversed(fits) if isinstance(t.effect, TableLaw)
    }
    for t, one, values in tables.values():  # the likeliest of each kind
        best = min(pool, key=lambda t: _cost(t.fit, criteria))
        if not isinstance(best.effect, TableLaw) and only_noise(best.fit, criteria):
            break
        law = t.fit.model.effect(t.name)
        assert isinstance(law, TableLaw)
        near = nearest(final.problem.model, one.forms(), law, values)
        pool += _of_few_numbers(search, final, t, near[:FORMS])
    return min(pool, key=lambda t: _cost(t.fit, criteria))


def _of_functions(
    search: Search, final: Fit, found: Sequence[tuple[Local, Array]]
) -> list[tuple[Tried, Local, Array]]:
    """Return the fits with each of some functions, the likeliest first."""
    tried = [(_added(search, final, local), local, along) for local, along in found]
    fits = [(t, local, along) for t, local, along in tried if t and t.gain >= search.criteria.least]
    return sorted(fits, key=lambda one: search.criteria.penalised(one[0].fit))


def _of_few_numbers(search: Search, final: Fit, t: Tried, forms: Sequence[Effect]) -> list[Tried]:
    """Return the fits with forms in place of a table."""
    found = []
    for form in forms:
        search.report(f"trying {form.name} in its place")
        try:
            fit = search.fit(t.fit, final.model.with_effects([form]))
        except FloatingPointError:
            continue
        found.append(beside(fit, final, form.name))
    return found


def _cost(fit: Fit, criteria: Criteria) -> float:
    """Return the penalised cost of a fit, and of how far its coefficients depart from the given ones.

    A drag that is larger below a speed is one that is smaller above it, with another coefficient: of two
    readings of the same logs, the given model tells which one departs from it.
    """
    departure = fit.prior.cost(fit.problem.inside(fit.p)) / TRUSTED**2
    return criteria.penalised(fit) + min(departure, criteria.apart)


def _added(search: Search, final: Fit, local: Local) -> Tried | None:
    """Return the fit with a function."""
    search.report(f"trying a function of {local.of.argument} in {local.equation}'")
    cls = final.problem.model.effect_class(local.table())
    start = {"value": 0.0} if "value" in cls.numbers else {}
    return try_effect(search, final, cls(**start, **local.numbers()))


def _selected(search: Search, selection: Selection, final: Fit, added: Mapping[str, int]) -> Selection:
    """Return a selection with functions, each effect confirmed beside the others.

    Parameters
    ----------
    added : mapping of str to int
        The number of functions from which each was chosen.
    """
    looked_at = selection.candidates
    counts = {n: selection.among.get(n, looked_at) for n in selection.effects}
    counts |= {n: looked_at + scanned for n, scanned in added.items()}
    now = confirmed(search, selection.base, final, list(counts), counts)
    return replace(
        selection,
        final=now.final,
        effects=tuple(now.own),
        gains={n: t.gain for n, t in now.own.items()},
        blocks={n: t.blocks for n, t in now.own.items()},
        without=now.without,
        among=counts,
        rivals=tuple(r for r in selection.rivals if r.instead_of in now.own),
        alternatives=(),
        undecided=(),
        leads=(*now.dropped, *(lead for lead in selection.leads if lead.name not in now.own)),
    )
