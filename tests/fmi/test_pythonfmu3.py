"""An FMU written in Python by pythonfmu3 loads, runs, and gets a sensor's bias around it."""

import subprocess
import sys

import control
import numpy as np
import pytest

from hovercontrol import Block, Signal
from hovercontrol.blocks.backends.compiler import NoCompilerError, find_compiler
from hovercontrol.fmi import corrected_fmu, load

pytest.importorskip("pythonfmu3")

SOURCE = """
from pythonfmu3 import Fmi3Causality, Fmi3Slave, Fmi3Variability, Float64

class Decay(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time, self.k, self.u, self.x = 0.0, 2.0, 0.0, 1.0
        kind = Fmi3Causality
        always, tunable = Fmi3Variability.continuous, Fmi3Variability.tunable
        self.register_variable(Float64("time", causality=kind.independent, variability=always))
        self.register_variable(Float64("k", causality=kind.parameter, variability=tunable))
        self.register_variable(Float64("u", causality=kind.input))
        self.register_variable(Float64("x", causality=kind.output))

    def do_step(self, current_time, step_size):
        self.x += step_size * (self.u - self.k * self.x)
        return True
"""


@pytest.fixture(scope="module")
def decay(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pythonfmu3")
    (folder / "decay.py").write_text(SOURCE)
    build = [sys.executable, "-m", "pythonfmu3", "build", "-f", "decay.py", "-d", "."]
    subprocess.run(build, cwd=folder, check=True, capture_output=True)
    return folder / "Decay.fmu"


def final(path):
    """Return x after 100 steps of 10 ms with u = 1."""
    with load(path, step=0.01) as system:
        run = control.input_output_response(system, np.arange(101) * 0.01, np.ones(101))
        return float(np.ravel(run.outputs)[-1])


#: x(n + 1) = x + h (u - k x)
WANT = 0.5 + 0.5 * (1.0 - 0.01 * 2.0) ** 100


def test_an_fmu_of_pythonfmu3_runs(decay):
    assert final(decay) == pytest.approx(WANT, abs=1e-12)


def test_a_bias_stands_after_it(decay, tmp_path):
    try:
        find_compiler()
    except NoCompilerError:
        pytest.skip("no C compiler on this machine")
    x, bias = Signal("x", "1"), Signal("x_bias", "1", start=0.25)
    outputs = {"x_measured": x.symbol + bias.symbol}
    after = Block("after", [], [x], [Signal("x_measured", "1")], [bias], {}, outputs)
    path = corrected_fmu(decay, tmp_path / "c.fmu", after=after)
    assert final(path) == pytest.approx(WANT + 0.25, abs=1e-12)
