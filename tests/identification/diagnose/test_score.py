"""How outcomes of blind cases count."""

import pytest

from .score import outcome

RIVAL = [("slope", "wind")]


@pytest.mark.parametrize(
    ("hidden", "verdict", "named", "rivals", "counts"),
    [
        (["slope"], "effect", ["slope"], [], "right"),
        (["slope"], "partial", ["slope"], [], "right"),
        (["slope"], "effect", ["wind"], [], "wrong"),
        (["slope"], "effect", ["slope", "gyro_bias"], [], "wrong"),
        (["slope"], "partial", ["wind"], [], "wrong"),
        (["slope"], "none", [], [], "missed"),
        (["slope"], "unexplained", [], [], "honest"),
        (["slope"], "ambiguous", ["wind"], RIVAL, "honest"),
        (["slope"], "ambiguous", ["wind", "gyro_bias"], RIVAL, "wrong"),
        (["wind"], "ambiguous", ["wind"], RIVAL, "honest"),
        (["munk_moment"], "ambiguous", ["wind"], RIVAL, "wrong"),
        (["slope", "gyro_bias"], "partial", ["slope"], [], "honest"),
        (["slope", "gyro_bias"], "effect", ["slope"], [], "missed"),
        ([], "none", [], [], "right"),
        ([], "unexplained", [], [], "wrong"),
        ([], "effect", ["slope"], [], "wrong"),
    ],
)
def test_each_outcome_counts_once(hidden, verdict, named, rivals, counts):
    assert outcome(hidden, verdict, named, rivals) == counts


@pytest.mark.parametrize("hidden", ["input_delay", "time_offset"])
@pytest.mark.parametrize("named", ["input_delay", "time_offset"])
def test_a_delay_and_an_offset_of_the_clock_are_one_finding(hidden, named):
    assert outcome([hidden], "effect", [named]) == "right"
    other = ({"input_delay", "time_offset"} - {named}).pop()
    assert outcome([hidden], "ambiguous", [named], [(other, named)]) == "right"


@pytest.mark.parametrize(("verdict", "counts"), [("none", "right"), ("unexplained", "right")])
def test_a_remainder_may_be_told_and_must_not_be_named(verdict, counts):
    assert outcome([], verdict, [], remainder=True) == counts
    assert outcome([], "partial", ["slope"], remainder=True) == "wrong"
    assert outcome([], "ambiguous", ["wind"], RIVAL, remainder=True) == "wrong"
