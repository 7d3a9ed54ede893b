"""Every Python example in README runs as it stands."""

import re
from pathlib import Path

import matplotlib
import pytest

README = Path(__file__).parents[1] / "README.md"
BLOCKS = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), flags=re.DOTALL)


def test_there_are_examples():
    assert len(BLOCKS) >= 4


def test_every_example_runs_in_order(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # an example writes an FMU
    matplotlib.use("Agg")
    space: dict = {}
    for block in BLOCKS:
        if block.startswith(">>>"):
            command, _, expected = block.partition("\n")
            exec(command.removeprefix(">>> "), space)
            assert capsys.readouterr().out.strip() == expected.strip()
        else:
            exec(block, space)
    assert space["cart"].feedthrough == {"v": ()}
    assert space["loop"].to_control().nstates == 83
    with pytest.raises(space["hc"].InputError, match="not linear in"):
        space["hc"].kalman_bucy(space["cart"], ["m"])
