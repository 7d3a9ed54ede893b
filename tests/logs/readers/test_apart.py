"""A library that crashes, stalls or prints in its own process costs one line, not the program."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers import apart
from hovercontrol.logs.readers.tables import faults


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("while True: pass", "numpy did not end within 1 s"),
        ("os.kill(os.getpid(), 11)", "numpy was ended by signal 11"),
        ("os._exit(3)", "numpy ended with 3"),
        ("raise OSError('a broken superblock')", "OSError: a broken superblock"),
    ],
)
def test_a_library_that_fails_is_told_in_one_line(tmp_path: Path, monkeypatch, body: str, said: str) -> None:
    monkeypatch.setattr(apart, "PATIENCE", 1.0)
    (tmp_path / "script.py").write_text(f"import os\ndef contents(file):\n    {body}\n")
    (tmp_path / "a.h5").write_bytes(b"")
    script = SimpleNamespace(__file__=str(tmp_path / "script.py"))
    with (
        pytest.raises(InputError, match=f"a.h5: not readable as HDF5: {said}$"),
        faults(tmp_path / "a.h5", "HDF5"),
    ):
        apart.Apart(tmp_path / "a.h5", script, "numpy", "HDF5 files").call("contents", "")


def test_arrays_come_back_as_they_are_whatever_the_library_prints(tmp_path: Path) -> None:
    (tmp_path / "csv.py").write_text("raise ImportError('a file beside the script is not imported')")
    (tmp_path / "script.py").write_text(
        "import csv, os, numpy as np\ndef contents(file):\n    print('one'); os.write(1, b'two')\n"
        "    return {'unit': '°'}, {'a/b': np.arange(6.0).reshape(2, 3).T, 'ü': np.zeros(0, 'i2')}\n"
    )
    script = SimpleNamespace(__file__=str(tmp_path / "script.py"))
    about, arrays = apart.Apart(tmp_path / "script.py", script, "numpy", "x").call("contents", "")
    assert about == {"unit": "°"} and list(arrays) == ["a/b", "ü"]
    assert np.array_equal(arrays["a/b"], [[0, 3], [1, 4], [2, 5]]) and arrays["ü"].dtype == np.int16
