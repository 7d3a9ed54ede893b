"""The monitor of a linear cart against a Kalman filter and likelihood ratios written out in NumPy."""

import numpy as np
import pytest
import sympy as sp
from scipy import stats

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.control.observers.disturbance import disturbance_name
from hovercontrol.craft.models.interface import as_model
from hovercontrol.identification.monitor.bank import LIMIT
from hovercontrol.identification.monitor.candidates import candidates_of
from hovercontrol.identification.monitor.design import Design, estimation_model
from hovercontrol.identification.monitor.equations import monitor_block
from hovercontrol.identification.monitor.monitor import named_effects
from hovercontrol.identification.monitor.motion import Motion
from hovercontrol.identification.monitor.signatures import along_motion
from hovercontrol.identification.monitor.threshold import false_alarm_rate, signatures_of, threshold_for

PERIOD, DRAG = 0.1, 0.5
NOISE = {"p": 0.05}


def cart():
    """p' = v, v' = F/m - c v: a linear plant with a position sensor."""
    p, v = hc.Signal("p", "m"), hc.Signal("v", "m/s")
    F, m, c = hc.Signal("F", "N"), hc.Signal("m", "kg", start=2.0), hc.Signal("c", "1/s", start=DRAG)
    slopes = {"p": v.symbol, "v": F.symbol / m.symbol - c.symbol * v.symbol}
    return hc.Block("cart", [p, v], [F], [p, v], [m, c], slopes)


@pytest.fixture(scope="module")
def block():
    return hc.monitor(
        cart(), ["c", "p_bias"], false_alarms_per_hour=20.0, period=PERIOD, measured=["p"],
        process_noise={"v": 0.1}, measurement_noise=NOISE, lost_samples=True,
    )  # fmt: skip


def data(seed=3, n=150, change=0.0, onset=60):
    """Position samples and forces of a cart whose drag coefficient grows by `change` at a tick."""
    rng = np.random.default_rng(seed)
    F = 2.0 * np.sign(np.sin(0.3 * np.arange(n)))
    x, y = np.zeros(2), []
    for k in range(n):
        y.append(x[0] + NOISE["p"] * rng.normal())
        Phi, B, Q = discrete(DRAG + (change if k >= onset else 0.0))
        x = Phi @ x + B * F[k] + np.linalg.cholesky(Q) @ rng.normal(size=2)
    return np.array(y), F


def discrete(c):
    """Exact transition, input and noise matrices of a tick."""
    e = np.exp(-c * PERIOD)
    Phi = np.array([[1.0, (1 - e) / c], [0.0, e]])
    B = np.array([(PERIOD - (1 - e) / c) / c, (1 - e) / c]) / 2.0
    s = np.linspace(0, PERIOD, 2001)
    g = np.stack([(1 - np.exp(-c * s)) / c, np.exp(-c * s)])
    Q = 0.1**2 * np.trapezoid(g[:, None] * g[None], s, axis=2)
    return Phi, B, Q


def brute(y, F, onset):
    """b and J of the drag and of the bias from an onset on, by a Kalman filter written out.

    In b an innovation counts for at most 3 standard deviations.
    """
    Phi, B, Q = discrete(DRAG)
    drive = np.array([(PERIOD - (1 - np.exp(-DRAG * PERIOD)) / DRAG) / DRAG, Phi[0, 1]])
    x, P, d = np.zeros(2), np.eye(2), np.zeros((2, 2))  # columns of d: drag, bias
    b, J = np.zeros(2), np.zeros(2)
    for k in range(len(y)):
        S = P[0, 0] + NOISE["p"] ** 2
        K = P[:, 0] / S
        e = y[k] - x[0]
        x = x + K * e
        if k >= onset:
            eta = d[0] + np.array([0.0, 1.0])
            b += eta * np.clip(e, -3 * np.sqrt(S), 3 * np.sqrt(S)) / S
            J += eta**2 / S
            d = Phi @ (d - np.outer(K, eta))
            d[:, 0] += drive * -x[1]
        x = Phi @ x + B * F[k]
        P = Phi @ (P - np.outer(K, P[0])) @ Phi.T + Q
    return b, J


