"""Rows that are kept belong to the tool as it was."""

from hovercontrol.identification.benchmark.run import run_cases

TOOL = """
from hovercontrol.identification.benchmark.answer import Answer


def guess(model, train_logs, holdout_log):
    return Answer("{verdict}")
"""


def test_a_tool_whose_file_has_changed_is_run_again(tmp_path):
    file, kept = tmp_path / "tool.py", tmp_path / "kept"
    kept.mkdir()
    verdicts = []
    for verdict in ("none", "unknown"):
        file.write_text(TOOL.format(verdict=verdict))
        for _ in range(2):
            (row,) = run_cases(["motor.nothing.noise.0"], [f"{file}:guess"], kept, 1, lambda done: None)
            verdicts.append(row["verdict"])
    assert verdicts == ["none", "none", "unknown", "unknown"]
    assert len(list(kept.iterdir())) == 2
