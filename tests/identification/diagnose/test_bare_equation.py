"""An effect may act in any equation, also in one in which the model has nothing: no drag beside two fans."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hovercontrol as hc
from hovercontrol.craft.effects import effect_class, effect_names
from hovercontrol.identification.diagnose import diagnose
from hovercontrol.identification.diagnose.evidence.holdout import held_fit
from hovercontrol.identification.diagnose.evidence.remainder import remainders
from hovercontrol.identification.diagnose.report import write_report
from hovercontrol.identification.diagnose.search.base import base_fit
from hovercontrol.identification.diagnose.search.candidates import candidates
from hovercontrol.identification.diagnose.search.columns import columns
from hovercontrol.identification.diagnose.search.score import Scores
from hovercontrol.identification.engine.data import gather
from hovercontrol.identification.engine.fit import first_noise, refit
from hovercontrol.identification.engine.prior import prior_of
from hovercontrol.identification.engine.problem import Problem
from hovercontrol.logs import Log

ARM, FORCE, TORQUE, DRAG = 0.03, 17.0, 500.0, (0.4, 1.0, 0.7)
BOAT = hc.Model(
    "airboat",
    [hc.effect("fan_force", FORCE), hc.effect("fan_torque", TORQUE)],
    fans=[hc.Fan("left", -0.03, ARM, 0.0), hc.Fan("right", -0.03, -ARM, 0.0)],
)


def sailed(seconds=10.0, step=0.04, seed=5):
    """Two fans push ahead and turn, linear drag brakes: Newton by hand, commands held between rows."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, seconds, step)
    pushes = np.repeat(rng.uniform(0.0, 0.06, (2, -(-t.size // 25))), 25, axis=1)[:, : t.size]

    def slope(at, s):
        psi, u, v, r = s[2:]
        left, right = pushes[:, min(int(at / step + 1e-9), t.size - 1)]
        return [
            u * np.cos(psi) - v * np.sin(psi),
            u * np.sin(psi) + v * np.cos(psi),
            r,
            FORCE * (left + right) + r * v - DRAG[0] * u,
            -r * u - DRAG[1] * v,
            TORQUE * ARM * (right - left) - DRAG[2] * r,
        ]

    run = solve_ivp(slope, (0.0, t[-1]), np.zeros(6), t_eval=t, rtol=1e-9, atol=1e-9, max_step=step)
    pose = run.y[:3] + 1e-3 * rng.normal(size=(3, t.size))
    return Log(f"run{seed}", t, dict(zip(("x", "y", "psi", "left", "right"), (*pose, *pushes), strict=True)))


@pytest.fixture(scope="module")
def bare():
    """The boat's model without any drag, fitted."""
    return base_fit(BOAT, gather(BOAT, [sailed()]))


MAY_LACK = [
    n for n in effect_names() if BOAT.accepts(effect_class(n)) and n not in ("fan_force", "fan_torque")
]


def test_a_craft_without_any_sway_force_is_one_on_which_a_force_may_act_there(bare):
    """What no equation says of sway is process noise, and it is seen."""
    assert bare.problem.driven_names == ("u", "v", "r") and bare.noise.process[1] > 0.1
    assert [r.equation for r in remainders(bare, bare)] == ["u'", "v'", "r'"]


@pytest.mark.parametrize("name", MAY_LACK)
def test_every_effect_is_scored_and_fitted_on_it(bare, name):
    tried = candidates(bare, [name])
    groups, _ = columns(bare, tried)
    assert all(np.isfinite(a).all() for pair in groups for a in pair if a is not None)
    (best,) = Scores(bare, tried).best()
    fit = held_fit(BOAT.with_effects([best.effect]), bare.problem.data, near=bare)
    assert np.isfinite(fit.cost) and fit.noise.process.shape == (3,)


def test_the_drag_that_was_there_scores_best_of_what_acts_in_sway_alone(bare):
    best = Scores(bare, candidates(bare)).best()
    sway = [s for s in best if type(s.candidate.trial).axis == "v" and s.allowed]
    assert sway[0].candidate.name == "sway_linear_drag" and sway[0].gain > 20.0


@pytest.mark.slow
def test_the_drags_that_were_there_are_named(tmp_path):
    found = diagnose(BOAT, [sailed(30.0)], sailed(20.0, seed=6))
    truth = dict(zip(("surge_linear_drag", "sway_linear_drag", "yaw_linear_drag"), DRAG, strict=True))
    assert {e.effect for e in found.effects} == truth.keys() and found.verdict == "effect"
    for e in found.effects:
        assert abs(e.value - truth[e.effect]) < 4.0 * e.std
    write_report(found, tmp_path / "report.html")
    assert "linear drag in sway" in (tmp_path / "report.html").read_text()


# ---- a Block of one's own --------------------------------------------------------------------------


@pytest.fixture
def side_drag():
    """A drag across a hull, as a user writes one."""

    class SideDrag(hc.Effect):
        """Drag across the hull."""

        name, source = "side_drag_in_a_test", "viscous friction"
        value = hc.Coefficient("1/s", lower=0.0)

        def terms(self, c, s):
            return {"v": -c.value * s.v}

    yield SideDrag
    hc.Effect.known.pop(SideDrag.name)


def hull():
    """A hull in its own axes: nothing but the turning of these acts in v'."""
    u, v, r = (hc.Signal(n, unit) for n, unit in (("u", "m/s"), ("v", "m/s"), ("r", "rad/s")))
    push, turn = hc.Signal("push", "m/s^2"), hc.Signal("turn", "rad/s^2")
    drag, damping = hc.Signal("drag", "1/s", start=0.4), hc.Signal("damping", "1/s", start=0.7)
    return hc.Block(
        "hull",
        [u, v, r],
        [push, turn],
        [u, v, r],
        [drag, damping],
        {
            "u": push.symbol + r.symbol * v.symbol - drag.symbol * u.symbol,
            "v": -r.symbol * u.symbol,
            "r": turn.symbol - damping.symbol * r.symbol,
        },
    )


def drifted(side=1.0):
    rng, t = np.random.default_rng(3), np.arange(0.0, 10.0, 0.04)
    push, turn = (np.repeat(rng.uniform(*span, 10), 25) for span in ((0.0, 2.0), (-1.0, 1.0)))

    def slope(at, s):
        k = min(int(at / 0.04 + 1e-9), t.size - 1)
        u, v, r = s
        return [push[k] + r * v - 0.4 * u, -r * u - side * v, turn[k] - 0.7 * r]

    run = solve_ivp(slope, (0.0, t[-1]), np.zeros(3), t_eval=t, rtol=1e-9, atol=1e-9, max_step=0.04)
    seen = dict(zip("uvr", run.y + 1e-3 * rng.normal(size=run.y.shape), strict=True))
    return Log("drift", t, {**seen, "push": push, "turn": turn})


@pytest.mark.parametrize("listed", [True, False])
def test_an_effect_of_ones_own_acts_in_any_equation_of_a_block(side_drag, listed):
    """What its catalogue holds is allowed for from the first fit on, anything else from when it is tried."""
    model = hc.BlockModel(hull(), [side_drag.name] if listed else ["input_delay"])
    base = base_fit(model, gather(model, [drifted()]))
    assert base.problem.driven_names == (("u", "v", "r") if listed else ("u", "r"))
    (best,) = Scores(base, candidates(base, [side_drag.name])).best()
    problem = Problem(model.with_effects([best.effect]), base.problem.data, pieces=base.problem.each)
    fit = refit(base, problem, prior_of(problem, model))
    assert fit.p[problem.names.index(side_drag.name)] == pytest.approx(1.0, abs=0.02)
    again = refit(fit, base.problem, base.prior)  # and without it once more
    assert again.cost < base.cost + 1.0


def test_noise_keeps_its_levels_in_the_equations_that_both_problems_have(side_drag):
    model = hc.BlockModel(hull(), ["input_delay"])
    data = gather(model, [drifted()])
    few, more = Problem(model, data), Problem(model.with_effects([side_drag(1.0)]), data)
    noise = replace(first_noise(few), process=np.array([0.1, 0.2]), seconds=np.array([0.3, 0.4]))
    there = noise.of(more)
    assert there.driven == ("u", "v", "r") and there.process[[0, 2]].tolist() == [0.1, 0.2]
    assert there.process[1] == more.accelerations[1] and there.seconds[[0, 2]].tolist() == [0.3, 0.4]
    back = there.of(few)
    assert (back.process.tolist(), back.seconds.tolist()) == ([0.1, 0.2], [0.3, 0.4])
