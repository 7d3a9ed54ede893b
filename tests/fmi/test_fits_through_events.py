"""Parameters of FMUs of other hands from logs: true values are those of the equations by hand."""

import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.base.errors import InputError

from .test_written import ball

NOISE = 0.01


def fitted(path, fit, log, kind, **options):
    plant = hc.fmu_plant(path, fit, kind=kind, isolated=False, **options)
    found = hc.identify(plant, [log])
    plant.close()
    return found


def dropped_by_euler(t, g, e, h=1e-3):
    """The ball in steps of Euler's method: it bounces at the end of the step in which it meets the floor."""
    x, v, found = 1.0, 0.0, []
    for _ in t:
        found.append(x)
        for _ in range(round((t[1] - t[0]) / h)):
            before, x, v = x, x + h * v, v - h * g
            if before > 0.0 >= x:
                x, v = np.finfo(float).tiny, -e * v
    return np.array(found)


@pytest.mark.parametrize("noise", [0.0, NOISE])
@pytest.mark.parametrize("kind", ["ModelExchange", "CoSimulation"])
def test_gravity_and_restitution_of_a_bouncing_ball(written, kind, noise):
    t = 0.01 * np.arange(200)
    h = ball(t, 9.6, 0.75) if kind == "ModelExchange" else dropped_by_euler(t, 9.6, 0.75)
    log = hc.Log("run", t, {"h": h + noise * np.random.default_rng(3).normal(size=t.size)})
    found = fitted(written("bouncing_ball"), ["g", "e"], log, kind)
    for name, true in (("g", 9.6), ("e", 0.75)):
        assert abs(found[name].value / true - 1.0) < 0.01
        if noise:
            assert abs(found[name].value - true) < 3.5 * found[name].std
            assert found[name].std < 0.01 * true


def test_damping_of_the_oscillator(written):
    """The log is of the FMU's own equation by SciPy."""
    from scipy.integrate import solve_ivp

    t = 0.02 * np.arange(400)
    x = solve_ivp(
        lambda t, x: [x[1], 1.5 * (1 - x[0] ** 2) * x[1] - x[0]], (0, 8), [2, 0], "DOP853", t, rtol=1e-10
    ).y[0]
    log = hc.Log("run", t, {"x": x + NOISE * np.random.default_rng(4).normal(size=t.size)})
    found = fitted(written("van_der_pol"), ["mu"], log, "ModelExchange")["mu"]
    assert abs(found.value - 1.5) < 3.5 * found.std < 0.02


@pytest.mark.parametrize("apart", [[1], [2], [1, 1, 2]])
def test_an_fmu_with_a_fixed_step(written, apart):
    """Rows that are one step apart, two, or now and then two, where one was lost."""
    steps = np.resize(apart, 99)
    t = 0.1 * np.concatenate([[0], np.cumsum(steps)])
    rng = np.random.default_rng(5)
    u, x = np.repeat(rng.uniform(-1.0, 1.0, 10), 10), [1.0]
    for now, count in zip(u[:-1], steps, strict=True):
        y = x[-1]
        for _ in range(count):
            y += 0.1 * (now - 1.4 * y)
        x.append(y)
    log = hc.Log("run", t, {"u": u, "x": np.array(x) + NOISE * rng.normal(size=t.size)})
    found = fitted(written("dahlquist"), ["k"], log, "CoSimulation")["k"]
    assert abs(found.value - 1.4) < 3.5 * found.std < 0.1


def test_rows_between_the_steps_of_an_fmu_are_one_line(written):
    t = 0.025 * np.arange(100)
    log = hc.Log("run", t, {"u": np.zeros(100), "x": np.exp(-t)})
    with pytest.raises(
        InputError, match=r"multiples of 0\.1 s apart, the fixed step of FMU 'dahlquist'; found 0\.025 s"
    ) as found:
        fitted(written("dahlquist"), ["k"], log, "CoSimulation")
    assert "\n" not in str(found.value)
