"""Numbers that stand for missing values are named with their column, rows and what to do."""

from __future__ import annotations

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.craft.models.vehicles import c17_experiment
from hovercontrol.identification.check import check
from hovercontrol.identification.identify import identify
from hovercontrol.logs import Log, read_log
from hovercontrol.logs.codes import gap_code

T = 0.02 * np.arange(400)
LOST = (T > 3.0) & (T < 3.5)


def coded(column: str, code: float) -> Log:
    """A craft that goes round, with one column coded where it was lost."""
    columns = {"x": np.sin(T), "y": np.cos(T), "psi": 0.3 + T}
    columns |= {"thrust": 2.0 + np.sin(3 * T), "rudder": 0.3 * np.cos(T)}
    return Log("run.csv", T, columns | {column: np.where(LOST, code, columns[column])})


@pytest.mark.parametrize("code", [-999.0, -9999.0, 999.0, 9999.0, -1e30, 1e38])
@pytest.mark.parametrize("column", ["x", "psi", "thrust"])
def test_a_code_for_missing_values_is_named_in_one_line(column, code, tmp_path):
    coded(column, code).save(tmp_path / "run.csv")
    with pytest.raises(InputError) as said:
        read_log(tmp_path / "run.csv", inputs=["thrust", "rudder"])
    assert f"column {column!r}: {code:g} in {LOST.sum()} rows, the first in line 153, looks" in str(
        said.value
    )
    assert str(said.value).endswith(f": --missing {code:g}") and "degrees" not in str(said.value)


@pytest.mark.parametrize("code", [-999.0, 9999.0, -1e30])
@pytest.mark.parametrize("column", ["x", "psi", "thrust"])
def test_a_code_that_is_named_is_a_missing_sample(column, code, tmp_path):
    coded(column, code).save(tmp_path / "run.csv")
    log = read_log(tmp_path / "run.csv", inputs=["thrust", "rudder"], missing=[-1.0, code])
    assert np.array_equal(np.isnan(log[column]), LOST) and log.missing(column) == LOST.sum()
    assert not np.isnan(log.stack(*(log.columns.keys() - {column}))).any()


def test_codes_are_numbers_of_the_file_and_not_of_the_log(tmp_path):
    coded("psi", -999.0).save(tmp_path / "run.csv")
    log = read_log(tmp_path / "run.csv", {"psi": "psi:deg"}, missing=[-999.0])
    assert log.missing("psi") == LOST.sum()


def test_logs_made_in_python_are_looked_at_too():
    log = coded("psi", -999.0)
    line = f"run.csv: column 'psi': -999 in {LOST.sum()} rows, the first at 3.02 s, looks"
    with pytest.raises(InputError, match=line):
        identify(c17_experiment(), [log])
    assert [e.startswith(line) for e in check(c17_experiment(), [log]).errors] == [True]
    assert [w.startswith(line) for w in check(None, [log]).warnings] == [True]


def test_any_number_that_repeats_far_outside_a_pose_is_one():
    assert gap_code(coded("x", 1e6)["x"]) == 1e6
    assert gap_code(coded("x", 1e6)["x"], any_number=False) is None


@pytest.mark.parametrize(
    "row",
    [
        np.linspace(0.0, 999.0, 400),  # reached by moving
        np.where(LOST, 0.0, 5.0 + 0.1 * np.sin(T)),  # zero is a place
        np.where(LOST, 999.0, 0.0),  # switched on
        np.full(400, 999.0),
        np.where(T == 2.0, 40.0, np.sin(T)),  # an outlier: one row
        np.full(400, np.nan),
        np.empty(0),
    ],
)
def test_what_a_signal_may_be_is_no_code(row):
    assert gap_code(row) is None