def run(block, y, F, params=None, **others):
    """Outputs at each tick, and the state after the last."""
    ticking = Ticking(block, params)
    every = []
    for k in range(len(y)):
        more = {key: value[k] for key, value in others.items()}
        every.append(ticking.tick(PERIOD * k, {"p": y[k], "F": F[k], "fresh": 1.0, "reset": 0.0, **more}))
    last = dict(zip((s.name for s in block.states), ticking.state, strict=True))
    return {name: np.array([row[name] for row in every]) for name in every[0]}, last


def test_scores_are_likelihood_ratios_written_out(block):
    y, F = data(change=0.3, n=151)
    _, last = run(block, y, F, {"monitor.threshold": 1e9})
    first, begin = round(0.25 / PERIOD), round(2.0 / PERIOD)  # the tests begin after 2 s
    starts = [begin] * 6
    for k in range(begin, len(y) - 1):  # no window moves after the last tick
        moved = [(k + 1 - begin) % (first * 2**w) == 0 for w in range(6)]
        starts = [(starts[w - 1] if w else k + 1) if moved[w] else starts[w] for w in range(6)]
    assert len(set(starts)) == 6
    for w, start in enumerate(starts):
        b, J = brute(y, F, start)
        assert [last[f"b[{w},{j}]"] for j in range(2)] == pytest.approx(b, rel=1e-3, abs=1e-3)
        assert [last[f"J[{w},{j}]"] for j in range(2)] == pytest.approx(J, rel=1e-3, abs=1e-6)


@pytest.mark.slow
def test_signatures_along_a_noisy_motion_bring_the_information_of_the_tests():
    """Noise along the motion raises no alarm that would hold the windows."""
    known = estimation_model(cart(), ["p"], {"v": 0.1}, NOISE, {}, 1.0, {}, {}, "monitor", False)
    found = candidates_of(hc.BlockModel(cart()), ["c", "p_bias"], ["p"], {}, "monitor", PERIOD)
    design = Design(known, tuple(found), PERIOD, 1.0, (), 6, round(0.25 / PERIOD), 1)
    y, F = data(n=151)
    _, shown, _ = along_motion(design, Motion(y[:, None], F[:, None], np.ones((y.size, 1), bool), {}))
    _, last = run(monitor_block(design, 1e9, [1.0, 1.0]), y, F)
    told = [[last[f"J[{w},{j}]"] for j in range(2)] for w in range(6)]
    assert shown.information[-1] == pytest.approx(np.array(told), rel=1e-9)


def test_a_change_is_named_with_its_size(block):
    y, F = data(change=2.0, n=250)
    told, _ = run(block, y, F)
    assert named_effects(block) == ["c", "p_bias", "p", "unknown_v"]
    assert told["alarm"][:60].max() == 0.0 and told["alarm"][-1] == 1.0
    assert told["effect"][-1] == 1.0 and told["possible_p_bias"][-1] == 0.0
    assert abs(told["change"][-1] - 2.0) < 2 * told["change_std"][-1] < 1.0
    assert told["since"][-1] == pytest.approx((len(y) - 60) * PERIOD, abs=3.0)


