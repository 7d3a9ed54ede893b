"""What acts in one regime only: the scan finds where, and the nearest form has the true numbers."""

from types import SimpleNamespace

import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.craft.effects.law import Factor
from hovercontrol.craft.models.interface import as_model
from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.laws import local
from hovercontrol.identification.diagnose.laws.local import _fitted, function_names, own_signals
from hovercontrol.identification.diagnose.laws.nearest import nearest
from hovercontrol.identification.diagnose.laws.regions import acting_side, region_of
from hovercontrol.identification.diagnose.laws.scan import Local, Scan
from hovercontrol.identification.diagnose.search.base import base_fit
from hovercontrol.identification.diagnose.search.confirm import Selection
from hovercontrol.identification.diagnose.search.fit import Search
from hovercontrol.identification.diagnose.search.hold_out import HeldOut
from hovercontrol.identification.engine.data import gather

x, v, F = hc.Signal("x", "m"), hc.Signal("v", "m/s"), hc.Signal("F", "N")
k, c = hc.Signal("k", "1/kg", start=0.9), hc.Signal("c", "1/s", start=0.5)
CART = hc.Block(
    "cart", [x, v], [F], [x, v], [k, c], {"x": v.symbol, "v": k.symbol * F.symbol - c.symbol * v.symbol}
)


def model():
    return as_model(CART)


