"""Derivatives of outputs by time, in Co-Simulation: for importers that extrapolate."""

import fmpy
import numpy as np
import pytest
import sympy as sp
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

import hovercontrol as hc
from hovercontrol.blocks.signals import time


def oscillator():
    """x' = k v, v' = -k x from x = 0, v = 1; outputs x = sin t, their product and one of time itself."""
    x, v, k = hc.Signal("x"), hc.Signal("v", start=1.0), hc.Signal("k", "1/s", start=1.0)
    product, clock = hc.Signal("product"), hc.Signal("clock")
    return hc.Block(
        "oscillator",
        [x, v],
        [],
        [x, product, clock],
        [k],
        derivatives={"x": k.symbol * v.symbol, "v": -k.symbol * x.symbol},
        output_expressions={
            "x": x.symbol,
            "product": x.symbol * v.symbol,
            "clock": sp.sin(3 * k.symbol * time),
        },
    )


@pytest.mark.parametrize("version", [2, 3])
def test_output_derivatives_are_those_of_the_exact_solution(tmp_path, version):
    path = oscillator().to_fmu(tmp_path / "x.fmu", version=version, rtol=1e-10)
    description = fmpy.read_model_description(path)
    assert description.coSimulation.maxOutputDerivativeOrder == 1
    folder = fmpy.extract(path)
    made = (FMU2Slave if version == 2 else FMU3Slave)(
        guid=description.guid, unzipDirectory=folder, modelIdentifier="oscillator", instanceName="one"
    )
    made.instantiate()
    if version == 2:
        made.setupExperiment(startTime=0.0)
    made.enterInitializationMode()
    made.exitInitializationMode()
    for k in range(7):
        made.doStep(0.1 * k, 0.1)
    references = {v.name: v.valueReference for v in description.modelVariables}
    wanted = [references[name] for name in ("x", "product", "clock")]
    get = made.getRealOutputDerivatives if version == 2 else made.getOutputDerivatives
    found = get(wanted, [1, 1, 1])
    t = 0.7
    assert np.allclose(found, [np.cos(t), np.cos(2 * t), 3 * np.cos(3 * t)], atol=1e-8)
    made.terminate()
    made.freeInstance()