@pytest.mark.slow
def test_the_estimate_of_a_friction_does_not_pass_zero():
    """The data have a drag of 0.5 - 2, which is no friction: the estimate stops at a drag of zero."""
    v = hc.Signal("v", "m/s")
    F, m = hc.Signal("F", "N"), hc.Signal("m", "kg", start=2.0)
    c = hc.Signal("c", "1/s", start=DRAG, lower=0.0)
    plant = hc.Block("cart", [v], [F], [v], [m, c], {"v": F.symbol / m.symbol - c.symbol * v.symbol})
    block = hc.monitor(
        plant, ["c"], false_alarms_per_hour=20.0, period=PERIOD, measured=["v"],
        process_noise={"v": 0.1}, measurement_noise={"v": 0.05},
    )  # fmt: skip
    rng, x, n = np.random.default_rng(1), 0.0, 120
    F, y = 2.0 * np.sign(np.sin(0.3 * np.arange(n))), []
    for k in range(n):
        y.append(x + 0.05 * rng.normal())
        growth = np.exp(-PERIOD * (DRAG if k < 60 else DRAG - 2.0))
        x = growth * x + 0.05 * F[k] + 0.03 * rng.normal()
    run_ = Ticking(block)
    told = [run_.tick(PERIOD * k, {"v": y[k], "F": F[k], "reset": 0.0}) for k in range(n)]
    assert told[-1]["alarm"] == 1.0 and told[-1]["change"] == pytest.approx(-DRAG)
    assert min(one["change"] for one in told if one["effect"] == 1.0) >= -DRAG - 1e-12


def test_lost_samples_and_single_outliers_raise_no_alarm(block):
    y, F = data(n=200)
    fresh = (np.arange(200) % 3 > 0) * 1.0
    y[[40, 90, 140]] += [5.0, -5.0, 50.0]
    fresh[[40, 90, 140]] = 1.0
    told, _ = run(block, y, F, fresh=fresh)
    assert told["alarm"].max() == 0.0


def test_a_dead_sensor_is_named_while_it_is_dead(block):
    y, F = data(n=200)
    held = y.copy()
    held[100:150] = y[99]
    told, _ = run(block, held, F)
    assert told["dead_p"][:108].max() == 0.0 and told["dead_p"][112:150].min() == 1.0
    assert set(told["effect"][112:150]) == {3.0} and told["alarm"][-1] == 0.0


def test_a_reset_ends_an_alarm(block):
    y, F = data(change=2.0, n=250)
    reset = (np.arange(250) == 119) * 1.0
    told, _ = run(block, y, F, reset=reset, fresh=(np.arange(250) < 120) * 1.0)
    assert told["alarm"][119] == 1.0 and told["alarm"][121] == 0.0


def test_python_and_c_agree(block):
    y, F = data(change=2.0, n=120)
    told, _ = run(block, y, F)
    time = PERIOD * np.arange(120)
    inputs = {"p": y, "F": F, "fresh": np.ones(120), "reset": np.zeros(120)}
    other = block.compile().simulate(time, inputs).outputs
    for s, row in zip(block.outputs, other, strict=True):
        assert np.asarray(row) == pytest.approx(told[s.name], rel=1e-9, abs=1e-9), s.name


@pytest.mark.parametrize(
    ("candidates", "text"),
    [
        (["d"], "unknown name 'd'"),
        (["c", "c"], "'c' is listed twice"),
        ([], "expected at least one"),
        (["m"], "'m': the measured channels v never show it"),
    ],
)
def test_a_wrong_candidate_is_refused_in_one_line(candidates, text):
    v, F = hc.Signal("v", "m/s"), hc.Signal("F", "N", nominal=0.0 + 1e-300)
    m = hc.Signal("m", "kg", start=2.0)
    c = hc.Signal("c", "1/s", start=1.0)
    block = hc.Block("cart", [v], [F], [v], [m, c], {"v": F.symbol / m.symbol - c.symbol * v.symbol})
    with pytest.raises(InputError, match=text) as error:
        hc.monitor(
            block, candidates, false_alarms_per_hour=1.0, period=PERIOD, measured=["v"],
            process_noise={"v": 0.1}, measurement_noise={"v": 0.1},
        )  # fmt: skip
    assert "\n" not in str(error.value)


def test_a_period_that_is_too_long_is_refused():
    with pytest.raises(InputError, match="fastest mode"):
        hc.monitor(
            cart(), ["c"], false_alarms_per_hour=1.0, period=500.0, measured=["p"],
            process_noise={"v": 0.1}, measurement_noise=NOISE,
        )  # fmt: skip


