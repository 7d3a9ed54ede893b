"""Accelerometers and gyro: what they feel, their errors, the gyro's lag; against K06 and by hand."""

import math

import control
import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.craft.hardware.sensors import (
    gyro_compensation,
    gyro_dynamics,
    imu,
    k06_imu,
    with_specific_force,
)
from hovercontrol.craft.models.vehicles import VEHICLES, hoverdemon
from tests.blocks.simulation.loops import run_loop

AT_REST = {"specific_force_x": 0.0, "specific_force_y": 0.0, "r": 0.0}
CHANNELS = ("acceleration_x", "acceleration_y", "yaw_rate")


def readings(block, count, params=None, **truth):
    ticking = block if isinstance(block, Ticking) else Ticking(block)
    ticking.set_parameters(params or {})
    block = ticking.block
    ticking.state = tuple(s.start for s in block.states)
    told = [ticking.tick(k * block.period, AT_REST | truth) for k in range(count)]
    return {name: np.array([row[name] for row in told]) for name in told[0]}


# ---- specific force ---------------------------------------------------------------------------------


@pytest.mark.parametrize("craft", sorted(VEHICLES))
def test_specific_force_is_that_of_the_plants_own_derivatives(craft, rng):
    plain = VEHICLES[craft]().plant()
    plant = with_specific_force(plain)
    x, u = rng.normal(size=(6, 40)), np.abs(rng.normal(size=(len(plain.inputs), 40)))
    slope = plain.to_numpy().derivatives(0.0, x, u)
    du, dv, dr = slope[3:6]
    told = plant.to_numpy().outputs(0.0, x, u)
    np.testing.assert_allclose(told[: len(plain.outputs)], plain.to_numpy().outputs(0.0, x, u))
    np.testing.assert_allclose(told[-3:], [du - x[4] * x[5], dv + x[3] * x[5], dr], atol=1e-12)
    np.testing.assert_array_equal(plant.to_numpy().derivatives(0.0, x, u), slope)


def second_derivative_of_a_path():
    t, lx, ly = sp.symbols("t lx ly")
    psi, x, y = (sp.Function(n)(t) for n in ("psi", "x", "y"))
    place = sp.Matrix([x, y]) + sp.rot_ccw_axis3(psi)[:2, :2] * sp.Matrix([lx, ly])
    given = [psi, psi.diff(t), psi.diff(t, 2), x.diff(t, 2), y.diff(t, 2)]
    names = sp.symbols("p dp ddp ddx ddy")
    swap = dict(zip(reversed(given), reversed(names), strict=True))
    return sp.lambdify([*names, lx, ly], place.diff(t, 2).subs(swap))


PATH = second_derivative_of_a_path()


@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(-5, 5), st.floats(-3, 3))
def test_on_a_lever_arm_it_is_the_second_derivative_of_that_points_path(lx, ly, r, push):
    """The path of the point is differentiated twice in the earth's axes, from derivatives of the plant."""
    plant = with_specific_force(hoverdemon().plant(), lever_arm=(lx, ly))
    state, command = np.array([0.3, -0.2, 0.7, 0.4, -0.3, r]), np.array([push, 0.4])
    told = plant.to_numpy().outputs(0.0, state, command)[6:8]
    slopes = plant.to_numpy().derivatives(0.0, state, command)
    c, s = math.cos(0.7), math.sin(0.7)
    turn = np.array([[c, -s], [s, c]])
    centre = turn @ (slopes[3:5] + r * np.array([0.3, 0.4]))  # a = R (v' + r x v)
    acceleration = PATH(0.7, r, slopes[5], *centre, lx, ly).ravel()
    np.testing.assert_allclose(told, turn.T @ acceleration, atol=1e-9)


def test_a_plant_without_velocities_has_no_specific_force():
    with pytest.raises(InputError, match="needs the states u, v and r"):
        with_specific_force(gyro_dynamics().unchecked(period=0.0))
    with pytest.raises(InputError, match="sampled"):
        with_specific_force(gyro_dynamics())
    with pytest.raises(InputError, match="expected two numbers"):
        with_specific_force(hoverdemon().plant(), lever_arm=(1.0,))


# ---- errors -----------------------------------------------------------------------------------------


PERFECT = Ticking(imu())


@given(*(st.floats(-3, 3) for _ in range(3)))
def test_with_every_error_off_it_tells_the_truth(ax, ay, r):
    told = readings(PERFECT, 3, specific_force_x=ax, specific_force_y=ay, r=r)
    for name, true in zip(CHANNELS, (ax, ay, r), strict=True):
        np.testing.assert_array_equal(told[name], true)


