"""Axes of a log: mirrored and north-east-down ones are recognised, sound ones never; NED is converted."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.craft.models.vehicles import vehicle
from hovercontrol.documents.samples import sample_path
from hovercontrol.documents.scenarios import load_scenario, run_scenario
from hovercontrol.identification.engine.frame_check import check_frame
from hovercontrol.logs import Log, read_log
from hovercontrol.logs.frames import in_z_up
from tests.identification.diagnose.generator import make


@cache
def sample():
    return read_log(sample_path(), None, ["thrust", "rudder"])


@cache
def field(name):
    """A craft with a fan, tracked and logged in the field; velocities are left out."""
    scenario = load_scenario(name)
    log = run_scenario(scenario).log()
    keep = ("x", "y", "psi", *(s.name for s in scenario.belief.plant().inputs))
    return scenario.belief, Log(name, log.time, {k: log[k] for k in keep})


def ned(log):
    """Write a log as a tracker does whose x is north, y east and z down."""
    columns = {"x": log["y"], "y": log["x"], "psi": np.pi / 2 - log["psi"]}
    columns |= {name: -log[name] for name in ("v", "r") if log.has(name)}
    return log.with_columns(columns)


LOGS = {
    "sample": lambda: (vehicle("c17_experiment"), sample()),
    "turn": lambda: field("k06-field-turn"),
    "turn held out": lambda: field("k06-field-holdout"),
}


@pytest.mark.parametrize("name", LOGS)
def test_a_sound_log_passes_and_others_say_what_they_are(name):
    model, log = LOGS[name]()
    check_frame(model, log)
    for change, said in (
        (log.with_columns({"x": -log["x"]}), "mirrored"),
        (log.with_columns({"y": -log["y"]}), "mirrored"),
        (log.with_columns({"psi": -log["psi"]}), "mirrored"),
        (log.with_columns({"psi": log["psi"] + np.pi}), "degrees from where its commands push"),
        (ned(log), "north-east-down axes? --frame ned converts it"),
        (log.with_columns({k: -log[k] for k in ("y", "psi", "v", "r") if log.has(k)}), "--frame ned"),
    ):
        with pytest.raises(InputError) as error:
            check_frame(model, change)
        assert said in str(error.value)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["k06-field-lateral", "k06-field-reverse"])
def test_sound_logs_of_the_field_raise_no_alarm(name):
    check_frame(*field(name))


@pytest.mark.parametrize(
    ("seed", "hidden"), [(1, ()), (2, ("input_delay",)), (3, ("slope",)), (4, ("thrust_lag",))]
)
def test_what_a_model_lacks_raises_no_alarm(seed, hidden):
    case = make(seed, hidden)
    for log in (*case.logs, case.holdout):
        check_frame(case.model, log)


def test_ned_comes_back_as_it_was_and_velocities_alone_are_looked_at():
    log = sample().with_columns(
        {"u": np.zeros(2001), "v": np.ones(2001), "r": np.gradient(sample()["psi"], 0.02)}
    )
    back = in_z_up(ned(log), "ned")
    for name, column in log.columns.items():
        np.testing.assert_allclose(back[name], column, atol=1e-12)
    body = Log("body", log.time, {k: log[k] for k in ("u", "v", "r", "thrust", "rudder")})
    check_frame(vehicle("c17_experiment"), body)
    with pytest.raises(InputError, match="against the torque"):
        check_frame(vehicle("c17_experiment"), body.with_columns({"r": -body["r"]}))


def test_a_frame_that_was_stated_is_not_looked_at_and_an_unknown_one_is_refused():
    check_frame(vehicle("c17_experiment"), in_z_up(ned(sample()), "z-up").select(slice(0, 1500)))
    with pytest.raises(InputError, match="frame: expected one of z-up, enu, ned, found 'nad'"):
        in_z_up(sample(), "nad")


@pytest.mark.slow
def test_the_commands_convert_and_refuse(call, tmp_path):
    ned(sample().select(slice(0, 1000))).save(tmp_path / "ned.csv")
    sample().select(slice(0, 1000)).save(tmp_path / "up.csv")
    for command in ("identify", "diagnose"):
        done = call(command, "ned.csv", "--vehicle", "c17_experiment", "--out", "out", cwd=tmp_path)
        assert (
            done.returncode == 2 and "--frame ned converts it" in done.stderr and done.stderr.count("\n") == 1
        )
    tables = []
    for name, frame in (("up", "z-up"), ("ned", "ned")):
        done = call(
            "identify",
            f"{name}.csv",
            "--vehicle",
            "c17_experiment",
            "--frame",
            frame,
            "--out",
            name,
            cwd=tmp_path,
        )
        assert done.returncode in (0, 1), done.stderr
        rows = (tmp_path / name / "coefficients.csv").read_text().splitlines()[1:]
        tables.append([float(row.split(",")[1]) for row in rows])
    np.testing.assert_allclose(*tables, rtol=1e-4)


def spinning(rows, away=0j, rate=4.0):
    """A craft that spins and coasts without drag, seen by a marker some way from its centre of gravity."""
    t = np.arange(rows) / 100
    thrust = np.repeat(np.random.default_rng(0).uniform(0.0, 4.0, rows // 50), 50)
    psi = rate * t - 2.0 * np.cos(t)
    z = np.cumsum(np.cumsum(thrust * np.exp(1j * psi))) / 1e4 + away * np.exp(1j * psi)
    return Log("spins", t, {"x": z.real, "y": z.imag, "psi": psi, "thrust": thrust, "rudder": 0.0 * t})


@pytest.mark.parametrize("away", [0.3, 0.3j - 0.2])
def test_a_marker_on_the_bow_of_a_craft_that_spins_is_no_heading_turned_round(away):
    log, model = spinning(3000, away), vehicle("c17_experiment")
    check_frame(model, log)
    with pytest.raises(InputError, match="from where its commands push"):
        check_frame(model, log.with_columns({"psi": log["psi"] + np.pi}))


def test_a_very_long_log_is_looked_at_in_parts():
    log, model = spinning(100_000, rate=0.3), vehicle("c17_experiment")
    check_frame(model, log)
    with pytest.raises(InputError, match="mirrored"):
        check_frame(model, log.with_columns({"x": -log["x"]}))


@pytest.mark.parametrize("seed", [40, 41])
def test_a_hull_that_turns_by_its_munk_moment_is_no_other_frame(seed):
    case = make(seed, ["munk_moment", "sway_yaw_coupling"])
    for log in case.logs:
        check_frame(case.model, log)
        with pytest.raises(InputError):
            check_frame(case.model, replace(in_z_up(log, "ned"), frame=""))
