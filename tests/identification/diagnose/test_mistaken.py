"""Names that stand for an effect of no catalogue: a mass that grows, drag of another power."""

import pytest

from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.search.base import base_fit
from hovercontrol.identification.diagnose.search.candidates import catalogue, effects_outside_catalogue
from hovercontrol.identification.diagnose.search.select import select
from hovercontrol.identification.engine.data import gather

from .generator import Conditions, make

SHORT = Conditions(duration=30.0, logs=1)


def searched(case, names):
    return select(base_fit(case.model, gather(case.model, case.logs)), case.model, names=names)


@pytest.fixture(scope="module")
def heavier():
    return make(8, ["mass_drift"], SHORT)


def test_a_craft_that_grows_heavier_has_no_weak_battery(heavier):
    assert heavier.truth.effect("mass_drift").values["value"] > 0.0, "heavier"
    found = searched(heavier, ["battery_sag", "slope"])
    assert found.effects == () and found.rivals == () and found.final is found.base
    heavy, sag = found.leads[:2]
    assert (heavy.name, sag.name) == ("mass_drift", "battery_sag")
    assert heavy.reason == "named only where it is asked for" and heavy.gain > sag.gain + CRITERIA.apart
    assert sag.reason.startswith("mass_drift in its place gains")


def test_it_is_named_where_it_is_asked_for(heavier):
    found = searched(heavier, ["battery_sag", "mass_drift"])
    assert found.effects == ("mass_drift",) and found.rivals == ()
    j = found.final.problem.names.index("mass_drift")
    error = found.final.p[j] - heavier.truth.effect("mass_drift").values["value"]
    assert abs(error) < 4.0 * found.final.covariance[j, j] ** 0.5


@pytest.mark.slow
@pytest.mark.parametrize("name", ["battery_sag", "yaw_quadratic_drag"])
def test_what_is_there_keeps_its_name(name):
    found = searched(make(5, [name], SHORT), [name, "slope"])
    assert found.effects == (name,) and found.rivals == ()


def test_a_search_asks_in_place_of_what_it_may_be_taken_for(heavier):
    asked_for = {
        "air_drag",
        "body_yaw_torque",
        "gyro_drift",
        "mass_drift",
        *(f"{a}_cubic_drag" for a in ("surge", "sway", "yaw")),
    }
    assert set(effects_outside_catalogue(heavier.model)) == asked_for
    assert set(effects_outside_catalogue(heavier.model, ["mass_drift"])) == asked_for - {"mass_drift"}
    assert not asked_for & {cls.name for cls in catalogue(heavier.model)}
    assert {cls.name for cls in catalogue(heavier.model, ["mass_drift"])} == {"mass_drift"}


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "sure"), [(2, True), (1, False)])
def test_two_drags_may_stand_for_one_of_another_power(seed, sure):
    """Where the logs do not tell, it is a rival of both."""
    case, both = make(seed, ["surge_cubic_drag"], SHORT), {"surge_quadratic_drag", "surge_stribeck"}
    found = searched(case, sorted(both))
    if sure:
        assert found.effects == () and {lead.name for lead in found.leads} == both | {"surge_cubic_drag"}
    else:
        assert set(found.effects) == both
        assert {(r.name, r.instead_of) for r in found.rivals} == {("surge_cubic_drag", n) for n in both}
        assert all(r.behind < 0.0 for r in found.rivals)
