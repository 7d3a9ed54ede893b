"""Systems of FMUs (SSP): what is in the file, and what other tools and python-control make of it."""

import tempfile
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import control as ct
import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.app.commands.exportable import choose
from hovercontrol.base.errors import InputError
from hovercontrol.fmi import export_ssp, load
from hovercontrol.fmi.ssp.names import SSD, SSV

X, U = hc.Signal("x", "m", start=1.0), hc.Signal("u", "m/s")
GAIN = hc.Signal("gain", "1/s", start=2.0)
TANK = hc.Block("tank", [X], [U], [X], derivatives={"x": U.symbol})
LAW = hc.Block("law", [], [X], [U], [GAIN], output_expressions={"u": -GAIN.symbol * X.symbol})


@pytest.fixture(scope="module")
def loop(tmp_path_factory):
    return export_ssp([TANK, LAW], tmp_path_factory.mktemp("ssp") / "loop.ssp", name="loop", step=0.05)


def parsed(path, name):
    return ElementTree.fromstring(zipfile.ZipFile(path).read(name))


def test_every_connection_joins_connectors_that_components_have(loop):
    system = parsed(loop, "SystemStructure.ssd").find(f"{{{SSD}}}System")
    kinds = {}
    for component in system.iter(f"{{{SSD}}}Component"):
        assert component.get("source") in zipfile.ZipFile(loop).namelist()
        for connector in component.iter(f"{{{SSD}}}Connector"):
            kinds[component.get("name"), connector.get("name")] = connector.get("kind")
    wires = list(system.iter(f"{{{SSD}}}Connection"))
    ends = [
        [w.get(f"{end}{what}") for end in ("start", "end") for what in ("Element", "Connector")]
        for w in wires
    ]
    assert sorted(ends) == [["law", "u", "tank", "u"], ["tank", "x", "law", "x"]]
    for a, b, c, d in ends:
        assert (kinds[a, b], kinds[c, d]) == ("output", "input")
    values = {
        p.get("name"): float(p[0].get("value"))
        for p in parsed(loop, "resources/law.ssv").iter(f"{{{SSV}}}Parameter")
    }
    assert values == {"law.gain": 2.0}


def test_parameter_sets_of_all_parts_have_the_name_of_the_system(loop):
    """Ecos applies the sets of one name: it could take the values of one part only."""
    sets = [parsed(loop, n) for n in zipfile.ZipFile(loop).namelist() if n.endswith(".ssv")]
    assert {s.get("name") for s in sets} == {"loop"}


def test_a_parameter_that_no_part_of_a_loaded_system_has_is_refused(loop):
    """python-control gives each system all parameters, and none refuses those that may be another's."""
    system, t = load(loop), np.arange(0.0, 1.025, 0.05)
    for key in ("gain", "lau.gain", "law.gian"):
        with pytest.raises(InputError, match=f"unknown parameter '{key}'; did you mean 'law.gain'"):
            ct.input_output_response(system, t, params={key: 3.0})
    found = ct.input_output_response(system, t, params={"law.gain": 3.0})
    x = found.outputs[system.output_labels.index("x")]
    assert x == pytest.approx(0.85 ** np.arange(len(t)), abs=1e-6)
    outer = ct.interconnect(
        [system, ct.tf([1], [1, 0], 0.05, name="other", inputs="x", outputs="sum")], outputs=["x"]
    )
    again = ct.input_output_response(outer, t, params={"law.gain": 3.0, "mass": 1.0})
    assert again.outputs[0] == pytest.approx(x, abs=1e-9)


def test_a_loaded_system_is_the_sampled_loop(loop):
    """x+ = x - h gain x: a tank under a sampled law."""
    system = load(loop)
    t = np.arange(0.0, 1.025, 0.05)
    found = ct.input_output_response(system, t)
    assert np.abs(found.outputs[system.output_labels.index("x")] - 0.9 ** np.arange(len(t))).max() < 1e-6


