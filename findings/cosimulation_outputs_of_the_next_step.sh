#!/bin/sh
# package: pathsim-fmi 0.1.1 (PathSim 0.27.1) and cofmupy 1.0.0 (FMU built by pythonfmu 0.7.0)
# guess: The value that a co-simulation records for an FMU at time t is the FMU's output at t, as FMPy's `simulate_fmu` records it.
# happens: Both tools step the FMU from t to t + step before they record at t: an output that equals the time is 0.1 at 0, 0.2 at 0.1 and so on. FMPy gives 0, 0.1.
# why: Trajectories are one step early beside a log or another simulator, and a block that reads the FMU in the same step gets a value of the future. Shift the result by a step.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
for tool in pathsim cofmupy; do # they need different versions of FMPy
    python3 -m venv "$tool"
done
pathsim/bin/pip install --quiet --disable-pip-version-check pathsim-fmi==0.1.1 pathsim==0.27.1 fmpy==0.3.32 pythonfmu==0.7.0 numpy==2.3.5
cofmupy/bin/pip install --quiet --disable-pip-version-check cofmupy==1.0.0 numpy==2.3.5
cat > clock.py <<'END'
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Clock(Fmi2Slave):
    """y is the time."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.y = 0.0
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.y = current_time + step_size
        return True
END
PATH="$folder/pathsim/bin:$PATH" pythonfmu build -f clock.py > /dev/null
cat > run_fmpy.py <<'END'
import fmpy

run = fmpy.simulate_fmu("Clock.fmu", stop_time=0.5, output_interval=0.1)
print(f"FMPy {fmpy.__version__}:", *[f"{t:.1f} {y:.1f}" for t, y in zip(run["time"], run["y"])][:4], sep="  ")
END
cat > run_pathsim.py <<'END'
from importlib.metadata import version

from pathsim import Connection, Simulation
from pathsim.blocks import Scope
from pathsim_fmi import CoSimulationFMU

clock, scope = CoSimulationFMU("Clock.fmu", dt=0.1), Scope()
Simulation([clock, scope], [Connection(clock[0], scope[0])], dt=0.1, log=False).run(0.5)
t, y = scope.read()
print(f"pathsim-fmi {version('pathsim-fmi')}:", *[f"{a:.1f} {b:.1f}" for a, b in zip(t, y[0])][:4], sep="  ")
END
cat > run_cofmupy.py <<'END'
from importlib.metadata import version

from cofmupy.coordinator import Coordinator

master = Coordinator()
master.start({"fmus": [{"id": "clock", "path": "Clock.fmu", "initialization": {}}], "connections": []})
master.run_simulation(0.1, 0.5)
found = master.get_results()
pairs = zip(found["time"], found["clock", "y"])
print(f"cofmupy {version('cofmupy')}:", *[f"{t:.1f} {y:.1f}" for t, y in pairs][:4], sep="  ")
END
echo "an FMU whose output y is the time: t and y as recorded"
pathsim/bin/python run_fmpy.py | tee said.txt
pathsim/bin/python run_pathsim.py | tee -a said.txt
cofmupy/bin/python run_cofmupy.py 2> errors.txt | tail -n 1 | tee -a said.txt
grep -q "^FMPy 0.3.32:  0.0 0.0  0.1 0.1  0.2 0.2  0.3 0.3$" said.txt
grep -q "^pathsim-fmi 0.1.1:  0.0 0.1  0.1 0.2  0.2 0.3  0.3 0.4$" said.txt
grep -q "^cofmupy 1.0.0:  0.0 0.1  0.1 0.2  0.2 0.3  0.3 0.4$" said.txt
