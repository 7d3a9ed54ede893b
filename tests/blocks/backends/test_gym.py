"""A Block as a Gymnasium environment passes Gymnasium's checks and steps as a runner does."""

import pickle

import numpy as np
import pytest

import hovercontrol as hc
from tests.blocks.backends.sampled_by_hand import sampled_loop

gymnasium = pytest.importorskip("gymnasium")
PLANT = hc.vehicle("c17_simulation").plant()
x, y = (s.symbol for s in PLANT.states[:2])
TASK = {
    "reward": -(x**2 + y**2),
    "terminated": x**2 + y**2 > 1.2,
    "duration": 2.0,
    "bounds": {"thrust": (-2.0, 2.0), "rudder": (-0.5, 0.5)},
    "start": {"x": (-1.0, 1.0), "plant.thrust": (0.5, 1.5)},
}
HYBRID = {
    "reward": 1.0,
    "actions": ["push"],
    "observations": ["v"],
    "duration": 0.2,
    "bounds": {"push": (-1.0, 1.0)},
}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("block", "task"), [(PLANT, TASK), (sampled_loop(), HYBRID)], ids=["plant", "sampled"]
)
def test_gymnasium_s_checker_passes(block, task):
    from gymnasium.utils.env_checker import check_env

    env = block.gym(0.05, **task)
    assert isinstance(env, gymnasium.Env)
    check_env(env, skip_render_check=True)
    again = pickle.loads(pickle.dumps(env))
    assert again.reset(seed=3)[0].tolist() == env.reset(seed=3)[0].tolist()


def test_a_step_is_that_of_a_simulation():
    env = PLANT.to("gym", step=0.1, **{**TASK, "start": {}, "rtol": 1e-10})
    env.reset(seed=1)
    actions = np.array([[1.5, 0.2], [2.0, -0.3], [1.0, 0.0]])
    steps = [env.step(action) for action in actions]
    grid, held = 0.1 * np.arange(4), np.vstack([actions, actions[-1:]]).T
    expected = hc.simulate(PLANT, grid, held, rtol=1e-10, atol=1e-12).outputs[:, 1:].T
    np.testing.assert_allclose([s[0] for s in steps], expected, rtol=1e-6, atol=1e-7)
    assert [s[1] for s in steps] == pytest.approx([-(o[0] ** 2 + o[1] ** 2) for o in expected], abs=1e-7)


@pytest.mark.parametrize(
    ("block", "task"), [(PLANT, TASK), (sampled_loop(), HYBRID)], ids=["lanes", "runners"]
)
def test_a_vector_environment_is_gymnasium_s_own_over_single_ones(block, task, rng):
    ours = block.gym(0.05, num_envs=5, substep=1e-3, **task)
    theirs = gymnasium.vector.SyncVectorEnv([lambda: block.gym(0.05, **task, rtol=1e-9)] * 5)
    assert isinstance(ours, gymnasium.vector.VectorEnv)
    assert ours.observation_space == theirs.observation_space and ours.action_space == theirs.action_space
    np.testing.assert_allclose(ours.reset(seed=7)[0], theirs.reset(seed=7)[0], rtol=1e-14)
    ends = 0
    for _ in range(100):
        actions = rng.uniform(-1.0, 1.0, ours.action_space.shape)
        found, wanted = ours.step(actions), theirs.step(actions)
        for a, b in zip(found[:4], wanted[:4], strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-6)
        ends += int((found[2] | found[3]).sum())
    assert ends > 5  # episodes ended and began again


def test_functions_judge_one_and_many_alike():
    task = {
        **TASK,
        "reward": lambda o, a: -(o[..., 0] ** 2) - o[..., 1] ** 2,
        "terminated": lambda o, a: o[..., 0] > 9,
    }
    one, many = PLANT.gym(0.05, **task), PLANT.gym(0.05, num_envs=2, **task)
    one.reset(seed=1), many.reset(seed=1)
    found, wanted = one.step(np.array([1.0, 0.1])), many.step(np.array([[1.0, 0.1]] * 2))
    assert found[1] == pytest.approx(wanted[1][0], abs=1e-6) and isinstance(found[1], float)
    assert found[2] is False and wanted[2].tolist() == [False, False]


def test_time_in_the_equations_is_the_time_of_the_episode():
    a = hc.Signal("a", lower=-1.0, upper=1.0)
    s, unit = hc.Signal("s"), hc.Signal("unit", "1/s", start=1.0)
    block = hc.Block("clocked", [s], [a], [s], [unit], {"s": hc.time * unit.symbol**2})
    env = block.gym(0.5, reward=1.0, num_envs=2)
    env.reset(seed=1)
    seen = [env.step(np.zeros((2, 1)))[0][0, 0] for _ in range(3)]
    assert seen == pytest.approx([0.125, 0.5, 1.125])  # t^2/2


@pytest.mark.parametrize("many", [None, 2])
def test_a_run_that_fails_ends_its_episode(many):
    s, a, unit = hc.Signal("s", start=1.0), hc.Signal("a"), hc.Signal("unit", "1/s", start=10.0)
    block = hc.Block("blown", [s], [a], [s], [unit], {"s": unit.symbol * s.symbol**2})
    env = block.gym(1.0, reward=1.0, num_envs=many)
    env.reset(seed=1)
    _, reward, terminated, _, info = env.step(np.zeros((many, 1)) if many else np.zeros(1))
    assert np.all(terminated) and np.all(np.asarray(reward) == 0.0) and "stopped" in info


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"actions": ["trust"]}, "unknown input 'trust'; did you mean 'thrust'"),
        ({"observations": []}, "expected one or more different outputs"),
        ({"reward": hc.Signal("xx").symbol}, "reward uses unknown signal 'xx'"),
        ({"start": {"z": (0.0, 1.0)}}, "start: unknown state or parameter 'z'"),
        ({"bounds": {"thrust": (1.0, 0.0)}}, r"bounds of 'thrust': expected \(low, high\)"),
        ({"duration": -1.0}, "duration must be positive"),
        ({"num_envs": 0}, "num_envs must be 1 or more"),
    ],
)
def test_wrong_arguments_are_told_in_one_line(change, said):
    with pytest.raises(hc.InputError, match=said):
        PLANT.gym(0.05, **{**TASK, **change})


def test_a_step_before_a_reset_and_a_missing_package_are_told(monkeypatch):
    with pytest.raises(hc.InputError, match=r"needs reset\(\)"):
        PLANT.gym(0.05, **TASK).step([0.0, 0.0])
    monkeypatch.setitem(__import__("sys").modules, "gymnasium", None)
    with pytest.raises(hc.InputError, match=r'pip install "\.\[rl\]"'):
        PLANT.gym(0.05, **TASK)