def test_a_candidate_whose_effects_cancel_in_the_measured_channels_is_refused():
    """y = a - b does not show a push that acts on both states alike."""
    a, b = hc.Signal("a", "m", start=0.3), hc.Signal("b", "m")
    f, y, k = hc.Signal("f", "m/s"), hc.Signal("y", "m"), hc.Signal("k", "1/s", start=0.7)
    slopes = {s.name: f.symbol - k.symbol * s.symbol for s in (a, b)}
    slopes["a"] += hc.Signal("F", "m/s").symbol
    plant = hc.Block("two", [a, b], [hc.Signal("F", "m/s")], [y], [f, k], slopes, {"y": a.symbol - b.symbol})
    with pytest.raises(InputError, match=r"candidate 'f': the measured channels y never show it"):
        hc.monitor(
            plant, ["k", "f"], false_alarms_per_hour=1.0, period=PERIOD, measured=["y"],
            process_noise={"a": 0.1}, measurement_noise={"y": 0.1},
        )  # fmt: skip


def watch_cart(candidates, rate=20.0, **others):
    return hc.monitor(
        cart(), candidates, false_alarms_per_hour=rate, period=PERIOD, measured=["p"],
        process_noise={"v": 0.1}, measurement_noise=NOISE, **others,
    )  # fmt: skip


def told_by(block, y, F):
    time = PERIOD * np.arange(len(y))
    found = block.compile().simulate(time, {"p": y, "F": F, "reset": 0 * time}).outputs
    return dict(zip((s.name for s in block.outputs), found, strict=True))


def test_gusts_and_uncertain_coefficients_are_states_of_the_filter():
    """Stationary variance of d' = -d/tau + q w: q^2 tau/2."""
    known = estimation_model(
        cart(), ["p"], {"v": 0.1}, NOISE, {"v": 0.8}, 0.5, {"c": 0.4}, {"p": 1.0, "v": 1.0}, "m", False
    )
    names = [s.name for s in known.plant.states]
    gust, drag = names.index(disturbance_name("v")), names.index("c")
    q2 = known.intensities[gust].subs({s.symbol: s.start for s in known.parameters})
    assert float(q2) * 0.5 / 2 == pytest.approx(0.8**2)
    assert known.plant.derivatives[names[drag]] == 0 and known.start_std[drag] == 0.4


def test_a_delay_changes_the_derivatives_by_the_late_command_minus_the_present_one():
    model = hc.BlockModel(cart(), ["input_delay"])
    late = hc.effect("input_delay", seconds=0.3)
    (one,) = candidates_of(model, [late], ["p"], {}, "m", PERIOD)
    assert one.delay == 0.3 and list(one.rates) == ["v"]
    values = {"F": 1.0, "F_late": 5.0, "v": 3.0}
    known = {
        s: 2.0 if s.name.endswith("m") else values.get(s.name, DRAG) for s in one.rates["v"].free_symbols
    }
    assert float(one.rates["v"].subs(known)) == pytest.approx((5.0 - 1.0) / 2.0)


@pytest.mark.parametrize(
    ("craft", "name"), [("c17_simulation", "rudder_offset"), ("four_fan", "fan_misalignment")]
)
def test_a_coefficient_of_either_sign_has_its_slope_at_zero(craft, name, rng):
    """d/dq sin(rudder + q) = cos(rudder) at 0, not sin(rudder + 1) - sin(rudder)."""
    (one,) = candidates_of(hc.vehicle(craft), [name], ["x", "y", "psi"], {}, "m", PERIOD)
    assert one.signed and one.rates.keys() == one.law.keys()
    symbols = set().union(*(e.free_symbols for e in one.law.values())) - {one.number}
    here, small = {s: rng.uniform(0.2, 1.2) for s in sorted(symbols, key=str)}, 1e-6
    for key, law in one.law.items():
        away = [float(law.subs(here).subs(one.number, q)) for q in (small, -small)]
        slope = float(one.rates[key].subs(here).subs(one.number, one.scale)) / one.scale
        assert slope == pytest.approx((away[0] - away[1]) / (2 * small), rel=1e-6)


