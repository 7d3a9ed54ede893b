"""Laws found in simulated logs: the form, the size, and none where none is."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from threadpoolctl import threadpool_limits

import hovercontrol as hc
from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.evidence.holdout import held_fit
from hovercontrol.identification.diagnose.laws.grammar import law_names
from hovercontrol.identification.diagnose.laws.scan import yardsticks
from hovercontrol.identification.diagnose.laws.screen import effective_tests, screened
from hovercontrol.identification.diagnose.search.base import base_fit
from hovercontrol.identification.engine.data import gather

DT, N = 0.05, 800


def ship() -> hc.BlockModel:
    S = hc.Signal
    v, r, delta = S("v", "m/s", nominal=0.5), S("r", "rad/s", nominal=0.5), S("rudder", "rad", nominal=0.5)
    numbers = (
        ("yv", "1/s", 0.4),
        ("yr", "m/s", 0.3),
        ("yd", "m/s^2", 0.6),
        ("nr", "1/s", 0.8),
        ("nd", "1/s^2", 1.2),
    )
    p = {n: S(n, unit, start=start) for n, unit, start in numbers}
    k = {n: s.symbol for n, s in p.items()}
    return hc.BlockModel(
        hc.Block(
            "ship", [v, r], [delta], [v, r], list(p.values()),
            {
                "v": -k["yv"] * v.symbol - k["yr"] * r.symbol + k["yd"] * delta.symbol,
                "r": -k["nr"] * r.symbol + k["nd"] * delta.symbol,
            },
        )
    )  # fmt: skip


def log(seed: int, c: float) -> hc.Log:
    """Return a log of the ship with ``c abs(v) r`` in r', by scipy."""
    rng = np.random.default_rng(seed)
    t = DT * np.arange(N)
    edges = np.cumsum(rng.uniform(0.5, 3.0, 60))
    delta = rng.uniform(-0.6, 0.6, 61)[np.searchsorted(edges, t)]

    def slopes(at, x):
        d = delta[min(int(at / DT + 1e-9), N - 1)]
        v, r = x
        return [-0.4 * v - 0.3 * r + 0.6 * d, -0.8 * r + 1.2 * d + c * abs(v) * r]

    run = solve_ivp(slopes, (0.0, t[-1]), [0.0, 0.0], t_eval=t, max_step=DT, rtol=1e-8, atol=1e-10)
    seen = run.y + 2e-3 * rng.normal(size=run.y.shape)
    return hc.Log(f"log {seed}", t, {"v": seen[0], "r": seen[1], "rudder": delta})


@pytest.fixture(scope="module")
def lacking():
    with threadpool_limits(1, "blas"):
        return base_fit(ship(), gather(ship(), [log(0, -1.5), log(1, -1.5)]))


def test_the_true_form_is_among_the_best_of_the_screening(lacking):
    names = law_names(ship())
    found = screened(lacking, names, CRITERIA, ship())
    assert "law_r__abs_v__r" in [s.name for s in found.laws][:3]
    assert 1.0 < found.tests < len(names)


def test_the_yardstick_finds_that_something_is_a_function_of_the_signals(lacking):
    (of_r,) = yardsticks(lacking, ["r"])
    assert of_r.gain > 50.0
    assert set(of_r.signals) <= {"v", "r", "rudder"}


def test_the_yardstick_of_a_held_out_log_leaves_the_coefficients_as_they_are(lacking):
    with threadpool_limits(1, "blas"):
        held = held_fit(lacking.model, gather(ship(), [log(2, -1.5)]))
        (of_r,) = yardsticks(held, ["r"])
    assert of_r.gain > 20.0
    assert set(of_r.signals) <= {"v", "r", "rudder"}


def test_the_yardstick_gives_nothing_where_nothing_is_missing():
    with threadpool_limits(1, "blas"):
        fit = base_fit(ship(), gather(ship(), [log(0, 0.0), log(1, 0.0)]))
    assert all(y.gain < 20.0 for y in yardsticks(fit, ["v", "r"]))
    assert screened(fit, law_names(ship()), CRITERIA, ship()).laws == []


@pytest.mark.slow
def test_the_law_is_named_in_place_of_a_drag_that_stands_for_it():
    """In these logs v follows r, so that the catalogue alone names a quadratic drag and leaves something."""
    found = hc.diagnose(ship(), [log(0, -1.5), log(1, -1.5)], log(2, -1.5))
    (own,) = found.effects
    assert own.effect == "law_r__abs_v__r" and own.unit == "1/m"
    assert own.value == pytest.approx(-1.5, abs=3 * own.std)
    assert found.after.rms["r"] < 0.3 * found.before.rms["r"]
    assert [e["kind"] for e in found.result()["effects"]] == ["law"]
    assert "abs(v) r in r'" in str(found)


def test_effective_tests_count_independent_columns_whole_and_equal_ones_once():
    assert effective_tests(np.eye(7)) == pytest.approx(7.0)
    twice = np.kron(np.eye(3), np.ones((2, 2)))
    assert effective_tests(twice) == pytest.approx(3.0)
