"""Every parameter of a Block is an unknown; what logs cannot show of it is said."""

import numpy as np
import pytest
from scipy.optimize import least_squares

import hovercontrol as hc
from hovercontrol.base.errors import InputError


def held(seed, n, every, low, high):
    return np.repeat(np.random.default_rng(seed).uniform(low, high, n // every + 1), every)[:n]


def first_order(u, a, b, x, dt):
    """Return the samples of ``x' = b u - a x`` under held inputs, from x."""
    fade, states = np.exp(-a * dt), np.empty(u.size)
    for k in range(u.size):
        states[k] = x
        x = x * fade + b * u[k] / a * (1.0 - fade)
    return states


def cart(m=2.04, c=1.0):
    v, force = hc.Signal("v", "m/s"), hc.Signal("F", "N")
    mass, drag = hc.Signal("m", "kg", start=m), hc.Signal("c", "kg/s", start=c)
    slope = (force.symbol - drag.symbol * v.symbol) / mass.symbol
    return hc.Block("cart", [v], [force], [v], [mass, drag], {"v": slope})


def cart_log(seed=1, n=1500):
    force = held(seed, n, 50, 0.3, 2.5)
    v = first_order(force, 0.5, 0.5, 0.5, 0.02) + 0.004 * np.random.default_rng(99 + seed).normal(size=n)
    return hc.Log(f"log{seed}", 0.02 * np.arange(n), {"v": v, "F": force})


def test_a_mass_in_a_denominator_is_fitted():
    found = hc.identify(cart(), [cart_log()])
    for name, value in {"m": 2.0, "c": 1.0}.items():
        assert abs(found[name].value - value) < 3 * found[name].std < 0.005 * value
    assert not found.bent and not found.misfit
    far = hc.identify(cart(m=0.7, c=2.0), [cart_log()])
    assert far["m"].value == pytest.approx(found["m"].value, rel=1e-4)


def test_a_mass_of_the_wrong_size_is_no_missing_effect():
    assert hc.diagnose(cart(), [cart_log(1)], cart_log(2)).verdict == "none"


def test_what_the_user_knows_is_kept_and_said():
    found = hc.identify(cart(), [cart_log()], fixed=["m"])
    assert [f.name for f in found.coefficients] == ["c"] and found["m"].value == 2.04
    assert found["m"].kept == "by you" and "2.04" in found.table() and "by you" in found.table()
    with pytest.raises(InputError, match="no coefficient 'mm'; did you mean 'm'"):
        hc.identify(cart(), [cart_log()], fixed=["mm"])
    with pytest.raises(InputError, match="'m' is to be fitted and fixed"):
        hc.identify(cart(), [cart_log()], ["m"], fixed=["m"])
    with pytest.raises(InputError, match="no coefficients to identify that are not fixed"):
        hc.identify(cart(), [cart_log()], fixed=["m", "c"])


def late_log(seed, rows=1000, first=0):
    """Commands held for 20 samples of 20 ms reach a cart 0.12 s late: six samples."""
    sent = held(seed, rows + first, 20, 0.3, 2.5)
    v = first_order(np.r_[np.zeros(6), sent[:-6]], 0.5, 0.5, 0.0, 0.02)
    v += 0.004 * np.random.default_rng(9 + seed).normal(size=v.size)
    return hc.Log(f"log{seed}", 0.02 * np.arange(rows), {"v": v[first:], "F": sent[first:]})


def test_the_delay_of_a_block_is_a_parameter():
    tau = hc.Signal("tau", "s", start=0.2, lower=0.0)
    plain = cart()
    late = hc.Block(
        "cart", plain.states, plain.inputs, plain.outputs, (*plain.parameters, tau), plain.derivatives,
        delays={"F": tau.symbol},
    )  # fmt: skip
    found = hc.identify(late, [late_log(1)])
    for name, value in {"m": 2.0, "c": 1.0, "tau": 0.12}.items():
        assert abs(found[name].value - value) < 3 * found[name].std < 0.02 * value
    assert found.block.delays == late.delays
    assert hc.diagnose(late, [late_log(1)], late_log(2)).verdict == "none"
    other = hc.Signal("other", "s", start=0.1)
    uneven = hc.Block(
        "cart", plain.states, plain.inputs, plain.outputs, (*late.parameters, other), plain.derivatives,
        delays={"F": tau.symbol + other.symbol},
    )  # fmt: skip
    with pytest.raises(InputError, match="not all late by one parameter"):
        hc.identify(uneven, [late_log(1)])


def test_a_log_that_begins_in_motion_has_commands_from_before():
    """The first six samples after a cut follow commands that the log does not have."""
    found = hc.diagnose(cart(), [late_log(1, first=63)], late_log(2, first=63))
    assert [e.effect for e in found.effects] == ["input_delay"]
    assert abs(found.effects[0].value - 0.12) < 3 * found.effects[0].std


def test_a_start_at_which_the_equations_are_not_defined_is_refused():
    with pytest.raises(InputError, match="m = 0, where the equations are not defined"):
        hc.identify(cart(m=0.0), [cart_log()])


def heater(gain=2.1, scale=0.5):
    """A heated body behind a thermometer whose scale is not known: only gain times scale shows."""
    x, power = hc.Signal("x", "K"), hc.Signal("u", "W")
    a, k = hc.Signal("a", "1/s", start=1.05), hc.Signal("gain", "K/J", start=gain)
    s, idle = hc.Signal("scale", "V/K", start=scale), hc.Signal("idle", "K", start=3.0)
    return hc.Block(
        "heater", [x], [power], [hc.Signal("y", "V")], [a, k, s, idle],
        {"x": k.symbol * power.symbol - a.symbol * x.symbol}, {"y": s.symbol * x.symbol},
    )  # fmt: skip


def test_what_only_a_product_shows_is_a_group_with_the_error_of_an_output_error_fit():
    n, dt, std = 1500, 0.02, 0.003
    power = held(3, n, 50, -1.0, 1.0)
    y = first_order(power, 1.0, 1.0, 0.0, dt) + std * np.random.default_rng(4).normal(size=n)
    log = hc.Log("log", dt * np.arange(n), {"y": y, "u": power})
    found = hc.identify(heater(), [log])
    (group,) = found.groups
    assert group.name == "gain*scale" and found["gain*scale"] is group
    assert np.isinf(found["gain"].std) and "only gain*scale" in found["scale"].reason
    assert found["idle"].value == 3.0 and "nothing measured depends on it" in found["idle"].reason
    assert found["gain"].value == pytest.approx(2.1, rel=0.1)  # about as given
    fit = least_squares(lambda p: (first_order(power, *p, dt) - y) / std, [1.0, 1.0, 0.0])
    own = np.sqrt(np.diag(np.linalg.inv(fit.jac.T @ fit.jac)))
    assert abs(group.value - fit.x[1]) < own[1] and own[1] < group.std < 2.0 * own[1]


def test_check_says_what_a_fit_could_estimate_together():
    log = cart_log()
    v, force = hc.Signal("v", "m/s"), hc.Signal("F", "N")
    k, m, c = (
        hc.Signal("k", "1", start=1.0),
        hc.Signal("m", "kg", start=2.0),
        hc.Signal("c", "1/s", start=0.5),
    )
    slope = k.symbol * force.symbol / m.symbol - c.symbol * v.symbol
    block = hc.Block("cart", [v], [force], [v], [k, m, c], {"v": slope})
    said = hc.check(block, [log])
    assert [g.name for g in said.groups] == ["k/m"] and "k/m" in said.text() and not said.errors
    assert not hc.check(block, [log], fixed=["k"]).groups


def test_equations_that_are_not_defined_along_the_logs_are_said_in_one_line():
    """A tank that runs empty: its measured level is below zero, and so is the argument of the root."""
    h, q = hc.Signal("h", "m"), hc.Signal("q", "m/s")
    a = hc.Signal("a", "m^(1/2)/s", start=0.1)
    tank = hc.Block("tank", [h], [q], [h], [a], {"h": q.symbol - a.symbol * h.symbol**0.5})
    noise = 0.01 * np.random.default_rng(0).normal(size=400)
    log = hc.Log("log", 0.1 * np.arange(400), {"h": noise, "q": held(5, 400, 40, 0.0, 1e-3)})
    for call in (hc.identify, hc.diagnose):
        with pytest.raises(InputError, match=r"'tank'.* not defined along the logs"):
            call(tank, [log])


def test_a_constant_of_an_effect_is_not_fitted():
    craft = hc.vehicle("c17_simulation")
    limited = craft.with_effects([craft.effect_class("thrust_rate_limit").small()])
    with pytest.raises(InputError, match="'thrust_rate_limit_tau' is a constant of its effect"):
        hc.identify(limited, [], ["thrust_rate_limit_tau"])
