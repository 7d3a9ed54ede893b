"""The verdict from a search and its remainders."""

from types import SimpleNamespace

import pytest

from hovercontrol.identification.diagnose.verdict import verdict_of


def selection(effects=(), rivals=()):
    return SimpleNamespace(effects=effects, rivals=tuple(SimpleNamespace(same=same) for same in rivals))


LEFT, NOTHING = SimpleNamespace(there=True), SimpleNamespace(there=False)


@pytest.mark.parametrize(
    ("effects", "rivals", "remainders", "verdict"),
    [
        ((), (), (NOTHING, NOTHING), "none"),
        ((), (), (NOTHING, LEFT), "unexplained"),
        (("slope",), (), (NOTHING,), "effect"),
        (("slope",), (), (NOTHING, LEFT), "partial"),
        (("slope",), (False,), (NOTHING,), "ambiguous"),
        (("slope",), (False,), (LEFT,), "ambiguous"),
        (("input_delay",), (True,), (NOTHING,), "effect"),
        (("input_delay",), (True,), (LEFT,), "partial"),
        (("input_delay",), (True, False), (NOTHING,), "ambiguous"),
    ],
)
def test_each_verdict(effects, rivals, remainders, verdict):
    assert verdict_of(selection(effects, rivals), remainders) == verdict
