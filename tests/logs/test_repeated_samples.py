"""A measurement that a logger wrote twice is one measurement; a craft at rest is measured at each row."""

from __future__ import annotations

import numpy as np
import pytest

from hovercontrol.craft.models.vehicles import c17_experiment
from hovercontrol.identification.check import check
from hovercontrol.identification.identify import identify
from hovercontrol.logs import Log
from hovercontrol.logs.repeated_samples import repeats, without_repeats

POSE, COMMANDS = ("x", "y", "psi"), ("thrust", "rudder")


def craft_log(noise: float = 1e-3) -> Log:
    """A craft at 50 Hz under random commands, each kept for 0.8 s."""
    rng, t = np.random.default_rng(0), 0.02 * np.arange(1000)
    commands = [np.repeat(rng.uniform(*span, 25), 40) for span in ((1, 4), (-0.4, 0.4))]
    run = c17_experiment().plant().compile().simulate(t, commands)
    seen = dict(zip(run.output_labels, run.outputs, strict=True))
    pose = {name: seen[name] + noise * rng.normal(size=t.size) for name in POSE}
    return Log("run.csv", t, pose | dict(zip(COMMANDS, commands, strict=True)))


LOG = craft_log()


def every(rows: int) -> np.ndarray:
    return np.arange(len(LOG)) // rows * rows


def at_rate(rate: float) -> np.ndarray:
    """Rows of the last sample of a slower stream on the grid of 50 Hz."""
    return np.ceil(np.floor(np.arange(len(LOG)) * rate / 50.0 + 1e-9) * 50.0 / rate - 1e-9).astype(int)


def by_chance() -> np.ndarray:
    fresh = np.random.default_rng(1).random(len(LOG)) > 0.43
    return np.maximum.accumulate(np.where(fresh, np.arange(len(LOG)), 0))


def holding(at: np.ndarray, names: tuple[str, ...] = POSE, log: Log = LOG) -> Log:
    return log.with_columns({name: log[name][at] for name in names})


@pytest.mark.parametrize(
    "at",
    [every(2), every(5), every(10), every(25), at_rate(29.0), at_rate(45.0), by_chance()],
    ids=["twice", "5 times", "10 times", "25 times", "29 Hz", "45 Hz", "by chance"],
)
def test_what_repeats_is_dropped_and_told(at):
    new = np.diff(at, prepend=-1) > 0
    found, said = without_repeats(holding(at), POSE)
    wrong = int((np.isfinite(found["x"]) != new).sum())
    assert wrong <= 0.02 * len(LOG)  # a run far longer than the others is a craft at rest
    assert np.array_equal(found["thrust"], LOG["thrust"])
    end = f": the {np.isnan(found['x']).sum()} of 1,000 rows that repeat it are not used as measurements"
    assert len(said) == 1 and said[0].startswith("run.csv: the pose changes at") and said[0].endswith(end)
    again, nothing = without_repeats(found, POSE)
    assert again is found and not nothing


@pytest.mark.slow
@pytest.mark.parametrize("rows", [2, 5])
def test_the_coefficients_are_those_of_the_craft(rows):
    truth = c17_experiment().coefficients()
    with pytest.warns(UserWarning, match="the pose changes at about"):
        found = identify(c17_experiment(), [holding(every(rows))])
    for c in found.coefficients:
        assert c.value == pytest.approx(truth[c.name], abs=4.0 * c.std), c.name


def test_a_check_tells_it_and_is_no_error():
    for model in (None, c17_experiment()):
        found = check(model, [holding(every(2))])
        assert not found.errors
        assert [w for w in found.warnings if "repeat" in w] == [
            "run.csv: the pose changes at about 25 Hz: the 500 of 1,000 rows that repeat it are not used as "
            "measurements"
        ]


@pytest.mark.parametrize("resolution", [1e-4, 1e-3, 1e-2, 5e-2])
@pytest.mark.parametrize("noise", [0.0, 0.3, 1.0, 3.0])
@pytest.mark.parametrize("names", [POSE, ("x",), ("psi",)])
def test_a_coarse_sensor_repeats_and_is_not_held(resolution, noise, names):
    rng = np.random.default_rng(2)
    rows = {k: LOG[k] + noise * resolution * rng.normal(size=len(LOG)) for k in names}
    rows = {k: resolution * np.rint(row / resolution) for k, row in rows.items()}
    assert not repeats(LOG.with_columns(rows), names).any()


def test_a_craft_that_stops_and_goes_with_a_coarse_pose_keeps_its_rows():
    t = LOG.time
    way = np.cumsum(np.maximum(np.sin(2 * np.pi * t), 0.0) ** 2) * 0.02  # at rest half of the time
    pose = {name: 1e-3 * np.rint((k + 1) * way / 1e-3) for k, name in enumerate(POSE)}
    assert (np.diff(pose["x"]) == 0).mean() > 0.4
    assert not repeats(Log("a", t, pose), POSE).any()


def test_a_machine_that_settles_between_its_commands_is_measured():
    t = 0.05 * np.arange(2000)
    goal, v = np.repeat(np.random.default_rng(3).uniform(0, 5, 40), 50), np.zeros(2000)
    for k in range(1999):
        v[k + 1] = v[k] + 0.4 * (goal[k] - v[k])
    v = np.round(v, 3)
    assert (np.diff(v) == 0).mean() > 0.4
    assert not repeats(Log("a", t, {"v": v}), ["v"]).any()


def test_of_a_craft_at_rest_under_a_held_pose_a_sample_is_kept_each_period():
    log = holding(every(2))
    rest = (log.time > 8.0) & (log.time < 12.0)
    still = {name: np.where(rest, log[name][400], log[name]) for name in POSE}
    kept = np.isfinite(without_repeats(log.with_columns(still), POSE)[0]["x"])
    assert 0.4 < kept[rest].mean() < 0.6


def test_single_rows_that_a_logger_wrote_twice_are_dropped():
    at = np.arange(len(LOG))
    at[40::50] -= 1
    assert np.flatnonzero(repeats(holding(at), POSE)).tolist() == list(range(40, 1000, 50))


def test_each_measurement_is_judged_by_itself():
    rates = {name: np.cos(LOG.time + k) for k, name in enumerate(("u", "v", "r"))}
    log = holding(every(10)).with_columns(rates)
    found, said = without_repeats(log, (*POSE, *rates))
    assert len(said) == 1 and np.isfinite(found.stack(*rates)).all()
    machine = {"speed": np.sin(LOG.time)[every(4)], "level": np.cos(LOG.time)[every(4)]}
    found, said = without_repeats(Log("m", LOG.time, machine), ["speed", "level"])
    text = "the 750 of 1,000 rows that repeat it are not used as measurements"
    assert said == [f"m: speed, level changes at about 12 Hz: {text}"]
    found, said = without_repeats(Log("m", LOG.time, machine | {"level": LOG["x"]}), ["speed", "level"])
    assert len(said) == 1 and "column 'speed'" in said[0] and np.isfinite(found["level"]).all()
