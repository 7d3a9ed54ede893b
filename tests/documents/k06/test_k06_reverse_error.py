"""Figure 6.23: what leaves a steady error astern and none ahead, by hand and in the real loop."""

import numpy as np
import pytest

from hovercontrol import InputError
from hovercontrol.craft.effects import effect
from hovercontrol.documents.k06.reverse_error import (
    SUSPECTS,
    SteadyError,
    Suspect,
    steady_errors,
    suspect_log,
)


def test_less_reverse_thrust_leaves_no_steady_error_without_friction():
    """m u' = -(1 - c) k1 (u - u_ref) rests at u_ref for every loss c."""
    from hovercontrol.blocks.interconnect import interconnect
    from hovercontrol.blocks.simulation.trajectory import simulate
    from hovercontrol.control.controllers.k06 import force_to_command, reverse, setpoints
    from hovercontrol.craft.models.vehicles import hoverdemon

    law = reverse(k1=1.5, k2=1.0, alpha=1.44)
    craft = hoverdemon().with_effects([effect("reverse_thrust_loss", 0.3)]).plant()
    told = setpoints([law], {"surge_ref": -0.73})
    loop = interconnect([craft, law, told, force_to_command(reversing=True)])
    run = simulate(loop, [0.0, 20.0])
    assert run.states[3, -1] == pytest.approx(-0.73, abs=2e-3)
    assert run.states[3, -1] - -0.73 == pytest.approx(0.73 * np.exp(-0.7 * 1.5 / 2.6 * 20.0), rel=0.05)


@pytest.mark.slow
def test_a_dead_zone_leaves_an_error_astern_as_k06_saw():
    craft = {"nothing": SUSPECTS["nothing"], "dead zone": SUSPECTS["dead zone of the fan, 0.2 N"]}
    nothing, found = steady_errors(craft, runs=1)
    assert found.agrees(nothing)[0]
    assert found.yaw_rate < 2 * nothing.yaw_rate  # "agree well": sway and yaw are the simulation's


def test_both_findings_are_asked_for():
    def errors(*values):
        return SteadyError("", tuple(np.array([v]) for v in values[:-1]), np.array([values[-1]]), 0.1)

    nothing = errors(0.01, 0.01, 0.04)
    assert errors(0.09, 0.08, 0.0).agrees(nothing) == (True, True)
    assert errors(0.09, 0.02, 0.0).agrees(nothing) == (False, True)
    assert errors(0.09, 0.08, -0.1).agrees(nothing) == (True, False)


def test_a_suspects_log_is_flown_both_ways_with_what_its_model_lacks():
    scenario = suspect_log(Suspect((effect("surge_coulomb", 0.1),)), seed=3)
    assert {p.setpoints.get("surge_ref", 0.0) for p in scenario.phases} == {-0.76, 0.0, 1.1, -0.5}
    assert scenario.plant != scenario.belief and scenario.autopilot.seed == 3


def test_a_fan_that_starts_late_pushes_ahead_as_before():
    tables = suspect_log(SUSPECTS["no reverse thrust below 6000 RPM"]).autopilot.tables
    straight = dict(zip(tables[1].columns, tables[1].values[7], strict=True))
    assert straight[-5000.0] == 0.0 > straight[-6000.0]
    assert straight[5000.0] > 0.3


def test_no_suspect_is_refused():
    with pytest.raises(InputError, match="one suspect at least"):
        steady_errors({})
