"""Calibration tables: what is refused of them, and that files come back as they were."""

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.craft.hardware.actuators import (
    FanTable,
    ServoTable,
    actuators,
    fan_tables,
    read_fan_table,
    thrust_lookup,
    with_reverse,
)


@pytest.mark.parametrize("which", [0, 1])
def test_a_table_comes_back_from_its_file(tmp_path, which):
    table = fan_tables()[which]
    found = read_fan_table(table.to_csv(tmp_path / "table.csv"))
    assert found.over == table.over
    assert (found.rudder == table.rudder).all()
    assert found.columns == pytest.approx(table.columns, abs=1e-12)
    assert found.values == pytest.approx(table.values, rel=1e-9, abs=1e-12)


def test_a_users_table_replaces_the_stand_in(tmp_path):
    table = fan_tables(lambda n, rudder: 3e-8 * n * np.abs(n))[0]  # twice as strong, no loss in reverse
    lookup = thrust_lookup(table=read_fan_table(table.to_csv(tmp_path / "mine.csv")), period=0.0).to_numpy()
    for force in (-1.5, 0.5, 1.9):
        speed = lookup.outputs(0.0, (), [force, 0.1])[0] * 60 / (2 * np.pi)
        assert np.sign(speed) * 3e-8 * speed**2 == pytest.approx(force, abs=2e-3)
    assert actuators(tables=fan_tables()).pilot[2].name == "thrust_lookup"


GOOD = [["rudder_deg/force_N", "-1", "0", "1"], ["-5", "-9000", "0", "8000"], ["0", "-8000", "0", "7000"]]


def changed(row, column, cell):
    rows = [list(r) for r in GOOD]
    rows[row][column] = cell
    return rows


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (changed(0, 0, "rudder"), "row 1, column 1: expected 'rudder_deg/force_N' or .*, found 'rudder'"),
        (changed(0, 2, "x"), "row 1, column 3: expected a number, found 'x'"),
        (changed(2, 3, "seven"), "row 3, column 4: expected a number, found 'seven'"),
        (changed(2, 3, "nan"), r"rudder 0 deg \(row 3\), force 1 \(column 4\): expected a finite number"),
        ([*GOOD[:2], GOOD[2][:3]], "row 3: expected 4 cells, found 3"),
        (
            changed(0, 3, "1.5"),
            "forces must increase by equal steps: after 0 expected 1, found 1.5 .column 4",
        ),
        (changed(2, 0, "-5"), "rudder angles must increase by equal steps"),
        (
            changed(1, 2, "-9500"),
            r"rudder -5 deg \(row 2\), force 0 \(column 3\): expected no less than -9000",
        ),
        (GOOD[:2], "expected two or more rudder angles, found 1"),
        ([], "row 1, column 1: expected"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line_with_its_place(tmp_path, rows, said):
    file = tmp_path / "table.csv"
    file.write_text("\n".join(",".join(r) for r in rows))
    with pytest.raises(InputError, match=said) as error:
        read_fan_table(file)
    assert str(error.value).startswith(str(file)) and "\n" not in str(error.value)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.csv: not readable as CSV: "):
        read_fan_table(tmp_path / "nowhere.csv")


def test_shapes_must_fit():
    with pytest.raises(InputError, match="demo: expected 2 x 3 entries, found 3 x 2"):
        FanTable("demo", "force", [0, 5], [0, 1, 2], np.zeros((3, 2)))
    with pytest.raises(InputError, match="over: expected 'force' or 'speed', found 'rpm'"):
        FanTable("demo", "rpm", [0, 5], [0, 1], np.zeros((2, 2)))


@pytest.mark.parametrize(
    ("pulse", "angle", "said"),
    [
        ([1.0, 1.5, 1.5], [0, 1, 2], "pulses must be monotone: entry 3 is 1.5 ms after 1.5 ms"),
        ([1.0, 1.5, 2.0], [0, 2, 1], "angles must be monotone: entry 3 is 1 deg after 2 deg"),
        ([1.0, 1.5, 2.0], [2, 1, 1], "angles must be monotone: entry 3 is 1 deg after 1 deg"),
        ([1.0, 1.5], [0, 2, 1], "two or more pulses and as many angles, found 2 pulses and 3 angles"),
    ],
)
def test_a_servos_table_must_be_monotone(pulse, angle, said):
    with pytest.raises(InputError, match=said):
        ServoTable("demo", pulse, angle)


def test_the_forward_table_of_14_x_81_entries_is_read_and_completed_by_the_reverse_ratio(tmp_path):
    """K06 section 4.3.2: 14 x 81 measured; with (4.4) they make the 14 x 161 of the autopilot."""
    whole, reverse = fan_tables()
    half = FanTable("ahead", "force", whole.rudder, whole.columns[80:], whole.values[:, 80:])
    half.to_csv(tmp_path / "ahead.csv")
    read = read_fan_table(tmp_path / "ahead.csv")
    assert read.shape == (14, 81)
    lookup, forces = with_reverse(read)
    assert lookup.shape == (14, 161)
    np.testing.assert_allclose(lookup.columns, whole.columns, atol=1e-12)
    np.testing.assert_array_equal(lookup.values[:, 80:], whole.values[:, 80:])
    reached = np.abs(whole.values) < half.values[:, -1:] - 250  # beyond, nothing was measured ahead
    assert reached.mean() > 0.6
    assert np.abs(lookup.values - whole.values)[reached].max() < 100  # RPM, between entries
    for speed in (-9000.0, -7000.0, 5000.0, 9000.0):
        ours, known = (
            np.array([np.interp(speed, t.columns, row) for row in t.values]) for t in (forces, reverse)
        )
        np.testing.assert_allclose(ours, known, atol=0.012)  # N
    with pytest.raises(InputError, match="expected a table over forces from 0 N on"):
        with_reverse(whole)
