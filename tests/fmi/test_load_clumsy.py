"""FMUs that end a run, leave out their step, or have inputs that may not be 0 are taken as they are."""

import pickle
import warnings
import zipfile

import control as ct
import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.fmi import load

from .probe import TROUBLE, binary, description, write_fmu

T = np.arange(0, 1.05, 0.1)
DECAY = np.exp(-2 * T)  # the probe without inputs


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("isolated", [False, True], ids=["here", "isolated"])
@pytest.mark.parametrize("trouble, reached, last", [("end", 0.3, 3), ("last", 0.4, 4)])
def test_a_run_that_the_fmu_ends_returns_what_it_has_and_says_when(
    probe, fmi, isolated, trouble, reached, last
):
    system = probe(fmi, isolated=isolated)
    for _ in range(2):  # the second run says it again
        with pytest.warns(
            UserWarning, match=f"FMU 'probe' ended the run at t = {reached} s; its outputs stay"
        ):
            response = ct.input_output_response(system, T, 0.0, params={"trouble": TROUBLE[trouble]})
        held = np.where(np.arange(len(T)) <= last, DECAY, DECAY[last])
        np.testing.assert_allclose(response.outputs[0], held, rtol=0, atol=1e-14)
        assert system.ended == pytest.approx(reached)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        whole = ct.input_output_response(system, T, 0.0)
    np.testing.assert_allclose(whole.outputs[0], DECAY, rtol=0, atol=1e-14)
    assert system.ended is None


def test_a_loop_goes_on_with_the_last_outputs_of_an_fmu_that_ended(probe):
    system = probe(params={"trouble": TROUBLE["last"], "at": 0.3})
    counter = ct.nlsys(
        lambda t, x, u, p: x + u, None, inputs=["x"], outputs=["s"], states=1, dt=0.1, name="sum"
    )
    loop = ct.interconnect([system, counter], inputs=["u"], outputs=["x", "s"], check_unused=False)
    with pytest.warns(UserWarning, match="FMU 'probe' ended the run at t = 0.4 s"):
        response = ct.input_output_response(loop, T, 0.0)
    np.testing.assert_allclose(response.outputs[0, 4:], DECAY[4], atol=1e-14)
    np.testing.assert_allclose(np.diff(response.outputs[1]), response.outputs[0, :-1], atol=1e-14)


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_run_step_by_step_stands_where_the_fmu_ended_it(probe, fmi):
    system = probe(fmi, params={"trouble": TROUBLE["last"]})
    with system.start(inputs={"u": 0.0}) as run:
        for _ in range(3):
            run.step(None, 0.1)
        saved = run.save()
        with pytest.warns(UserWarning, match="ended the run at t = 0.4 s; these are its last outputs"):
            last = run.step(None, 0.1)
        assert last[0] == pytest.approx(DECAY[4], abs=1e-14) and run.ended == run.time == pytest.approx(0.4)
        with pytest.raises(InputError, match=r"ended the run at t = 0.4 s; no step can follow"):
            run.step(None, 0.1)
        run.restore(saved)
        assert run.ended is None and run.time == pytest.approx(0.3)


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_fmu_that_states_no_step_gets_one_with_a_notice(probe, fmu, fmi):
    with pytest.warns(UserWarning, match=r"probe0.fmu has no step size: using 0.01 s, 10 ms"):
        assert probe(fmi, preferred=None).dt == 0.01
    path = fmu(fmi, preferred=None)
    text = description(fmi, preferred=None)
    text = text.replace("<ModelVariables>", '<DefaultExperiment startTime="1" stopTime="5"/><ModelVariables>')
    rewritten(path, text)
    with pytest.warns(UserWarning, match="using 0.004 s, a thousandth of its default experiment"):
        load(path).close()


