"""What the held-out log says of a selection: names it drops, and what takes their place."""

from types import SimpleNamespace

import numpy as np
import pytest

from hovercontrol.discrepancy.criteria import CRITERIA
from hovercontrol.discrepancy.diagnose import base_fit
from hovercontrol.discrepancy.evidence.blocks import agreement
from hovercontrol.discrepancy.evidence.holdout import Horizons
from hovercontrol.discrepancy.search.confirm import Selection
from hovercontrol.discrepancy.search.held_out import _less, _with_other, _worse, held_out
from hovercontrol.discrepancy.search.trial import Tried, beside
from hovercontrol.effects import effect
from hovercontrol.estimation.data import gather

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
    fits = [SimpleNamespace(model=base.model.with_effects([effect(n, seconds=0.02)])) for n in LATE]
    late = [Tried(n, f, 1.0, blocks, 1) for n, f in zip(LATE, fits, strict=True)]
    given = selection(base, other, "rudder_offset", tuple(("rudder_offset", t) for t in late))
    changed = _with_other(given, "rudder_offset", late[0])
    assert [(r.name, r.instead_of, r.same) for r in changed.rivals] == [("time_offset", "input_delay", True)]


def test_what_predicts_worse_goes_and_says_so(sloped):
    _, base, fit, _ = sloped
    left = _less(selection(base, fit, "slope"), ["slope"])
    assert left.effects == () and left.final is base
    assert left.leads[0].reason == "the held-out log is predicted worse with it"


@pytest.mark.parametrize(("t", "worse"), [((-4.0, -5.0, 1.0), True), ((-4.0, 0.0, 1.0), False), ((), False)])
def test_worse_is_surely_and_at_most_horizons(t, worse):
    assert _worse(Horizons(together=t), CRITERIA) is worse


def test_without_a_held_out_log_training_speaks_alone(sloped):
    _, base, fit, _ = sloped
    found = held_out(selection(base, fit, "slope"), None)
    assert found.before is None and found.evidence["slope"].holdout.each == ()
