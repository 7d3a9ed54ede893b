"""The PID controller: against its transfer function, the textbook's sampled algorithm, and on a craft."""

import control
import numpy as np
import pytest
import scipy.signal

import hovercontrol as hc
from hovercontrol.base.errors import InputError

Y, U = hc.Signal("y", "m"), hc.Signal("force", "N")
GAINS = {"kp": 3.0, "ki": 2.0, "kd": 0.5, "derivative_filter": 0.1}


def test_the_linear_controller_is_the_transfer_function_of_the_textbook():
    """Astrom & Murray (11.1) with filtered derivative and setpoint weights."""
    kp, ki, kd, T = GAINS.values()
    system = hc.pid(Y, U, **GAINS, b=0.6, c=0.3).linearize([0, 0], [0, 0])
    s = control.tf("s")
    from_r = kp * 0.6 + ki / s + 0.3 * kd * s / (1 + T * s)
    from_y = -(kp + ki / s + kd * s / (1 + T * s))
    for w in (0.05, 1.0, 30.0):
        found = system(1j * w)
        assert found[0, 1] == pytest.approx(from_r(1j * w), rel=1e-9)
        assert found[0, 0] == pytest.approx(from_y(1j * w), rel=1e-9)


def test_a_loop_with_a_mass_is_the_closed_solution_of_its_linear_equations():
    v, m = hc.Signal("v", "m/s"), hc.Signal("m", "kg", start=2.0)
    y = hc.Signal("y", "m")
    mass = hc.Block("mass", [y, v], [U], [y], [m], {"y": v.symbol, "v": U.symbol / m.symbol})
    loop = hc.interconnect([mass, hc.pid(Y, U, **GAINS)], outputs=["y"])
    t = np.linspace(0, 8, 161)
    kp, ki, kd, T = GAINS.values()
    # y (2 s^2 (1 + T s) s + kp s (1 + T s) + ki (1 + T s) + kd s^2) = r (kp s + ki) (1 + T s)
    denominator = np.array([2 * T, 2.0, kp * T + kd, kp + ki * T, ki])
    numerator = np.polymul([kp, ki], [T, 1.0])
    _, expected = scipy.signal.step((numerator, denominator), T=t)
    for run in (
        hc.simulate(loop, t, {"y_ref": 1.0}, rtol=1e-10, atol=1e-12),
        loop.compile().simulate(t, {"y_ref": 1.0}, rtol=1e-10, atol=1e-12),
    ):
        assert np.ravel(run.outputs) == pytest.approx(expected, abs=1e-7)
    response = control.input_output_response(
        loop.to_control(), t, np.ones_like(t), solve_ivp_kwargs={"rtol": 1e-10, "atol": 1e-12}
    )
    assert np.ravel(response.outputs) == pytest.approx(expected, abs=1e-7)


def test_the_sampled_controller_is_the_algorithm_of_the_textbook(rng):
    """Astrom & Murray, section 11.5, the pseudocode on computer implementation."""
    h, Tt, b = 0.05, 0.4, 0.7
    kp, ki, kd, T = GAINS.values()
    block = hc.pid(Y, U, **GAINS, b=b, bounds=(-2.0, 2.0), tracking_time=Tt, period=h)
    f = block.to_numpy()
    integral = derivative = last = 0.0
    x = np.zeros(3)
    limited = 0
    for _ in range(60):
        y, r = rng.normal(size=2)
        derivative = T / (T + h) * derivative - kd / (T + h) * (y - last)
        demand = kp * (b * r - y) + integral + derivative
        applied = min(max(demand, -2.0), 2.0)
        integral += ki * h * (r - y) + h / Tt * (applied - demand)
        last = y
        assert f.outputs(0.0, x, [y, r])[0] == pytest.approx(applied, abs=1e-10)
        x = f.derivatives(0.0, x, [y, r])
        limited += applied != demand
    assert 10 < limited < 60
    assert block.period == h


def craft_on_course(**kwargs):
    plant = hc.vehicle("c17_experiment").plant()
    speed = hc.pid(plant.signal("u"), plant.signal("thrust"), kp=4.0, ki=1.0, offset=1.8, name="speed")
    heading = hc.pid(plant.signal("psi"), plant.signal("rudder"), angle=True, name="heading", **kwargs)
    return hc.interconnect([plant, speed, heading])


@pytest.mark.parametrize("period", [None, 0.02])
def test_a_craft_turns_the_short_way_to_its_heading(period):
    loop = craft_on_course(kp=-1.0, kd=-0.8, derivative_filter=0.05, period=period)
    t = np.linspace(0, 12, 241)
    run = loop.compile().simulate(
        t, {"psi_ref": -3.0, "u_ref": 1.0}, x0={"plant.psi": 3.0, "plant.u": 1.0, "heading.last": -3.0}
        if period else {"plant.psi": 3.0, "plant.u": 1.0, "heading.filtered": -3.0},
    )  # fmt: skip
    psi = run.outputs[run.output_labels.index("psi")]
    assert psi[-1] == pytest.approx(2 * np.pi - 3.0, abs=0.1)
    assert psi.min() > 2.9


