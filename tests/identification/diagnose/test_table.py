"""The reduced blind table."""

from collections import Counter

from .table import AXES, FEWEST, cases, reduced


def test_the_reduced_table_has_300_planned_cases_and_some_of_each_axis():
    few = reduced()
    assert len(few) == len(set(few)) == 300
    assert set(few) <= set(cases(list(AXES), None))
    of = Counter(axis for axis, _, _ in few)
    assert min(of[axis] for axis in AXES) >= FEWEST
