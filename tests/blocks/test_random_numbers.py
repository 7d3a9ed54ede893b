"""Random numbers as equations: the published generator, whatever the backend, and how good its draws are."""

import numpy as np
import pytest
from scipy import stats

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.random_numbers import random_numbers
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.simulation.sampled import Ticking


def source(count, kind, salt="source", name="source", period=1.0):
    noise = random_numbers(count, salt=salt, kind=kind)
    outputs = [Signal(f"{name}_{k}") for k in range(count)]
    told = {s.name: value for s, value in zip(outputs, noise.values, strict=True)}
    own = (noise.parameters, noise.next_values, told, noise.definitions)
    return Block(name, noise.states, [], outputs, *own, period=period)


def drawn(block, ticks, seed=1.0):
    run = Ticking(block, {f"{block.name}.seed": seed})
    return np.array([list(run.tick(0.0, {}).values()) for _ in range(ticks)])


def mrg32k3a(state, n):
    """L'Ecuyer's generator in whole numbers, as the paper has it."""
    m1, m2 = 2**32 - 209, 2**32 - 22853
    p, q = list(state[:3]), list(state[3:])
    for _ in range(n):
        p = [*p[1:], (1403580 * p[1] - 810728 * p[0]) % m1]
        q = [*q[1:], (527612 * q[2] - 1370589 * q[0]) % m2]
        z = (p[2] - q[2]) % m1
        yield (z if z else m1) / (m1 + 1)


def test_it_is_the_published_generator():
    block = source(1, "uniform").with_values({s.name: 12345.0 for s in source(1, "uniform").states})
    found = drawn(block, 2000)[:, 0]
    assert found == pytest.approx(list(mrg32k3a([12345] * 6, 2000)), rel=1e-15, abs=0)
    assert found[:3] == pytest.approx(
        [0.1270111, 0.3185275, 0.3091860], abs=1e-6
    )  # printed in many libraries


def test_machine_code_draws_the_same_numbers():
    idle = Block("idle", [Signal("z", "m")], [], [], derivatives={"z": Signal("w", "m/s", start=1.0).symbol},
                 parameters=[Signal("w", "m/s", start=1.0)])  # fmt: skip
    whole = interconnect([source(2, "uniform"), idle])
    run = whole.compile().simulate(np.arange(500.0))
    assert run.outputs.T.tolist() == drawn(source(2, "uniform"), 500).tolist()


@pytest.mark.parametrize("seed", [0.0, 1.0, 2.0, 2.0**31 - 3])
def test_draws_have_their_distribution(seed):
    normal = drawn(source(3, "normal"), 4000, seed)
    assert min(stats.kstest(column, "norm").pvalue for column in normal.T) > 1e-4
    assert np.abs(np.corrcoef(normal.T) - np.eye(3)).max() < 5 / np.sqrt(4000)
    assert abs(np.corrcoef(normal[1:, 0], normal[:-1, 2])[0, 1]) < 5 / np.sqrt(4000)
    uniform = drawn(source(1, "uniform"), 4000, seed)[:, 0]
    assert stats.kstest(uniform, "uniform").pvalue > 1e-4


def test_neighbouring_seeds_and_other_salts_are_independent():
    block = source(1, "uniform")
    first = [drawn(block, 1, float(seed))[0, 0] for seed in range(2000)]
    assert stats.kstest(first, "uniform").pvalue > 1e-4
    assert abs(np.corrcoef(first[1:], first[:-1])[0, 1]) < 5 / np.sqrt(2000)
    one, other = (drawn(source(1, "normal", salt=salt), 4000)[:, 0] for salt in ("left", "right"))
    assert abs(np.corrcoef(one, other)[0, 1]) < 5 / np.sqrt(4000)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"count": 0}, "count must be positive"),
        ({"count": 1, "kind": "gauss"}, "kind must be"),
        ({"count": 1, "seed": -1}, "a seed is a whole number from 0"),
        ({"count": 1, "seed": 1.5}, "a seed is a whole number from 0"),
    ],
)
def test_what_does_not_fit_is_refused(arguments, said):
    with pytest.raises(InputError, match=said):
        random_numbers(salt="x", **arguments)
