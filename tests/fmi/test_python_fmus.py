"""FMUs written in Python, by pythonfmu (FMI 2) and pythonfmu3 (FMI 3), are fitted to logs."""

import subprocess
import sys

import numpy as np
import pytest

import hovercontrol as hc

SOURCES = {
    "pythonfmu": """
from pythonfmu import Fmi2Causality as Causality, Fmi2Slave, Fmi2Variability as Variability, Real

class Decay(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.k, self.u, self.x = 1.0, 0.0, 1.0
        self.register_variable(Real("k", causality=Causality.parameter, variability=Variability.tunable))
        self.register_variable(Real("u", causality=Causality.input))
        self.register_variable(Real("x", causality=Causality.output))

    def do_step(self, current_time, step_size):
        self.x += step_size * (self.u - self.k * self.x)
        return True
""",
    "pythonfmu3": """
from pythonfmu3 import Fmi3Causality as Causality, Fmi3Slave, Fmi3Variability as Variability, Float64

class Decay(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time, self.k, self.u, self.x = 0.0, 1.0, 0.0, 1.0
        self.register_variable(
            Float64("time", causality=Causality.independent, variability=Variability.continuous)
        )
        self.register_variable(Float64("k", causality=Causality.parameter, variability=Variability.tunable))
        self.register_variable(Float64("u", causality=Causality.input))
        self.register_variable(Float64("x", causality=Causality.output))

    def do_step(self, current_time, step_size):
        self.x += step_size * (self.u - self.k * self.x)
        return True
""",
}


@pytest.mark.parametrize("package", list(SOURCES))
def test_a_parameter_is_found_with_its_error(package, tmp_path):
    pytest.importorskip(package)
    (tmp_path / "decay.py").write_text(SOURCES[package])
    build = [sys.executable, "-m", package, "build", "-f", "decay.py", "-d", "."]
    subprocess.run(build, cwd=tmp_path, check=True, capture_output=True)
    rng, t = np.random.default_rng(7), 0.02 * np.arange(300)
    u, x = np.repeat(rng.uniform(-1.0, 1.0, 10), 30), [1.0]
    for now in u[:-1]:  # its steps are 10 ms: x(n + 1) = x + h (u - k x)
        y = x[-1]
        for _ in range(2):
            y += 0.01 * (now - 1.4 * y)
        x.append(y)
    log = hc.Log("run", t, {"u": u, "x": np.array(x) + 0.01 * rng.normal(size=t.size)})
    plant = hc.fmu_plant(tmp_path / "Decay.fmu", ["k"], strict=False)
    found = hc.identify(plant, [log])["k"]
    plant.close()
    assert abs(found.value - 1.4) < 3.5 * found.std < 0.1
