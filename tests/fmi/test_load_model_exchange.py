"""FMUs for Model Exchange as continuous python-control systems."""

import copy
import warnings

import control as ct
import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.fmi import load

VERSIONS = pytest.mark.parametrize("version", [2, 3])
PLANT = hc.vehicle("c17_simulation").plant()


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("me")
    return {v: PLANT.to_fmu(folder / f"plant{v}.fmu", version=v) for v in (2, 3)}


@pytest.fixture
def plant(files):
    made = []

    def make(version, **options):
        made.append(load(files[version], kind="ModelExchange", **options))
        return made[-1]

    yield make
    for system in made:
        system.close()


def points(n=5):
    rng = np.random.default_rng(3)
    return [(rng.normal(0.0, 0.7, 6), rng.uniform(-1.0, 1.0, 2) * [1.0, 0.5]) for _ in range(n)]


@VERSIONS
def test_the_equations_are_those_of_the_model(plant, version):
    system, expected = plant(version), PLANT.to_control()
    assert system.isctime() and system.state_labels == expected.state_labels
    for x, u in points():
        assert np.allclose(system.dynamics(0.0, x, u), expected.dynamics(0.0, x, u), rtol=1e-14, atol=1e-14)
        assert np.allclose(system.output(0.0, x, u), expected.output(0.0, x, u), rtol=1e-14, atol=1e-14)


@VERSIONS
def test_linearize_is_equal_to_differences(plant, version):
    """python-control's own differences, of the FMU's functions in a system that knows no derivatives."""
    system = plant(version)
    bare = ct.nlsys(
        lambda t, x, u, p: system.dynamics(t, x, u),
        lambda t, x, u, p: system.output(t, x, u),
        states=6,
        inputs=2,
        outputs=6,
    )
    for x, u in points():
        found = ct.linearize(system, x, u)
        expected = [np.zeros_like(found.A), np.zeros_like(found.B)]
        for sign in (1.0, -1.0):  # central, from python-control's forward differences of both signs
            one = ct.linearize(bare, x, u, eps=sign * 1e-6)
            expected = [e + 0.5 * m for e, m in zip(expected, (one.A, one.B), strict=True)]
        assert np.abs(found.A - expected[0]).max() < 1e-7 and np.abs(found.B - expected[1]).max() < 1e-7
        assert np.array_equal(found.C, np.eye(6)) and found.state_labels == system.state_labels


@VERSIONS
def test_trim_and_response_of_python_control(plant, version):
    system, expected = plant(version), PLANT.to_control()
    wanted = {"x0": [0, 0, 0, 1.0, 0, 0], "u0": [1.0, 0.0], "ix": [0, 1, 2, 3], "idx": [2, 3, 4, 5], "iu": []}
    x, u = ct.find_operating_point(system, **wanted)
    y, w = ct.find_operating_point(expected, **wanted)
    assert np.allclose(x, y, atol=1e-7) and np.allclose(u, w, atol=1e-7)
    t = np.linspace(0.0, 3.0, 31)
    row = np.array([1.0 + 0 * t, 0.2 * np.sin(t)])
    # at rtol 1e-10 the solver itself errs by 6e-9
    options = {"solve_ivp_kwargs": {"rtol": 1e-12, "atol": 1e-14}}
    found = ct.input_output_response(system, t, row, params={"plant.yaw_coulomb": 0.4}, **options)
    same = ct.input_output_response(expected, t, row, params={"plant.yaw_coulomb": 0.4}, **options)
    assert np.abs(found.outputs - same.outputs).max() < 1e-8


def test_fmu_block_and_native_system_in_one_interconnect(plant):
    hull, yaw = plant(3, name="hull"), hc.Signal("r", "rad/s")
    k = hc.Signal("k", "s", start=0.5)
    damper = hc.Block("damper", [], [yaw], [hc.Signal("rudder", "rad")], [k],
                      output_expressions={"rudder": k.symbol * yaw.symbol})  # fmt: skip
    motor = ct.ss([[-2.0]], [[2.0]], [[1.0]], [[0.0]], inputs="throttle", outputs="thrust", name="motor")
    loop = ct.interconnect([hull, damper.to_control(), motor], inputs="throttle", outputs=["u", "r"])
    same = ct.interconnect(
        [PLANT.to_control(name="hull"), damper.to_control(), motor], inputs="throttle", outputs=["u", "r"]
    )
    t, x0 = np.linspace(0.0, 4.0, 41), [0, 0, 0, 0.5, 0, 1.0, 0]
    options = {"solve_ivp_kwargs": {"rtol": 1e-10, "atol": 1e-12}}
    found = ct.input_output_response(loop, t, np.ones(41), x0, **options)
    assert (
        np.abs(found.outputs - ct.input_output_response(same, t, np.ones(41), x0, **options).outputs).max()
        < 1e-8
    )