def test_bias_and_full_scale():
    told = readings(imu(acceleration_bias=(0.1, -0.2), yaw_rate_bias=0.3), 2)
    assert [told[name][1] for name in CHANNELS] == [0.1, -0.2, 0.3]
    for r in (6.0, -6.0):  # rad/s
        assert readings(k06_imu(), 1, r=r)["yaw_rate"][0] == pytest.approx(
            math.copysign(math.radians(300), r)
        )
    assert readings(k06_imu(), 1, specific_force_x=20.0)["acceleration_x"][0] == pytest.approx(1.7 * 9.80665)


def test_noise_is_white_and_of_the_size_asked_for():
    n = 4000
    told = readings(imu(acceleration_noise=0.1, yaw_rate_noise=0.02), n)
    for name, sigma in zip(CHANNELS, (0.1, 0.1, 0.02), strict=True):
        z = told[name] / sigma
        assert abs(z.mean()) < 5 / math.sqrt(n)
        assert z.std() == pytest.approx(1, abs=5 / math.sqrt(2 * n))
        assert abs(np.mean(z[1:] * z[:-1])) < 5 / math.sqrt(n)
    between = np.corrcoef([told[name] for name in CHANNELS])
    assert np.abs(between[np.triu_indices(3, 1)]).max() < 5 / math.sqrt(n)


def test_allan_deviation_falls_for_white_noise_and_rises_for_a_random_walk():
    n, dt, white, walk = 16384, 0.01, 0.1, 0.3
    noisy = readings(imu(period=dt, yaw_rate_noise=white, acceleration_walk=walk), n)

    def allan(values, m):
        means = values[: n // m * m].reshape(-1, m).mean(axis=1)
        return math.sqrt(np.mean(np.diff(means) ** 2) / 2)

    for m in (4, 16, 64):
        few = 5 / math.sqrt(n / m)  # relative, a generous five sigma of the estimate
        assert allan(noisy["yaw_rate"], m) == pytest.approx(white / math.sqrt(m), rel=few)
        # A random walk K has the Allan deviation K sqrt(tau / 3), sampled 1 + 1/(2 m^2) of it in square.
        true = walk * math.sqrt(m * dt / 3 * (1 + 1 / (2 * m**2)))
        assert allan(noisy["acceleration_x"], m) == pytest.approx(true, rel=few)


def test_noise_and_walk_are_independent():
    n, sigma = 4000, 0.1
    told = readings(imu(period=0.01, acceleration_noise=sigma, acceleration_walk=sigma / 0.1), n)
    for name in CHANNELS[:2]:
        steps = np.diff(told[name])  # two readings' noise and one step of the walk, of one size
        assert steps.std() == pytest.approx(math.sqrt(3) * sigma, rel=7 / math.sqrt(2 * n))


def test_biases_drawn_at_the_start_stay_and_have_k06s_spread():
    assert np.ptp(readings(imu(acceleration_bias_spread=0.025), 20)["acceleration_x"]) == 0.0
    sensor = Ticking(k06_imu())
    first = [readings(sensor, 1, {"imu.seed": float(s), "imu.yaw_rate_noise": 0.0}) for s in range(1, 201)]
    for name, spread in zip(CHANNELS, (0.025, 0.025, math.radians(1)), strict=True):
        drawn = np.array([row[name][0] for row in first]) / spread
        assert abs(drawn.mean()) < 5 / math.sqrt(200)
        assert drawn.std() == pytest.approx(1, abs=5 / math.sqrt(400))


def test_a_seed_repeats_a_run_and_another_does_not():
    one, again, other = (readings(k06_imu(), 5, {"imu.seed": s})["yaw_rate"] for s in (3.0, 3.0, 4.0))
    np.testing.assert_array_equal(one, again)
    assert not np.any(one == other)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"period": 0.0}, "period must be positive"),
        ({"period": -0.1}, "period must be positive"),
        ({"yaw_rate_noise": -1.0}, "yaw_rate_noise must not be negative"),
        ({"acceleration_walk": math.nan}, "acceleration_walk must be a number"),
        ({"acceleration_bias": (1.0,)}, "expected two numbers"),
        ({"yaw_rate_bias": math.inf}, "must be a finite number"),
    ],
)
def test_wrong_numbers_of_the_imu_are_refused(wrong, said):
    with pytest.raises(InputError, match=said):
        imu(**wrong)


