"""The tutorials run as they stand, and what they show is what the scripts hold."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

TUTORIALS = Path(__file__).parents[2] / "docs" / "tutorials"


def test_scripts_with_a_tutorial_are_shown_in_it():
    for script in TUTORIALS.glob("*.py"):
        assert f"python from={script.name} " in script.with_suffix(".md").read_text(encoding="utf-8")


@pytest.mark.slow
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
    assert 0.9 < after < 1.1  # the laser's noise is 1 mm
    assert "cable spring" in (tmp_path / "report.html").read_text(encoding="utf-8")

    command = [sys.executable, "-m", "hovercontrol.app.cli", "diagnose", "trial1.csv", "trial2.csv"]
    own = ["--holdout", "trial3.csv", "--model", f"{script}:MODEL", "--effects", "cable_spring,rail_slope"]
    again = subprocess.run([*command, *own], capture_output=True, text=True, timeout=120, cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    result = json.loads((tmp_path / "out" / "diagnose" / "result.json").read_text(encoding="utf-8"))
    numbers = [number["value"] for effect in result["effects"] for number in effect["numbers"].values()]
    assert numbers == pytest.approx([0.8, 0.5], rel=0.005)


@pytest.mark.slow
def test_the_calibration_finds_what_its_benches_were_drawn_with(tmp_path):
    script = TUTORIALS / "calibration.py"
    grams = tmp_path / "pulses.csv"  # two fans, 0.5 N per (us/1000 - 1)^2 each
    rows = [f"{pulse},{2 * 0.5 * (pulse / 1e3 - 1) ** 2 / 9.80665e-3}" for pulse in range(1100, 1801, 50)]
    grams.write_text("\n".join(["pwm,trial_1", *rows]), encoding="utf-8")
    command = [sys.executable, str(script), "--out", str(tmp_path / "out"), "--pulses", str(grams)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("tables: (14, 161) speeds over forces")
    found = re.findall(r"^  (\w+) = (\S+) \+- (\S+)", done.stdout, flags=re.MULTILINE)
    drawn = {"slope": -1.40, "offset": 0.566, "inertia": 0.096, "c3": 9.734e-4, "c0": -1.099}  # (4.3), (4.4)
    for name, value, std in found:
        if name in drawn:
            assert abs(float(value) - drawn.pop(name)) < 3.5 * float(std), name
    assert not drawn
    assert [float(value) for name, value, _ in found if name in "abc"][-3:] == pytest.approx([0.5, -1.0, 0.5])
    worst = re.search(r"wrong: (\d+) mN", done.stdout)
    assert 0 < int(worst[1]) < 20
    assert {"thrust.png", "reverse_ratio.png", "speed_over_force.csv"} <= {
        file.name for file in (tmp_path / "out").iterdir()
    }


@pytest.mark.slow
def test_the_real_crafts_fans_lag(tmp_path):
    data = Path(os.environ.get("HOVERCONTROL_DATA", TUTORIALS.parents[2] / "shared" / "data")) / "holohover"
    if not (data / "h1_aligned.csv").exists():
        pytest.skip(f"the craft's log is not in {data}")
    script = TUTORIALS / "real_craft.py"
    command = [sys.executable, str(script), "--data", str(data), "--out", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("verdict: partial\nMissing: fan lag, 0.02")
    falls = re.findall(r"0.2 s ahead: (\S+) -> (\S+)", done.stdout)
    assert len(falls) == 3 and all(float(after) < 0.85 * float(before) for before, after in falls)
