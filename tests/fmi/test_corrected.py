"""FMUs with Blocks around other FMUs, run by FMPy, compute what SciPy computes from the equations."""

import ctypes
import re
import zipfile

import fmpy
import numpy as np
import pytest
import sympy as sp
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.fmi3 import FMU3Model, FMU3Slave
from scipy.integrate import solve_ivp

from hovercontrol import Block, InputError, Signal, interconnect, rename, vehicle
from hovercontrol.blocks.backends.compiler import NoCompilerError, find_compiler
from hovercontrol.blocks.signals import time
from hovercontrol.fmi import corrected_fmu, load

try:
    find_compiler()
except NoCompilerError:
    pytest.skip("no C compiler on this machine", allow_module_level=True)

EXACT = {"rtol": 1e-12, "atol": 1e-12, "method": "DOP853"}
MASS, STIFFNESS, LAG, BIAS, SENSOR, DRAG = 2.0, 3.0, 0.3, 0.05, 0.2, 0.4
STEP = 2.0  # when the input steps from 1 to -0.5 [s]
TIME = np.linspace(0.0, 4.0, 401)


def spring() -> Block:
    """A mass on a spring, whose acceleration is an output: m x'' = u - k x."""
    x, v, u = Signal("x", "m", start=1.0), Signal("v", "m/s"), Signal("u", "N")
    m, k, a = Signal("m", "kg", start=MASS), Signal("k", "N/m", start=STIFFNESS), Signal("a", "m/s^2")
    slope = (u.symbol - k.symbol * x.symbol) / m.symbol
    return Block("spring", [x, v], [u], [x, v, a], [m, k], {"x": v.symbol, "v": slope}, {"a": slope})


def lagged() -> Block:
    u, lag, tau = Signal("u", "N"), Signal("u_lagged", "N"), Signal("T", "s", start=LAG, lower=1e-3)
    slope = (u.symbol - lag.symbol) / tau.symbol
    outputs = {"u_given": lag.symbol}
    return Block("before", [lag], [u], [Signal("u_given", "N")], [tau], {"u_lagged": slope}, outputs)


def sensors() -> Block:
    """A bias of x, a lag of a."""
    x, a, seen = Signal("x", "m"), Signal("a", "m/s^2"), Signal("a_lagged", "m/s^2")
    bias, tau = Signal("x_bias", "m", start=BIAS), Signal("a_lag", "s", start=SENSOR)
    outputs = {"x_measured": x.symbol + bias.symbol, "a_measured": seen.symbol}
    return Block(
        "after",
        [seen],
        [x, a],
        [Signal("x_measured", "m"), Signal("a_measured", "m/s^2")],
        [bias, tau],
        {"a_lagged": (a.symbol - seen.symbol) / tau.symbol},
        outputs,
    )


def drag() -> Block:
    v, d = Signal("v", "m/s"), Signal("drag", "1/s", start=DRAG)
    return Block("added", [], [v], [Signal("added", "m/s^2")], [d], {}, {"added": -d.symbol * v.symbol})


def late() -> tuple[Block, Block]:
    """The input acts 0.137 s late, the sensor of x tells 0.213 s late."""
    u, x = Signal("u", "N"), Signal("x", "m", start=0.25)
    at_input, at_sensor = Signal("late", "s", start=0.137), Signal("late_x", "s", start=0.213)
    before = Block(
        "before", [], [u], [Signal("u_given", "N")], [at_input], {}, {"u_given": u.symbol},
        delays={"u": at_input.symbol},
    )  # fmt: skip
    after = Block(
        "after", [], [x], [Signal("x_measured", "m")], [at_sensor], {}, {"x_measured": x.symbol},
        delays={"x": at_sensor.symbol},
    )  # fmt: skip
    return before, after


def pieces(function, start, ends, times):
    """Return the solution of x' = f(x, u) u held before each of `ends`, pairs of time and u."""
    rows, t, x = np.full((len(times), len(start)), np.nan), 0.0, np.array(start)
    for end, u in ends:
        found = solve_ivp(lambda _, z, u=u: function(z, u), (t, end), x, dense_output=True, **EXACT)
        inside = (times >= t - 1e-12) & (times <= end + 1e-12)
        rows[inside] = found.sol(times[inside]).T
        t, x = end, found.y[:, -1]
    return rows


