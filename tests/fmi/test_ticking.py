"""A Block that ticks in other tools: Model Exchange at the FMU's tolerance is as good as Co-Simulation."""

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave

from hovercontrol import Block, Signal, interconnect
from hovercontrol.blocks.backends.compiler import NoCompilerError, find_compiler

try:
    find_compiler()
except NoCompilerError:
    pytest.skip("no C compiler on this machine", allow_module_level=True)

q, v, F = Signal("q", "m", start=1.0), Signal("v", "m/s"), Signal("F", "m/s^2")
k, d = Signal("k", "1/s^2", start=400.0), Signal("d", "1/s", start=0.05)
BODY = Block("body", [q, v], [F], [q, v], [k], {"q": v.symbol, "v": F.symbol - k.symbol * q.symbol})
DAMPER = Block("damper", [], [v], [F], [d], output_expressions={"F": -d.symbol * v.symbol}, period=1e-3)


@pytest.fixture(scope="module")
def swing(tmp_path_factory):
    """Return the FMU of a swing whose damper works in ticks of 1 ms."""
    path = tmp_path_factory.mktemp("fmu") / "swing.fmu"
    return interconnect([BODY, DAMPER], "swing").to_fmu(path, stop=2.0, step=0.05)


def swung(path, kind, **options):
    found = fmpy.simulate_fmu(str(path), fmi_type=kind, output=["q"], stop_time=2.0, **options)
    return np.interp(np.linspace(0.0, 2.0, 41), found["time"], found["q"])


def test_its_tolerance_makes_up_for_an_integration_that_begins_afresh_at_every_tick(swing):
    asked = float(fmpy.read_model_description(str(swing)).defaultExperiment.tolerance)
    assert asked == pytest.approx(1e-10)
    right = swung(swing, "CoSimulation")
    here = np.abs(swung(swing, "ModelExchange") - right).max()
    coarse = np.abs(swung(swing, "ModelExchange", relative_tolerance=1e-6) - right).max()
    assert here < 1e-5 and coarse > 10.0 * here


def test_without_ticks_the_tolerance_is_as_given(tmp_path):
    path = BODY.to_fmu(tmp_path / "body.fmu", rtol=1e-7)
    assert float(fmpy.read_model_description(str(path)).defaultExperiment.tolerance) == pytest.approx(1e-7)


def test_a_tick_is_at_the_time_that_an_importer_has_summed_up_with_rounding(tmp_path):
    """i[n + 1] = i[n] + e[n] at every 20 ms; e jumps at ticks; the time is a sum of steps of 10 ms."""
    i, e = Signal("i"), Signal("e")
    law = Block("law", [i], [e], [i], [], {"i": i.symbol + e.symbol}, period=0.02)
    path = str(law.to_fmu(tmp_path / "law.fmu", version=2))
    described = fmpy.read_model_description(path)
    reference = {v.name: v.valueReference for v in described.modelVariables}
    fmu = FMU2Slave(
        guid=described.guid, unzipDirectory=fmpy.extract(path), modelIdentifier="law", instanceName="law"
    )  # fmt: skip
    fmu.instantiate()
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    given = np.random.default_rng(3).normal(size=300)
    t, found = 0.0, []
    for step in range(600):
        fmu.setReal([reference["e"]], [given[step // 2]])
        fmu.doStep(t, 0.01)
        t += 0.01
        found += fmu.getReal([reference["i"]])
    assert t != 6.0  # rounding
    # the output of a tick is the state before it
    np.testing.assert_allclose(found[0::2], np.concatenate([[0.0], np.cumsum(given)[:-1]]), atol=1e-12)
