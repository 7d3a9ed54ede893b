"""A Block in JAX computes what NumPy and compiled Blocks compute, and its runs have exact gradients."""

import contextlib

import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.blocks.backends.sweep import FIGURES
from hovercontrol.blocks.delays import undelayed
from hovercontrol.blocks.signals import time
from hovercontrol.documents.scenarios import load_scenario
from hovercontrol.documents.scenarios.runner import loop_parts
from tests.blocks.backends import designed
from tests.blocks.backends.sampled_by_hand import sampled_loop

jax = pytest.importorskip("jax")
jnp = pytest.importorskip("jax.numpy")
CRAFT = hc.vehicle("c17_simulation")
PARTS = loop_parts(load_scenario("table1"))
LOOP = hc.interconnect(
    [CRAFT.plant(), hc.tracking_controller(CRAFT), hc.ellipse(1.5, 2.5, rate=-1.0)], "loop"
)
PLANT = CRAFT.plant()
STRAIGHT = PLANT.trim({"u": 1.0, "r": 0.0, "psi": 0.0})
WEIGHTS = {"y": 1.0, "u": 1.0}, {"thrust": 1.0, "rudder": 4.0}

BLOCKS = {
    **{name: hc.vehicle(name).plant() for name in hc.VEHICLES},
    "tracking": hc.tracking_controller(CRAFT),
    "lqr": hc.lqr(PLANT, STRAIGHT, *WEIGHTS),
    "lqi": hc.lqi(PLANT, STRAIGHT, {"u": 1.0, "integral_u": 4.0}, {"thrust": 1.0}, integrate="u"),
    "course_control": hc.course_control(gain=2.0, yaw_rate=10.0),
    "line_of_sight": hc.line_of_sight([[0.0, 0.0], [10.0, 0.0]], lookahead=2.0).in_continuous_time,
    "pid": hc.pid(hc.Signal("v", "m/s"), hc.Signal("a", "m/s^2"), kp=2.0, ki=0.5, kd=0.1),
    "waypoints": hc.waypoints([[0, 0], [1, 2], [3, 1]], [0.0, 1.0, 2.5]),
    "loop": LOOP,
    "sampled": sampled_loop(),
    **{f"table1 {name}": block for name, block in PARTS.items()},
}


@pytest.mark.slow("estimator", "monitor")
@pytest.mark.parametrize("name", [*BLOCKS, *designed.MAKERS])
def test_functions_are_numpy_s_at_random_points(name, rng):
    block = undelayed(BLOCKS[name] if name in BLOCKS else designed.designed(name))
    x, u = (rng.normal(0, 1, (len(group), 100)) for group in (block.states, block.inputs))
    x = x if name in BLOCKS else designed.near_start(block, rng, 100)
    t = rng.uniform(0, 3, 100)
    functions, expected = block.to_jax(), block.to_numpy()
    for rows in ("next" if block.period else "derivatives", "outputs"):
        found = np.asarray(jax.jit(getattr(functions, rows))(t, x, u))
        wanted = expected.derivatives(t, x, u) if rows != "outputs" else expected.outputs(t, x, u)
        assert np.isfinite(wanted).all()
        np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-12 * np.abs(wanted).max(initial=0))


def test_the_jacobian_is_the_exact_one(rng):
    plant = CRAFT.plant()
    x, u = rng.normal(0, 1, 6), rng.normal(0, 1, 2)
    found = jax.jit(jax.jacobian(plant.to("jax").derivatives, 1))(0.0, x, u)
    np.testing.assert_allclose(found, plant.to_numpy().jacobian(0.0, x, u), rtol=1e-12, atol=1e-12)


# ---- runs --------------------------------------------------------------------------------------------

