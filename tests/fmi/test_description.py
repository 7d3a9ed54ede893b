"""modelDescription.xml as FMPy reads and validates it."""

from pathlib import Path
from xml.etree import ElementTree

import fmpy
import pytest
from fmpy.validation import validate_fmu
from lxml import etree

from hovercontrol.app.commands.exportable import choose
from hovercontrol.fmi.exporter.description import Experiment, model_description
from hovercontrol.fmi.exporter.terminals import terminals
from hovercontrol.fmi.exporter.variables import Interface

from .blocks import BLOCKS

EXPERIMENT = Experiment(5.0, 0.02, 1e-5)


def written(name, version, folder, friction="events"):
    interface = Interface(BLOCKS[name], friction)
    text = model_description(interface, version, "{token}", EXPERIMENT, "what it is", ["a.c"])
    (folder / "modelDescription.xml").write_bytes(text)
    return folder


def read(name, version, folder, friction="events"):
    return fmpy.read_model_description(written(name, version, folder, friction))


@pytest.mark.slow("smooth")
@pytest.mark.parametrize("friction", ["events", "smooth"])
@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("name", BLOCKS)
def test_fmpy_finds_nothing_wrong(name, version, friction, tmp_path):
    assert validate_fmu(str(written(name, version, tmp_path, friction))) == []


@pytest.mark.parametrize(
    ("old", "new"),
    [('unit="rad/s"', 'unit="rad/min"'), ('name="psi"', 'name="p si"'), ('initial="exact"', "")],
)
def test_the_validation_can_fail(old, new, tmp_path):
    file = written("plant", 3, tmp_path) / "modelDescription.xml"
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))
    assert validate_fmu(str(tmp_path))


@pytest.mark.parametrize("version", [2, 3])
def test_units_bounds_and_start_values_arrive(version, tmp_path):
    description = read("plant", version, tmp_path)
    found = {v.name: v for v in description.modelVariables}
    units = {u.name: u for u in description.unitDefinitions}
    assert found["psi"].displayUnit == "deg" and found["der(r)"].displayUnit == "deg/s^2"
    assert units["rad"].displayUnits[0].factor == pytest.approx(57.29577951308232)
    assert units["m/s^2"].baseUnit.m == 1 and units["m/s^2"].baseUnit.s == -2
    drag = found["plant.surge_coulomb"]
    assert (drag.causality, drag.variability, drag.start, drag.min) == ("parameter", "tunable", "1.35", "0.0")
    assert found["y"].causality == "output" and found["y"].start == "1.5"
    assert float(found["rudder"].nominal) == 0.5
    assert found["der(u)"].derivative is found["u"]
    assert found["friction_mode_u"].type in ("Int32", "Integer")
    names = {v.name for v in description.modelVariables}
    assert all(t.name not in names for t in description.typeDefinitions)
    experiment = description.defaultExperiment
    times = (experiment.startTime, experiment.stopTime, experiment.stepSize, experiment.tolerance)
    assert [float(t) for t in times] == [0.0, 5.0, 0.02, 1e-5]


@pytest.mark.parametrize("version", [2, 3])
def test_structure_lists_what_the_standards_ask_for(version, tmp_path):
    description = read("controller", version, tmp_path)
    (thrust,) = (u for u in description.outputs if u.variable.name == "thrust")
    known = {v.name for v in thrust.dependencies}
    assert "x_ref" in known
    assert ("controller.k1" in known) == (version == 3)  # FMI 2 counts parameters at initialization only
    initial = {u.variable.name: {v.name for v in u.dependencies} for u in description.initialUnknowns}
    assert "controller.k1" in initial["thrust"]
    assert set(initial) == {"thrust", "rudder", "error_x", "error_y"}


def test_event_indicators_are_as_many_as_dry_frictions(tmp_path):
    assert read("plant", 2, tmp_path).numberOfEventIndicators == 3
    found = read("plant", 3, tmp_path)
    assert [u.variable.name for u in found.eventIndicators] == [f"event_indicator_{v}" for v in "uvr"]
    assert read("plant", 3, tmp_path, "smooth").eventIndicators == []


def test_states_that_friction_stops_may_jump_at_events(tmp_path):
    root = ElementTree.parse(written("plant", 3, tmp_path) / "modelDescription.xml").getroot()
    assert [v.get("name") for v in root.iter() if v.get("reinit") == "true"] == ["u", "v", "r"]


def test_what_the_runtime_can_do_is_said(tmp_path):
    two, three = read("plant", 2, tmp_path), read("plant", 3, tmp_path)
    for description in (two, three):
        for kind in (description.modelExchange, description.coSimulation):
            assert kind.canGetAndSetFMUstate and kind.canSerializeFMUstate
            assert kind.modelIdentifier == "plant"
    assert three.coSimulation.hasEventMode and three.coSimulation.canHandleVariableCommunicationStepSize
    assert three.coSimulation.providesAdjointDerivatives and two.coSimulation.providesDirectionalDerivative
    assert three.modelExchange.needsCompletedIntegratorStep


def test_terminals_of_parts_that_belong_together_have_one_name():
    def found(name):
        text = terminals(Interface(BLOCKS[name], "events")).decode()
        return {part.split('"')[0] for part in text.split('Terminal name="')[1:]}

    assert found("plant") == {"command", "pose", "velocity"}
    assert found("controller") >= found("plant") | {"reference", "estimate", "tracking_error"}
    assert found("waypoints") == {"reference"}


@pytest.mark.parametrize(
    ("part", "expected"), [("imu", {"measurement", "velocity"}), ("rudder_servo", {"command", "command_out"})]
)
def test_what_sensors_measure_is_no_command(part, expected):
    document = etree.fromstring(terminals(Interface(choose(part).block)))
    assert {t.get("name").removesuffix("_out") for t in document.iter("Terminal")} == {
        e.removesuffix("_out") for e in expected
    }


@pytest.mark.slow
def test_range_filter_has_no_terminal_of_commands():
    assert 'name="command' not in terminals(Interface(choose("range_filter").block)).decode()


def test_the_model_is_named_after_the_craft(tmp_path):
    choice = choose("four_fan")
    file = choice.block.to_fmu(tmp_path / "x.fmu", model_name=choice.title)
    assert fmpy.read_model_description(file).modelName == "four_fan"
    assert choose("table1:plant").title == "c17_simulation"


@pytest.mark.parametrize("name", BLOCKS)
def test_terminals_fit_the_standards_schema_and_name_listed_variables(name):
    interface = Interface(BLOCKS[name], "events")
    schema = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"
    document = etree.fromstring(terminals(interface))
    etree.XMLSchema(file=str(schema)).assertValid(document)
    members = [m.get("variableName") for m in document.iter("TerminalMemberVariable")]
    ports = [v.name for v in (*interface.of("input"), *interface.outputs)]
    assert sorted(members) == sorted(ports)
