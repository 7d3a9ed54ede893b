"""A sampled scenario is wired from Blocks: as stepped by hand, compiled, in NumPy, and over many runs."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.documents.scenarios import load_scenario, run_scenario
from hovercontrol.documents.scenarios.definition import Phase
from hovercontrol.documents.scenarios.grid import vary
from hovercontrol.documents.scenarios.parts import loop_parts, phase_parameters
from hovercontrol.documents.scenarios.sampling import sampled_loop
from tests.control.observers.textbook import Textbook

TABLE2 = load_scenario("table2")
#: Two phases, the estimator on in the second, without noise: that a hand can step.
SHORT = replace(
    TABLE2,
    phases=(Phase("off", 0.5, scale={"yaw_coulomb": 1.2}), Phase("on", 1.2, adaptation=1.0)),
    estimator={**TABLE2.estimator, "start": 0.5},
    sampling=replace(TABLE2.sampling, position_noise=0.0, heading_noise=0.0),
    metrics=(),
)


@pytest.fixture(scope="module")
def run():
    return run_scenario(SHORT)


def by_hand(scenario, until):
    """Step plant, camera, estimator, controller and radio in a loop, friction by Runge-Kutta of 0.5 ms."""
    parts = loop_parts(scenario)
    plant, controller, reference = (parts[k] for k in ("plant", "controller", "reference"))
    c = scenario.estimator
    names = scenario.belief.linear_coefficients()
    prior = [scenario.belief.coefficients()[n] for n in names]
    estimator = Textbook(prior, 0.01, c["R"], c["Q"], c["P0"])
    x = np.array([s.start for s in plant.states])
    computed = sent = np.zeros(2)
    pose, rows, tick, rhs = None, [], 0.0005, plant.to_numpy().derivatives
    hats = estimator.c
    for k in range(round(until / tick)):
        t = k * tick
        phase = scenario.phases[0] if t < scenario.phases[0].until - 1e-9 else scenario.phases[1]
        params = phase_parameters(scenario, phase)
        if k % 20 == 0:  # 100 Hz: camera, estimator, controller
            now = x[:3].copy()
            speed = x[3:].copy()
            if pose is not None:
                dx, dy, dpsi = (now - pose) / 0.01
                cos, sin = math.cos(now[2]), math.sin(now[2])
                speed = np.array([cos * dx + sin * dy, -sin * dx + cos * dy, dpsi])
            pose = now
            if t >= c["start"] - 1e-9:
                hats = estimator.step(speed, computed)
            told = reference.to_numpy().outputs(t, ())
            known = dict(zip(("x", "y", "psi", "u", "v", "r"), (*now, *speed), strict=True))
            known |= dict(zip((s.name for s in reference.outputs), told, strict=True))
            known |= dict(zip((f"{n}_hat" for n in names), hats, strict=True))
            share = {"controller.adaptation": phase.adaptation}
            given = [known[s.name] for s in controller.inputs]
            computed = controller.to_numpy().outputs(t, (), given, share)[:2]
        if k % 45 == 0:  # 22.5 ms: the radio
            sent = computed
        if k % 20 == 0:
            rows.append((t, *x, *sent, *hats))
        own = {key: v for key, v in params.items() if key.startswith("plant.")}
        half = x + tick / 2 * rhs(t, x, sent, own)
        x = x + tick * rhs(t + tick / 2, half, sent, own)
    return np.array(rows).T


def test_the_loop_is_the_one_that_a_hand_steps(run):
    time, *rows = by_hand(SHORT, 1.2)
    names = [f"true_{n}" for n in ("x", "y", "psi", "u", "v", "r")] + ["thrust", "rudder"]
    names += [f"{n}_hat" for n in SHORT.belief.linear_coefficients()]
    at = np.searchsorted(run.time, time - 1e-9)
    for name, values in zip(names, rows, strict=True):
        assert np.abs(run.columns[name][at] - values).max() < 2e-3 * max(1.0, np.abs(values).max()), name


def test_estimates_move_from_the_start_on_only(run):
    hats = np.array([run.columns[f"{n}_hat"] for n in SHORT.belief.linear_coefficients()])
    before = run.time < 0.5 - 1e-9
    assert (hats[:, before] == hats[:, :1]).all()
    assert (hats[:, run.time >= 0.55] != hats[:, :1]).any(axis=0).all()


@pytest.mark.slow
def test_the_python_interpreter_of_ticks_gives_the_same(run):
    """The compiled loop against NumPy's, through the first phase."""
    loop = sampled_loop(SHORT, loop_parts(SHORT))
    found = simulate(loop, np.arange(0.0, 0.305, 0.01), params=phase_parameters(SHORT, SHORT.phases[0]))
    columns = dict(zip(found.output_labels, np.asarray(found.outputs), strict=True))
    for name in ("x", "psi", "r"):
        np.testing.assert_allclose(columns[name], run.columns[f"true_{name}"][:31], atol=1e-5)
    np.testing.assert_allclose(columns["thrust"], run.columns["thrust"][:31], atol=2e-3)


def test_a_sweep_gives_what_single_runs_give(run):
    found = vary(SHORT, {"controller.k1": np.array([1.7, 1.75])}, "tracking_error", "final")
    assert found.values[1] == pytest.approx(run.columns["tracking_error"][-1], abs=1e-5)
    assert found.values[0] != found.values[1]


def test_a_continuous_estimator_has_no_start(tmp_path):
    (tmp_path / "mine.toml").write_text(
        "[scenario]\nstep = 0.01\n[plant]\nvehicle = 'c17_simulation'\n[reference]\nkind = 'circle'\n"
        "radius = 2.0\n[controller]\n[estimator]\nstart = 1.0\n[[phase]]\nuntil = 0.1\n"
    )
    with pytest.raises(InputError, match=r"estimator\.start needs a \[sampling\]"):
        load_scenario(tmp_path / "mine.toml")
