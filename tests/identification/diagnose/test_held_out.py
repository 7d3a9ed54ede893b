"""What the held-out log says of a selection: names it drops, and what takes their place."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import sympy as sp

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.craft.effects import effect
from hovercontrol.identification.diagnose import diagnose
from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.evidence.blocks import agreement
from hovercontrol.identification.diagnose.evidence.effect_evidence import Evidence
from hovercontrol.identification.diagnose.evidence.holdout import Gained, Horizons, ahead, held_fit
from hovercontrol.identification.diagnose.search.base import base_fit
from hovercontrol.identification.diagnose.search.confirm import Selection
from hovercontrol.identification.diagnose.search.fit import Tried, beside
from hovercontrol.identification.diagnose.search.hold_out import (
    HeldOut,
    _less,
    _rows,
    _with_other,
    _worse,
    held_out,
)
from hovercontrol.identification.engine.data import gather

from .generator import Conditions, make

LATE = ("input_delay", "time_offset")
SHORT = Conditions(duration=15.0, logs=1)


@pytest.fixture(scope="module")
def sloped():
    """Return a case with a slope, the given model fitted, the true one, and one with another effect."""
    case = make(52, ["slope"], SHORT)
    data = gather(case.model, case.logs)
    other = case.model.with_effects([effect("rudder_offset", 0.01)])
    return case, *(base_fit(m, data) for m in (case.model, case.truth, other))


def selection(base, fit, name, alternatives=()):
    own = beside(fit, base, name)
    return Selection(
        base,
        fit,
        (name,),
        {name: own.gain},
        {name: own.blocks},
        without={name: base},
        alternatives=alternatives,
    )


def test_what_predicts_better_stays(sloped):
    case, base, fit, _ = sloped
    found = held_out(selection(base, fit, "slope"), gather(case.model, [case.holdout]))
    assert found.selection.effects == ("slope",)
    assert np.mean(found.far.together) > CRITERIA.better


def test_a_model_that_diverges_on_the_held_out_log_is_refuted_by_it(sloped, monkeypatch):
    case, base, fit, other = sloped
    instead = Tried("rudder_offset", other, 30.0, agreement(other, base, "rudder_offset"), 1)

    def diverging(model, *rest):
        if "slope" in [e.name for e in model.effects]:
            raise FloatingPointError("the model diverges")
        return held_fit(model, *rest)

    monkeypatch.setattr("hovercontrol.identification.diagnose.search.hold_out.held_fit", diverging)
    given = selection(base, fit, "slope", (("slope", instead),))
    found = held_out(given, gather(case.model, [case.holdout]))
    assert not found.selection.effects and found.selection.final is base
    assert found.selection.leads[0].reason == "the model with it diverges on the held-out log"


def test_a_held_out_log_on_which_the_equations_are_not_defined_is_refused():
    level, inflow, drain = hc.Signal("h", "m", start=1.0), hc.Signal("q", "m/s"), hc.Signal("k", "m^(1/2)/s")
    law = {"h": inflow.symbol - drain.symbol * sp.sqrt(level.symbol)}
    tank = hc.Block("tank", [level], [inflow], [level], [drain], law).with_values({"k": 0.2})
    rng, t = np.random.default_rng(0), np.arange(200) * 0.1
    flow, h = np.repeat(rng.uniform(0.0, 0.4, 20), 10), np.ones(200)
    for k in range(199):  # h' = q - k h^(1/2)
        h[k + 1] = h[k] + 0.1 * (flow[k] - 0.2 * np.sqrt(h[k]))
    seen = h + 1e-3 * rng.normal(size=200)
    logs = [hc.Log("run", t, {"h": seen, "q": flow}), hc.Log("below", t, {"h": seen - 1.0, "q": flow})]
    with pytest.raises(InputError, match="the held-out log below: the model diverges, or its equations"):
        diagnose(tank, logs[:1], logs[1])


def test_another_that_predicts_better_takes_the_place_of_one_that_does_not(sloped):
    case, base, fit, other = sloped
    name = other.problem.model.effects[-1].name
    true = Tried("slope", fit, base.cost - fit.cost, agreement(fit, base, "slope"), 2)
    given = selection(base, other, name, (("rudder_offset", true),))
    found = held_out(given, gather(case.model, [case.holdout]))
    assert found.selection.effects == ("slope",) and found.selection.final is fit
    assert found.selection.leads[0].name == "rudder_offset"
    assert found.selection.leads[0].reason == "slope predicts the held-out log better"
    assert found.selection.gains == {"slope": true.gain}


def test_twins_of_what_takes_a_place_are_readings_of_it(sloped):
    _, base, fit, other = sloped
    blocks = agreement(fit, base, "slope")
    models = [base.model.with_effects([effect(n, seconds=0.02)]) for n in LATE]
    fits = [SimpleNamespace(model=m, problem=SimpleNamespace(model=m)) for m in models]
    late = [Tried(n, f, 1.0, blocks, 1) for n, f in zip(LATE, fits, strict=True)]
    given = selection(base, other, "rudder_offset", tuple(("rudder_offset", t) for t in late))
    changed = _with_other(given, "rudder_offset", late[0])
    assert [(r.name, r.instead_of, r.same) for r in changed.rivals] == [("time_offset", "input_delay", True)]


def test_what_predicts_worse_goes_and_says_so(sloped):
    _, base, fit, _ = sloped
    left = _less(selection(base, fit, "slope"), ["slope"], "the held-out log is predicted worse with it")
    assert left.effects == () and left.final is base
    assert left.leads[0].reason == "the held-out log is predicted worse with it"


@pytest.mark.parametrize(
    ("t", "likelier", "worse"),
    [
        ((-4.0, -5.0, 1.0), None, True),
        ((-4.0, -5.0, 1.0), 2.0, True),
        ((-4.0, -5.0, 1.0), 4.0, False),  # other coefficients made up for what was missing
        ((-4.0, 0.0, 1.0), None, False),
        ((), None, False),
    ],
)
def test_worse_is_surely_at_most_horizons_and_not_as_surely_likelier(sloped, t, likelier, worse):
    _, base, fit, _ = sloped
    own = None if likelier is None else Gained(10.0 * likelier, 10.0)
    found = Evidence(1.0, agreement(fit, base, "slope"), Horizons(together=t), own)
    assert _worse(found, CRITERIA) is worse


def test_without_a_held_out_log_training_speaks_alone(sloped):
    _, base, fit, _ = sloped
    found = held_out(selection(base, fit, "slope"), None)
    assert found.before is None and found.evidence["slope"].holdout.each == ()


def judged(sloped, t, scatter, far=0.0, remains=True):
    """Return a selection of a slope beside another effect as found on a held-out log."""
    _, base, fit, other = sloped
    process = np.full_like(fit.noise.process, 1.0 if remains else 0.0)
    final = replace(fit, noise=replace(fit.noise, process=process))
    found = Selection(base, final, ("slope", "rudder_offset"), without={"slope": other, "rudder_offset": fit})
    far = Horizons(together=(far, far))
    sure = Evidence(100.0, None, Horizons(together=(5.0, 5.0)), Gained(200.0, 20.0))
    own = Evidence(30.0, None, far, Gained(t * scatter, scatter))
    return HeldOut(found, {"slope": sure, "rudder_offset": own}, base)


@pytest.mark.parametrize(
    ("t", "scatter", "far", "remains", "doubtful"),
    [
        (0.4, 10.0, 0.1, True, True),
        (-2.0, 30.0, 0.1, True, True),
        (1.8, 10.0, 0.1, True, False),  # confirmed
        (0.4, 3.0, 0.1, True, False),  # that log cannot show it
        (0.4, 10.0, 2.5, True, False),  # predictions surely get better
        (0.4, 10.0, 0.1, False, False),  # nothing else is wrong with the model
    ],
)
def test_where_something_remains_a_name_needs_the_held_out_log(sloped, t, scatter, far, remains, doubtful):
    rows = _rows(judged(sloped, t, scatter, far, remains), CRITERIA)
    assert [row.effect for row in rows if not row.passed] == (["rudder_offset"] if doubtful else [])


@pytest.mark.parametrize(("taken", "doubtful"), [((0.1, 0.45), True), ((0.1, 0.8), False)])
def test_what_takes_most_of_the_held_out_error_is_confirmed_by_however_few_events(sloped, taken, doubtful):
    found = judged(sloped, 0.9, 100.0, 1.0, True)
    own = found.evidence["rudder_offset"]
    own = replace(own, holdout=replace(own.holdout, taken=taken))
    found = replace(found, evidence={"rudder_offset": own})
    assert any(not row.passed for row in _rows(found, CRITERIA)) == doubtful


def test_the_part_of_the_error_taken_does_not_depend_on_calm_blocks(sloped):
    case, base, fit, _ = sloped
    before, after = (held_fit(m.model, gather(case.model, [case.holdout])) for m in (base, fit))
    found = ahead(before, after)
    assert len(found.taken) == len(found.together) and max(found.taken) > 0.5
    for horizon, taken in zip(dict.fromkeys(a.horizon for a in found.each), found.taken, strict=True):
        left = [(a.after / a.before) ** 2 for a in found.each if a.horizon == horizon]
        assert taken == pytest.approx(1.0 - np.mean(left))


@pytest.mark.slow
def test_a_wrong_name_beside_a_right_one_is_dropped_and_the_right_one_judged_alone(sloped):
    case, base, fit, _ = sloped
    data = gather(case.model, case.logs)
    both = base_fit(case.truth.with_effects([effect("rudder_offset", 0.01)]), data)
    p = np.where([n.endswith("rudder_offset") for n in both.problem.names], 0.02, both.p)  # too large
    both = replace(both, p=p, noise=replace(fit.noise, process=np.ones(3)))
    own = {n: beside(both, f, n) for n, f in (("slope", base), ("rudder_offset", fit))}
    given = Selection(
        base,
        both,
        ("slope", "rudder_offset"),
        {n: t.gain for n, t in own.items()},
        {n: t.blocks for n, t in own.items()},
        without={"slope": base, "rudder_offset": fit},
    )
    held = gather(case.model, [case.holdout])
    found = held_out(given, held)
    assert found.selection.effects == ("slope",) and found.selection.final is fit
    assert "the held-out log" in found.selection.leads[0].reason
    assert found.evidence["slope"].gained.t > CRITERIA.confirmed


def test_several_held_out_logs_are_judged_together(sloped):
    case, base, fit, _ = sloped
    whole = case.holdout
    parts = [replace(whole.between(a, b), name=name) for name, a, b in (("b", 0, 7), ("c", 7.01, 15))]
    given = selection(base, fit, "slope")
    both, *alone = (held_out(given, gather(case.model, logs)) for logs in (parts, *([log] for log in parts)))
    assert [m.name for m in both.before.problem.logs] == ["b", "c"]
    apart = sum(found.evidence["slope"].gained.gain for found in alone)
    assert both.evidence["slope"].gained.gain == pytest.approx(apart, rel=0.15)  # one noise for both logs


def test_a_held_out_log_given_twice_or_fitted_is_refused(sloped):
    case = sloped[0]
    with pytest.raises(InputError, match="is the held-out log"):
        diagnose(case.model, case.logs, [case.holdout, case.holdout])
    with pytest.raises(InputError, match="the held-out log is the training log"):
        diagnose(case.model, case.logs, [case.holdout, case.logs[0]])
