"""An exported FMU remembers inputs that act late, in both kinds and both versions of FMI."""

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree
from zipfile import ZipFile

import control
import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from hovercontrol import Block, Signal, interconnect
from hovercontrol.blocks.backends.compiler import NoCompilerError, find_compiler
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.craft.effects import effect
from hovercontrol.craft.models.vehicles import c17_simulation
from hovercontrol.fmi import load

try:
    find_compiler()
except NoCompilerError:
    pytest.skip("no C compiler on this machine", allow_module_level=True)

STEP = 0.05
TIMES = np.arange(81) * STEP
RNG = np.random.default_rng(3)
x, fast = Signal("x", "m"), Signal("fast", "m/s")
slow = Signal("slow", "m/s", start=0.25)
rate, late = Signal("rate", "1/s", start=2.0), Signal("late", "s", start=0.32, lower=0.0)
#: Two inputs, one of them late; an output shows it as it arrives.
LAG = Block(
    "lag", [x], [fast, slow], [x, Signal("felt", "m/s")], [rate, late],
    {"x": fast.symbol + slow.symbol - rate.symbol * x.symbol}, {"felt": slow.symbol},
    delays={"slow": late.symbol},
)  # fmt: skip
SENT = np.round(RNG.normal(size=(2, TIMES.size)), 1)
TIGHT = {"rtol": 1e-9, "atol": 1e-11}


def hybrid() -> Block:
    """The lag, and a sensor that tells at its ticks what arrives."""
    felt, told = Signal("felt", "m/s"), Signal("told", "m/s")
    sensor = Block("sensor", [], [felt], [told], output_expressions={"told": felt.symbol}, period=0.02)
    return interconnect([LAG, sensor], "hybrid")


BLOCKS = {
    "lag": LAG,
    "hybrid": hybrid(),
    "craft": c17_simulation().with_effects([effect("input_delay", seconds=0.173)]).plant("craft"),
}


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Iterator[dict[tuple[str, int], Path]]:
    folder = tmp_path_factory.mktemp("late")
    return {
        (name, version): block.to_fmu(
            folder / f"{name}{version}.fmu", version=version, step=STEP, friction="events", **TIGHT
        )
        for name, block in BLOCKS.items()
        for version in (2, 3)
    }


def table(block):
    names = [s.name for s in block.inputs]
    types = [("time", float), *((name, float) for name in names)]
    return np.array(list(zip(TIMES, *SENT, strict=True)), dtype=types)


@pytest.mark.slow("lag")
@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("name", BLOCKS)
def test_co_simulation_gives_the_machine_codes_numbers(written, name, version):
    block = BLOCKS[name]
    expected = block.compile(friction="events").simulate(TIMES, SENT, **TIGHT)
    found = fmpy.simulate_fmu(
        str(written[name, version]), fmi_type="CoSimulation", input=table(block), stop_time=TIMES[-1],
        output_interval=STEP, relative_tolerance=1e-9,
    )  # fmt: skip
    own = {"fast", "slow"}  # FMPy reads before it sets: what acts at once it sees a step later
    for s, y in zip(block.outputs, expected.outputs, strict=True):
        if s.name not in own:
            np.testing.assert_allclose(found[s.name], y, atol=1e-7, err_msg=s.name)


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("name", ["lag", "craft"])
def test_model_exchange_stops_at_every_arrival(written, name, version):
    """FMPy announces jumps of discrete inputs as events, and integrates by CVode."""
    block = BLOCKS[name]
    expected = block.compile(friction="events").simulate(
        TIMES, SENT if name == "craft" else [0 * TIMES, SENT[1]], **TIGHT
    )
    given = table(block)
    if name == "lag":
        given["fast"] = 0.0  # which is continuous: FMPy would interpolate it
    found = fmpy.simulate_fmu(
        str(written[name, version]), fmi_type="ModelExchange", input=given, stop_time=TIMES[-1],
        output_interval=STEP, relative_tolerance=1e-9, record_events=False,
    )  # fmt: skip
    assert len(found["time"]) == TIMES.size
    for s, y in zip(block.outputs, expected.outputs, strict=True):
        np.testing.assert_allclose(found[s.name], y, atol=1e-5, err_msg=s.name)


@pytest.mark.parametrize("version", [2, 3])
def test_a_parameter_says_how_late(written, version):
    for seconds in (0.0, 0.07, 1.5):
        expected = simulate(LAG, TIMES, SENT, params={"lag.late": seconds}, **TIGHT)
        found = fmpy.simulate_fmu(
            str(written["lag", version]), fmi_type="CoSimulation", input=table(LAG), stop_time=TIMES[-1],
            output_interval=STEP, relative_tolerance=1e-9, start_values={"lag.late": seconds},
        )  # fmt: skip
        np.testing.assert_allclose(found["x"], expected.outputs[0], atol=1e-7)


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("name", BLOCKS)
def test_the_validator_finds_nothing(written, name, version):
    assert validate_fmu(str(written[name, version])) == []


@pytest.mark.parametrize("version", [2, 3])
def test_the_description_says_what_is_discrete_and_what_is_fixed(written, version):
    with ZipFile(written["lag", version]) as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
        files = archive.namelist()
    kinds = {v.get("name"): v.get("variability") for v in root.find("ModelVariables")}
    assert (kinds["slow"], kinds["fast"]) == ("discrete", "continuous")
    assert (kinds["lag.late"], kinds["lag.rate"]) == ("fixed", "tunable")
    assert {"sources/hc_delays.c", "sources/delays.c"} <= set(files)


def test_a_prompt_plant_carries_nothing_of_it(tmp_path):
    with ZipFile(c17_simulation().plant().to_fmu(tmp_path / "plant.fmu")) as archive:
        assert not [name for name in archive.namelist() if name.endswith("delays.c")]


def test_an_imported_fmu_remembers_too(written):
    """python-control asks for steps in any order: the FMU's state holds what is under way."""
    with load(written["lag", 3], step=STEP) as system:
        run = control.input_output_response(system, TIMES, SENT)
        again = control.input_output_response(system, TIMES, SENT)
    expected = simulate(LAG, TIMES, SENT, **TIGHT)
    np.testing.assert_allclose(run.outputs[0], expected.outputs[0], atol=1e-6)
    np.testing.assert_array_equal(run.outputs, again.outputs)