GRID = np.linspace(0.0, 1.0, 101)
PUSH = np.where((GRID > 0.2) & (GRID < 0.5), 0.3, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("method", [{"method": "rk4", "step": 0.0025}, {"rtol": 1e-9}])
def test_a_sampled_controller_a_delay_and_noise_are_as_in_a_compiled_run(method):
    pytest.importorskip("diffrax")
    block = sampled_loop()
    found = block.to_jax().simulate(GRID, {"push": PUSH}, params={"cart.late": 0.0333}, **method)
    expected = hc.simulate(block, GRID, {"push": PUSH}, params={"cart.late": 0.0333}, rtol=1e-9)
    np.testing.assert_allclose(found.states, expected.states, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(found.outputs, expected.outputs, rtol=1e-12, atol=1e-12)


def test_the_error_of_runge_kutta_falls_sixteenfold_when_the_step_is_halved():
    """x' = x cos(t), x = exp(sin(t)); and a pendulum's small swing with it, x'' = -x."""
    import sympy as sp

    rate, (x, y, v) = hc.Signal("rate", "1/s", start=1.0), (hc.Signal(n) for n in "xyv")
    r = rate.symbol
    slopes = {"x": r * x.symbol * sp.cos(r * time), "y": r * v.symbol, "v": -r * y.symbol}
    states = [x.replace(start=1.0), y.replace(start=1.0), v]
    block = hc.Block("smooth", states, [], states, [rate], slopes)
    t = np.linspace(0.0, 4.0, 5)
    exact = np.array([np.exp(np.sin(t)), np.cos(t), -np.sin(t)])
    run = block.to_jax().simulate
    errors = [np.abs(run(t, method="rk4", step=h).states - exact).max(axis=1) for h in (0.1, 0.05, 0.025)]
    np.testing.assert_allclose(np.divide(errors[:-1], errors[1:]), 16.0, rtol=0.15)


def test_a_switch_at_a_set_time_is_not_stepped_over():
    import sympy as sp

    on, off = hc.Signal("on", "s", start=0.5137), hc.Signal("off", "s", start=0.5138)
    force = hc.Signal("force", "1/s", start=5.0)
    kick = sp.Piecewise((force.symbol, (time > on.symbol) & (time < off.symbol)), (0.0, True))
    x = hc.Signal("x")
    block = hc.Block("kicked", [x], [], [x], [on, off, force], {"x": kick})
    found = block.to_jax().simulate([0.0, 1.0], method="rk4", step=0.1)
    assert found.states[0, -1] == pytest.approx(5e-4, rel=1e-3)


def test_what_sets_restarts_is_fixed_in_a_run_function():
    run = sampled_loop().to_jax().run_function(GRID, step=0.01)
    with pytest.raises(hc.InputError, match=r"'cart.late' sets times at which the run restarts"):
        run({"cart.late": 0.1})
    with pytest.raises(hc.InputError, match=r"unknown parameter 'brake.kk'; did you mean 'brake.k'"):
        run({"brake.kk": 0.1})
    with pytest.raises(hc.InputError, match=r"unknown state 'cart.w'"):
        run(x0={"cart.w": 0.1})


# ---- sweeps ------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("block", "method"),
    [
        (LOOP, {"method": "rk4", "step": 2e-3}),
        (sampled_loop(), {"method": "dormand-prince", "rtol": 1e-10}),
    ],
    ids=["continuous", "hybrid"],
)
def test_a_sweep_has_the_figures_of_the_compiled_one(block, method):
    key = {"loop": "controller.k1", "braked": "cart.late"}[block.name]
    given = {"params": {key: np.linspace(0.01, 2.0, 7)}, "start": 0.2, "band": 1e-3, **method}
    found, expected = (made.sweep(GRID, **given, **more) for made, more in (
        (block.to_jax(), {"chunk": 3}), (block.compile(), {})
    ))  # fmt: skip
    for name in (*FIGURES, "states_final"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=2e-7, atol=2e-7)
    assert not found.status.any()


def test_a_run_that_fails_is_marked_and_the_others_go_on():
    x = hc.Signal("x", start=1.0)
    k = hc.Signal("k", "1/s", start=1.0)
    block = hc.Block("blown", [x], [], [x], [k], {"x": k.symbol * x.symbol**2})  # infinite at t = 1/k
    result = block.to_jax().sweep([0.0, 0.5, 2.0], params={"blown.k": [0.1, 3.0, 0.2]}, step=1e-3)
    assert result.status.tolist() == [0, 2, 0]
    assert "a derivative is not a number" in str(result.failures[0]) and np.isnan(result["x"].final[1])
    assert result["x"].final[[0, 2]] == pytest.approx([1 / (1 - 0.2), 1 / (1 - 0.4)])  # x = 1/(1 - k t)


def test_without_jax_one_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "jax", None)
    with pytest.raises(hc.InputError, match=r'pip install "\.\[jax\]"'):
        LOOP.to_jax()