# ---- the gyro's lag ---------------------------------------------------------------------------------

TABLE_6_5 = {5: -8.59, 10: -8.59, 15: -8.28, 20: -7.48, 30: -5.46, 40: -3.62, 50: -2.26}  # Hz, ms


@pytest.mark.parametrize("frequency", TABLE_6_5)
def test_gyro_lags_as_in_table_6_5_and_its_compensation_undoes_it(frequency):
    gyro, undo = (b.to_control().linearize([0, 0], [0]) for b in (gyro_dynamics(), gyro_compensation()))
    w = 2 * math.pi * frequency
    z = np.exp(1j * w * 0.0065536)
    phase = np.angle(gyro(z))
    # K06 prints phases to 0.01 rad, of which it takes dt: so does this.
    assert 1e3 * round(phase, 2) / w == pytest.approx(TABLE_6_5[frequency], abs=0.006)
    assert 1e3 * phase / w == pytest.approx(TABLE_6_5[frequency], abs=0.05)
    assert gyro(z) * undo(z) == pytest.approx(1.0, abs=1e-12)


def test_gyro_is_the_transfer_function_6_2():
    system = control.ss2tf(gyro_dynamics().to_control().linearize([0, 0], [0]))
    theirs = control.tf([0.3236, 0, 0], [1, -0.9805, 0.2898], 0.0065536)
    for w in (1.0, 30.0, 200.0):
        z = np.exp(1j * w * 0.0065536)
        assert system(z) == pytest.approx(theirs(z), rel=1e-9)


@given(st.lists(st.floats(-5, 5), min_size=1, max_size=20))
def test_compensation_gives_back_any_rate(rates):
    gyro, undo = Ticking(gyro_dynamics()), Ticking(gyro_compensation())
    for r in rates:
        seen = gyro.tick(0.0, {"r": r})["gyro_rate"]
        assert undo.tick(0.0, {"yaw_rate": seen})["yaw_rate_compensated"] == pytest.approx(r, abs=1e-9)


def test_switched_off_both_pass_what_they_get():
    for block, name in ((gyro_dynamics(), "r"), (gyro_compensation(), "yaw_rate")):
        off = Ticking(block, {f"{block.name}.dynamics": 0.0})
        assert [next(iter(off.tick(0.0, {name: v}).values())) for v in (1.0, -2.0, 3.0)] == [1.0, -2.0, 3.0]


def test_compensation_amplifies_noise_above_the_band():
    """The price that K06 names below table 6.5."""
    n = 2000
    noisy = readings(imu(yaw_rate_noise=0.01), n)["yaw_rate"]
    undo = Ticking(gyro_compensation())
    out = np.array([undo.tick(0.0, {"yaw_rate": y})["yaw_rate_compensated"] for y in noisy])
    gain = math.sqrt(1 + 0.9805**2 + 0.2898**2) / 0.3236  # of white noise through (6.2)'s inverse
    assert out.std() / noisy.std() == pytest.approx(gain, rel=5 / math.sqrt(n))


def test_plant_gyro_and_imu_run_together():
    plant = with_specific_force(hoverdemon().plant())
    push = [p.replace(name=f"{p.name}_set", start=v) for p, v in zip(plant.inputs, (0.26, 0.1), strict=True)]
    pilot = Block(
        "pilot",
        outputs=plant.inputs,
        parameters=push,
        output_expressions={p.name: s.symbol for p, s in zip(plant.inputs, push, strict=True)},
        period=0.0065536,
    )
    run = run_loop(plant, [pilot, gyro_dynamics(), imu(rate="gyro_rate")], 2.0)
    told = dict(zip(run.output_labels, run.outputs, strict=True))
    # No drag: the force alone is felt, turned by the rudder.
    assert told["acceleration_x"] == pytest.approx(0.26 * math.cos(0.1) / 2.6, abs=1e-9)
    assert np.abs(told["acceleration_y"]) == pytest.approx(0.26 * math.sin(0.1) / 2.6, abs=1e-9)
    # After a ramp of angular acceleration a the lag is constant; the gain at rest is that of (6.2) at z = 1.
    gain = 0.3236 / (1 - 0.9805 + 0.2898)
    slope = np.diff(told["yaw_rate"])[-1] / np.diff(told["r"])[-1]
    assert slope == pytest.approx(gain, rel=1e-6)
