#!/bin/sh
# package: FMPy 0.3.32 (FMU built by pythonfmu3 0.3.4)
# guess: `simulate_fmu(input=...)` takes a structured array with a vector column for an FMI 3 array input and a plain column for a scalar one.
# happens: Either alone is accepted. Both together are a ValueError, "all input arrays must have the same shape".
# why: An FMU with an array input and a scalar input cannot be driven by `simulate_fmu`. Make the scalar an element of the vector, or step the FMU by hand.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check fmpy==0.3.32 pythonfmu3==0.3.4 numpy==2.3.5
cd "$folder"
cat > gain.py <<'END'
import numpy as np
from pythonfmu3 import CoSimulation, Dimension, Float64, Fmi3Causality, Fmi3Slave, Fmi3Variability


class Gain(Fmi3Slave, CoSimulation):
    """y = s u, of a vector u and a scalar s."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time, self.s = 0.0, 4.0
        self.u, self.y = np.array([1.0, 2.0, 3.0]), np.zeros(3)
        for name, causality, size in (("time", "independent", 0), ("u", "input", 3), ("s", "input", 0), ("y", "output", 3)):
            sizes = [Dimension(start=str(size))] if size else []
            options = {"causality": Fmi3Causality[causality], "variability": Fmi3Variability.continuous}
            self.register_variable(Float64(name, dimensions=sizes, **options))

    def do_step(self, current_time, step_size):
        self.y = self.s * self.u
        return True
END
PATH="$folder/venv/bin:$PATH" pythonfmu3 build -f gain.py > /dev/null
venv/bin/python - <<'END'
import sys

import fmpy
import numpy as np

VECTOR, SCALAR = ("u", float, (3,)), ("s", float)
VALUES = {"u": [1.0, 2.0, 3.0], "s": 4.0}
said = {}
for columns in ([VECTOR], [SCALAR], [VECTOR, SCALAR]):
    names = [column[0] for column in columns]
    row = tuple(VALUES[name] for name in names)
    table = np.array([(0.0, *row), (1.0, *row)], dtype=[("time", float), *columns])
    try:
        y = fmpy.simulate_fmu("Gain.fmu", input=table, stop_time=1.0, output_interval=0.5)["y"][-1]
        said[", ".join(names)] = f"y = {y}"
    except ValueError as error:
        said[", ".join(names)] = f"ValueError: {error}"
print(f"FMPy {fmpy.__version__}: inputs u (three elements) and s (scalar)")
for names, text in said.items():
    print(f"  input with {names}: {text}")
sys.exit(not (said["u"] == said["s"] == "y = [ 4.  8. 12.]" and said["u, s"].startswith("ValueError")))
END
