"""The turn law's two limit points: W_bad and the entry ball (2.48) keep what K06 says of them."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hovercontrol import InputError
from hovercontrol.control.controllers.k06.energy import kinetic_energy
from hovercontrol.documents.k06.law_loop import TURNING, turn_loop
from hovercontrol.documents.k06.turn_basins import (
    ATOL,
    CLOSE,
    RTOL,
    TOLD,
    levels,
    slow_rate,
    turn_basins,
)

M, J, D = 2.6, 0.096, 0.32
K1, K2, REF = 0.5, 3.5, 3.0
PLANES = [
    ({"v": (-2.5, 2.5), "r": (-8.0, 8.0)}, {}),
    ({"u": (-2.5, 2.5), "r": (-8.0, 8.0)}, {"v": -D * REF}),
    ({"u": (-2.5, 2.5), "v": (-2.5, 2.5)}, {"r": 0.0}),
]


def by_hand(_, p):
    """K06 (2.10) and (2.39) in momenta, as printed."""
    px, py, pi = p
    fx, fy = -K1 * px / M, -K2 * (py / M - D * (pi - J * REF) / J)
    return [py * pi / J + fx, -px * pi / J + fy, -D * fy]


def in_loop(velocities):
    return dict(zip(("craft.u", "craft.v", "craft.r"), velocities, strict=True))


@pytest.fixture(scope="module", params=PLANES, ids=lambda p: "".join(p[0]))
def region(request):
    plane, at = request.param
    return turn_basins(plane, 24, at=at)


@pytest.mark.slow
def test_every_start_ends_at_one_of_the_two_limit_points(region):
    classes = np.array([region[name] for name in ("turns", "stuck", "unwanted")])
    assert (classes.sum(axis=0) == 1).all()
    assert 0.05 < region["unwanted"].mean() < 0.6  # a basin of positive measure, one zero eigenvalue or not
    assert (np.isfinite(region["time"]) == region["turns"]).all()
    late = region["leaves"][region["stuck"]]
    assert (np.isfinite(late)).any() and np.nanmin(late) > 300.0


def test_neither_w_below_w_bad_nor_the_entry_ball_has_a_counter_example(region):
    assert region["level"].any()
    assert not (region["level"] & region["unwanted"]).any()
    assert region.outside("entry", "level") == []
    assert region.share("level", "turns") < 0.6  # sufficient, not necessary


def test_the_yaw_rate_on_the_slow_manifold_has_the_sign_that_tighter_tolerances_find(rng):
    start = {f"craft.{k}": rng.uniform(-s, s, 300) for k, s in (("u", 2.5), ("v", 2.5), ("r", 8.0))}
    loop = turn_loop(k1=K1, k2=K2, yaw_rate=REF).compile()
    found, tight = (
        loop.sweep([0.0, 150.0], x0=start, rtol=rtol, atol=atol)
        for rtol, atol in ((RTOL, ATOL), (RTOL / 100, ATOL / 100))
    )
    r, other = (run.states_final[:, run.states.index("craft.r")] for run in (found, tight))
    near = (tight["away"].final < CLOSE) & (np.abs(other) > TOLD)
    assert near.mean() > 0.3
    assert (np.sign(r[near]) == np.sign(other[near])).all()
    assert np.percentile(np.abs(r - other)[near], 95) < TOLD


@pytest.mark.parametrize("r0", [3e-3, 1e-3, -1e-2])
def test_on_the_slow_manifold_the_yaw_rate_grows_with_its_square(r0):
    """By hand: r = r0/(1 - kappa r0 t), so that half the time to leave doubles it."""
    kappa = slow_rate(k1=K1, yaw_rate=REF)
    v = D * (r0 - REF)
    span = 0.5 / (kappa * abs(r0))
    start = [M * M * v * r0 / K1, M * v, J * r0]
    run = solve_ivp(by_hand, (0.0, span), start, rtol=1e-10, atol=1e-14)
    assert run.y[2, -1] / J == pytest.approx(r0 / (1 - kappa * r0 * span), rel=0.15)


def test_the_time_until_it_turns_is_that_of_a_run_by_hand():
    region = turn_basins({"v": (-0.5, 0.5), "r": (-1.0, 2.0)}, 2)
    for row, column in ((0, 0), (1, 1)):
        v, r = region.x.values[column], region.y.values[row]
        run = solve_ivp(by_hand, (0.0, 60.0), [0.0, M * v, J * r], rtol=1e-9, atol=1e-12, dense_output=True)
        times = np.linspace(0.0, 60.0, 60_001)
        px, py, pi = run.sol(times)
        level = ((px**2 + py**2) / M + (pi - J * REF) ** 2 / J) / 2 / levels(REF)[0]
        assert region["time"][row, column] == pytest.approx(times[np.argmax(level < TURNING)], abs=0.01)
        assert abs(pi[level < TURNING][0] / J - REF) < 0.1 * REF


def test_k06s_unwanted_limit_point_is_no_minimiser_of_w():
    """Erratum of section 2.2.6: the gradient there is (0, -2.50, -0.288)."""
    at, h = np.array([0.0, -D * REF, 0.0]), 1e-6

    def W(p):
        return kinetic_energy(M, J, p[0], p[1], p[2] - REF)

    gradient = [(W(at + h * e) - W(at - h * e)) / (2 * h) for e in np.eye(3)]
    assert gradient == pytest.approx([0.0, -2.496, -0.288], abs=1e-4)


def test_starts_all_over_the_space_below_w_bad_reach_the_wanted_turn(rng):
    bad, _ = levels(REF)
    direction = rng.normal(size=(3000, 3))
    direction *= (rng.uniform(size=3000) ** (1 / 3) / np.linalg.norm(direction, axis=1))[:, None]
    start = direction * np.sqrt(2 * 0.999 * bad / np.array([M, M, J])) + [0.0, 0.0, REF]
    runs = turn_loop(k1=K1, k2=K2, yaw_rate=REF).compile().sweep([0.0, 300.0], x0=in_loop(start.T))
    assert np.abs(runs.states_final[:, :3] - [0.0, 0.0, REF]).max() < 1e-3


def test_the_levels_are_k06s_in_momenta():
    bad, entry = levels(REF)
    pi = J * REF
    assert bad == pytest.approx((D * M * pi) ** 2 / (2 * M * J**2) + pi**2 / (2 * J))
    assert entry == pytest.approx((D**2 * M) ** 2 * pi**2 / (8 * J**2 * (J + D**2 * M)))


def test_the_entry_ball_is_inside_the_level_and_smaller_than_it_need_be():
    def worst(energy):
        """Return the largest W of (2.36) in the ball."""
        rates = np.linspace(-1.0, 1.0, 20_001) * np.sqrt(2 * energy / J)
        return (energy + 0.5 * J * (REF**2 - 2 * rates * REF)).max()

    bad, entry = levels(REF)
    assert worst(entry) < 0.8 * bad
    root = np.sqrt(J**3) + np.sqrt(J**3 + D**2 * M * J**2)  # (2.47) itself, which (2.48) rounds up
    sharp = (D**2 * M * J * REF / root) ** 2 / 2
    assert worst(sharp) == pytest.approx(bad)
    assert sharp / entry == pytest.approx(1.743, abs=1e-3)


def test_a_run_is_the_thesis_equations_in_momenta():
    start = np.array([0.4, -1.2, -2.0])
    loop = turn_loop(k1=K1, k2=K2, yaw_rate=REF).compile()
    found = loop.simulate([0.0, 5.0], x0=in_loop(start))
    scale = np.array([M, M, J])
    exact = solve_ivp(by_hand, (0.0, 5.0), start * scale, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(found.states[:3, -1], exact.y[:, -1] / scale, rtol=1e-5, atol=1e-6)


def test_w_never_grows():
    loop = turn_loop(k1=K1, k2=K2, yaw_rate=REF).compile()
    level = loop.simulate(np.linspace(0, 30, 3001), x0=in_loop([1.0, -2.0, -5.0]), rtol=1e-9).outputs[0]
    assert (np.diff(level) <= 1e-9).all()


def test_turning_the_other_way_mirrors_the_basins():
    plane = {"v": (-2.5, 2.5), "r": (-8.0, 8.0)}
    left, right = (turn_basins(plane, 12, yaw_rate=sign * REF) for sign in (1, -1))
    np.testing.assert_array_equal(left["unwanted"], right["unwanted"][::-1, ::-1])


def test_the_drawn_edges_are_those_of_the_maps():
    region = turn_basins(points=100, duration=1.0)
    for name, map_name in (("W = W_bad", "level"), ("entry ball (2.48)", "entry")):
        v, r = region.lines[name]
        area = 0.5 * abs(np.sum(v[:-1] * np.diff(r) - r[:-1] * np.diff(v)))
        cell = np.diff(region.x.values)[0] * np.diff(region.y.values)[0]
        assert region[map_name].sum() * cell == pytest.approx(area, rel=0.05)
    assert region.marks["unwanted limit point"] == pytest.approx((-0.96, 0.0))


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (lambda: turn_basins(yaw_rate=0.0), "expected a turn, found 0"),
        (lambda: turn_basins(k1=0.0), "k1 must be positive"),
        (lambda: turn_basins({"v": (1.0, -1.0), "r": (0.0, 1.0)}), "v: the range 1 to -1 m/s is reversed"),
        (lambda: turn_basins({"v": (0.0, 1.0), "w": (0.0, 1.0)}), "unknown velocity 'w'"),
        (lambda: turn_basins({"v": (0.0, 1.0)}), "expected two of u, v, r, found 1"),
        (lambda: turn_basins(at={"v": 1.0}), "at: expected u, the velocity outside the plane, found 'v'"),
        (lambda: turn_basins(points=100_000), "would take .* take fewer points"),
        (lambda: turn_basins(duration=0.0), "duration must be positive"),
    ],
)
def test_bad_input_is_refused(call, line):
    with pytest.raises(InputError, match=line):
        call()
