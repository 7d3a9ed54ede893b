"""Linear systems and dry friction: its slope as smoothed, left out, or by its describing function."""

import warnings

import control as ct
import numpy as np
import pytest
from scipy.integrate import quad

import hovercontrol as hc
from hovercontrol.blocks.delays import pade

C17 = hc.vehicle("c17_simulation").coefficients()
C5, C6 = C17["yaw_coulomb"], C17["yaw_linear_drag"]
AHEAD = [0, 0, 0, 1.0, 0, 0]


@pytest.fixture(scope="module")
def craft():
    return hc.vehicle("c17_simulation").plant()


@pytest.fixture(scope="module")
def ahead(craft):
    return craft.trim(states={"u": 1.0})


def first_harmonic(v, A):
    """Gain and mean of sgn(v + A sin) by quadrature."""
    jumps = sorted(np.arcsin(-v / A) % (2 * np.pi) if abs(v) < A else 0 for _ in (0,))
    jumps = [*jumps, (np.pi - jumps[0]) % (2 * np.pi)]
    gain = quad(lambda p: np.sign(v + A * np.sin(p)) * np.sin(p), 0, 2 * np.pi, points=jumps)[0]
    mean = quad(lambda p: np.sign(v + A * np.sin(p)), 0, 2 * np.pi, points=jumps)[0]
    return gain / (np.pi * A), mean / (2 * np.pi)


def test_the_smoothed_slope_warns_and_names_pole_state_width_and_what_to_use(craft, ahead):
    with pytest.warns(hc.SmoothedFrictionWarning) as caught:
        line = craft.linearize(ahead)
    assert line.A[5, 5] == pytest.approx(-C5 / 0.01 - C6)
    assert str(caught[0].message).startswith(
        "block 'plant': the pole at -83.5 rad/s comes from the smoothed dry friction in r, of width "
        "0.01 rad/s; without its slope the pole is at -0.48 rad/s. Linearise with friction='none'"
    )
    assert caught[0].filename == __file__


def test_control_linearize_warns_at_the_line_that_calls_it(craft, ahead):
    with pytest.warns(hc.SmoothedFrictionWarning) as caught:
        ct.linearize(craft.to_control(), ahead.operating_point)
    assert caught[0].filename == __file__


@pytest.mark.parametrize(
    "point",
    [{"u": 1.0, "r": 0.5, "v": -0.5}, {"u": 0.3, "r": -0.1}],
    ids=str,
)
def test_away_from_rest_nothing_warns(craft, point):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        smooth = craft.linearize(point)
        none = craft.linearize(point, friction="none")
    np.testing.assert_allclose(smooth.A, none.A, atol=1e-5)


def test_a_craft_without_dry_friction_never_warns():
    free = hc.vehicle("hoverdemon").plant()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        every = [free.linearize([0.0] * 6, friction=f).A for f in ("smooth", "none", "describing")]
    np.testing.assert_array_equal(every[0], every[1])
    np.testing.assert_array_equal(every[0], every[2])


def test_without_its_slope_the_craft_has_the_poles_of_its_linear_drag(craft, ahead):
    # u' = .. + r v,  v' = c7 T theta - c4 v - u r,  r' = -c8 T theta - c6 r about T0 = c1/c7, u = 1
    T0 = C17["surge_coulomb"] / C17["thrust"]
    line = craft.linearize(ahead, friction="none")
    A = np.array([[0, 0, 0], [0, -C17["sway_linear_drag"], -1.0], [0, 0, -C6]])
    B = np.array([[C17["thrust"], 0], [0, C17["thrust"] * T0], [0, -C17["rudder_torque"] * T0]])
    np.testing.assert_allclose(line.A[3:, 3:], A, atol=1e-9)
    np.testing.assert_allclose(line.B[3:], B, atol=1e-9)
    assert line.state_labels == ["x", "y", "psi", "u", "v", "r"]
    assert line.input_labels == ["thrust", "rudder"]


@pytest.mark.parametrize(("r", "A"), [(0.0, 0.2), (0.05, 0.2), (-0.1, 0.3), (0.5, 0.2)])
def test_the_describing_function_is_the_first_harmonic(craft, r, A):
    line = craft.linearize({"u": 1.0, "r": r}, friction="describing", amplitude={"r": A})
    gain = first_harmonic(r, A)[0] if abs(r) < A else 0.0
    assert -(line.A[5, 5] + C6) / C5 == pytest.approx(gain, abs=1e-6)
    if r == 0.0:
        assert gain == pytest.approx(4 / (np.pi * A))


def test_what_multiplies_friction_has_its_mean():
    # v' = -c sgn(v): by the input c the derivative is minus the mean of sgn
    v, c, w = hc.Signal("v", "m/s"), hc.Signal("c", "m/s^2", start=2.0), hc.Signal("w", "m/s", start=0.01)
    slide = hc.Block("slide", [v], [c], [v], [w], {"v": -c.symbol * hc.sgn(v.symbol, w.symbol)})
    line = slide.linearize([0.1], [2.0], friction="describing", amplitude={"v": 0.4})
    gain, mean = first_harmonic(0.1, 0.4)
    assert line.A.item() == pytest.approx(-2.0 * gain, abs=1e-6)
    assert line.B.item() == pytest.approx(-mean, abs=1e-6)
    assert slide.linearize([0.1], [2.0], friction="none").B.item() == pytest.approx(-1.0)


