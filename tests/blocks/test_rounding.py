"""A value outside its bounds by rounding is the bound, told once; one further outside is refused."""

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.blocks import signals
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal

V = Signal("v", "m/s", start=1.0)
K = Signal("k", "1/s", start=2.0, lower=0.0)
DECAY = Block("decay", [V], [], [V], [K], {"v": -K.symbol * V.symbol})


@pytest.fixture(autouse=True)
def nothing_told(monkeypatch):
    monkeypatch.setattr(signals, "_TOLD", set())


def test_a_parameter_a_hair_outside_is_the_bound_and_told_once(recwarn):
    for value in (-1e-9, -1e-12, np.float32(-1e-7)):
        assert DECAY.parameter_values({"decay.k": value}) == (0.0,)
    assert [str(w.message) for w in recwarn.list] == [
        "decay.k = -1e-09 1/s is out of its bounds [0, inf] by rounding: it is set to 0"
    ]


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (-2e-6, r"out of its bounds \[0, inf\]"), (-1.0, r"out of its bounds \[0, inf\]"),
        (float("nan"), "expected a number, found nan"),
    ],
)  # fmt: skip
def test_one_further_outside_is_refused(value, said):
    with pytest.raises(InputError, match=said):
        DECAY.parameter_values({"decay.k": value})


@pytest.mark.parametrize(
    ("signal", "room"),
    [
        (Signal("rudder", "rad", nominal=0.5, lower=-0.5, upper=0.5), 5e-7),
        (Signal("fan", "N", nominal=0.1, lower=0.0), 1e-7),
        (Signal("share", lower=0.0, upper=0.01), 1e-8),
        (Signal("seed", lower=0.0, upper=4294967295.0), 1e-6),
    ],
)
def test_the_room_is_a_millionth_of_the_nominal_size_or_of_the_range(signal, room):
    assert signal.room == pytest.approx(room)


def test_a_sweep_takes_the_bound_too():
    with pytest.warns(UserWarning, match="by rounding"):
        runs = DECAY.compile().sweep([0.0, 1.0], params={"decay.k": [1.0, -1e-9, -1e-10]})
    assert runs["v"].final[1:].tolist() == [1.0, 1.0]


def test_a_start_value_a_hair_outside_is_the_bound():
    with pytest.warns(UserWarning, match="fan = -1e-09 N is out of its bounds"):
        assert Signal("fan", "N", start=-1e-9, lower=0.0).start == 0.0
