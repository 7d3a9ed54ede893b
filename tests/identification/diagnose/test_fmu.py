"""What an FMU lacks: names, sizes and evidence on logs of the exact solution of its equation."""

import json

import fmpy
import numpy as np
import pytest
from jsonschema import Draft202012Validator
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import hovercontrol as hc
from hovercontrol.app.schema import schema
from hovercontrol.base.plain_json import json_text
from hovercontrol.craft.effects.generic_commands import lag

#: v' = GAIN u - DRAG v, its sensor's lag, noise and the time between rows
GAIN, DRAG, LAG, NOISE, STEP, ROWS = 2.0, 0.8, 0.08, 0.005, 0.02, 600


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    v, u = hc.Signal("v", "m/s"), hc.Signal("u", "V")
    gain, drag = hc.Signal("gain", "m/s^2/V", start=GAIN), hc.Signal("drag", "1/s", start=DRAG)
    slope = gain.symbol * u.symbol - drag.symbol * v.symbol
    block = hc.Block("motor", [v], [u], [v], [gain, drag], {"v": slope})
    path = block.to_fmu(tmp_path_factory.mktemp("motor") / "motor.fmu", version=2)
    found = hc.fmu_plant(path, ["motor.drag"], isolated=False)
    yield found
    found.close()


def given(seed):
    return np.repeat(np.random.default_rng(seed).uniform(-2.0, 2.0, ROWS // 25), 25)


def exact(u, seconds=LAG):
    """Velocity and lagged velocity at the rows: a linear system with its input held, by the exponential."""
    A = np.array([[-DRAG, 0.0, GAIN], [1.0 / seconds, -1.0 / seconds, 0.0], [0.0, 0.0, 0.0]])
    transition, z, found = expm(STEP * A), np.zeros(3), []
    for value in u:
        z[2] = value
        found.append(z[:2].copy())
        z = transition @ z
    return np.array(found).T


def log(seed, column=0, u=None, added=0.0):
    u = given(seed) if u is None else u
    noise = NOISE * np.random.default_rng(100 + seed).normal(size=ROWS)
    return hc.Log(f"run {seed}", STEP * np.arange(ROWS), {"u": u, "v": exact(u)[column] + added + noise})


def test_a_lag_after_the_fmu_is_the_exact_solution(plant):
    u = given(1)
    slow = plant.with_effects(after=[lag("v", "m/s")(seconds=LAG)])
    found = slow.at(STEP * np.arange(ROWS), u[:, None], [0.0])[:, 0]
    np.testing.assert_allclose(found, exact(u)[1], atol=2e-4 * np.ptp(exact(u)[1]))


def test_the_lag_of_a_sensor_is_named_with_its_size(plant):
    found = hc.diagnose(plant, [log(2, column=1)], names=["v_lag", "v_bias", "v_scale", "u_deadzone"])
    assert found.verdict == "effect" and [e.name for e in found.effects] == ["after.v_lag"]
    (lagged,) = found.effects
    assert abs(lagged.numbers["seconds"] - LAG) < 3.5 * lagged.std["seconds"] < 0.02
    assert lagged.blocks.n > 10 and lagged.gain > 24.0
    passed = [row for row in found.why("after.v_lag") if row.step == "confirm"]
    assert passed and all(row.passed for row in passed)


def test_of_two_effects_each_is_needed_and_has_its_size(plant):
    u = given(3)
    late = log(3, u=np.append([u[0]] * 5, u[:-5]), added=0.05)
    logged = hc.Log("run", late.time, {"u": u, "v": late["v"]})
    found = hc.diagnose(plant, [logged], names=["v_bias", "input_delay", "u_deadzone"])
    sizes = {e.name: (*e.numbers.values(), *e.std.values()) for e in found.effects}
    assert set(sizes) == {"after.v_bias", "before.input_delay"}
    for name, true in (("after.v_bias", 0.05), ("before.input_delay", 0.1)):
        value, std = sizes[name]
        assert abs(value - true) < 3.5 * std < 0.01


def test_a_late_command_and_a_late_clock_are_one_finding(plant):
    u = given(4)
    logged = hc.Log(
        "run", STEP * np.arange(ROWS), {"u": u, "v": log(4, u=np.append([u[0]] * 5, u[:-5]))["v"]}
    )
    found = hc.diagnose(plant, [logged], names=["input_delay", "time_offset", "v_bias"])
    assert found.verdict == "effect" and len(found.effects) == 1
    assert {found.effects[0].name, *found.effects[0].same} == {"before.input_delay", "after.time_offset"}
    assert found.effects[0].numbers["seconds"] == pytest.approx(0.1, abs=0.005)


def test_an_effect_with_which_held_out_logs_are_predicted_worse_is_not_named(plant):
    names = ["v_bias", "u_lag"]
    biased, sound = log(5, added=0.05), log(6)
    assert [e.effect for e in hc.diagnose(plant, [biased], names=names).effects] == ["v_bias"]
    found = hc.diagnose(plant, [biased], [sound], names=names)
    assert not found.effects and found.verdict == "unexplained"
    lead = next(one for one in found.leads if one.name == "after.v_bias")
    assert lead.reason == "the held-out logs are predicted worse with it"


def test_of_an_fmu_without_states_nothing_is_estimated_on_a_held_out_log(tmp_path):
    u, y, k = hc.Signal("u", "V"), hc.Signal("y", "m/s"), hc.Signal("k", "m/s/V", start=GAIN)
    block = hc.Block("sensor", [], [u], [y], [k], {}, {"y": k.symbol * u.symbol})
    sensor = hc.fmu_plant(block.to_fmu(tmp_path / "sensor.fmu", version=2), ["sensor.k"], isolated=False)
    rng = np.random.default_rng(11)

    def run(name):
        v = given(9)
        seen = GAIN * v + 0.05 + NOISE * rng.normal(size=ROWS)
        return hc.Log(name, STEP * np.arange(ROWS), {"u": v, "y": seen})

    found = hc.diagnose(sensor, [run("a")], [run("b")], names=["y_bias"])
    sensor.close()
    (biased,) = found.effects
    assert biased.name == "after.y_bias"
    assert abs(biased.numbers["value"] - 0.05) < 3.5 * biased.std["value"] < 0.005


def test_too_little_gain_is_a_lead_with_its_reason(plant):
    found = hc.diagnose(plant, [log(7, added=0.0009)], names=["v_bias"])
    assert not found.effects
    assert all("are asked for" in one.reason for one in found.leads)


@pytest.mark.slow
def test_a_law_in_a_derivative_is_named_and_the_corrected_fmu_has_it(plant, tmp_path):
    """v' = GAIN u - DRAG v - 0.25 v abs(v), by SciPy."""
    quadratic, u = 0.25, given(8)
    v = [0.0]
    for now in u[:-1]:
        run = solve_ivp(
            lambda _, z, now=now: GAIN * now - DRAG * z - quadratic * z * abs(z), (0.0, STEP), v[-1:],
            "DOP853", rtol=1e-10, atol=1e-12,
        )  # fmt: skip
        v.append(run.y[0, -1])
    noise = NOISE * np.random.default_rng(108).normal(size=ROWS)
    logged = hc.Log("run", STEP * np.arange(ROWS), {"u": u, "v": np.array(v) + noise})
    own = hc.fmu_plant(plant.path, ["motor.drag"], laws_in=["v"], isolated=False)
    found = hc.diagnose(own, [logged], names=["v_quadratic_drag", "v_coulomb", "u_deadzone"])
    (law,) = found.effects
    assert (found.verdict, law.name) == ("effect", "added.v_quadratic_drag")
    assert abs(law.numbers["value"] - quadratic) < 3.5 * law.std["value"] < 0.02
    Draft202012Validator(schema("fmu")).validate(json.loads(json_text(found.result())))
    found.save(tmp_path / "out")
    table = np.array(list(zip(logged.time, u, strict=True)), dtype=[("time", float), ("u", float)])
    run = fmpy.simulate_fmu(
        str(tmp_path / "out" / "corrected.fmu"), fmi_type="CoSimulation", stop_time=logged.time[-1],
        output_interval=STEP, input=table, output=["v"], relative_tolerance=1e-10,
    )  # fmt: skip
    want = found.amended.at(logged.time, u[:, None], [0.0])[:, 0]
    np.testing.assert_allclose(run["v"], want, atol=1e-6)
    own.close()