def test_a_rudder_offset_enters_by_the_cosine_of_the_rudder():
    (one,) = candidates_of(hc.vehicle("c17_simulation"), ["rudder_offset"], ["psi"], {}, "m", PERIOD)
    thrust, rudder = sp.symbols("thrust rudder", real=True)
    torque = sp.Symbol("m.rudder_torque", real=True)
    assert sp.simplify(one.rates["r"] + torque * thrust * sp.cos(rudder) * one.number) == 0


def test_the_trial_of_a_lag_is_a_few_sampling_periods():
    (one,) = candidates_of(hc.BlockModel(cart()), ["F_lag"], ["p"], {"F": 2.0}, "m", 0.05)
    assert one.scale == pytest.approx(0.2) and one.law


@pytest.mark.slow
def test_coefficients_lie_within_their_standard_deviations():
    """z of 40 runs is N(0, 1): 38 within 2, on average; 33 or fewer with a probability of 1 %."""
    block = watch_cart(["c"])
    inside = named = 0
    for seed in range(40):
        told = told_by(block, *data(seed, n=400, change=0.8, onset=60))
        named += told["alarm"][-1]
        inside += abs(told["change"][-1] - 0.8) < 2 * told["change_std"][-1]
    assert named >= 38 and inside >= named - 6


@pytest.mark.slow
def test_an_error_of_an_uncertain_coefficient_raises_no_alarm():
    """The drag is off by its standard deviation; a monitor that takes it for exact raises an alarm."""
    y, F = data(seed=2, n=500, change=0.8, onset=0)
    assert told_by(watch_cart(["c"], 0.1), y, F)["alarm"].max() == 1.0
    assert told_by(watch_cart(["c"], 0.1, coefficient_std={"c": 0.8}), y, F)["alarm"].max() == 0.0


@pytest.mark.slow
def test_gusts_that_the_monitor_knows_raise_no_alarm():
    """Accelerations that last about 0.5 s, simulated in steps of a tick."""
    rng, n = np.random.default_rng(7), 400
    keep, gust, x, y = np.exp(-PERIOD / 0.5), 0.0, np.zeros(2), []
    F = 2.0 * np.sign(np.sin(0.3 * np.arange(n)))
    Phi, B, _ = discrete(DRAG)
    for k in range(n):
        y.append(x[0] + NOISE["p"] * rng.normal())
        x = Phi @ x + B * F[k] + 2.0 * B * gust  # B is the response per force on 2 kg
        gust = keep * gust + 0.8 * np.sqrt(1 - keep**2) * rng.normal()
    y = np.array(y)
    known = watch_cart(["c", "p_bias"], 0.1, gusts={"v": 0.8}, gust_seconds=0.5)
    assert told_by(watch_cart(["c", "p_bias"], 0.1), y, F)["alarm"].max() == 1.0
    assert told_by(known, y, F)["alarm"].max() == 0.0


@pytest.mark.slow
def test_a_lag_far_from_its_trial_is_estimated_without_bias():
    """A lag of 0.6 s against a trial of 0.2 s; the secant of the trial gives another value."""
    model = hc.BlockModel(cart())
    block = hc.monitor(
        model, ["c", model.effect_class("F_lag")(seconds=0.2)], false_alarms_per_hour=20.0, period=PERIOD,
        measured=["p"], process_noise={"v": 0.02}, measurement_noise={"p": 0.002},
    )  # fmt: skip
    n, lagged, x, y = 500, 0.0, np.zeros(2), []
    F = 2.0 * np.sign(np.sin(0.3 * np.arange(n)))
    keep, parts = np.exp(-PERIOD / 10 / 0.6), 10
    fine = PERIOD / parts
    for k in range(n):
        y.append(x[0])
        for _ in range(parts):  # force that follows its command, held over a tenth of a tick
            lagged = keep * lagged + (1 - keep) * F[k] if k >= 60 else F[k]
            e = np.exp(-DRAG * fine)
            x = np.array([x[0] + (1 - e) / DRAG * x[1], e * x[1]]) + lagged / 2.0 * np.array(
                [(fine - (1 - e) / DRAG) / DRAG, (1 - e) / DRAG]
            )
    told = told_by(block, np.array(y), F)
    assert named_effects(block)[int(told["effect"][-1]) - 1] == "F_lag"
    assert told["change"][-1] == pytest.approx(0.6, rel=0.05)
    late = np.flatnonzero(told["alarm"] > 0.5)[50:]  # the first samples took the slopes of a shorter lag
    assert (np.abs(told["change"][late] - 0.6) < 3.0 * told["change_std"][late]).all()