@VERSIONS
def test_a_body_that_sticks_by_its_event_indicators(tmp_path, version):
    """v' = -1/2 sgn v from 1 m/s: at rest after 2 s, by then 1 m away."""
    s, v = hc.Signal("s", "m"), hc.Signal("v", "m/s", start=1.0)
    c, width = hc.Signal("c", "m/s^2", start=0.5), hc.Signal("width", "m/s", start=1e-3)
    body = hc.Block("body", [s, v], [], [s, v], [c, width],
                    derivatives={"s": v.symbol, "v": -c.symbol * hc.sgn(v.symbol, width.symbol)})  # fmt: skip
    path = body.to_fmu(tmp_path / "body.fmu", version=version, friction="events")
    with load(path, kind="ModelExchange") as system:
        assert system.interface.indicators == 1
        run = system.simulate(np.linspace(0.0, 4.0, 41))
    t = np.minimum(run.time, 2.0)
    assert np.abs(run.states[0] - (t - t**2 / 4)).max() < 1e-7
    assert run.states[1, 21:].max() == 0.0


@VERSIONS
def test_ticks_are_time_events(tmp_path, version):
    """A count rises by one every 0.1 s and a lag follows it: exact from tick to tick."""
    count, lag, k = hc.Signal("count", "1"), hc.Signal("lag", "1"), hc.Signal("k", "1/s", start=1.0)
    counter = hc.Block("counter", [count], [], [count], period=0.1, derivatives={"count": count.symbol + 1})
    follower = hc.Block("follower", [lag], [count], [lag], [k],
                        derivatives={"lag": k.symbol * (count.symbol - lag.symbol)})  # fmt: skip
    path = hc.interconnect([counter, follower], "both").to_fmu(tmp_path / "both.fmu", version=version)
    with pytest.warns(UserWarning, match="time events"):
        system = load(path, kind="ModelExchange")
    with system:
        run = system.simulate(np.linspace(0.0, 0.95, 20), rtol=1e-9, atol=1e-12)
    x = [0.0]
    for half in range(19):  # a Block that ticks shows at tick k what it had before: k
        x.append(half // 2 + (x[-1] - half // 2) * np.exp(-0.05))
    assert np.abs(run.outputs[list(system.output_index).index("lag")] - x).max() < 1e-7


def test_what_does_not_fit_is_one_line(files, plant):
    with pytest.raises(InputError, match="no communication step"):
        load(files[3], kind="ModelExchange", step=0.1)
    with pytest.raises(InputError, match="Co-Simulation alone"):
        load(files[3], kind="ModelExchange", isolated=True)
    system = plant(3)
    with pytest.raises(InputError, match=r"unknown parameter 'plant\.yaw'"):
        system.dynamics(0.0, np.zeros(6), np.zeros(2), params={"plant.yaw": 1.0})
    with pytest.raises(InputError, match="failed at t = 0 s"):
        system.dynamics(0.0, np.full(6, np.nan), np.zeros(2))
    assert np.isfinite(system.dynamics(0.0, np.zeros(6), np.zeros(2))).all()  # and it goes on
    with pytest.raises(InputError, match="unknown method"):
        system.simulate([0.0, 1.0], method="Euler")
    twin = copy.deepcopy(system)
    system.close()
    with pytest.raises(InputError, match="is closed"):
        system.dynamics(0.0, np.zeros(6), np.zeros(2))
    assert np.isfinite(twin.dynamics(0.0, np.zeros(6), np.zeros(2))).all()
    twin.close()


def test_findings_are_a_warning_where_they_are_tolerated(fmu):
    """Two variables of one name; FMPy calls that a finding."""
    path = fmu(2, rename={"x": "u"})
    with pytest.raises(InputError, match="strict=False"):
        load(path)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        load(path, strict=False).close()
    assert any("breaks FMI 2.0" in str(w.message) for w in caught)


def differences(system, x, u, h=1e-5):
    """A and C by central differences of python-control's own functions."""
    columns = []
    for e in np.eye(system.nstates):
        ends = [np.concatenate([system.dynamics(0.0, x + s * h * e, u), system.output(0.0, x + s * h * e, u)])
                for s in (1.0, -1.0)]  # fmt: skip
        columns.append((ends[0] - ends[1]) / (2.0 * h))
    table = np.array(columns).T
    return table[: system.nstates], table[system.nstates :]


@pytest.mark.parametrize("name", ["van_der_pol", "bouncing_ball", "dahlquist"])
def test_fmus_of_other_hands_are_linearised(written, name):
    """One gives directional derivatives, one has events; by hand A is known too."""
    by_hand = {
        "van_der_pol": lambda x: [[0.0, 1.0], [-2.0 * x[0] * x[1] - 1.0, 1.0 - x[0] ** 2]],
        "bouncing_ball": lambda x: [[0.0, 1.0], [0.0, 0.0]],
        "dahlquist": lambda x: [[-1.0]],
    }
    with load(written(name), kind="ModelExchange") as system:
        rng = np.random.default_rng(1)
        for _ in range(5):
            x, u = rng.uniform(0.2, 1.5, system.nstates), np.zeros(system.ninputs)
            found = ct.linearize(system, x, u)
            A, C = differences(system, x, u)
            assert np.abs(found.A - A).max() < 1e-7 and np.abs(found.C - C).max() < 1e-7
            assert np.abs(found.A - by_hand[name](x)).max() < 1e-7


def test_an_operating_point_of_an_fmu_of_another_hand(written):
    """x' = u - k x with k = 1: at rest with u = 0.7 the state is 0.7."""
    with load(written("dahlquist"), kind="ModelExchange") as system:
        x, _ = ct.find_operating_point(system, [0.0], [0.7])
    assert x == pytest.approx(0.7, abs=1e-7)
