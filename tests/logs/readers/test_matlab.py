"""MATLAB's timetables, struct arrays and Simulink's signals are read, in version 7 and 7.3."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from hovercontrol.base.errors import InputError
from hovercontrol.logs import read_log

TIME = 0.0125 * np.arange(120)


def test_a_struct_array_is_a_table_with_a_row_for_each_element(tmp_path: Path) -> None:
    rows = np.zeros((1, 120), dtype=[("time", "O"), ("x", "O"), ("note", "O")])
    for k, t in enumerate(TIME):
        rows[0, k] = (t, 0.5 * t, "text")
    savemat(tmp_path / "a.mat", {"log": rows})
    for columns in (None, {"x": "log.x"}, {"x": "x"}):
        log = read_log(tmp_path / "a.mat", columns)
        assert log.time == pytest.approx(TIME) and log["x"] == pytest.approx(0.5 * TIME)


@pytest.mark.parametrize("shape", [(3, 1, 120), (3, 120), (120, 3)])
def test_signals_of_simulink_have_time_as_their_last_or_longest_dimension(tmp_path: Path, shape) -> None:
    values = np.vstack([TIME, 2 * TIME, 3 * TIME])
    values = values.T if shape[0] == 120 else values.reshape(shape)
    signals = {"values": values, "dimensions": np.array([3.0, 1.0])}
    savemat(tmp_path / "a.mat", {"out": {"time": TIME[:, None], "signals": signals}})
    log = read_log(tmp_path / "a.mat", {"x": "out.signals.values[1]", "psi": "signals.values[2]"})
    assert log["x"] == pytest.approx(2 * TIME) and log["psi"] == pytest.approx(3 * TIME)


@pytest.mark.parametrize("version", ["v7", "v7.3"])
def test_a_timetable_is_read_with_its_times(tmp_path: Path, version: str) -> None:
    matio, pandas = pytest.importorskip("matio"), pytest.importorskip("pandas")
    pytest.importorskip("h5py")
    index = pandas.to_timedelta(np.round(1e6 * TIME).astype("int64"), unit="us")
    frame = pandas.DataFrame({"x": 0.5 * TIME, "on": TIME > 0.5, "mode": ["a"] * 120}, index=index)
    frame.index.name = "Time"
    with pytest.warns() as _:
        matio.save_to_mat(str(tmp_path / "a.mat"), {"run": frame}, version=version)
    log = read_log(tmp_path / "a.mat", {"x": "run.x", "on": "run.on"})
    assert log.time == pytest.approx(TIME) and log["x"] == pytest.approx(0.5 * TIME)
    assert np.array_equal(log["on"], TIME > 0.5)


def test_a_library_that_a_file_needs_is_named(tmp_path: Path, monkeypatch) -> None:
    (tmp_path / "a.mat").write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512, b"\0"))

    monkeypatch.setattr("hovercontrol.logs.readers.apart.find_spec", lambda module: None)
    with pytest.raises(InputError, match=r'of version 7.3 needs mat-io: pip install "\.\[logs-all\]"'):
        read_log(tmp_path / "a.mat")