def test_windup_is_bounded():
    """A heavy mass under a small force limit: overshoot with and without back-calculation."""
    v, m, y = hc.Signal("v", "m/s"), hc.Signal("m", "kg", start=2.0), hc.Signal("y", "m")
    mass = hc.Block("mass", [y, v], [U], [y], [m], {"y": v.symbol, "v": U.symbol / m.symbol})
    t, found = np.linspace(0, 60, 1201), {}
    for label, tracking_time in (("bounded", None), ("wound up", 1e9)):
        block = hc.pid(
            Y,
            U,
            kp=1.0,
            ki=0.1,
            kd=2.5,
            derivative_filter=0.05,
            bounds=(-0.5, 0.5),
            tracking_time=tracking_time,
        )
        loop = hc.interconnect([mass, block])
        run = loop.compile().simulate(t, {"y_ref": 5.0})
        assert np.abs(run.outputs[run.output_labels.index("force")]).max() <= 0.5
        integral = run.states[run.state_labels.index("controller.integral")]
        found[label] = (run.outputs[run.output_labels.index("y")].max() - 5.0, np.abs(integral).max())
    assert found["bounded"][0] < 1.0 < found["wound up"][0]
    assert found["bounded"][1] < 0.5 * found["wound up"][1]


def test_default_times_are_those_of_the_textbook():
    block = hc.pid(Y, U, kp=3.0, ki=2.0, kd=0.5, bounds=(-1.0, 1.0))
    assert block.default_parameters["controller.derivative_filter"] == pytest.approx(0.5 / 3.0 / 10)
    assert block.default_parameters["controller.tracking_time"] == pytest.approx(np.sqrt(1.5 * 0.5 / 3.0))
    pi = hc.pid(Y, U, kp=3.0, ki=2.0, bounds=(-1.0, 1.0))
    assert pi.default_parameters["controller.tracking_time"] == pytest.approx(1.5)


def test_parts_that_are_not_there_have_no_states_and_gains_have_units():
    assert hc.pid(Y, U, kp=1.0).states == ()
    block = hc.pid(Y, U, **GAINS)
    assert [s.name for s in block.states] == ["integral", "filtered"]
    units = {s.name: s.dimension for s in block.parameters}
    assert units["ki"] == hc.Signal("x", "N/m/s").dimension
    assert units["kd"] == hc.Signal("x", "N*s/m").dimension


def test_the_anti_windup_can_read_what_the_actuator_applies():
    block = hc.pid(Y, U, kp=1.0, ki=2.0, tracking_time=0.5, applied=True)
    f = block.to_numpy()
    assert f.derivatives(0.0, [0.3], [0.0, 1.0, 0.8])[0] == pytest.approx(2.0 + (0.8 - 1.3) / 0.5)
    assert block.feedthrough["force"] == ("y", "y_ref")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"kp": float("nan")}, "pid: kp"),
        ({"period": 0.0}, "pid: period must be positive"),
        ({"derivative_filter": 0.0}, "pid: derivative_filter must be positive"),
        ({"kp": 0.0}, "derivative_filter must be given where kp is 0"),
        ({"angle": True, "b": 0.5}, "setpoint weights of an angle"),
        ({"bounds": (1.0, 2.0)}, "pid: offset = 0 N is out of the command's bounds [1, 2]"),
    ],
)
def test_wrong_input_is_refused_in_one_line(change, words):
    with pytest.raises(InputError) as caught:
        hc.pid(Y, U, **({"kp": 1.0, "kd": 1.0} | change))
    assert words in str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize("period", [None, 0.02])
def test_the_controller_works_as_an_fmu(tmp_path, period):
    fmpy = pytest.importorskip("fmpy")
    loop = craft_on_course(kp=-1.0, kd=-0.8, derivative_filter=0.05, period=period)
    loop = loop.with_values({"plant.u": 1.0, "psi_ref": 0.5, "u_ref": 1.0})
    expected = loop.compile().simulate(np.arange(101) * 0.02)
    path = loop.to_fmu(tmp_path / "loop.fmu")
    found = fmpy.simulate_fmu(str(path), stop_time=2.0, output_interval=0.02, output=["psi"])
    psi = expected.outputs[expected.output_labels.index("psi")]
    assert psi[-1] > 0.2
    assert found["psi"] == pytest.approx(psi, abs=1e-4)
