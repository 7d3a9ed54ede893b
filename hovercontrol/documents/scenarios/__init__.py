"""Scenarios: runs of the source documents (and a user's own), written as TOML."""

from hovercontrol.documents.scenarios.definition import Scenario
from hovercontrol.documents.scenarios.load import load_scenario, scenario_names
from hovercontrol.documents.scenarios.result import Run
from hovercontrol.documents.scenarios.runner import run_scenario

__all__ = ["Run", "Scenario", "load_scenario", "run_scenario", "scenario_names"]
