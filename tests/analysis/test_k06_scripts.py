"""The scripts of K06's basins and margins leave pictures, tables and findings."""

import importlib.util
from pathlib import Path

import pyarrow.csv
import pytest

FOLDER = Path(__file__).parents[2] / "analyses"
SMALL = {"k06_turn_basins": {"points": 8}, "k06_margins": {"points": 4, "instants": 4}}


@pytest.mark.parametrize("name", SMALL)
def test_a_script_leaves_pictures_tables_and_findings(name, tmp_path):
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    told = []
    files = module.main(tmp_path, told.append, **SMALL[name])
    assert [f.suffix for f in files].count(".csv") == 3
    assert {f.suffix for f in files} == {".png", ".svg", ".csv", ".txt"}
    assert told[-1] == pytest.approx(1.0)
    for file in files:
        assert file.stem.startswith(name)
        if file.suffix == ".csv":
            assert pyarrow.csv.read_csv(file).num_rows >= 4
    assert "nan" not in (tmp_path / f"{name}.txt").read_text().split()