@pytest.mark.slow
def test_a_delay_of_the_command_is_named():
    """The force acts 0.3 s late from 6 s on; the rivals are other coefficients."""
    model = hc.BlockModel(cart(), ["input_delay"])
    late = hc.effect("input_delay", seconds=0.3)
    block = hc.monitor(
        model, ["c", "p_bias", late], false_alarms_per_hour=20.0, period=PERIOD, measured=["p"],
        process_noise={"v": 0.05}, measurement_noise={"p": 0.01},
    )  # fmt: skip
    rng, n = np.random.default_rng(4), 400
    F = 4.0 * np.sign(np.sin(0.3 * np.arange(n)))
    x, y = np.zeros(2), []
    Phi, B, Q = discrete(DRAG)
    for k in range(n):
        y.append(x[0] + 0.01 * rng.normal())
        x = Phi @ x + B * F[k - 3 if k >= 63 else k] + 0.5 * np.linalg.cholesky(Q) @ rng.normal(size=2)
    told = told_by(block, np.array(y), F)
    assert told["alarm"][:60].max() == 0.0
    assert named_effects(block)[int(told["effect"][-1]) - 1] == "input_delay"
    assert told["possible_c"][-1] == 0.0
    assert abs(told["change"][-1] - 0.3) < 3 * told["change_std"][-1] < 0.05


FREE = np.array([np.inf])


def steady(K, W, first, m=1):
    """Signatures of one candidate that shows alike in every sample."""
    return signatures_of(np.ones((K, W, 1, m)), first)


def test_the_rate_of_tests_of_single_samples_is_the_tail_of_chi_squared():
    found = steady(600, 1, 1)
    rate = false_alarm_rate(found, np.array([0.5]), -FREE, FREE, 5.5)
    assert rate == pytest.approx(stats.chi2.sf(5.5 * 1.5, 1), rel=1e-3)
    one_sided = false_alarm_rate(found, np.array([0.5]), np.zeros(1), FREE, 5.5)
    assert one_sided == pytest.approx(rate / 2, rel=1e-3)
    assert false_alarm_rate(found, np.array([0.5]), -FREE, FREE, 6.1) == 0.0  # limited to 3: 9 < 6.1 * 1.5


def test_a_threshold_that_no_limited_test_reaches_stays():
    """A single sample, limited to 3, reaches 9; of samples without a limit 1e-6 exceed 23.9."""
    h = threshold_for(steady(600, 1, 1), np.zeros(1), -FREE, FREE, 1e-6)
    assert 9.0 <= h < 25.0


@pytest.mark.slow
def test_the_rate_of_tests_of_two_limited_samples_is_an_integral_of_their_tail():
    """b = psi(e1) + psi(e2), J = 2: P(b > c) by the density of e1, for c = 4.5 and c = 5.5."""
    found = steady(600, 1, 1, m=2)
    for c in (4.5, 5.5):
        rate = false_alarm_rate(found, np.zeros(1), np.zeros(1), FREE, c**2 / 2, draws=20_000)
        e = np.linspace(-LIMIT, LIMIT, 20_001)
        over = np.where(c - e < LIMIT, stats.norm.sf(c - e), 0.0)
        tail = np.trapezoid(stats.norm.pdf(e) * over, e) + stats.norm.sf(LIMIT) * stats.norm.sf(c - LIMIT)
        assert rate == pytest.approx(tail, rel=0.05)


