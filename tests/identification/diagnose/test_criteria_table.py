"""The table of how near decisions are to their limits: comparisons by hand, and thresholds put back."""

import pytest

from benchmarks.criteria import BEHIND, Row, changed, limits, nearest, planned, table, to_rerun

AT_LEAST, AT_MOST = "gain in twice the log likelihood, at least", "p-value of its size over segments, at most"


def row(rule, value, limit, passed):
    return Row("rich", "slope", 0, "effect slope", "confirm", "slope", rule, value, limit, passed)


def test_a_decision_turns_if_the_other_limit_lies_beyond_its_value():
    just_enough, far = row(AT_LEAST, 30.0, 24.0, 1), row(AT_LEAST, 500.0, 24.0, 1)
    assert (just_enough.turns(2.0), just_enough.turns(0.5)) == (True, False)
    assert not (far.turns(2.0) or far.turns(0.5))
    small = row(AT_MOST, 0.6e-3, 1e-3, 1)
    assert (small.turns(2.0), small.turns(0.5)) == (False, True)


def test_the_table_counts_turning_decisions_and_finds_the_nearest():
    found = [row(AT_LEAST, v, 24.0, v >= 24.0) for v in (10.0, 13.0, 30.0, 500.0)]
    assert nearest(found) == "1.25" and limits(found) == "24"
    assert f"| confirm | {AT_LEAST} | 24 | 4 | 1 | 1 | 1.25 |" in table(found)
    assert [(rule, factor) for rule, factor, *_ in to_rerun(found, 6)] == [(AT_LEAST, 2.0), (AT_LEAST, 0.5)]


@pytest.mark.parametrize("rule", BEHIND)
def test_thresholds_change_inside_only(rule):
    def value(owner, name):
        return owner.spread(40) if name == "spread" else getattr(owner, name)

    before = [value(*own) for own in BEHIND[rule]]
    with changed(rule, 2.0):
        assert [value(*own) for own in BEHIND[rule]] == pytest.approx([2.0 * v for v in before])
    assert [value(*own) for own in BEHIND[rule]] == before


def test_the_first_cases_are_of_different_conditions_and_part_of_more_cases():
    few, many = planned(12), planned(40)
    assert few == many[:12] and len({axis for axis, *_ in few}) == 12
