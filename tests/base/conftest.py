"""Results that notebooks show, each made once."""

import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.craft.effects import effect
from hovercontrol.documents.scenarios import load_scenario, run_scenario
from hovercontrol.documents.scenarios.grid import vary
from hovercontrol.identification.check import check
from hovercontrol.identification.diagnose import diagnose
from hovercontrol.identification.identify.study import Study
from hovercontrol.logs import Log

CRAFT = hc.vehicle("c17_experiment")


def runs():
    rng, t, found = np.random.default_rng(3), 0.04 * np.arange(300), []
    truth = CRAFT.with_effects([effect("slope", x=0.15)]).plant().compile(friction="smooth")
    for k in range(2):
        u = [np.repeat(rng.uniform(*span, 15), 20) for span in ((1, 4), (-0.4, 0.4))]
        run = truth.simulate(t, u)
        seen = {
            n: y + 1e-3 * rng.normal(size=t.size) for n, y in zip(run.output_labels, run.outputs, strict=True)
        }
        found.append(Log(f"run{k}", t, seen | dict(zip(("thrust", "rudder"), u, strict=True))))
    return found


@pytest.fixture(scope="session")
def logs():
    return runs()


@pytest.fixture(scope="session")
def results(logs):
    scenario = load_scenario("k06-turn")
    sweep = vary(scenario, {"controller.k2": np.linspace(1.0, 6.0, 5)}, "r", "final")
    study = Study.make(CRAFT, logs[:1], logs[1:])
    return {
        "log": logs[0],
        "run": run_scenario(scenario, lambda t: None),
        "varied": sweep,
        "sweep": sweep.result,
        "study": study,
        "identified": study.found,
        "free run": study.judged[0].run,
        "diagnosis": diagnose(CRAFT, logs[:1], logs[1], names=["slope"]),
        "check": check(CRAFT, logs[:1]),
    }
