"""An FMU as a model: parameters from logs, effects around it, values for other tools."""

import csv
import zipfile
from dataclasses import replace

import fmpy
import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.craft.effects.command import InputDelay
from hovercontrol.craft.effects.generic_commands import lag
from hovercontrol.craft.effects.generic_measurements import bias
from hovercontrol.fmi.around import Around
from hovercontrol.fmi.replay.start_values import save_corrected

K, B = 2.0, 0.8


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """A machine with quadratic drag as an FMU: dv/dt = k u - b v abs(v)."""
    v, u = hc.Signal("v", "m/s"), hc.Signal("u", "V")
    k, b = hc.Signal("k", "m/s^2/V", start=K, lower=0.0), hc.Signal("b", "1/m", start=B)
    block = hc.Block(
        "motor", [v], [u], [v], [k, b], {"v": k.symbol * u.symbol - b.symbol * v.symbol * abs(v.symbol)}
    )
    return block, block.to_fmu(tmp_path_factory.mktemp("motor") / "motor.fmu", version=2)


def logged(block, noise=0.01, seed=0, late=0, added=0.0, n=1500):
    """A log of the Block by its own simulation, which the FMU had no part in."""
    rng = np.random.default_rng(seed)
    t = 0.02 * np.arange(n)
    u = np.repeat(rng.uniform(-2.0, 2.0, n // 50), 50)
    given = np.concatenate([np.full(late, u[0]), u[: n - late]])
    run = hc.simulate(block, t, {"u": given})
    seen = np.asarray(run.outputs).reshape(-1) + noise * rng.normal(size=n) + added
    return hc.Log("run", t, {"u": u, "v": seen})


@pytest.mark.parametrize("kind", ["ModelExchange", "CoSimulation"])
def test_parameters_are_found_with_their_errors(file, kind):
    block, path = file
    plant = hc.fmu_plant(
        path, ["motor.k", "motor.b"], values={"motor.k": 1.5, "motor.b": 1.1}, kind=kind, isolated=False
    )
    found = hc.identify(plant, [logged(block)])
    for name, true in (("motor.k", K), ("motor.b", B)):
        assert abs(found[name].value - true) < 3.5 * found[name].std
        assert 0.0 < found[name].std < 0.01
    assert found["motor.b"].unit == "1/m" and found.converged
    plant.close()


def test_a_delay_before_the_inputs_is_named(file):
    block, path = file
    plant = hc.fmu_plant(path, ["motor.k"], isolated=False)
    found = hc.diagnose(
        plant, [logged(block, late=5)], names=["input_delay", "u_lag", "u_deadzone", "v_bias"]
    )
    assert found.effects[0].effect == "input_delay"
    assert found.effects[0].numbers["seconds"] == pytest.approx(0.1, abs=0.005)
    plant.close()


def test_nothing_is_named_where_nothing_lacks(file):
    block, path = file
    plant = hc.fmu_plant(path, ["motor.k"], isolated=False)
    found = hc.diagnose(plant, [logged(block)], names=["input_delay", "u_lag", "v_bias"])
    assert found.verdict == "none" and not found.effects
    plant.close()


def test_values_go_to_other_tools(file, tmp_path):
    block, path = file
    plant = hc.fmu_plant(path, ["motor.k"], values={"motor.k": 1.5}, isolated=False)
    found = hc.identify(plant, [logged(block)])
    found.save(tmp_path / "out")
    with (tmp_path / "out" / "start_values.csv").open() as rows:
        assert float(next(csv.DictReader(rows))["value"]) == found["motor.k"].value
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(tmp_path / "out" / "motor.fmu") as new:
        assert old.namelist() == new.namelist()
        changed = [n for n in old.namelist() if old.read(n) != new.read(n)]
        assert changed == ["modelDescription.xml"]
    from fmpy import read_model_description

    said = read_model_description(str(tmp_path / "out" / "motor.fmu"))
    start = {v.name: v.start for v in said.modelVariables}["motor.k"]
    assert float(start) == found["motor.k"].value
    plant.close()


def test_the_blocks_around_compute_what_their_effects_say():
    u, y = hc.Signal("u", "V"), hc.Signal("y", "m")
    around = Around((u,), (y,), at_inputs=(lag("u", "V")(seconds=0.5),), at_outputs=(bias("y", "m")(0.2),))
    assert around.before.to_numpy().derivatives(0.0, [1.0], [2.0]).tolist() == [2.0]
    assert around.after.to_numpy().outputs(0.0, [], [1.0]).tolist() == [1.2]
    with pytest.raises(InputError, match="acts on an output, not an input"):
        Around((u,), (y,), at_inputs=(bias("y", "m")(0.2),))


def test_wrong_names_end_in_one_line(file):
    block, path = file
    with pytest.raises(InputError, match=r"no parameter 'motor\.kk'"):
        hc.fmu_plant(path, ["motor.kk"])
    plant = hc.fmu_plant(path, ["motor.k"], isolated=False)
    log = logged(block)
    with pytest.raises(InputError, match="no column for the input 'u'"):
        hc.identify(plant, [hc.Log("run", log.time, {"v": log["v"]})])
    plant.close()


@pytest.mark.slow
@pytest.mark.parametrize("trouble", [3, 5])
def test_a_crash_or_exit_in_a_fit_ends_in_one_line(fmu, trouble):
    plant = hc.fmu_plant(fmu(2), ["k"])
    t = 0.02 * np.arange(50)
    plant = hc.FmuPlant(**{**vars(plant), "values": {"trouble": trouble, "at": 0.3}})
    with pytest.raises(InputError, match="failed on run: its process ended by itself"):
        hc.identify(plant, [hc.Log("run", t, {"u": np.zeros(50), "x": np.ones(50)})])
    plant.close()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("values", "u", "line"),
    [
        ({"trouble": 4, "at": 0.3}, 0.0, "failed on run: it did not answer within 0.5 s"),
        ({"gain": 1e300}, 1e300, "failed on run: 'z' is inf at t = 0 s"),
    ],
)
def test_a_hang_or_infinite_value_in_a_fit_ends_in_one_line(fmu, values, u, line):
    plant = hc.fmu_plant(fmu(2), ["k"], timeout=0.5)
    t = 0.02 * np.arange(50)
    plant = replace(plant, values=values)
    with pytest.raises(InputError, match=line) as found:
        hc.identify(plant, [hc.Log("run", t, {"u": np.full(50, u), "z": np.ones(50)})])
    assert "\n" not in str(found.value)
    plant.close()


def by_fmpy(path, kind, t, u):
    """The output v of an FMU in FMPy, its input held from row to row."""
    near = 1e-9 if kind == "CoSimulation" else 0.0  # FMPy holds what it reads at the beginning of a step
    rows = [(t[0], u[0])]
    for k in np.flatnonzero(np.diff(u)) + 1:
        rows += [(t[k] - near, u[k - 1]), (t[k] - near, u[k])]
    rows.append((t[-1], u[-1]))
    table = np.array(rows, dtype=[("time", float), ("u", float)])
    return fmpy.simulate_fmu(
        str(path), fmi_type=kind, stop_time=t[-1], output_interval=t[1], input=table, output=["v"],
        relative_tolerance=1e-10, record_events=False,
    )["v"]  # fmt: skip


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
@pytest.mark.parametrize(
    "before", [[InputDelay(seconds=0.0937)], [InputDelay(seconds=0.0937), lag("u", "V")(seconds=0.25)]]
)
def test_the_corrected_fmu_gives_our_prediction(file, kind, before, tmp_path):
    """A delay of parts of a row, and a lag; both FMUs begin at rest with no input."""
    plant = hc.fmu_plant(file[1], ["motor.k"], values={"motor.k": 1.5}, isolated=False)
    model = replace(plant.with_effects(before=before, after=[bias("v", "m/s")(0.2)]), pieces=4)
    save_corrected(model, tmp_path / "corrected.fmu")
    t = 0.02 * np.arange(200)
    u = np.repeat([0.0, 1.5, -2.0, 0.7], 50)
    ours = model.seen(t, model.raw(t, u[:, None], [0.0]))[:, 0]
    theirs = by_fmpy(tmp_path / "corrected.fmu", kind, t, u)
    assert np.ptp(ours) > 1.0
    np.testing.assert_allclose(theirs[: t.size], ours, atol=1e-6)
    plant.close()


def test_diagnose_writes_the_corrected_fmu(file, tmp_path):
    block, path = file
    plant = hc.fmu_plant(path, ["motor.k"], isolated=False)
    found = hc.diagnose(plant, [logged(block, added=0.3)], names=["input_delay", "v_bias"])
    found.save(tmp_path / "out")
    said = fmpy.read_model_description(str(tmp_path / "out" / "corrected.fmu"), validate=True)
    start = {v.name: v.start for v in said.modelVariables}
    assert float(start["after.v_bias"]) == pytest.approx(0.3, abs=0.005)
    assert float(start["motor.k"]) == found.amended.value("motor.k")
    plant.close()
