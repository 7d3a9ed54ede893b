"""FMUs of other hands: Van der Pol's oscillator, a bouncing ball and Dahlquist's equation, in C."""

import fmpy
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hovercontrol.fmi import load

G, E = 9.81, 0.7


def ball(t, g=G, e=E, h=1.0):
    """The height of a ball that falls from h, by hand: parabolas between bounces."""
    first = np.sqrt(2.0 * h / g)
    y = h - 0.5 * g * t**2
    start, v = first, e * g * first
    while start < t[-1]:
        own = t >= start
        y[own] = v * (t[own] - start) - 0.5 * g * (t[own] - start) ** 2
        start, v = start + 2.0 * v / g, e * v
    return y


@pytest.mark.parametrize("name", ["van_der_pol", "bouncing_ball", "dahlquist"])
def test_fmpy_finds_nothing_wrong(written, name):
    fmpy.read_model_description(str(written(name)), validate=True)


def test_the_ball_bounces_at_its_state_events(written):
    t = np.linspace(0.0, 2.0, 201)
    with load(written("bouncing_ball"), kind="ModelExchange") as system:
        run = system.simulate(t, rtol=1e-9, atol=1e-12)
    assert np.abs(run.states[0] - ball(t)).max() < 1e-9


def test_the_oscillator_moves_as_scipy_says(written):
    t = np.linspace(0.0, 10.0, 101)
    true = solve_ivp(
        lambda t, x: [x[1], 1.5 * (1 - x[0] ** 2) * x[1] - x[0]],
        (0, 10),
        [2, 0],
        "DOP853",
        t,
        rtol=1e-11,
        atol=1e-12,
    )
    with load(written("van_der_pol"), kind="ModelExchange") as system:
        run = system.simulate(t, params={"van_der_pol.mu": 1.5}, rtol=1e-10, atol=1e-12)
    assert np.abs(run.states - true.y).max() < 1e-7
