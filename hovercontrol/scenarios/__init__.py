"""Scenarios: runs of the source documents (and a user's own), written as TOML."""

from hovercontrol.scenarios.definition import Scenario
from hovercontrol.scenarios.load import load_scenario, scenario_names
from hovercontrol.scenarios.result import Run
from hovercontrol.scenarios.runner import run_scenario

__all__ = ["Run", "Scenario", "load_scenario", "run_scenario", "scenario_names"]