def rewritten(path, text):
    """Give an FMU another description."""
    with zipfile.ZipFile(path) as archive:
        library = {name: archive.read(name) for name in archive.namelist() if name.startswith("binaries")}
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", text)
        for name, data in library.items():
            archive.writestr(name, data)


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_enumeration_without_item_0_begins_at_its_start_value(probe, fmi):
    system = probe(fmi, names=["gear", "sum"])
    assert list(np.ravel(ct.input_output_response(system, T[:3], 0.0).outputs)) == [1, 1, 1]  # start: low
    assert system.output(0, [0], [2])[0] == 2
    line = r"input 'gear' at t = 0 s: expected one of 1 \(low\), 2 \(high\), found 3"
    with pytest.raises(InputError, match=line):
        system.output(0, [0], [3])
    with system.start() as run:
        assert run.outputs[0] == 1 and run.inputs[0] == 1
        with pytest.raises(InputError, match=r"expected one of 1 \(low\), 2 \(high\), found 0"):
            run.step({"gear": 0}, 0.1)


def sized(fmu, start='start="3"'):
    """Return an FMU whose arrays v and w have n elements."""
    path = fmu(3, names=["v", "w", "k"])
    text = description(3, names=["v", "w", "k"])
    n = f'<UInt64 name="n" valueReference="38" causality="structuralParameter" variability="fixed" {start}/>'
    text = text.replace('<Dimension start="3"/>', '<Dimension valueReference="38"/>')
    rewritten(path, text.replace("<ModelVariables>", f"<ModelVariables>{n}"))
    return path


def test_structural_parameters_size_arrays(fmu):
    path = sized(fmu)
    with load(path) as system:
        assert system.input_labels == ["v[1]", "v[2]", "v[3]"] and list(system.params) == ["probe.k"]
        assert list(system.output(0, [0], [1.0, 1.0, 1.0])) == [1, 2, 3]
        with pytest.raises(InputError, match=r"n' is a structural parameter .*: load\(\) sets it"):
            system.output(0, [0], [1.0, 1.0, 1.0], params={"probe.n": 2, "n": 2})
    for given, isolated in (({"n": 2}, False), ({"probe.n": 2, "k": 3.0}, True)):
        with (
            load(path, params=given, isolated=isolated) as system,
            pickle.loads(pickle.dumps(system)) as again,
        ):
            for each in (system, again):
                assert each.input_labels == ["v[1]", "v[2]"]
                assert list(each.output(0, [0], [1.0, 1.0])) == [1, 2]
    with pytest.raises(InputError, match=r"structural parameter 'n': expected a size, found 1\.5"):
        load(path, params={"n": 1.5})
    with pytest.raises(InputError, match="structural parameter 'n' has no start value"):
        load(sized(fmu, ""))


def test_messages_come_whatever_their_category(fmu):
    path = fmu(3, names=["u", "x", "trouble", "at"])
    category = '<LogCategories><Category name="logStatusError"/></LogCategories>'
    text = description(3, names=["u", "x", "trouble", "at"])
    rewritten(path, text.replace("<DefaultExperiment", category + "<DefaultExperiment"))
    with (
        load(path, params={"trouble": TROUBLE["error"]}) as system,
        pytest.raises(InputError, match=r"the tank is empty, level -1\.5"),
    ):
        ct.input_output_response(system, T, 0.0)


def test_a_system_without_outputs_is_a_warning(fmu):
    with pytest.warns(UserWarning, match="has no outputs"):
        load(fmu(3, names=["u", "k"])).close()


def test_an_entry_that_is_there_twice_with_the_same_bytes_is_taken(library, tmp_path):
    path = write_fmu(tmp_path / "twice.fmu", library)
    with zipfile.ZipFile(path, "a") as archive, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # zipfile warns of the double
        archive.writestr("modelDescription.xml", description(2))
        archive.write(library, binary(2))
    with load(path) as system:
        np.testing.assert_allclose(ct.input_output_response(system, T, 0.0).outputs[0], DECAY, atol=1e-14)
