"""The table of the page on discrete-time plants: its rows are true, and no function of Blocks is missing."""

import inspect
import re
from functools import partial
from pathlib import Path

import control as ct
import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.control import analysis

PAGE = (Path(__file__).parents[2] / "docs" / "design" / "discrete.md").read_text(encoding="utf-8")
ROWS = dict(re.findall(r"^\| `([\w.]+)` \| (.+) \|$", PAGE, re.MULTILINE))
H, N = 0.05, 60
T = H * np.arange(N)

#: Take Blocks that are no plants (references, monitors, files of parameters) or are for planar craft alone.
NO_PLANT = {"Trim", "replay", "read_log", "load_parameters", "save_parameters"}
NO_PLANT |= {"expected_errors", "iss_gain", "steering_map"}


def filter_block():
    y, c, a = hc.Signal("y", start=0.0), hc.Signal("c", lower=-5.0, upper=5.0), hc.Signal("a", start=0.2)
    return hc.Block(
        "filter", [y], [c], [y], [a], {"y": (1 - a.symbol) * y.symbol + a.symbol * c.symbol}, period=H
    )


B = filter_block()
LAW = hc.lqr(B, {"y": 0.0}, {"y": 1.0}, {"c": 1.0})
REST = {"y_ref": 0.0}
NOISE = {"process_noise": {"y": 0.01}, "measurement_noise": {"y": 0.001}}


def log():
    rng = np.random.default_rng(3)
    u, x = np.repeat(rng.uniform(-1, 1, 40), 30), np.zeros(1200)
    for k in range(1199):
        x[k + 1] = 0.92 * x[k] + 0.08 * u[k]
    return hc.Log("record", H * np.arange(1200), {"y": x + 1e-3 * rng.normal(size=1200), "c": u})


def static_law():
    k = hc.Signal("k", start=1.0)
    y, c = B.signal("y"), B.signal("c")
    return hc.Block("law", [], [y], [c], [k], output_expressions={"c": -k.symbol * y.symbol})


def signals():
    u = np.sin(np.arange(N))
    return {"y": hc.simulate(B, T, {"c": u}).outputs, "c": u}


def motion():
    loop = hc.interconnect([B, LAW], "loop")
    return ct.input_output_response(loop.to_control(), T, np.ones(N), X0=[0.5])


def fleet(folder):
    log().save(folder / "record.csv")
    return hc.fleet(B, [str(folder / "record.csv")], out=folder / "out").craft


def fmu(tmp):
    return B.to_fmu(tmp / "filter.fmu").exists()


MONITOR = dict(false_alarms_per_hour=1.0, period=H, measured=["y"], **NOISE)
OCP = B.to_control()
COST = ct.optimal.quadratic_cost(OCP, [[1.0]], [[1.0]])