@pytest.mark.slow
def test_gradients_of_a_run_are_the_variational_sensitivities():
    """Ten seconds of the craft, friction over 0.2 m/s, against the variational equations by DOP853."""
    from scipy.integrate import solve_ivp

    plant = hc.vehicle("c17_simulation").plant()
    values = {k: 0.2 if k.endswith("width") else v for k, v in plant.default_parameters.items()}
    names, rows = list(values), [s.name for s in plant.states]
    n, count = len(rows), len(values)
    t, command, x0 = np.linspace(0, 10, 101), np.array([3.0, 0.2]), np.array([0, 0, 0, 1.0, 0.1, 0.2])
    numpy = plant.to_numpy()

    def slopes(at, z):
        x, S = z[:n], z[n:].reshape(n, count)
        A = numpy.jacobian(at, x, command, values)
        B = numpy.jacobian(at, x, command, values, "derivatives", "parameters")
        return np.r_[numpy.derivatives(at, x, command, values), (A @ S + B).ravel()]

    exact = solve_ivp(slopes, (0, 10), np.r_[x0, np.zeros(n * count)], "DOP853", rtol=1e-12, atol=1e-14)
    expected = exact.y[n:, -1].reshape(n, count)
    run = plant.to_jax().run_function(t, np.tile(command[:, None], t.size), step=0.005)
    start = dict(zip(rows, x0, strict=True))

    def final(params):
        found = run(params, start)
        return jnp.stack([found[name][-1] for name in rows])

    found = jax.jit(jax.jacfwd(final))(values)
    ours = np.stack([np.asarray(found[name]) for name in names], axis=1)
    assert np.abs(ours - expected).max() < 1e-8 * np.abs(expected).max()


# ---- the kernel of a GPU -----------------------------------------------------------------------------


def _plan_and_values(block, key, runs):
    from hovercontrol.blocks.backends.engines import checked_solver
    from hovercontrol.blocks.backends.jax_run import plan_of
    from hovercontrol.blocks.delays import arrivals
    from hovercontrol.blocks.simulation.arguments import input_rows

    functions, times = block.to_jax().plain, np.array([0.0, 0.03, 0.1])
    values, solver = np.array(block.parameter_values()), checked_solver("rk4", 0.01, 1e-6, 1e-9)
    plan = plan_of(
        functions.block, times, arrivals(block, times, input_rows(block, None, times), values), values, solver
    )
    some = np.linspace(0.8, 1.2, runs) * block.default_parameters[key]
    p = tuple(some if k == key else v for k, v in block.default_parameters.items())
    x = tuple(jnp.full(runs, s.start) for s in block.states)
    return functions, plan, x, p, times, {key: some}


@pytest.mark.slow
@pytest.mark.parametrize(("block", "name"), [(LOOP, "yaw_linear_drag"), (sampled_loop(), "k")])
def test_the_kernel_of_a_gpu_computes_what_compiled_runs_compute(block, name):
    from hovercontrol.blocks.backends.jax_kernel import fits_kernel, kernel_runner

    key = next(k for k in block.default_parameters if k.endswith(f".{name}"))
    functions, plan, x, p, times, params = _plan_and_values(block, key, 40)  # no multiple of a warp
    assert fits_kernel(functions.block)
    rows, last = kernel_runner(functions, interpret=True)(x, p, plan)
    expected = block.compile().sweep(times, params=params, method="rk4", step=0.01)
    np.testing.assert_allclose(np.stack(last, axis=-1), expected.states_final, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(np.stack(rows, axis=-1)[-1], expected.final, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(np.stack(rows, axis=-1).max(axis=0), expected.maximum, rtol=1e-12, atol=1e-14)


def test_the_kernel_compiles_for_a_gpu():
    from hovercontrol.blocks.backends.jax_kernel import kernel_runner

    decay = hc.Block(
        "decay", [v := hc.Signal("v", "m/s", start=1.0)], [], [v], [k := hc.Signal("k", "1/s", start=2.0)],
        {"v": -k.symbol * v.symbol},
    )  # fmt: skip
    functions, plan, x, p, *_ = _plan_and_values(decay, "decay.k", 32)
    with _as_if_a_gpu_were_here():
        traced = jax.jit(lambda x, p: kernel_runner(functions)(x, p, plan)).trace(x, p)
        assert "triton" in traced.lower(lowering_platforms=("cuda",)).as_text()


def _as_if_a_gpu_were_here() -> contextlib.AbstractContextManager:
    """Describe an H100 to the compiler: JAX asks for it from 0.12 on."""
    if tuple(map(int, jax.__version__.split(".")[:2])) < (0, 12):
        return contextlib.nullcontext()
    from jax.sharding import AbstractDevice, AbstractMesh, use_abstract_mesh

    card = AbstractDevice(device_kind="NVIDIA H100 80GB HBM3", num_cores=None, platform="gpu")
    return use_abstract_mesh(AbstractMesh((1,), ("runs",), abstract_device=card))


def test_a_block_with_a_table_has_no_kernel():
    from hovercontrol.blocks.backends.jax_kernel import fits_kernel
    from hovercontrol.blocks.lookup import Entries, entry

    a, b = hc.Signal("a", "1"), hc.Signal("b", "1")
    squares = entry(a.symbol, Entries("squares", [0.0, 1.0, 4.0]))
    table = hc.Block("t", [], [a], [b], [], output_expressions={"b": squares})
    assert not fits_kernel(table)
