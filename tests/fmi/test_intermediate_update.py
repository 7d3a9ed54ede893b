"""Co-Simulation of FMI 3: the importer reads the FMU after each step of its solver and may end there."""

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Slave

from .test_output_derivatives import oscillator


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return oscillator().to_fmu(tmp_path_factory.mktemp("update") / "x.fmu", rtol=1e-9)


class Run:
    """An oscillator x = sin t, with a callback that keeps what it was told and read."""

    def __init__(self, path, early=True, action=None):
        described = fmpy.read_model_description(path)
        assert described.coSimulation.providesIntermediateUpdate
        assert described.coSimulation.canReturnEarlyAfterIntermediateUpdate
        self.references = {v.name: v.valueReference for v in described.modelVariables}
        self.rows, self.told, self.action = [], [], action
        self.fmu = FMU3Slave(
            guid=described.guid,
            unzipDirectory=fmpy.extract(path),
            modelIdentifier="oscillator",
            instanceName="one",
        )
        wanted = [self.references["x"]]
        self.fmu.instantiate(
            earlyReturnAllowed=early,
            intermediateUpdate=self.update,
            requiredIntermediateVariables=wanted,
            logMessage=lambda *arguments: self.told.append(arguments[-1].decode()),
        )
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def update(self, _environment, time, set_requested, get_allowed, finished, can_return, requested, until):
        references = [self.references[name] for name in ("time", "x", "product")]
        found = self.fmu.getFloat64(references)
        slope = self.fmu.getOutputDerivatives([self.references["product"]], [1])
        self.rows.append((time, *found, *slope))
        self.flags = (set_requested, get_allowed, finished)
        self.can_return = can_return
        if self.action:
            self.action(self, requested, until)


def test_the_outputs_are_read_after_each_step_of_the_solver(path):
    run = Run(path)
    for k in range(4):
        assert run.fmu.doStep(0.5 * k, 0.5)[2] is False
        assert run.rows[-1][0] == pytest.approx(0.5 * (k + 1), abs=1e-12) and not run.can_return
    assert run.flags == (False, True, True)
    told, time, x, product, slope = np.array(run.rows).T
    assert len(time) > 8 and (np.diff(time) > 0).all()
    np.testing.assert_array_equal(told, time)
    np.testing.assert_allclose(x, np.sin(time), atol=1e-7)
    np.testing.assert_allclose(product, 0.5 * np.sin(2 * time), atol=1e-7)
    np.testing.assert_allclose(slope, np.cos(2 * time), atol=1e-6)


def test_the_importer_ends_a_step_early_and_goes_on(path):
    def stop(run, requested, until):
        if run.can_return and len(run.rows) == 2:
            requested[0], until[0] = True, run.rows[-1][0]

    run = Run(path, action=stop)
    _, terminate, early, reached = run.fmu.doStep(0.0, 1.0)
    assert early and not terminate and 0.0 < reached < 1.0
    assert reached == run.rows[1][0] and len(run.rows) == 2
    assert run.fmu.doStep(reached, 1.0 - reached)[2] is False
    assert run.fmu.getFloat64([run.references["x"]])[0] == pytest.approx(np.sin(1.0), abs=1e-7)


def test_no_early_return_where_the_importer_does_not_allow_it(path):
    def stop(run, requested, until):
        requested[0], until[0] = True, run.rows[-1][0]

    run = Run(path, early=False, action=stop)
    assert run.fmu.doStep(0.0, 1.0)[2] is False
    assert not run.can_return and run.rows[-1][0] == 1.0


def test_setting_in_the_callback_ends_the_step_with_an_error(path):
    def change(run, requested, until):
        with pytest.raises(FMICallException):
            run.fmu.setFloat64([run.references["oscillator.k"]], [2.0])

    run = Run(path, action=change)
    with pytest.raises(FMICallException):
        run.fmu.doStep(0.0, 1.0)
    assert any("Intermediate Update Mode" in text for text in run.told)