def joint(z, u):
    x, v, lag, seen = z
    a = (lag - STIFFNESS * x) / MASS
    return [v, a - DRAG * v, (u - lag) / LAG, (a - seen) / SENSOR]


def by_fmpy(path, kind, outputs, stop=TIME[-1], **options):
    """Return columns by name; the input steps at STEP."""
    near = STEP - 1e-9 if kind == "CoSimulation" else STEP  # FMPy holds what it reads at the begin of a step
    rows = [(0.0, 1.0), (STEP - 1e-7 if near < STEP else STEP, 1.0), (near, -0.5), (stop + 1.0, -0.5)]
    table = np.array(rows, dtype=[("time", float), ("u", float)])
    options = {"relative_tolerance": 1e-10, "input": table, **options}
    return fmpy.simulate_fmu(
        str(path), fmi_type=kind, stop_time=stop, output_interval=0.01, record_events=False,
        output=list(outputs), **options,
    )  # fmt: skip


@pytest.fixture(scope="module")
def plants(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plants")
    return {n: spring().to_fmu(folder / f"spring{n}.fmu", version=n) for n in (2, 3)}


def without_exchange(path, out):
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(out, "w") as new:
        for name in old.namelist():
            data = old.read(name)
            if name == "modelDescription.xml":
                data = re.sub(
                    rb"<ModelExchange[^>]*/>|<ModelExchange.*?</ModelExchange>", b"", data, flags=re.S
                )
            new.writestr(name, data)
    return out


@pytest.mark.parametrize("version", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_lag_before_sensors_after_and_a_law_in_an_equation(plants, version, tmp_path):
    path = corrected_fmu(
        plants[version], tmp_path / "c.fmu", before=lagged(), after=sensors(), added={"der(v)": drag()}
    )
    described = fmpy.read_model_description(str(path), validate=True)
    names = {v.name: v for v in described.modelVariables}
    given = fmpy.read_model_description(str(plants[version])).modelVariables
    assert {v.name for v in given} <= set(names)
    assert names["before.T"].start == "0.3" and names["before.T"].unit == "s"
    assert names["inner.x"].causality == "local" and names["x"].causality == "output"
    want = pieces(joint, [1.0, 0.0, 0.0, 0.0], [(STEP, 1.0), (5.0, -0.5)], TIME)
    for kind, error in (("CoSimulation", 1e-9), ("ModelExchange", 1e-7)):
        found = by_fmpy(path, kind, ["x", "inner.x", "v", "a"])
        np.testing.assert_allclose(found["x"], want[:, 0] + BIAS, atol=error)
        np.testing.assert_allclose(found["inner.x"], want[:, 0], atol=error)
        np.testing.assert_allclose(found["v"], want[:, 1], atol=error)
        np.testing.assert_allclose(found["a"], want[:, 3], atol=error)


@pytest.mark.parametrize("version", [3, pytest.param(2, marks=pytest.mark.slow)])
def test_inputs_and_sensors_that_are_late(plants, version, tmp_path):
    before, after = late()
    path = corrected_fmu(plants[version], tmp_path / "c.fmu", before=before, after=after)

    def plain(z, u):
        return [z[1], (u - STIFFNESS * z[0]) / MASS]

    ends = [(0.137, 0.0), (STEP + 0.137, 1.0), (5.0, -0.5)]
    want = pieces(plain, [1.0, 0.0], ends, np.maximum(TIME - 0.213, 0.0))[:, 0]
    want[TIME < 0.213 - 1e-9] = 0.25  # the start value of the sensor's Block
    for kind, error in (("CoSimulation", 1e-8), ("ModelExchange", 1e-6)):
        found = by_fmpy(path, kind, ["x"])["x"]
        np.testing.assert_allclose(found, want, atol=error)


@pytest.mark.parametrize("version", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_around_co_simulation_inputs_hold_over_a_step(plants, version, tmp_path):
    """By hand: the lag's exact values at the beginnings of steps, and a sensor's lag along straight lines."""
    inner = without_exchange(plants[version], tmp_path / "cs.fmu")
    path = corrected_fmu(inner, tmp_path / "c.fmu", before=lagged(), after=sensors())
    described = fmpy.read_model_description(str(path), validate=True)
    assert described.modelExchange is None
    found = by_fmpy(path, "CoSimulation", ["x", "a", "before.u_lagged"], stop=1.0)
    h, lag, seen, z = 0.01, 0.0, 0.0, np.array([1.0, 0.0])
    w, rows = np.sqrt(STIFFNESS / MASS), []
    for _ in range(100):
        rest = lag / STIFFNESS  # x'' = w^2 (rest - x), exactly
        a0 = (lag - STIFFNESS * z[0]) / MASS
        rows.append([z[0] + BIAS, seen, lag])
        turn = np.array([[np.cos(w * h), np.sin(w * h) / w], [-w * np.sin(w * h), np.cos(w * h)]])
        z = turn @ (z - [rest, 0.0]) + [rest, 0.0]
        a1, e = (lag - STIFFNESS * z[0]) / MASS, np.exp(-h / SENSOR)
        ramp = (a1 - a0) / h
        seen = a1 - SENSOR * ramp + (seen - a0 + SENSOR * ramp) * e
        lag = 1.0 + (lag - 1.0) * np.exp(-h / LAG)
    for k, name in enumerate(["x", "a", "before.u_lagged"]):
        np.testing.assert_allclose(found[name][:100], np.array(rows)[:, k], atol=1e-8)


def test_events_of_the_fmu_inside_are_located(tmp_path):
    """A craft whose dry friction sticks and slips behind a lag, against our own simulation of one Block."""
    craft = vehicle("c17_simulation")
    plant = craft.plant()
    inner = plant.to_fmu(tmp_path / "plant.fmu", friction="events")
    thrust, lag = next(s for s in plant.inputs if s.name == "thrust"), Signal("lagged", "1")
    tau = Signal("T", "s", start=0.4)
    before = Block(
        "before", [lag], [thrust], [thrust.replace(name="thrust_given")], [tau],
        {"lagged": (thrust.symbol - lag.symbol) / tau.symbol}, {"thrust_given": lag.symbol},
    )  # fmt: skip
    path = corrected_fmu(inner, tmp_path / "c.fmu", before=before)
    time = np.linspace(0.0, 6.0, 301)
    values = np.where(time < 2.0, 3.0, np.where(time < 3.0, -1.0, 0.0))
    table = np.array(
        [(t, u, 0.1) for t, u in zip(time, values, strict=True)],
        dtype=[("time", float), ("thrust", float), ("rudder", float)],
    )
    found = fmpy.simulate_fmu(
        str(path), fmi_type="CoSimulation", stop_time=6.0, output_interval=0.02, input=table,
        relative_tolerance=1e-9, record_events=False,
    )  # fmt: skip
    whole = interconnect([rename(plant, {"thrust": "thrust_given"}), before])
    want = whole.compile(friction="events").simulate(
        time, {"thrust": values, "rudder": np.full(time.size, 0.1)}, rtol=1e-10, atol=1e-12
    )
    u = np.array(want.outputs)[[s.name for s in whole.outputs].index("u")]
    assert (found["u"][-20:] == 0.0).all() and np.abs(u).max() > 0.3  # it moved, and it sticks
    for name in ("x", "y", "psi", "u"):
        row = np.array(want.outputs)[[s.name for s in whole.outputs].index(name)]
        np.testing.assert_allclose(found[name], row, atol=1e-6)


def test_a_sampled_block_ticks_around_an_fmu(plants, tmp_path):
    """An input is held every 0.25 s; in between it keeps its value although the importer changes it."""
    u = Signal("u", "N")
    held = Block("before", [], [u], [Signal("u_given", "N")], [], {}, {"u_given": u.symbol}, period=0.25)
    path = corrected_fmu(plants[2], tmp_path / "c.fmu", before=held)
    time = np.arange(0, 201) * 0.01
    table = np.array([(t, np.sin(5 * t)) for t in time], dtype=[("time", float), ("u", float)])
    found = by_fmpy(path, "CoSimulation", ["x"], stop=2.0, input=table)["x"]
    ends = [(0.25 * (k + 1), np.sin(5 * 0.25 * k)) for k in range(8)]
    want = pieces(lambda z, u: [z[1], (u - STIFFNESS * z[0]) / MASS], [1.0, 0.0], ends, time)[:, 0]
    np.testing.assert_allclose(found, want, atol=1e-8)


def slave(path, folder, version):
    described = fmpy.read_model_description(str(path))
    unzipped = fmpy.extract(str(path), str(folder))
    kind = FMU2Slave if version == 2 else FMU3Slave
    fmu = kind(
        guid=described.guid, unzipDirectory=unzipped, instanceName="one",
        modelIdentifier=described.coSimulation.modelIdentifier,
    )  # fmt: skip
    fmu.instantiate()
    return fmu, {v.name: v.valueReference for v in described.modelVariables}


@pytest.mark.parametrize("version", [3, pytest.param(2, marks=pytest.mark.slow)])
def test_a_saved_state_continues_to_the_bit(plants, version, tmp_path):
    before, after = late()
    path = corrected_fmu(plants[version], tmp_path / "c.fmu", before=before, after=after)
    fmu, vr = slave(path, tmp_path / "unzipped", version)
    read, write = (fmu.getReal, fmu.setReal) if version == 2 else (fmu.getFloat64, fmu.setFloat64)
    if version == 2:
        fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()

    def run(first, last):
        rows = []
        for k in range(first, last):
            write([vr["u"]], [np.sin(0.1 * k)])
            fmu.doStep(0.05 * k, 0.05)
            rows.append(list(read([vr["x"], vr["v"]])))
        return rows

    run(0, 20)
    get, put = (fmu.getFMUstate, fmu.setFMUstate) if version == 2 else (fmu.getFMUState, fmu.setFMUState)
    state = get()
    first = run(20, 60)
    put(state)
    assert run(20, 60) == first
    data = fmu.serializeFMUstate(state) if version == 2 else fmu.serializeFMUState(state)
    again = fmu.deSerializeFMUstate(data) if version == 2 else fmu.deserializeFMUState(data)
    put(again)
    assert run(20, 60) == first
    fmu.reset()
    if version == 2:
        fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    run(0, 20)
    assert run(20, 60) == first
    fmu.terminate()
    fmu.freeInstance()


def test_start_values_and_parameters(plants, tmp_path):
    """New start values of both, one more parameter set by the importer; and an FMU around that FMU."""
    first = corrected_fmu(
        plants[3], tmp_path / "c.fmu", before=lagged(), start={"spring.k": 5.0, "before.T": 0.1, "x": 0.4}
    )
    path = corrected_fmu(first, tmp_path / "cc.fmu", after=sensors())
    found = by_fmpy(path, "CoSimulation", ["x"], start_values={"spring.m": 1.5, "after.x_bias": 0.5})["x"]

    def equations(z, u):
        return [z[1], (z[2] - 5.0 * z[0]) / 1.5, (u - z[2]) / 0.1]

    want = pieces(equations, [0.4, 0.0, 0.0], [(STEP, 1.0), (5.0, -0.5)], TIME)[:, 0] + 0.5
    np.testing.assert_allclose(found, want, atol=1e-8)


def test_our_importer_reads_it_without_a_false_algebraic_loop(plants, tmp_path):
    path = corrected_fmu(plants[2], tmp_path / "c.fmu", before=lagged(), after=sensors())
    with load(path, kind="ModelExchange") as system:
        assert system.interface.feedthrough == {"x": (), "v": (), "a": ()}
        A = np.array(system.linearize(np.zeros(4), np.zeros(1)).A)
    x, v, u, a = range(4)  # the FMU's states, then the Blocks': k/m, the lags
    want = np.zeros((4, 4))
    want[x, v], want[v, x], want[v, u] = 1.0, -STIFFNESS / MASS, 1.0 / MASS
    want[u, u], want[a] = -1.0 / LAG, [-STIFFNESS / MASS / SENSOR, 0.0, 1.0 / MASS / SENSOR, -1.0 / SENSOR]
    np.testing.assert_allclose(A, want, atol=1e-14)


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({}, "no Block around it changes"),
        ({"added": {"der(w)": drag()}}, "no derivative 'der\\(w\\)'"),
        (
            {"start": {"spring.kk": 1.0}, "before": lagged()},
            "no variable 'spring.kk'; did you mean 'spring.k'",
        ),
        ({"before": lagged(), "platforms": "aarch64-linux"}, "no library for the platform aarch64-linux"),
        ({"before": sensors()}, "no scalar real input 'x_measured'; known: u"),
    ],
)
def test_wrong_arguments_end_in_one_line(plants, options, line, tmp_path):
    with pytest.raises(InputError, match=line):
        corrected_fmu(plants[2], tmp_path / "c.fmu", **options)


@pytest.mark.slow
def test_libraries_for_other_systems_are_built(tmp_path):
    pytest.importorskip("ziglang")
    others = "x86_64-windows,aarch64-darwin,aarch64-linux"  # one of each format
    inner = spring().to_fmu(tmp_path / "p.fmu", platforms=others)
    path = corrected_fmu(inner, tmp_path / "c.fmu", before=lagged(), platforms="all")  # that it has
    names = zipfile.ZipFile(path).namelist()
    for suffix, folder in (
        (".dll", "x86_64-windows"),
        (".dylib", "aarch64-darwin"),
        (".so", "aarch64-linux"),
    ):
        assert f"binaries/{folder}/spring_corrected{suffix}" in names
        assert f"resources/inner/binaries/{folder}/spring{suffix}" in names


def instance(path, folder, version):
    """Return an instance for Model Exchange in continuous time, and value references by name."""
    described = fmpy.read_model_description(str(path))
    kind = FMU2Model if version == 2 else FMU3Model
    fmu = kind(
        guid=described.guid, unzipDirectory=fmpy.extract(str(path), str(folder)), instanceName="one",
        modelIdentifier=described.modelExchange.modelIdentifier,
    )  # fmt: skip
    fmu.instantiate()
    if version == 2:
        fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    while (fmu.newDiscreteStates() if version == 2 else fmu.updateDiscreteStates())[0]:
        pass
    fmu.enterContinuousTimeMode()
    return fmu, {v.name: v.valueReference for v in described.modelVariables}


def abilities(path):
    """Return what the description says of partial derivatives; FMPy does not read FMI 3's words."""
    text = zipfile.ZipFile(path).read("modelDescription.xml").decode()
    return re.findall(r'provides(\w+?)Derivatives?="true"', re.search("<ModelExchange.*?>", text)[0])


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("late_input", [False, True])
def test_directional_and_adjoint_derivatives_are_those_of_differences(plants, version, late_input, tmp_path):
    """A dead zone and a lag before, a bias and a lag after; a law of u, v and a in v'."""
    u, lag, tau = Signal("u", "N"), Signal("u_lagged", "N"), Signal("T", "s", start=LAG)
    zone, share = Signal("zone", "N", start=0.1), Signal("share", "1", start=0.2)
    kept = sp.Max(lag.symbol - zone.symbol, 0) + sp.Min(lag.symbol + zone.symbol, 0)
    before = Block(
        "before", [lag], [u], [Signal("u_given", "N")], [tau, zone, share],
        {"u_lagged": (u.symbol - lag.symbol) / tau.symbol}, {"u_given": kept + share.symbol * u.symbol},
    )  # fmt: skip
    if late_input:
        before = late()[0]
    v, a, d = Signal("v", "m/s"), Signal("a", "m/s^2"), Signal("drag", "1/m", start=DRAG)
    of_a, of_u = Signal("of_a", "s/m", start=0.1), Signal("of_u", "m/s^2/N^2", start=0.3)
    terms = -d.symbol * v.symbol * sp.Abs(v.symbol) + of_a.symbol * a.symbol * v.symbol
    law = Block(
        "added", [], [v, a, u], [Signal("added", "m/s^2")], [d, of_a, of_u], {},
        {"added": terms + of_u.symbol * u.symbol**2},
    )  # fmt: skip
    path = corrected_fmu(
        plants[version], tmp_path / "c.fmu", before=before, after=sensors(), added={"der(v)": law}
    )
    fmpy.read_model_description(str(path), validate=True)
    assert abilities(path) == ["Directional", "Adjoint"][: version - 1]
    fmu, vr = instance(path, tmp_path / "unzipped", version)
    read, write = (fmu.getReal, fmu.setReal) if version == 2 else (fmu.getFloat64, fmu.setFloat64)
    own = [] if late_input else ["before.u_lagged"]
    states = ["inner.x", "v", *own, "after.a_lagged"]
    knowns = [*states, "u"]
    unknowns = ["x", "v", "a", "der(x)", "der(v)", *(f"der({n})" for n in (*own, "after.a_lagged"))]
    at = np.array([0.7, -0.4, *(0.5 for _ in own), 0.2, 0.9])

    def values(z):
        write([vr["u"]], [z[-1]])
        fmu.setContinuousStates((ctypes.c_double * len(states))(*z[:-1]), len(states))
        return np.array(read([vr[n] for n in unknowns]))

    h = 1e-6
    want = np.array([(values(at + h * e) - values(at - h * e)) / (2 * h) for e in np.eye(len(at))]).T
    values(at)
    U, K = [vr[n] for n in unknowns], [vr[n] for n in knowns]
    more = (len(U),) if version == 3 else ()
    found = np.array([fmu.getDirectionalDerivative(U, K, list(e), *more) for e in np.eye(len(K))]).T
    np.testing.assert_allclose(found, want, atol=2e-9)
    sees = [True, True, *(True for _ in own), False, not late_input]  # what der(v) depends on at once
    assert ((np.abs(want[4]) > 0.01) == sees).all()
    if version == 3:
        found = np.array([fmu.getAdjointDerivative(U, K, list(e), len(K)) for e in np.eye(len(U))])
        np.testing.assert_allclose(found, want, atol=2e-9)
    fmu.terminate()
    fmu.freeInstance()


def test_directional_derivatives_in_co_simulation(plants, tmp_path):
    path = corrected_fmu(plants[2], tmp_path / "c.fmu", before=lagged(), added={"der(v)": drag()})
    fmu, vr = slave(path, tmp_path / "unzipped", 2)
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    fmu.doStep(0.0, 0.1)
    fmu.setReal([vr["u"]], [0.5])
    knowns = [vr[n] for n in ("v", "x", "before.u_lagged", "u")]
    rows = [fmu.getDirectionalDerivative([vr["der(v)"], vr["a"]], knowns, list(e)) for e in np.eye(4)]
    want = [[-DRAG, 0.0], [-STIFFNESS / MASS] * 2, [1.0 / MASS] * 2, [0.0, 0.0]]
    np.testing.assert_allclose(rows, want, atol=1e-15)
    fmu.terminate()
    fmu.freeInstance()


def test_directional_derivatives_are_not_promised_where_they_cannot_be_given(plants, tmp_path):
    """Around Co-Simulation, and where a Block depends on time itself."""
    inner = without_exchange(plants[2], tmp_path / "cs.fmu")
    path = corrected_fmu(inner, tmp_path / "c.fmu", before=lagged())
    assert b"provides" not in zipfile.ZipFile(path).read("modelDescription.xml")
    x, per = Signal("x", "m"), Signal("per_second", "m/s", start=0.1)
    drifting = Block(
        "after", [], [x], [Signal("x_measured", "m")], [per], {},
        {"x_measured": x.symbol + per.symbol * time},
    )  # fmt: skip
    path = corrected_fmu(plants[2], tmp_path / "t.fmu", after=drifting)
    assert abilities(path) == []


@pytest.mark.parametrize("kind", ["CoSimulation", None])
def test_the_interface_that_is_used(written, kind, tmp_path):
    """x' = u + offset - k x: in Euler's steps of 0.1 s, as the FMU's Co-Simulation takes them; else exact."""
    u, offset = Signal("u", "m/s"), Signal("offset", "m/s", start=0.3)
    before = Block(
        "before", [], [u], [Signal("u_given", "m/s")], [offset], {}, {"u_given": u.symbol + offset.symbol}
    )
    path = corrected_fmu(written("dahlquist"), tmp_path / "c.fmu", before=before, kind=kind)
    described = fmpy.read_model_description(str(path), validate=True)
    assert (described.modelExchange is None) == (kind == "CoSimulation")
    fmu, vr = slave(path, tmp_path / "unzipped", 3)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    found, euler, exact = [], [1.0], [1.0]
    for k in range(30):
        now = np.sin(k)
        fmu.setFloat64([vr["u"]], [now])
        fmu.doStep(0.1 * k, 0.1)
        found += fmu.getFloat64([vr["x"]])
        euler.append(euler[-1] + 0.1 * (now + 0.3 - euler[-1]))
        exact.append(now + 0.3 + (exact[-1] - now - 0.3) * np.exp(-0.1))
    fmu.terminate()
    fmu.freeInstance()
    want, other = (euler, exact) if kind else (exact, euler)
    assert np.abs(np.array(found) - want[1:]).max() < 1e-6
    assert np.abs(np.array(found) - other[1:]).max() > 1e-2


def test_an_fmu_with_clocks_is_refused_in_one_line(written, tmp_path):
    with pytest.raises(InputError, match="an FMU with clocks cannot be corrected; 'e' has one") as found:
        corrected_fmu(written("clocked"), tmp_path / "c.fmu", before=lagged())
    assert "\n" not in str(found.value)