#: What each row says, as a call that returns something true.
CALLS = {
    "block.trim": lambda: B.trim({"y": 1.0}).inputs["c"] == pytest.approx(1.0),
    "block.linearize": lambda: B.linearize({}).A == 0.8 and ct.linearize(B.to_control(), [0.0]).dt == H,
    "block.to_control": lambda: B.to_control().dt == H,
    "block.to_numpy": lambda: B.to_numpy().derivatives(0.0, [1.0], [0.0]) == 0.8,
    "block.to_casadi": lambda: B.to_casadi().derivatives(0.0, [1.0], [0.0], [0.2]) == 0.8,
    "block.to_jax": lambda: B.to_jax().next(0.0, [1.0], [0.0]) == 0.8,
    "block.start": lambda: B.start({"y": 1.0}).step([0.0], H) == 0.8,
    "block.compile": lambda: B.compile().simulate(T, x0={"y": 1.0}).outputs[1] == 0.8,
    "block.gym": lambda: B.gym(2 * H, reward=B.signal("y").symbol).reset(seed=1)[0].shape == (1,),
    "hc.simulate": lambda: hc.simulate(B, T, x0={"y": 1.0}).outputs[1] == 0.8,
    "hc.interconnect": lambda: hc.interconnect([B, LAW]).period == H,
    "hc.rename": lambda: hc.rename(B, {"y": "z"}).period == H,
    "hc.prefix": lambda: hc.prefix(B, "left").period == H,
    "hc.actuated": lambda: hc.actuated(B, bounds={"c": (-1.0, 1.0)}).period == H,
    "hc.applied_inputs": lambda: (
        hc.applied_inputs(hc.extended_kalman(B, ["y"], **NOISE), hc.actuated(B, bounds={"c": (-1.0, 1.0)}))
    ),
    "hc.lqr": lambda: LAW.period == H,
    "hc.lqi": lambda: hc.lqi(B, {"y": 0.0}, {"integral_y": 1.0}, {"c": 1.0}, integrate="y").period == H,
    "hc.place": lambda: "K_c_y" in hc.place(B, {"y": 0.0}, [0.5]).equations(),
    "hc.gain_scheduled": lambda: (
        hc.gain_scheduled(
            B, [B.trim({"y": v}) for v in (0.0, 1.0)], partial(hc.lqr, Q=1.0, R=1.0), schedule="y"
        ).period
        == H
    ),
    "hc.pid": lambda: hc.pid(B.signal("y"), B.signal("c"), kp=1.0, period=B.period).period == H,
    "hc.margins": lambda: hc.margins([B, LAW], "c", REST).stable,
    "hc.bode": lambda: hc.bode([B, LAW], "c", REST).frequencies[-1] == pytest.approx(np.pi / H),
    "hc.nyquist": lambda: hc.nyquist([B, LAW], "c", REST).closed_loop_unstable == 0,
    "hc.sensitivity": lambda: hc.sensitivity([B, LAW], "c", REST).Ms >= 1.0,
    "hc.mpc": lambda: hc.mpc(B, period=2 * H, weights={"y": 1.0}).control([1.0])[0] < 0.0,
    "hc.solve_ocp": lambda: hc.solve_ocp(OCP, T[:5], [1.0], COST).success,
    "hc.minimum_time": lambda: len(hc.minimum_time(B, {"y": 0.5}).time) == 2,
    "hc.extended_kalman": lambda: hc.extended_kalman(B, ["y"], **NOISE).period == H,
    "hc.unscented_kalman": lambda: hc.unscented_kalman(B, ["y"], **NOISE, period=2 * H).period == 2 * H,
    "hc.moving_horizon": lambda: hc.moving_horizon(B, ["y"], **NOISE).timepts[1] == H,
    "hc.with_disturbances": lambda: hc.with_disturbances(B, ["y"]).period == H,
    "hc.disturbance_observer": lambda: (
        hc.disturbance_observer(
            B, ["y"], disturbance_noise={"y": 0.1}, measurement_noise={"y": 0.1}
        ).period
        == H
    ),
    "hc.observability": lambda: hc.observability(B, {}, ["y"]).window == H,
    "hc.BlockModel": lambda: hc.BlockModel(B).plant().period == H,
    "hc.check": lambda: not hc.check(B, [log()]).errors,
    "hc.identify": lambda: hc.identify(B, [log()]),
    "hc.diagnose": lambda: hc.diagnose(B, [log()]).verdict == "none",
    "hc.experiment": lambda: hc.experiment(B, [log()]).next is None,
    "hc.kalman_bucy": lambda: hc.kalman_bucy(B, ["a"]).period == H,
    "hc.regression": lambda: hc.regression(B, ["a"]),
    "hc.monitor": lambda: hc.monitor(B, ["y_bias"], **MONITOR).period == H,
    "analysis.stabilizability": lambda: analysis.stabilizability(B).verdict == "possible",
    "analysis.observability_gramian": lambda: analysis.observability_gramian(B, T, signals()).observable,
    "analysis.excitation": lambda: analysis.excitation(B, T, signals()),
    "analysis.packet_loop": lambda: analysis.packet_loop([B, static_law()], "c", 2 * H).growth(0.0) < 1.0,
    "analysis.margins_along": lambda: analysis.margins_along([B, LAW], "c", motion()).worst.stable,
    "analysis.packet_loop_along": lambda: analysis.packet_loop_along([B, LAW], "c", motion()),
    "analysis.sweep_map": lambda: (
        analysis.sweep_map(
            B.compile(), analysis.axis("a", "1", (0.1, 0.3), 2), analysis.axis("y", "V", (0.0, 1.0), 2),
            lambda a, y: {"filter.a": a}, T, x0={"y": 1.0},
        ).final.size
        == 4
    ),
}  # fmt: skip
FILES = {"block.to_fmu": fmu, "hc.fleet": fleet}
SLOW = {"hc.fleet", "hc.identify", "hc.diagnose", "hc.experiment", "hc.monitor", "hc.check", "block.to_jax"}


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] if n in SLOW else []) for n in ROWS]
)
def test_a_row_is_true(name, tmp_path):
    call = partial(FILES[name], tmp_path) if name in FILES else CALLS[name]
    if ROWS[name].startswith("refused"):
        with pytest.raises(InputError) as caught:
            call()
        assert "\n" not in str(caught.value)
    else:
        assert call()


def takes_a_block(function):
    kinds = re.compile(r"\b(Block|AnyModel|Loop)\b")
    return any(kinds.search(str(p.annotation)) for p in inspect.signature(function).parameters.values())


def test_every_public_function_of_a_block_is_in_the_table():
    names = {n for n in hc.__all__ if callable(f := getattr(hc, n)) and f is not hc.sgn and takes_a_block(f)}
    wanted = {f"hc.{name}" for name in names - NO_PLANT}
    wanted |= {
        f"analysis.{name}"
        for name in {*analysis.__all__} - {*hc.__all__} - NO_PLANT
        if callable(f := getattr(analysis, name)) and takes_a_block(f) and not inspect.isclass(f)
    } - {"analysis.loop_gain"}  # in the row of margins
    assert wanted <= set(ROWS)


def test_what_the_rows_say_is_refused_is_told_in_one_line():
    for call, text in (
        (lambda: B.to_control(step=0.1), "sampled every 0.05 s, found step=0.1"),
        (lambda: B.to_jax().derivatives(0.0, [1.0], [0.0]), "next values"),
        (lambda: hc.actuated(B, lag={"c": 0.1}), "no rate limit or lag"),
    ):
        with pytest.raises(InputError, match=text):
            call()
