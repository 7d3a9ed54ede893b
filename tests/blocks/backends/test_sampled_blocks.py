"""Runs of a sampled Block in every backend, against its map iterated by hand."""

import numpy as np
import pytest

import hovercontrol as hc

H, N = 0.05, 12
T, U = H * np.arange(N), np.sin(np.arange(N))


def filter_block():
    y, z = hc.Signal("y", start=0.1), hc.Signal("z")
    c, a = hc.Signal("c"), hc.Signal("a", start=0.2)
    following = {"y": (1 - a.symbol) * y.symbol + a.symbol * c.symbol * y.symbol**2, "z": y.symbol}
    return hc.Block("filter", [y, z], [c], [y, z], [a], following, period=H)


def by_hand(a=0.2, start=0.5):
    y, z, rows = start, 0.0, []
    for u in U:
        rows.append((y, z))
        y, z = (1 - a) * y + a * u * y**2, y
    return np.array(rows).T


@pytest.mark.parametrize("start", [{"y": 0.5}, {"filter.y": 0.5}, [0.5, 0.0]], ids=["own", "whole", "array"])
@pytest.mark.parametrize(
    "run",
    [
        lambda b, **k: hc.simulate(b, T, {"c": U}, **k),
        lambda b, **k: b.compile().simulate(T, {"c": U}, **k),
        pytest.param(lambda b, **k: b.to_jax().simulate(T, {"c": U}, **k), marks=pytest.mark.slow),
        pytest.param(
            lambda b, **k: b.to_jax().simulate(T, {"c": U}, method="rk4", **k), marks=pytest.mark.slow
        ),
    ],
    ids=["python", "c", "jax", "jax rk4"],
)
def test_every_backend_iterates_the_map_from_states_by_their_own_names(run, start):
    assert run(filter_block(), x0=start).outputs == pytest.approx(by_hand(), abs=1e-14)


def test_sweeps_take_no_step_and_agree():
    wanted = [by_hand(a)[0, -1] for a in (0.1, 0.3)]
    given = {"params": {"filter.a": [0.1, 0.3]}, "x0": {"y": 0.5}, "inputs": {"c": U}}
    for found in (filter_block().compile().sweep(T, **given), filter_block().to_jax().sweep(T, **given)):
        assert found.final[:, 0] == pytest.approx(wanted, abs=1e-14)


@pytest.mark.slow
def test_the_gradient_of_a_run_in_jax_is_that_of_the_map():
    jax = pytest.importorskip("jax")
    run = filter_block().to_jax().run_function(T, {"c": U})
    slope = jax.grad(lambda a: run({"filter.a": a}, {"y": 0.5})["y"][-1])(0.2)
    step = 1e-6
    assert slope == pytest.approx(
        (by_hand(0.2 + step)[0, -1] - by_hand(0.2 - step)[0, -1]) / (2 * step), rel=1e-7
    )


def test_casadi_has_the_next_values():
    f = filter_block().to_casadi()
    assert f.derivatives(0.0, [0.5, 0.0], [U[3]], f.parameters).full().ravel() == pytest.approx(
        [0.8 * 0.5 + 0.2 * U[3] * 0.25, 0.5]
    )


def test_an_environment_starts_and_steps_with_the_map():
    pytest.importorskip("gymnasium")
    block = filter_block()
    env = block.gym(H, reward=block.signal("y").symbol, start={"y": (0.5, 0.5)})
    seen, _ = env.reset(seed=1)
    assert seen == pytest.approx([0.5, 0.0])
    seen, reward, *_ = env.step([1.0])
    assert seen == pytest.approx([0.8 * 0.5 + 0.2 * 0.25, 0.5]) and reward == pytest.approx(seen[0])
