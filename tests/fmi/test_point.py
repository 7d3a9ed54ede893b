"""A point of an FMU for Model Exchange: one call in C, or calls from Python without a compiler."""

import ctypes

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Model
from fmpy.fmi3 import FMU3Model

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.fmi import load
from hovercontrol.fmi.importer import point

CALLED = pytest.mark.parametrize("compiled", [True, False])


@pytest.fixture
def without(monkeypatch):
    """Return a function that takes the compiler away."""
    return lambda compiled: None if compiled else monkeypatch.setattr(point, "_built", lambda: None)


@pytest.fixture(scope="module")
def craft(tmp_path_factory):
    plant, folder = hc.vehicle("c17_simulation").plant(), tmp_path_factory.mktemp("craft")
    return {v: plant.to_fmu(folder / f"plant{v}.fmu", version=v) for v in (2, 3)}


class ByFmpy:
    """The FMU's answers through FMPy's own functions, everything set anew at each point."""

    def __init__(self, path, folder):
        described = fmpy.read_model_description(str(path))
        self.of = {
            c: [v.valueReference for v in described.modelVariables if v.causality == c]
            for c in ("input", "output")
        }
        self.two = described.fmiVersion == "2.0"
        self.fmu = (FMU2Model if self.two else FMU3Model)(
            guid=described.guid,
            modelIdentifier=described.modelExchange.modelIdentifier,
            unzipDirectory=fmpy.extract(str(path), str(folder)),
            instanceName="fmpy",
        )
        fmu, self.n = self.fmu, described.numberOfContinuousStates or len(described.derivatives)
        self.z = described.numberOfEventIndicators
        fmu.instantiate()
        if self.two:
            fmu.setupExperiment(startTime=0.0)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        fmu.newDiscreteStates() if self.two else fmu.updateDiscreteStates()
        fmu.enterContinuousTimeMode()

    def at(self, t, x, u):
        fmu = self.fmu
        fmu.setTime(t)
        fmu.setContinuousStates((ctypes.c_double * self.n)(*x), self.n)
        if self.of["input"]:
            (fmu.setReal if self.two else fmu.setFloat64)(self.of["input"], list(u))
        rates, z = (ctypes.c_double * self.n)(), (ctypes.c_double * self.z)()
        (fmu.getDerivatives if self.two else fmu.getContinuousStateDerivatives)(rates, self.n)
        if self.z:
            fmu.getEventIndicators(z, self.z)
        y = (fmu.getReal if self.two else fmu.getFloat64)(self.of["output"])
        return list(rates), list(y), list(z)


@CALLED
@pytest.mark.parametrize("what", [2, 3, "van_der_pol", "bouncing_ball", "dahlquist"])
def test_the_answers_are_the_fmus_to_the_bit(craft, written, without, tmp_path, what, compiled):
    """Points of which all, some or nothing differs from the last; with and without a compiler."""
    without(compiled)
    path = craft[what] if what in craft else written(what)
    fmu, rng = ByFmpy(path, tmp_path / "unpacked"), np.random.default_rng(4)
    with load(path, kind="ModelExchange") as system:
        assert isinstance(system._engine._point, point.CompiledPoint) == compiled
        t, x, u = 0.0, rng.normal(size=system.nstates), rng.uniform(0.1, 1.0, system.ninputs)
        for _ in range(60):
            change = rng.integers(0, 8)
            t = float(rng.uniform(0.0, 9.0)) if change & 1 else t
            x = rng.normal(0.0, 0.7, system.nstates) if change & 2 else x
            u = rng.uniform(0.1, 1.0, system.ninputs) if change & 4 else u
            rates, y, z = fmu.at(t, x, u)
            assert system.dynamics(t, x, u).tolist() == rates
            assert system.output(t, x, u).tolist() == y
            if z:
                assert system._engine.indicators(t, x, u).tolist() == z
        assert (
            system.dynamics(0, np.ones(system.nstates, int), u).tolist() == fmu.at(0.0, 1.0 + 0.0 * x, u)[0]
        )


def test_points_of_a_wrong_size_are_one_line(craft):
    with load(craft[3], kind="ModelExchange") as system:
        with pytest.raises(InputError, match="expected 6 states and 2 inputs, found 5 and 2"):
            system.dynamics(0.0, np.zeros(5), np.zeros(2))
        assert np.isfinite(system.dynamics(0.0, np.zeros(6), np.zeros(2))).all()


def test_a_simulation_is_the_same_to_the_bit(written, without):
    """Through the ball's bounces; both ways against each other."""
    t, found = np.linspace(0.0, 1.5, 76), []
    for compiled in (True, False):
        without(compiled)
        with load(written("bouncing_ball"), kind="ModelExchange") as system:
            found.append(system.simulate(t).states)
    assert np.array_equal(*found)
