"""Laws with a memory of one input: found in exact logs, and carried to every backend."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import StateSpace, cont2discrete, lsim
from threadpoolctl import threadpool_limits

import hovercontrol as hc
from hovercontrol.craft.effects.law import law_class
from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.laws.grammar import law_names
from hovercontrol.identification.diagnose.laws.screen import screened
from hovercontrol.identification.diagnose.laws.search import sound
from hovercontrol.identification.diagnose.search.base import base_fit
from hovercontrol.identification.engine.data import gather

DT, N = 0.05, 800
DRAG, GAIN, SLOW, TAU = 0.8, 1.0, 0.7, 0.9
NAME = "law_w__filtered_a"


def motor() -> hc.BlockModel:
    S = hc.Signal
    w, a = S("w", "rad/s"), S("a", "V")
    d, k = S("d", "1/s", start=DRAG), S("k", "rad/s^2/V", start=GAIN)
    rate = -d.symbol * w.symbol + k.symbol * a.symbol
    return hc.BlockModel(hc.Block("motor", [w], [a], [w], [d, k], {"w": rate}))


def exact(c: float) -> StateSpace:
    """Return w' = -d w + k a + c a_f, tau a_f' = a - a_f, output w."""
    return StateSpace([[-DRAG, c], [0.0, -1.0 / TAU]], [[GAIN], [1.0 / TAU]], [[1.0, 0.0]], [[0.0]])


def log(seed: int, c: float) -> hc.Log:
    """Return a log of the exact solution between steps of the command."""
    rng = np.random.default_rng(seed)
    t = DT * np.arange(N)
    edges = np.cumsum(rng.uniform(0.5, 3.0, 60))
    command = rng.uniform(-1.0, 1.0, 61)[np.searchsorted(edges, t)]
    system = exact(c)
    A, B, *_ = cont2discrete((system.A, system.B, system.C, system.D), DT)
    x = np.zeros((N, 2))
    for k in range(N - 1):
        x[k + 1] = A @ x[k] + B[:, 0] * command[k]
    return hc.Log(f"log {seed}", t, {"w": x[:, 0] + 2e-3 * rng.normal(size=N), "a": command})


@pytest.fixture(scope="module")
def lacking():
    with threadpool_limits(1, "blas"):
        return base_fit(motor(), gather(motor(), [log(0, SLOW), log(1, SLOW)]))


def test_the_memory_of_the_input_is_the_best_law_at_a_time_constant_near_the_true_one(lacking):
    with threadpool_limits(1, "blas"):
        found = screened(lacking, law_names(motor()), CRITERIA, motor())
    best = found.laws[0]
    assert best.name == NAME
    assert best.trials[NAME].values["tau"] == pytest.approx(TAU, rel=0.8)


def test_nothing_of_the_past_is_screened_where_nothing_is_missing():
    with threadpool_limits(1, "blas"):
        base = base_fit(motor(), gather(motor(), [log(0, 0.0), log(1, 0.0)]))
        found = screened(base, law_names(motor()), CRITERIA, motor())
    assert NAME not in [s.name for s in found.laws]


@pytest.mark.slow
def test_the_memory_is_named_with_its_size_and_time_constant():
    found = hc.diagnose(motor(), [log(0, SLOW), log(1, SLOW)], log(2, SLOW))
    of = {e.parameter: e for e in found.effects}
    assert set(of) == {NAME, f"{NAME}_tau"}
    assert of[NAME].value == pytest.approx(SLOW, abs=3 * of[NAME].std)
    assert of[f"{NAME}_tau"].value == pytest.approx(TAU, abs=3 * of[f"{NAME}_tau"].std)
    assert "a_f in w'" in str(found)


def shaken(seed: int) -> hc.Log:
    """Return a log of the motor with a load on a spring that it shakes, solved exactly from row to row.

    With a load at q from its rest: ``w' = -d w + k a + 0.3 pull``, ``pull = W^2 q + 2 z W q'``,
    ``q'' = -pull - w'``, W = 2 pi 0.15/s, z = 0.5.
    """
    rng = np.random.default_rng(seed)
    edges = np.cumsum(rng.uniform(0.5, 3.0, 60))
    command = rng.uniform(-1.0, 1.0, 61)[np.searchsorted(edges, DT * np.arange(N))]
    fast = 2 * np.pi * 0.15
    pull = np.array([0.0, fast**2, fast])
    rate = np.array([-DRAG, 0.0, 0.0]) + 0.3 * pull
    slopes = np.array([rate, [0.0, 0.0, 1.0], -pull - rate])
    push = np.array([[GAIN], [0.0], [-GAIN]])
    A, B, *_ = cont2discrete((slopes, push, np.eye(3), np.zeros((3, 1))), DT)
    x = np.zeros((N, 3))
    for k in range(N - 1):
        x[k + 1] = A @ x[k] + B[:, 0] * command[k]
    return hc.Log(f"log {seed}", DT * np.arange(N), {"w": x[:, 0] + 2e-3 * rng.normal(size=N), "a": command})


@pytest.mark.slow
def test_a_load_that_the_command_shakes_is_no_memory_of_first_order():
    """A filter of first order takes part of it, and held-out logs confirm that part."""
    found = hc.diagnose(motor(), [shaken(0), shaken(1)], shaken(2))
    assert found.verdict == "unexplained" and found.effects == ()
    assert next(x.reason for x in found.leads if x.name == NAME).startswith("more is missing than this law")


def test_a_memory_beside_more_than_noise_is_not_sound_whatever_it_takes(lacking):
    model = motor().with_effects([motor().effect_class(NAME)(SLOW, tau=TAU)])
    again = SimpleNamespace(selection=SimpleNamespace(final=SimpleNamespace(model=model)))
    assert not sound(again, NAME, lacking, CRITERIA)


def test_the_plant_and_its_machine_code_have_the_response_of_the_exact_system():
    plant = motor().with_effects([motor().effect_class(NAME)(SLOW, tau=TAU)]).plant()
    t = DT * np.arange(200)
    command = np.sin(0.9 * t)
    run = plant.compile().simulate(t, [command], rtol=1e-9, atol=1e-11)  # each value held to the next row
    _, wanted, _ = lsim(exact(SLOW), command, t, interp=False)
    assert np.atleast_2d(run.outputs)[0] == pytest.approx(wanted, abs=1e-8)


def test_a_model_file_holds_the_memory_and_its_time_constant(tmp_path):
    craft = hc.vehicle("c17_experiment")
    amended = craft.with_effects([craft.effect_class("law_u__filtered_thrust")(0.4, tau=0.3)])
    file = hc.save_model(amended, tmp_path / "craft.toml")
    assert "law_u__filtered_thrust = {value = 0.4, tau = 0.3}" in file.read_text()
    assert hc.load_model(file) == amended


def test_two_memories_in_one_law_are_refused():
    with pytest.raises(hc.InputError, match="two factors with numbers of their own; one is the most"):
        law_class("law_w__filtered_a__filtered_b", {"w": "rad/s", "a": "V", "b": "V"})
