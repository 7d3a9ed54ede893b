"""What an analysis leaves: tables given as rows, as columns or by a function become the same CSV."""

import csv

import numpy as np
from matplotlib.figure import Figure

from hovercontrol.control.analysis.output import save


def test_rows_columns_and_a_function_write_the_same_table(tmp_path):
    text = '"time [s]","name"\n0.5,"a"\n1.5,"b, c"\n'
    tables = {
        "rows": [{"time [s]": 0.5, "name": "a"}, {"time [s]": 1.5, "name": "b, c"}],
        "columns": {"time [s]": np.array([0.5, 1.5]), "name": ["a", "b, c"]},
        "function": lambda path: path.write_text(text),
    }
    files = save(tmp_path, "figure", Figure(), tables, ["A sentence."])
    assert [f.name for f in files] == [
        "columns.csv", "figure.png", "figure.svg", "figure.txt", "function.csv", "rows.csv",
    ]  # fmt: skip
    for name in tables:
        with (tmp_path / f"{name}.csv").open(newline="") as file:
            assert list(csv.reader(file)) == [["time [s]", "name"], ["0.5", "a"], ["1.5", "b, c"]]
    assert (tmp_path / "figure.txt").read_text() == "A sentence.\n"
