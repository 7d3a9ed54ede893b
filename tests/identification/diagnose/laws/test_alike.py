"""Laws that logs hardly tell apart: compared on equal terms, and told apart by the proposed experiment."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from threadpoolctl import threadpool_limits

import hovercontrol as hc
from hovercontrol.identification.benchmark.cases import gust
from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.experiment.propose import next_experiment
from hovercontrol.identification.diagnose.laws.screen import LikelyLaw
from hovercontrol.identification.diagnose.laws.search import _with_same
from hovercontrol.identification.diagnose.search.base import base_fit
from hovercontrol.identification.diagnose.search.confirm import Selection
from hovercontrol.identification.diagnose.search.fit import TRIALS, Search, try_effect, with_times
from hovercontrol.identification.engine.data import gather
from tests.identification.diagnose.laws.test_search import DT, N, ship

TRUE, MIRRORED = "law_r__abs_v__r", "law_r__v__r"


def log(seed: int, pushed: float, least: float) -> hc.Log:
    """Return a log of the ship with ``-1.5 abs(v) r`` and pushes in r', its rudder at least `least`."""
    rng = np.random.default_rng(seed)
    t = DT * np.arange(N)
    edges = np.cumsum(rng.uniform(0.5, 3.0, 60))
    delta = rng.uniform(least, 0.6, 61)[np.searchsorted(edges, t)]
    delta[N // 2 : N // 2 + 4] = -0.6  # too short for the ship to turn to the other side
    push = gust(rng, N, 8 * DT, pushed)  # nearly white: not the correlation time that a fit begins with

    def slopes(at, x):
        k = min(int(at / DT + 1e-9), N - 1)
        v, r = x
        return [-0.4 * v - 0.3 * r + 0.6 * delta[k], -0.8 * r + 1.2 * delta[k] - 1.5 * abs(v) * r + push[k]]

    run = solve_ivp(slopes, (0.0, t[-1]), [0.0, 0.0], t_eval=t, max_step=DT, rtol=1e-8, atol=1e-10)
    seen = run.y + 2e-3 * rng.normal(size=run.y.shape)
    return hc.Log(f"log {seed}", t, {"v": seen[0], "r": seen[1], "rudder": delta})


def compared(least: float, named: str, breaks_more: bool, pushed: float = 0.1) -> Selection:
    """Return a selection that names a law, compared with the other one."""
    logs = [log(seed, pushed, least) for seed in (0, 1)]
    with threadpool_limits(1, "blas"):
        base = base_fit(ship(), gather(ship(), logs))
        search = Search(ship(), None, CRITERIA, lambda what: None)
        trials = {n: ship().effect_class(n)(0.1) for n in (TRUE, MIRRORED)}
        own = with_times(search, try_effect(search, base, trials[named].neutral()))
        (other,) = set(trials) - {named}
        given = Selection(
            base, own.fit, (named,), {named: own.gain}, {named: own.blocks}, without={named: base}
        )
        return _with_same(search, given, [LikelyLaw(named, own.gain, {other: breaks_more}, trials)])


@pytest.mark.slow
@pytest.mark.parametrize("named", [TRUE, MIRRORED])
def test_laws_that_are_one_in_the_logs_are_equally_likely_whichever_was_fitted_first(named):
    found = compared(0.1, named, False)
    (rival,) = found.rivals
    assert {rival.name, *found.effects} == {TRUE, MIRRORED}
    assert abs(rival.behind) < TRIALS.level and not rival.same
    assert set(found.gains) == set(found.blocks) == set(found.without) == {rival.instead_of}


def test_a_law_that_is_surely_likelier_takes_the_place_of_the_one_that_was_fitted_first():
    found = compared(-0.6, MIRRORED, False, 0.02)
    assert found.effects == (TRUE,) and not found.rivals


@pytest.mark.slow
def test_a_law_that_breaks_a_symmetry_is_the_same_in_the_logs_until_an_experiment_tells_it():
    found = compared(0.1, TRUE, True, 0.02)
    (rival,) = found.rivals
    assert found.effects == (TRUE,) and rival.same
    assert rival.fit.model.effect(MIRRORED).values["value"] != 0.0
    with threadpool_limits(1, "blas"):
        experiment, advice = next_experiment(found, ())
    assert experiment is not None and experiment.benefit > 40.0
    assert TRUE in advice and MIRRORED in advice
    assert experiment.commands["rudder"].min() < 0.0


@pytest.mark.slow
def test_a_law_that_breaks_a_symmetry_and_is_surely_unlikely_is_no_rival():
    assert not compared(-0.6, TRUE, True, 0.02).rivals
