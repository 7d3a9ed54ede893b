#!/bin/sh
# package: FMPy 0.3.32 (`fmpy.ssp`; Ecos 0.7.2 beside it, FMUs built by pythonfmu 0.7.0)
# guess: `simulate_ssp` runs an SSP file as it is written: with the parameter values that it holds, the factors of its connections and the start values of inputs that nothing feeds.
# happens: Values and factors are skipped, and an input without a source gets the signal of the input before it: 1500 mm times 0.001, a gain of 5 and a bias of 2 give 3000 (1500 and 1500). Ecos gives 9.5 for the same file.
# why: The file is the exchange format for exactly these values. The system runs with the FMUs' defaults, in wrong units, and nothing says so. Give the values again as `parameter_set`, and use FMUs that agree on units.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check fmpy==0.3.32 ecospy==0.7.2 tbb==2022.3.0 pythonfmu==0.7.0 numpy==2.3.5
cat > sensor.py <<'END'
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Sensor(Fmi2Slave):
    """A distance of 1500 mm."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.distance = 1500.0
        self.register_variable(Real("distance", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        return True
END
cat > gain.py <<'END'
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class Gain(Fmi2Slave):
    """y = k u + bias, with k = 1 and bias = 2 unless somebody sets them."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.k, self.u, self.bias, self.y = 1.0, 0.0, 2.0, 0.0
        self.register_variable(Real("k", causality=Fmi2Causality.parameter, variability=Fmi2Variability.fixed))
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("bias", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.y = self.k * self.u + self.bias
        return True
END
for part in sensor gain; do
    PATH="$folder/venv/bin:$PATH" pythonfmu build -f $part.py > /dev/null
done
cat > SystemStructure.ssd <<'END'
<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
    xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"
    xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" name="chain" version="1.0">
  <ssd:System name="chain">
    <ssd:Elements>
      <ssd:Component name="sensor" type="application/x-fmu-sharedlibrary" source="resources/Sensor.fmu">
        <ssd:Connectors>
          <ssd:Connector name="distance" kind="output"><ssc:Real/></ssd:Connector>
        </ssd:Connectors>
      </ssd:Component>
      <ssd:Component name="gain" type="application/x-fmu-sharedlibrary" source="resources/Gain.fmu">
        <ssd:Connectors>
          <ssd:Connector name="u" kind="input"><ssc:Real/></ssd:Connector>
          <ssd:Connector name="bias" kind="input"><ssc:Real/></ssd:Connector>
          <ssd:Connector name="y" kind="output"><ssc:Real/></ssd:Connector>
        </ssd:Connectors>
        <ssd:ParameterBindings>
          <ssd:ParameterBinding>
            <ssd:ParameterValues>
              <ssv:ParameterSet name="values" version="1.0">
                <ssv:Parameters><ssv:Parameter name="k"><ssv:Real value="5"/></ssv:Parameter></ssv:Parameters>
              </ssv:ParameterSet>
            </ssd:ParameterValues>
          </ssd:ParameterBinding>
        </ssd:ParameterBindings>
      </ssd:Component>
    </ssd:Elements>
    <ssd:Connections>
      <ssd:Connection startElement="sensor" startConnector="distance" endElement="gain" endConnector="u">
        <ssc:LinearTransformation factor="0.001"/>
      </ssd:Connection>
    </ssd:Connections>
  </ssd:System>
  <ssd:DefaultExperiment startTime="0" stopTime="1"/>
</ssd:SystemStructureDescription>
END
cat > pack.py <<'END'
import zipfile

with zipfile.ZipFile("chain.ssp", "w") as file:
    file.write("SystemStructure.ssd")
    for name in ("Sensor.fmu", "Gain.fmu"):
        file.write(name, f"resources/{name}")
END
venv/bin/python pack.py
cat > run_fmpy.py <<'END'
import fmpy
from fmpy.ssp.simulation import simulate_ssp

run = simulate_ssp("chain.ssp", stop_time=1.0, step_size=0.1)
print(f"FMPy {fmpy.__version__}: y = {run['gain.y'][-1]:g}")
END
cat > run_ecos.py <<'END'
from importlib.metadata import version

from ecospy import EcosSimulation

run = EcosSimulation(step_size=0.1, ssp_path="chain.ssp")
run.init(parameter_set="values")
run.step(10)
print(f"Ecos {version('ecospy')}: y = {run.get_real('gain::y'):g}")
run.terminate()
END
echo "1500 mm, a connection with the factor 0.001, k = 5 in the SSP file, a bias that starts at 2"
venv/bin/python run_fmpy.py | tee said.txt
PATH="$folder/venv/bin:$PATH" LD_LIBRARY_PATH="$folder/venv/lib" venv/bin/python run_ecos.py 2> errors.txt | tail -n 1 | tee -a said.txt
grep -q "^FMPy 0.3.32: y = 3000$" said.txt
grep -q "^Ecos 0.7.2: y = 9.5$" said.txt
