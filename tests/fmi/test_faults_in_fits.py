"""An FMU that answers NaN, crashes, hangs, refuses or exits in a fit: one line, and the next fit runs."""

import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.base.errors import InputError

FAULTS = {
    1: r"'x' is nan at t = 0\.3[0-9]* s",
    2: "its process ended by itself",
    3: r"it did not answer within 0\.5 s",
    4: "returned fmi3Error",
    5: "its process ended by itself",
}


@pytest.mark.slow("2-", "3-", "5-", "CoSimulation")  # a process is started again
@pytest.mark.parametrize("kind", ["ModelExchange", "CoSimulation"])
@pytest.mark.parametrize("fault", list(FAULTS))
def test_a_fault_is_one_line(written, kind, fault):
    t = 0.01 * np.arange(100)
    log = hc.Log("run", t, {"u": np.zeros(100), "x": np.exp(-1.2 * t)})
    plant = hc.fmu_plant(written("faulty"), ["k"], kind=kind, values={"fault": fault}, timeout=0.5)
    with pytest.raises(InputError, match=f"^FMU 'faulty' failed on run: .*{FAULTS[fault]}") as found:
        hc.identify(plant, [log])
    assert "\n" not in str(found.value)
    again = hc.identify(plant.with_values({"fault": 0.0}), [log])["k"]
    assert abs(again.value - 1.2) < 0.02
    plant.close()


@pytest.mark.parametrize("kind", ["ModelExchange", "CoSimulation"])
def test_a_fault_on_the_way_does_not_end_the_fit(written, kind):
    """NaN from 0.8 s on in a second log that is never so long: only the first 0.7 s are there."""
    t = 0.01 * np.arange(70)
    log = hc.Log("run", t, {"u": np.zeros(70), "x": np.exp(-1.2 * t)})
    plant = hc.fmu_plant(
        written("faulty"), ["k"], kind=kind, values={"fault": 1.0, "at": 0.8}, isolated=False
    )
    assert abs(hc.identify(plant, [log])["k"].value - 1.2) < 0.02
    plant.close()
