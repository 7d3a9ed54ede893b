"""The tutorials run as they stand, and what they show is what the scripts hold."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

TUTORIALS = Path(__file__).parents[2] / "docs" / "tutorials"


@pytest.mark.parametrize("text", sorted(TUTORIALS.glob("*.md")), ids=lambda path: path.stem)
def test_every_example_stands_in_its_script(text):
    script = text.with_suffix(".py").read_text(encoding="utf-8")
    examples = re.findall(r"```python\n(.*?)```", text.read_text(encoding="utf-8"), flags=re.DOTALL)
    assert examples
    for example in examples:
        assert example in script


def test_the_cable_of_a_users_own_machine_is_named_from_closed_loop_logs(tmp_path):
    script = TUTORIALS / "own_machine.py"
    done = subprocess.run(
        [sys.executable, str(script), "--out", str(tmp_path)], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    said = done.stdout
    assert said.startswith("verdict: effect\n")
    found = {}
    for name, value, low, high in re.findall(r"^(\w+) = (\S+) .*: (\S+) to (\S+)$", said, flags=re.MULTILINE):
        assert float(low) < float(value) < float(high)
        found[name] = float(value)
    assert found == pytest.approx({"cable_spring": 0.8, "cable_spring_beyond": 0.5}, rel=0.005)
    before, after = map(float, re.findall(r"(\S+) mm", said))
    assert before > 4.0
    assert 0.95 < after < 1.05  # the laser's noise is 1 mm
    assert "cable spring" in (tmp_path / "report.html").read_text(encoding="utf-8")

    command = [sys.executable, "-m", "hovercontrol.cli", "diagnose", "trial1.csv", "trial2.csv"]
    own = ["--holdout", "trial3.csv", "--model", f"{script}:MODEL", "--effects", "cable_spring,rail_slope"]
    again = subprocess.run([*command, *own], capture_output=True, text=True, timeout=120, cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    result = json.loads((tmp_path / "out" / "diagnose" / "result.json").read_text(encoding="utf-8"))
    numbers = [effect["coefficient"] for effect in result["effects"]]
    assert numbers == pytest.approx([0.8, 0.5], rel=0.005)
