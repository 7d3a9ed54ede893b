"""The cases: equations by hand and another solver, seeds, and blind names."""

from collections import Counter

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.base.pythonfile import from_python
from hovercontrol.identification.benchmark import benchmark_case, benchmark_names, blind_names
from hovercontrol.identification.benchmark.cases import CONDITIONS, lacks, parsed
from hovercontrol.identification.benchmark.files import save_case
from hovercontrol.identification.benchmark.machines import MACHINES

#: By hand, from the textbooks: rates of the states, of x, u and the coefficients p.
BY_HAND = {
    "ship": lambda x, u, p: [
        x[2],
        -p["yv"] * x[1] - p["yr"] * x[2] + p["yd"] * u[0],
        -p["nv"] * x[1] - p["nr"] * x[2] + p["nd"] * u[0],
    ],
    "rover": lambda x, u, p: [x[2], p["a"] * u[0] - p["d"] * x[1], p["b"] * u[1] - p["e"] * x[2]],
    "motor": lambda x, u, p: [
        p["per_inductance"] * u[0] - p["resistance"] * x[0] - p["emf"] * x[1],
        p["torque"] * x[0] - p["damping"] * x[1],
    ],
    "pendulum": lambda x, u, p: [
        x[1],
        p["a"] * u[0] - p["gravity"] * np.sin(x[0]) - p["viscous"] * x[1],
    ],
}
#: What a law adds, by hand.
LAWS = {
    "ship.law_r_abs_v_r.usual.0": lambda x: np.array([0, 0, -abs(x[1]) * x[2]]),
    "rover.law_speed_sin_2_psi.usual.0": lambda x: np.array([0, -np.sin(2 * x[0]), 0]),
    "motor.law_speed_speed_3.usual.0": lambda x: np.array([0, -(x[1] ** 3)]),
    "pendulum.law_rate_abs_angle_rate.usual.0": lambda x: np.array([0, -abs(x[0]) * x[1]]),
}


@pytest.mark.parametrize("name", LAWS)
def test_the_true_motion_is_that_of_the_equations_by_hand(name):
    """True coefficients are near the given ones: fitted to the motion, they give it exactly."""
    from scipy.optimize import least_squares

    case = benchmark_case(name)
    rates = BY_HAND[name.partition(".")[0]]
    given = {k.rpartition(".")[2]: v for k, v in case.model.coefficients().items()}
    inputs = np.array([case.holdout[k] for k in MACHINES[name.partition(".")[0]].commands])
    dt, rows = case.holdout.time[1], slice(0, 60)

    def path(scale, n=60):
        p = {k: v * s for (k, v), s in zip(given.items(), scale, strict=True)}
        x, found = np.zeros(case.motion.shape[1]), []
        for k in range(n):
            found.append(x)
            x = solve_ivp(
                lambda t, x, u=inputs[:, k]: np.array(rates(x, u, p), float)
                + case.truth.coefficient * LAWS[name](x),
                (0.0, dt), x, rtol=1e-9, atol=1e-11,
            ).y[:, -1]  # fmt: skip
        return np.array(found)

    size = case.motion[rows].std(axis=0)
    fit = least_squares(
        lambda s: ((path(s) - case.motion[rows]) / size).ravel(), np.ones(len(given)), xtol=1e-12
    )
    assert np.abs(fit.fun).max() < 2e-4
    assert np.abs(fit.x - 1).max() < 0.2


test_the_true_motion_is_that_of_the_equations_by_hand = pytest.mark.slow(
    test_the_true_motion_is_that_of_the_equations_by_hand
)


@pytest.mark.parametrize("name", BY_HAND)
def test_models_are_the_equations_of_the_textbooks(name):
    model = MACHINES[name].model()
    block = model.plant()
    p = {k.rpartition(".")[2]: v for k, v in model.coefficients().items()}
    rng = np.random.default_rng(0)
    for _ in range(5):
        x, u = rng.normal(size=len(block.states)), rng.normal(size=len(block.inputs))
        assert block.to_numpy().derivatives(0.0, x, u) == pytest.approx(BY_HAND[name](x, u, p))


def test_the_small_edition_has_what_the_benchmark_promises():
    names = benchmark_names()
    whats = {parsed(n)[1] for n in names}
    assert len(names) == len(set(names)) == 60
    assert Counter(lacks(n) for n in names) == {"effect": 24, "law": 24, "nothing": 12}
    assert len({parsed(n)[0] for n in names}) == 6
    assert len({w for w in whats if not w.startswith("law_")} - {"nothing"}) >= 12
    assert {parsed(n)[2] for n in names} == set(CONDITIONS)
    laws = {(law, name) for name, m in MACHINES.items() for law in m.laws}
    assert len(laws) == 24


def test_the_full_edition_has_all_conditions_and_seeds():
    names = benchmark_names("full")
    assert len(set(names)) == len(names) == 900
    assert Counter(lacks(n) for n in names)["nothing"] == 180  # 20 %


def test_a_case_is_the_same_each_time_and_another_seed_another_case():
    a, b, c = (benchmark_case(f"motor.law_speed_speed_3.dirt.{s}") for s in (0, 0, 1))
    for k in a.train[0].columns:
        assert np.array_equal(a.train[0][k], b.train[0][k])
    assert a.truth == b.truth != c.truth


def test_conditions_do_what_they_say():
    usual, noise, dirt = (benchmark_case(f"rover.nothing.{c}.0") for c in ("usual", "noise", "dirt"))
    assert len(usual.train[0]) == 2000 > len(dirt.train[0]) > 1800
    assert np.ptp(np.diff(dirt.train[0].time)) > 1e-3

    def error(case):
        return np.std(case.holdout["speed"] - case.motion[:, 1])

    assert error(usual) == pytest.approx(5e-3, rel=0.1)
    assert error(noise) == pytest.approx(15e-3, rel=0.1)


def test_blind_cases_follow_from_the_key_alone():
    one, other = blind_names("key"), blind_names("key 2")
    assert one == blind_names("key") and set(one.values()).isdisjoint(other.values())
    assert Counter(lacks(n) for n in one.values()) == {"effect": 24, "law": 24, "nothing": 12}
    assert [parsed(n)[:3] for n in one.values()] != [parsed(n)[:3] for n in other.values()]


def test_a_case_goes_through_files(tmp_path):
    name = "ship.law_v_v_3.usual.0"
    files = save_case(name, tmp_path / "one")
    case = benchmark_case(name)
    assert sorted(f.name for f in files) == ["answer.json", "holdout.csv", "model.py", "train.csv"]
    assert not any("0.8" in f.name or "answer" in f.name for f in (tmp_path / "one").iterdir())
    model = from_python(f"{tmp_path}/one/model.py:MODEL", hc.BlockModel)
    assert model.coefficients() == case.model.coefficients()
    log = hc.read_log(tmp_path / "one" / "train.csv")
    for k, v in case.train[0].columns.items():
        assert np.allclose(log[k], v, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("tug.nothing.usual.0", "unknown machine 'tug'"),
        ("ship.r_quadratic_darg.usual.0", "did you mean 'r_quadratic_drag'"),
        ("ship.nothing.usua.0", "unknown condition 'usua'; did you mean 'usual'"),
        ("ship.nothing.usual.-1", "expected a seed of 0 or more, found '-1'"),
        ("ship", "expected MACHINE.WHAT.CONDITION.SEED"),
    ],
)
def test_a_wrong_name_says_what_is_wrong(name, message):
    with pytest.raises(InputError, match=message):
        benchmark_case(name)