def driven(seed, extra, n=1500, h=0.02):
    """Return a log of the cart with a further acceleration, a function of its velocity."""
    rng = np.random.default_rng(seed)
    force = np.repeat(rng.uniform(-2.5, 2.5, n // 50), 50)
    rows, at, speed = np.empty((n, 2)), 0.0, 0.0
    for i in range(n):
        rows[i] = at, speed
        for _ in range(10):
            at, speed = at + h / 10 * speed, speed + h / 10 * (0.9 * force[i] - 0.5 * speed + extra(speed))
    rows += rng.normal(size=rows.shape) * [1e-3, 5e-3]
    return hc.Log("log", h * np.arange(n), {"x": rows[:, 0], "v": rows[:, 1], "F": force})


@pytest.fixture(scope="module")
def fit():
    """Return the fit of the cart to a log with a further drag above 1.2 m/s."""
    log = driven(1, lambda s: -1.5 * np.sign(s) * max(abs(s) - 1.2, 0.0))
    return base_fit(model(), gather(model(), [log]))


def test_the_scan_finds_the_signal_and_where_the_drag_acts(fit):
    found = Scan(fit, "v").found()
    assert found[0].of == Factor("", "v", of_abs=True) and found[0].gain > 100.0
    best = next(one for one in found if one.kind == "rise")  # below, the same but for a coefficient
    (back, ahead) = best.region()
    assert back["high"] == -ahead["low"] and ahead["high"] is None
    assert best.ends[0] == pytest.approx(1.2, abs=0.1)


@pytest.mark.slow
def test_what_begins_with_a_step_is_a_range_and_the_given_coefficients_tell_on_which_side():
    found = base_fit(model(), gather(model(), [driven(3, lambda s: 0.4 * s * (s < -1.0))]))
    scan = Scan(found, "v")
    seen = [(one, scan.values[one.of.signal]) for one in scan.found()]
    assert seen[0][0].table() in ("law_v__v__above_v", "law_v__v__below_v")  # alike, but for a coefficient
    t = _fitted(Search(model(), None, CRITERIA, lambda what: None), found, seen)
    law = t.fit.model.effect(t.name)
    assert t.name == "law_v__v__below_v" and law.values["value"] == pytest.approx(0.4, abs=0.03)
    ((low, high),) = [(one["low"], one["high"]) for one in region_of(law)]
    assert low is None and high == pytest.approx(-1.0, abs=0.03)
    assert t.fit.model.coefficients()["c"] == pytest.approx(0.5, abs=0.02)


def test_a_function_of_time_and_one_that_gains_less_than_a_law_are_no_names(fit):
    best, rows = Scan(fit, "v").found()[0], []
    late = Local("v", (), Factor("", "time"), 500.0, kind="rise", ends=(1.0, 2.0))
    weak = Local("v", (), Factor("", "F"), 21.0, kind="rise", ends=(0.0, 1.0))
    seen = [(one, np.zeros(3)) for one in (late, weak, best)]
    assert [one for one, _ in function_names(fit, seen, model(), CRITERIA, rows)] == [best]
    assert [(row.effect, row.passed) for row in rows] == [("law_v__rise_F", False), (best.table(), True)]


def test_nothing_is_found_where_nothing_is_missing():
    best, *_ = Scan(base_fit(model(), gather(model(), [driven(2, lambda s: 0.0)])), "v").found() or [None]
    assert best is None or best.gain < 20.0


@pytest.mark.parametrize(
    ("wanted", "function", "at"),
    [
        ("law_v__saturating_v", lambda a: 2.0 * a / (0.6 + a), 0.6),
        ("law_v__over_v", lambda a: 2.0 * np.maximum(a - 1.0, 0.0), 1.0),
        ("law_v__bell_v", lambda a: 2.0 * np.exp(-(((a - 1.4) / 0.7) ** 2)), 1.4),
    ],
)
def test_the_nearest_form_to_a_table_is_the_one_it_was_made_of(wanted, function, at):
    cls = model().effect_class("law_v__rise_v")
    places = np.linspace(0.0, 3.0, 6)
    table = cls(low=0.0, high=3.0, **{f"y{i}": float(function(places[i])) for i in range(1, 6)})
    names = ["law_v__v", *(f"law_v__{form}_v" for form in ("saturating", "over", "decaying", "sqr", "bell"))]
    best = nearest(model(), names, table, np.linspace(0.0, 3.0, 300))[0]
    assert best.name == wanted and best.values["at"] == pytest.approx(at, rel=0.35)


def test_the_own_signals_of_an_effect_are_those_of_its_terms(fit):
    law = model().effect_class("law_v__F__abs_v")(0.0)
    other = fit.problem.of(model().with_effects([law]))
    assert own_signals(SimpleNamespace(problem=other), law.name) == ({"F", "v"}, {"v"})


def test_a_fit_with_other_times_that_runs_away_leaves_the_fit_as_it_is(fit, monkeypatch):
    def runs_away(*_, **__):
        raise FloatingPointError("the model runs away")

    monkeypatch.setattr("hovercontrol.identification.diagnose.search.fit.refit", runs_away)
    search = Search(model(), None, None, lambda what: None)
    assert search.fit(fit, fit.model, times=True) is fit


def test_a_law_of_two_signals_acts_on_no_side():
    """Of abs(v) r, the factor of abs(v) is no number."""
    sway, turn = hc.Signal("v", "m/s"), hc.Signal("r", "rad/s")
    a, b = hc.Signal("a", "1/s", start=0.3), hc.Signal("b", "1/m/s", start=0.1)
    rates = {"v": -a.symbol * sway.symbol, "r": -a.symbol * turn.symbol - b.symbol * sway.symbol}
    ship = as_model(hc.Block("ship", [sway, turn], [], [sway, turn], [a, b], rates))
    law = ship.effect_class("law_r__abs_v__r")(-0.6)
    assert acting_side(ship, ship.with_effects([law]), law) == []


def test_names_found_beside_a_wrong_form_go_with_it_if_no_function_is_found_beside_them(monkeypatch):
    """A cubic law imitated an overflow beside a bias: the fit with the bias alone shows nothing."""
    known = SimpleNamespace(effect=lambda name: SimpleNamespace(flexible=False))
    base, final, beside = (SimpleNamespace(model=known) for _ in range(3))
    names, told = ("law_h__cub_h", "h_bias"), SimpleNamespace(t=5.0, n=8)
    fits = dict(zip(names, (beside, final), strict=True))
    selection = Selection(
        base, final, names, dict.fromkeys(names, 50.0), dict.fromkeys(names, told), without=fits
    )
    asked = []

    def with_found(search, given, found, data, model):
        asked.append((found.selection.final, found.selection.effects))
        return None, []

    monkeypatch.setattr(local, "only_noise", lambda fit, criteria: False)
    monkeypatch.setattr(local, "_of_wrong_form", lambda *_: {"law_h__cub_h": 63.0})
    monkeypatch.setattr(local, "_with_found", with_found)
    given = HeldOut(selection, {})
    kept = local.with_functions(given, model(), None)
    assert asked == [(beside, ("h_bias",)), (base, ())]
    assert kept.selection.effects == names
