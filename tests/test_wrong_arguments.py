"""The public API, called wrongly: each argument of each thing offered, replaced by what it cannot be.

The calls that are right come from the examples of the docstrings (:mod:`tests.fuzz.sound`).
"""

import inspect

import pytest

from tests.fuzz.sound import CALLABLES, sound_calls
from tests.fuzz.walk import WRONG, walk
from tests.test_public_api import CLASSES, FUNCTIONS

#: Errors themselves, a SymPy function, a protocol that others implement.
NO_GATE = {"InputError", "UnitError", "SmoothedFrictionWarning", "sgn", "Delays"}


def test_everything_offered_passes_the_gate():
    through = {q: f for q, f in FUNCTIONS.items() if inspect.signature(f).parameters}
    through |= {
        q: c.__init__ for q, c in CLASSES.items() if "__init__" in vars(c) and c.__name__ not in NO_GATE
    }
    assert len(through) > 230
    assert [q for q, thing in through.items() if not hasattr(thing, "__checked__")] == []


@pytest.mark.slow
def test_wrong_arguments_are_refused_in_one_line():
    calls = sound_calls(0.5)  # those whose examples come to their call soon; the fuzzer has the others
    count = walk(calls, seconds=0.3, every=5)
    assert count.broken == []
    assert len(calls) > 0.8 * len(CALLABLES) and count.total() > 200 * len(WRONG)
    assert count.probes["refused"] > 10 * count.probes["accepted"] > 0