@pytest.mark.parametrize("low", [0.3, 2.0])
def test_the_rate_of_a_bounded_coefficient_is_that_of_its_largest_likelihood(low):
    """One sample, eta = 1: g is the largest 2 z theta - 1.5 theta^2 with theta >= -low, z is N(0, 1)."""
    found, h = steady(600, 1, 1), 4.0
    rate = false_alarm_rate(found, np.array([0.5]), np.array([-low]), FREE, h)
    z = np.linspace(-8.0, 8.0, 4001)
    theta = np.arange(-low, 8.0, 0.002)
    g = np.array([(2 * np.clip(one, -LIMIT, LIMIT) * theta - 1.5 * theta**2).max() for one in z])
    assert rate == pytest.approx(np.trapezoid((g > h) * stats.norm.pdf(z), z), rel=0.02)


@pytest.mark.parametrize("rest", [0, 40])
def test_the_rate_of_false_alarms_is_that_of_a_simulation_with_resets(rest):
    W, first, h, J0 = 4, 2, 11.0, 0.3
    found = steady(400, W, first)
    rate = false_alarm_rate(found, np.array([J0]), -FREE, FREE, h, rest=rest, draws=4000)
    rng, runs, ticks = np.random.default_rng(5), 2000, 4000
    b, J, alarms = np.zeros((runs, W)), np.zeros((runs, W)), 0
    off = np.zeros(runs)  # ticks until the tests begin anew
    for k in range(ticks):
        on = (off == 0)[:, None]
        e = np.clip(rng.normal(size=(runs, 1)), -LIMIT, LIMIT)
        b, J = (b + e) * on, (J + 1.0) * on
        over = (b**2 > h * (J + J0)).any(axis=1)
        alarms += int(over.sum())
        b[over], J[over] = 0.0, 0.0
        off = np.where(over, rest, np.maximum(off - 1, 0))
        for w in reversed(range(W)):
            if (k + 1) % (first * 2**w) == 0:
                b[:, w], J[:, w] = (b[:, w - 1], J[:, w - 1]) if w else (0.0, 0.0)
    assert rate == pytest.approx(alarms / (runs * ticks), rel=0.06)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
@pytest.mark.parametrize("version", [2, 3])
def test_an_fmu_agrees_with_c_to_the_last_digit(block, tmp_path, version, kind):
    fmpy = pytest.importorskip("fmpy")
    y, F = data(change=2.0, n=120)
    time = PERIOD * np.arange(120)
    path = block.to_fmu(tmp_path / "monitor.fmu", version=version)
    rows = np.zeros(120, [(name, float) for name in ("time", "p", "F", "fresh", "reset")])
    rows["time"], rows["p"], rows["F"], rows["fresh"] = time, y, F, 1.0
    names = [s.name for s in block.outputs]
    other = fmpy.simulate_fmu(
        str(path),
        input=rows,
        output=names,
        stop_time=time[-1],
        output_interval=PERIOD / 2,
        fmi_type=kind,
    )
    # a tick reads the inputs that are set at its time; its outputs hold until the next tick
    inputs = {"p": y, "F": F, "fresh": np.ones(120), "reset": np.zeros(120)}
    ours = dict(zip(names, block.compile().simulate(time, inputs).outputs, strict=True))
    assert ours["alarm"][-1] == 1.0
    between = [np.argmin(np.abs(other["time"] - t)) for t in time[:-1] + PERIOD / 2]
    for name in names:
        assert np.array_equal(other[name][between], ours[name][:-1]), name


def test_a_change_of_a_mass_is_a_candidate_by_default():
    found = {c.name: c for c in candidates_of(as_model(cart()), None, ["p"], {}, "watch", PERIOD)}
    assert list(found) == ["m", "c", "p_bias"]
    slope = found["m"].rates["v"].subs({p.symbol: p.start for p in found["m"].parameters})
    assert {s.name.rpartition(".")[2]: s for s in slope.free_symbols}.keys() == {"F", "m"}
    values = {s: {"F": 3.0, "m": 2.0}[s.name.rpartition(".")[2]] for s in slope.free_symbols}
    assert float(slope.subs(values)) == pytest.approx(-3.0 / 2.0**2)
