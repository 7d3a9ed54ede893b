"""Blank cells: a measured one is a sample that is missing, in a command the last value holds."""

from __future__ import annotations

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.craft.models.vehicles import c17_experiment
from hovercontrol.identification.check import check
from hovercontrol.identification.diagnose.checks import check_logs
from hovercontrol.identification.identify import identify
from hovercontrol.logs import Log, join_logs
from hovercontrol.logs.log import Trial
from hovercontrol.logs.prepare import prepared
from tests.logs.test_repeated_samples import COMMANDS, LOG, POSE

NAN = float("nan")


def blanked(rows: slice, *names: str) -> Log:
    columns = {name: LOG[name].copy() for name in names}
    for column in columns.values():
        column[rows] = NAN
    return LOG.with_columns(columns)


@pytest.mark.slow
def test_lost_samples_are_told_and_change_little():
    log = blanked(slice(700, 706), *POSE)
    line = "run.csv: columns 'x', 'y', 'psi': 6 of 1,000 samples missing"
    whole = identify(c17_experiment(), [LOG])
    with pytest.warns(UserWarning, match=line):
        found = identify(c17_experiment(), [log])
    for one, other in zip(found.coefficients, whole.coefficients, strict=True):
        assert one.value == pytest.approx(other.value, abs=other.std)
    assert line in check_logs(c17_experiment(), [log])
    told = check(c17_experiment(), [log])
    assert line in told.warnings and not told.errors
    assert [c.missing for c in told.logs[0].columns] == [6, 6, 6, 0, 0]
    assert "missing" in told.text() and "missing" not in check(None, [LOG]).text()


@pytest.mark.slow
def test_blank_commands_hold():
    log = blanked(slice(405, 412), "thrust")
    found, said = prepared(log, POSE, COMMANDS)
    assert np.array_equal(found["thrust"], LOG["thrust"])
    assert said == ["run.csv: column 'thrust': 7 blank cells hold the last value"]
    with pytest.warns(UserWarning, match="7 blank cells"):
        same = identify(c17_experiment(), [log])
    assert [c.value for c in same.coefficients] == [
        c.value for c in identify(c17_experiment(), [LOG]).coefficients
    ]


def test_rows_before_the_first_command_are_left_out_in_each_trial():
    t = np.arange(8.0)
    fan = np.array([NAN, NAN, 1.0, NAN, NAN, 2.0, NAN, 3.0])
    log = Log("a", t, {"v": t, "fan": fan}, trials=(Trial(0), Trial(4)))
    found, said = prepared(log, ["v"], ["fan"])
    assert found["fan"].tolist() == [1.0, 1.0, 2.0, 2.0, 3.0] and found.trials[1].first == 2
    assert said == [
        "a: column 'fan': 2 blank cells hold the last value",
        "a: 3 rows before the first command: left out",
    ]


def test_rows_of_two_topics_in_one_table_are_read():
    """As an outer join writes them: a row has a pose or a command."""
    rng = np.random.default_rng(0)
    command = np.sort(rng.choice(1000, 300, replace=False))
    command[0] = 0
    pose = np.setdiff1d(np.arange(1000), command)
    columns = {name: LOG[name].copy() for name in LOG.columns}
    for name in POSE:
        columns[name][command] = NAN
    for name in COMMANDS:
        columns[name][pose] = NAN
    log = LOG.with_columns(columns)
    said = check_logs(c17_experiment(), [log])
    assert "run.csv: columns 'x', 'y', 'psi': 300 of 1,000 samples missing" in said
    assert "run.csv: column 'thrust': 700 blank cells hold the last value" in said


@pytest.mark.parametrize("name", ["x", "thrust"])
def test_an_empty_column_is_refused(name):
    log = blanked(slice(None), name)
    line = f"run.csv: column {name!r} is empty: NaN in all 1000 rows"
    for work in (lambda: identify(c17_experiment(), [log]), lambda: check_logs(c17_experiment(), [log])):
        with pytest.raises(InputError, match=line):
            work()
    assert line in check(c17_experiment(), [log]).errors


def test_rows_for_a_command_alone_are_no_missing_samples():
    pose = LOG.select(slice(0, None, 3))
    pose = Log("pose", pose.time, {name: pose[name].copy() for name in POSE})
    pose["x"][7] = NAN
    joined = join_logs(pose, Log("commands", LOG.time, {name: LOG[name] for name in COMMANDS}))
    assert np.isnan(joined["x"]).sum() > 10 and joined.missing("x") == 1
    assert prepared(joined, POSE, COMMANDS)[1] == ["pose: column 'x': 1 of 334 samples missing"]
