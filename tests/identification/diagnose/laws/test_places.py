"""Laws that differ in their place only: told apart, and found in two equations at once."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from threadpoolctl import threadpool_limits

import hovercontrol as hc
from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.laws.grammar import law_names
from hovercontrol.identification.diagnose.laws.screen import screened
from hovercontrol.identification.diagnose.laws.search import in_own_equations
from hovercontrol.identification.diagnose.report import write_report
from hovercontrol.identification.diagnose.search.base import base_fit
from hovercontrol.identification.diagnose.search.confirm import Selection
from hovercontrol.identification.engine.data import gather
from tests.identification.diagnose.laws.test_search import DT, N, ship

IN_V, IN_R = -0.9, 1.4


def log(seed: int, in_v: float, in_r: float) -> hc.Log:
    """Return a log of the ship with ``in_v abs(v) v`` in v' and ``in_r abs(v) v`` in r', by scipy."""
    rng = np.random.default_rng(seed)
    t = DT * np.arange(N)
    edges = np.cumsum(rng.uniform(0.5, 3.0, 60))
    delta = rng.uniform(-0.6, 0.6, 61)[np.searchsorted(edges, t)]

    def slopes(at, x):
        d = delta[min(int(at / DT + 1e-9), N - 1)]
        v, r = x
        push = abs(v) * v
        return [-0.4 * v - 0.3 * r + 0.6 * d + in_v * push, -0.8 * r + 1.2 * d + in_r * push]

    run = solve_ivp(slopes, (0.0, t[-1]), [0.0, 0.0], t_eval=t, max_step=DT, rtol=1e-8, atol=1e-10)
    seen = run.y + 2e-3 * rng.normal(size=run.y.shape)
    return hc.Log(f"log {seed}", t, {"v": seen[0], "r": seen[1], "rudder": delta})


@pytest.fixture(scope="module")
def screening():
    logs = [log(0, IN_V, IN_R), log(1, IN_V, IN_R)]
    with threadpool_limits(1, "blas"):
        base = base_fit(ship(), gather(ship(), logs))
        drag = ship().with_effects([ship().effect_class("v_quadratic_drag")(-IN_V)])
        named = Selection(base, base_fit(drag, gather(drag, logs)), ("v_quadratic_drag",), steps=())
        return screened(base, law_names(ship()), CRITERIA, ship()), named


def test_the_same_forms_in_the_other_equation_are_searched_too(screening):
    found, _ = screening
    forms = {s.name.split("__", 1)[1] for s in found.laws}
    assert found.elsewhere
    assert {n.split("__", 1)[1] for n in found.elsewhere} <= forms
    assert not {s.name for s in found.laws} & set(found.elsewhere)
    assert "law_v__abs_v__v" not in found.elsewhere  # the catalogue has a name for it


def test_a_law_in_an_equation_without_a_name_is_searched_beside_the_name(screening):
    found, named = screening
    assert in_own_equations(found.laws, named)
    in_v = [s for s in found.laws if s.name.startswith("law_v")]
    assert not in_own_equations(in_v, named)


@pytest.mark.slow
def test_a_force_off_the_centre_of_mass_is_found_in_both_equations(tmp_path):
    found = hc.diagnose(ship(), [log(0, IN_V, IN_R), log(1, IN_V, IN_R)], log(2, IN_V, IN_R))
    of = {e.effect: e for e in found.effects}
    assert set(of) == {"v_quadratic_drag", "law_r__abs_v__v"}
    assert of["v_quadratic_drag"].value == pytest.approx(-IN_V, abs=3 * of["v_quadratic_drag"].std)
    assert of["law_r__abs_v__v"].value == pytest.approx(IN_R, abs=3 * of["law_r__abs_v__v"].std)
    assert found.rivals == ()
    assert "one form in 2 equations" in write_report(found, tmp_path / "report.html").read_text()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("in_v", "in_r", "name", "where"),
    [(0.0, IN_R, "law_r__abs_v__v", "force in r'"), (IN_V, 0.0, "v_quadratic_drag", "force in v'")],
)
def test_a_force_in_one_equation_is_told_from_the_same_in_the_other(in_v, in_r, name, where):
    found = hc.diagnose(ship(), [log(0, in_v, in_r), log(1, in_v, in_r)], log(2, in_v, in_r))
    assert [(e.effect, e.place) for e in found.effects] == [(name, where)]
    assert found.rivals == ()