def test_parameter_values_of_the_system_are_used(loop, tmp_path):
    changed = tmp_path / "changed.ssp"
    with zipfile.ZipFile(loop) as old, zipfile.ZipFile(changed, "w") as new:
        for name in old.namelist():
            data = old.read(name)
            new.writestr(
                name, data.replace(b'value="2.0"', b'value="4.0"') if name.endswith(".ssv") else data
            )
    system = load(changed)
    found = ct.input_output_response(system, np.arange(0.0, 0.525, 0.05))
    assert abs(found.outputs[system.output_labels.index("x")][-1] - 0.8**10) < 1e-6


def test_an_fmu_of_any_tool_and_an_open_input(tmp_path):
    foreign = TANK.to_fmu(tmp_path / "foreign.fmu", version=2)
    path = export_ssp([foreign], tmp_path / "one.ssp")
    assert zipfile.ZipFile(path).read("resources/foreign.fmu") == foreign.read_bytes()
    system = load(path)
    assert system.input_labels == ["u"]
    t = np.arange(0.0, 1.005, 0.01)
    assert abs(ct.input_output_response(system, t, np.ones(len(t))).outputs[-1] - 2.0) < 1e-6


def test_what_is_no_system_is_one_line(tmp_path, loop):
    with pytest.raises(InputError, match=r"ends in \.ssp"):
        export_ssp([TANK], tmp_path / "x.fmu")
    with pytest.raises(InputError, match="have the output 'x'"):
        export_ssp([TANK, TANK.named("other")], tmp_path / "x.ssp")
    with pytest.raises(InputError, match="a system has its own"):
        load(loop, name="x")
    empty = tmp_path / "empty.ssp"
    with zipfile.ZipFile(empty, "w") as archive:
        archive.writestr("a.txt", "")
    with pytest.raises(InputError, match=r"without SystemStructure\.ssd"):
        load(empty)


def test_of_fmi_3_it_is_ssp_2_with_units_arrays_and_outputs_that_are_asked_for(tmp_path):
    xs = [hc.Signal(f"x[{i}]", "m") for i in range(2)]
    us = [hc.Signal(f"u[{i}]", "m/s") for i in range(2)]
    rates = {x.name: u.symbol for x, u in zip(xs, us, strict=True)}
    vector = hc.Block("vector", xs, us, xs, derivatives=rates).to_fmu(tmp_path / "vector.fmu", arrays=True)
    path = export_ssp([vector], tmp_path / "loop.ssp", outputs=["x"])
    root = parsed(path, "SystemStructure.ssd")
    assert root.get("version") == "2.0"
    listed = [(c.get("name"), c[0].get("unit"), c[1].get("size")) for c in root.iter(f"{{{SSD}}}Connector")]
    assert listed == [("u", "m/s", "2"), ("x", "m", "2")] * 2
    system = load(path)
    assert system.output_labels == ["x[1]", "x[2]"]
    inputs = np.array([[1.0] * 101, [2.0] * 101])
    found = ct.input_output_response(system, np.arange(101) * system.dt, inputs).outputs
    assert np.allclose(found[:, -1], [1.0, 2.0])


@pytest.mark.slow
def test_libcosim_runs_the_loop_of_table_1(tmp_path):
    execution = pytest.importorskip("libcosimpy.CosimExecution")
    observer = pytest.importorskip("libcosimpy.CosimObserver").CosimObserver.create_last_value()
    choice = choose("table1")
    path = export_ssp(choice.parts, tmp_path / "loop.ssp", name="loop")
    with tempfile.TemporaryDirectory() as folder:
        zipfile.ZipFile(path).extractall(folder)
        run = execution.CosimExecution.from_ssp_file(ssp_path=str(Path(folder)), step_size=10_000_000)
        run.add_observer(observer=observer)
        assert run.simulate_until(target_time=10_000_000_000)
        plant = run.slave_index_from_instance_name("plant")
        places = {v.name.decode(): v.reference for v in run.slave_variables(plant)}
        xy = observer.last_real_values(slave_index=plant, variable_references=[places["x"], places["y"]])
    whole = choice.block.compile().simulate(np.linspace(0.0, 10.0, 101), rtol=1e-9, atol=1e-11)
    assert np.hypot(*(np.array(xy) - whole.states[:2, -1])) < 0.03  # values are exchanged every 10 ms