def test_a_controller_that_cancels_friction_is_treated_like_the_craft(craft):
    # C17 (25) cancels c5 sgn r: where both keep their sign the loop has the poles that its gains give
    model = hc.vehicle("c17_simulation")
    loop = hc.interconnect([model.plant(), hc.tracking_controller(model), hc.line([1.0, 0.0])])
    straight = loop.trim(rates={"plant.x": 1.0})
    assert straight.states["plant.x"] == pytest.approx(-0.2)  # the control point is on the reference
    with pytest.warns(hc.SmoothedFrictionWarning, match=r"plant\.r"):
        loop.linearize(straight)
    poles = np.sort_complex(loop.linearize(straight, friction="none").poles())
    gains = np.sort_complex([-1 - 1j, -1 - 1j, -1 + 1j, -1 + 1j])  # s^2 + 2 s + 2, twice
    for pole in gains:
        assert np.min(np.abs(poles - pole)) < 1e-4


def test_a_regulator_made_without_the_slope_moves_the_poles_it_says(craft, ahead):
    # the complaint: LQR on the smoothed craft believes in a yaw damping that is not there under way
    heading = craft.linearize(ahead, friction="none")
    keep = [k for k, name in enumerate(heading.state_labels) if name in ("psi", "v", "r")]
    A, B = heading.A[np.ix_(keep, keep)], heading.B[keep][:, 1:]
    K, _, poles = ct.lqr(A, B, np.eye(3), np.eye(1))
    turning = craft.linearize({"u": 1.0, "r": 0.1, "thrust": 1.8})  # at constant sign of r, as written
    At, Bt = turning.A[np.ix_(keep, keep)], turning.B[keep][:, 1:]
    np.testing.assert_allclose(np.sort(np.linalg.eigvals(At - Bt @ K)), np.sort(poles), atol=1e-4)


# ---- ways to give the point ------------------------------------------------------------------------------


def test_every_way_to_give_a_point_gives_the_same_system(craft, ahead):
    ways = [
        craft.linearize(ahead, friction="none"),
        ahead.linearize(friction="none"),
        craft.linearize(ahead.operating_point, friction="none"),
        craft.linearize(ahead.x, ahead.u, friction="none"),
        craft.linearize({**ahead.states, **ahead.inputs}, friction="none"),
        craft.linearize({"u": 1.0}, {"thrust": ahead.inputs["thrust"]}, friction="none"),
    ]
    for other in ways[1:]:
        for name in "ABCD":
            np.testing.assert_array_equal(getattr(other, name), getattr(ways[0], name))


def test_a_trim_brings_its_parameters_and_its_time():
    x, k = hc.Signal("x", "1"), hc.Signal("k", "1/s", start=1.0)
    unit = hc.Signal("unit", "1/s", start=1.0)
    aged = hc.Block("aged", [x], [], [x], [k, unit], {"x": -k.symbol * x.symbol * hc.time * unit.symbol})
    point = aged.trim(params={"aged.k": 3.0}, time=2.0)
    assert aged.linearize(point).A.item() == pytest.approx(-6.0)
    assert aged.linearize(point, t=1.0, params={"aged.k": 5.0}).A.item() == pytest.approx(-5.0)


def test_a_late_input_is_linearised_as_a_fraction(craft):
    late = hc.vehicle("c17_simulation").with_effects([hc.effect("input_delay", seconds=0.1)]).plant()
    with pytest.raises(hc.InputError, match="pade"):
        late.linearize([0.0] * 6, friction="none")
    approximated = pade(late, 2)
    line = approximated.linearize(approximated.trim({"u": 1.0}), friction="none")
    assert line.nstates == 10


@pytest.mark.parametrize(
    ("asked", "line"),
    [
        ({"friction": "describing"}, r"needs an amplitude of the oscillation: amplitude=\{"),
        ({"friction": "describing", "amplitude": {"rr": 0.1}}, "no dry friction in 'rr'"),
        ({"friction": "describing", "amplitude": {"r": 0.0}}, "amplitude of r must be positive"),
        ({"amplitude": {"r": 0.1}}, "an amplitude is for friction='describing'"),
        ({"friction": "sharp"}, "Block.linearize: friction"),
        ({"u": {"thrst": 1.0}}, "no input 'thrst'; did you mean 'thrust'"),
    ],
)
def test_wrong_arguments_are_one_line(craft, asked, line):
    with pytest.raises(hc.InputError, match=line):
        craft.linearize(AHEAD, **asked)


def test_a_trim_of_another_block_is_refused(craft):
    other = hc.vehicle("four_fan").plant().trim()
    with pytest.raises(hc.InputError, match="has other inputs"):
        craft.linearize(other)
    with pytest.raises(hc.InputError, match="no state or input 'w'"):
        craft.linearize({"w": 1.0})
