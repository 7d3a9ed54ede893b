"""Sets of candidates by their cross-validated gain, against least squares on the raw columns."""

from types import SimpleNamespace

import numpy as np
import pytest

from hovercontrol.craft.effects import effect
from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.search.candidates import Candidate
from hovercontrol.identification.diagnose.search.score import Scores
from hovercontrol.identification.diagnose.search.sets import best_set, singles

BLOCKS, ROWS = 12, 60
NAMES = ("body_surge_force", "body_side_force", "rudder_offset", "gyro_bias")


def table(residual, unknowns, columns, names=NAMES):
    """Return the table of a linear problem: blocks of rows, columns of unknowns and of one candidate each."""
    scores = object.__new__(Scores)
    every = np.concatenate([unknowns, columns], axis=2)
    P, M = unknowns.shape[2], columns.shape[2]
    scores.G = np.einsum("brp,brq->bpq", every, every)
    scores.f = -np.einsum("brp,br->bp", every, residual)
    scores.P, scores.movable, scores.pull = P, np.arange(P), np.zeros(P)
    scores.fit = SimpleNamespace(prior=SimpleNamespace(precision=np.zeros(P)))
    scores.tried = [Candidate(n, effect(n, 0.01), ("value",)) for n in names[:M]]
    scores.own = [(k,) for k in range(M)]
    return scores


def left_out(residual, unknowns, columns):
    """Return by how much the squares of each block fall where other blocks chose the sizes, summed."""

    def squares(W):
        total = 0.0
        for b in range(BLOCKS):
            rest = np.arange(BLOCKS) != b
            theta = np.linalg.lstsq(W[rest].reshape(-1, W.shape[2]), -residual[rest].ravel(), rcond=None)[0]
            total += float(((residual[b] + W[b] @ theta) ** 2).sum())
        return total

    return squares(unknowns) - squares(np.concatenate([unknowns, columns], axis=2))


@pytest.fixture
def parts(rng):
    unknowns, columns = rng.normal(size=(BLOCKS, ROWS, 3)), rng.normal(size=(BLOCKS, ROWS, 4))
    columns[..., 1] += 0.8 * columns[..., 0]
    noise = rng.normal(size=(BLOCKS, ROWS))
    return noise, unknowns, columns


def test_the_gain_is_that_of_squares_on_blocks_left_out(parts):
    noise, unknowns, columns = parts
    residual = noise + 0.4 * columns[..., 0] + unknowns @ [0.1, 0.0, -0.2]
    scores = table(residual, unknowns, columns)
    for i in range(4):
        expected = left_out(residual, unknowns, columns[..., [i]])
        assert scores.left_out_gain(i) == pytest.approx(expected, abs=1e-6)
    pair = scores.left_out_gain_of([*scores.columns_of(0), *scores.columns_of(2)])
    assert pair == pytest.approx(left_out(residual, unknowns, columns[..., [0, 2]]), abs=1e-6)
    alone = singles(scores)
    assert alone[0].names == ("body_surge_force",)
    assert best_set(scores, alone, CRITERIA) is None  # a needless second effect gains nothing


def test_two_effects_that_act_together_are_a_set(parts):
    noise, unknowns, columns = parts
    columns[..., 2] += 2.0 * columns[..., 0]  # each hides most of the other
    residual = noise + 1.0 * columns[..., 0] - 0.45 * columns[..., 2]
    scores = table(residual, unknowns, columns)
    alone = singles(scores)
    found = best_set(scores, alone, CRITERIA)
    assert set(found.names) == {"body_surge_force", "rudder_offset"}
    assert found.gain > alone[0].gain + CRITERIA.least


def test_what_is_in_one_block_alone_gains_nothing(parts):
    noise, unknowns, columns = parts
    residual = noise.copy()
    residual[0] += 3.0 * columns[0, :, 3]
    residual[1] -= 3.0 * columns[1, :, 3]
    found = {s.names[0]: s.gain for s in singles(table(residual, unknowns, columns))}
    assert max(found.values()) < CRITERIA.least


def test_a_shift_in_time_is_no_partner_of_another(parts):
    noise, unknowns, columns = parts
    names = ("input_delay", "time_offset")
    residual = noise - columns[..., 0] - columns[..., 1]
    scores = table(residual, unknowns, columns[..., :2], ("body_surge_force", "body_side_force"))
    alone = singles(scores)
    assert best_set(scores, alone, CRITERIA) is not None
    scores = table(residual, unknowns, columns[..., :2], ("body_surge_force", "body_side_force"))
    scores.tried = [Candidate(n, effect(n, 0.01), ()) for n in names]
    alone = singles(scores)
    assert len(alone) == 2 and best_set(scores, alone, CRITERIA) is None
