"""Sample logs of the package, simulated by it (``python -m hovercontrol.documents.samples``)."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from hovercontrol.logs import Log

#: What a motion-capture log of a rudder craft has: pose and commands.
COLUMNS = ("x", "y", "psi", "thrust", "rudder")


def sample_path() -> Path:
    """Return the file of the sample log: 40 s of thrust and rudder steps, pose at 50 Hz."""
    return Path(str(resources.files("hovercontrol.documents.samples") / "rudder_craft.csv"))


def make_sample() -> Log:
    """Simulate the sample log anew (scenario ``sample``), rounded to a micrometre and a microradian."""
    from hovercontrol.documents.scenarios import load_scenario, run_scenario

    run = run_scenario(load_scenario("sample"))
    return Log("rudder_craft", run.time.round(6), {name: run.columns[name].round(6) for name in COLUMNS})
