"""Several trials in one file count as several logs: nothing is predicted from one to the next."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.identification.engine.measure import measure
from hovercontrol.identification.identify import identify
from hovercontrol.identification.identify.predict import free_run
from hovercontrol.logs import Log, join_logs, read_log
from hovercontrol.logs.log import Trial

V, U = Signal("speed", "m/s"), Signal("fan", "1")
K, D = Signal("k", "m/s^2", start=8.0), Signal("d", "1/s", start=1.0)
TROLLEY = Block("trolley", [V], [U], [V], [K, D], {"speed": K.symbol * U.symbol - D.symbol * V.symbol})
STEP, ROWS, TRIALS = 0.05, 120, 6


def trials() -> list[np.ndarray]:
    """Each from another speed: time, speed, fan."""
    rng, t = np.random.default_rng(0), STEP * np.arange(ROWS)
    fade, found = np.exp(-1.2 * STEP), []
    for k in range(TRIALS):
        u, v = np.repeat(rng.uniform(0, 0.5, 6), ROWS // 6), np.full(ROWS, 1.0 + k)
        for i in range(ROWS - 1):
            v[i + 1] = fade * v[i] + (1 - fade) * 7.0 * u[i] / 1.2
        found.append(np.stack([t, v + 1e-3 * rng.normal(size=ROWS), u]))
    return found


PARTS = trials()


def write(path: Path, pause: float | None) -> Path:
    """Write all trials, a pause [s] between them or each from zero on."""
    rows = ["time,speed,fan,trial"]
    for k, (t, v, u) in enumerate(PARTS):
        begin = 0.0 if pause is None else k * (ROWS * STEP + pause)
        rows += [f"{a + begin:.3f},{b:.6f},{c:.6f},{k}" for a, b, c in zip(t, v, u, strict=True)]
    path.write_text("\n".join(rows))
    return path


def read(path: Path, **options: str) -> Log:
    return read_log(path, None, ["fan"], motion=False, **options)


@pytest.mark.parametrize(
    ("pause", "options", "said"),
    [
        (None, {}, "since time begins again; each is moved 20 s further than the last"),
        (300.0, {}, "since time pauses"),
        (2.0, {"trial": "trial"}, "by column 'trial'"),
        (0.0, {"trial": "trial"}, "by column 'trial'"),
        (None, {"trial": "trial"}, "by column 'trial'; each is moved 20 s further than the last"),
    ],
)
def test_trials_are_found_and_fitted_as_so_many_logs(tmp_path, pause, options, said):
    log = read(write(tmp_path / "all.csv", pause), **options)
    assert log.notes == (f"all.csv: 6 trials, {said}",) and not log.gaps
    assert [trial.first for trial in log.trials] == [ROWS * k for k in range(TRIALS)]
    assert [part["speed"][0].round() for part in log.each_trial()] == [1, 2, 3, 4, 5, 6]
    with pytest.warns(UserWarning, match="6 trials"):
        found = identify(TROLLEY, [log])
    apart = identify(TROLLEY, [Log(str(k), t, {"speed": v, "fan": u}) for k, (t, v, u) in enumerate(PARTS)])
    for one, other, truth in zip(found.coefficients, apart.coefficients, (7.0, 1.2), strict=True):
        assert one.value == pytest.approx(truth, abs=4.0 * one.std)
        assert one.value == pytest.approx(other.value, abs=0.5 * one.std)
        assert one.std == pytest.approx(other.std, rel=0.2)
    assert set(found.fit.problem.rows.piece) == set(range(TRIALS))


def test_a_free_run_starts_again_at_each_trial(tmp_path):
    log = read(write(tmp_path / "all.csv", None))
    run = free_run(TROLLEY.with_values({"k": 7.0, "d": 1.2}), log)
    assert len(run.starts) == TRIALS and run.rms["speed"] < 2e-3
    assert measure(TROLLEY, log).segments == tuple((ROWS * k, ROWS * (k + 1)) for k in range(TRIALS))


def test_commands_of_a_trial_do_not_lag_into_the_next(tmp_path):
    from hovercontrol.identification.engine.data import gather
    from hovercontrol.identification.engine.problem import Problem

    problem = Problem(
        BlockModel(TROLLEY), gather(BlockModel(TROLLEY), [read(write(tmp_path / "a.csv", None))])
    )
    before = np.array([20.0 * k - 1.0 for k in range(1, TRIALS)])
    # each trial begins in motion: in the pause before it its own first command is held, not the last one's
    (acting,) = problem.inputs.at([], before, np.zeros(before.size, dtype=int))
    np.testing.assert_allclose(acting, [part[2][0] for part in PARTS[1:]], atol=1e-6)


def test_rows_that_belong_to_no_trial_are_left_out(tmp_path):
    path = write(tmp_path / "a.csv", 2.0)
    path.write_text(path.read_text().replace(",3\n", ",\n"))
    log = read(path, trial="trial")
    assert len(log) == 5 * ROWS and len(log.trials) == 5
    assert log.notes[1] == "a.csv: 120 rows with no 'trial': left out"


def test_a_selection_keeps_the_trials_that_are_left(tmp_path):
    log = read(write(tmp_path / "all.csv", None))
    some = log.between(log.time[ROWS + 60], log.time[3 * ROWS + 1])
    assert [trial.first for trial in some.trials] == [0, 60, 180]
    assert [trial.shift for trial in some.trials] == [20.0, 40.0, 60.0]
    assert not log.select(slice(0, ROWS)).trials and len(log.spread(300)[0].trials) == 0


@pytest.mark.parametrize("wrong", ["0.25", "5.9", "-3"])
def test_a_row_out_of_order_is_no_trial(tmp_path, wrong):
    rows = write(tmp_path / "a.csv", 300.0).read_text().splitlines()
    rows[100] = f"{wrong},1,0,0"
    (tmp_path / "a.csv").write_text("\n".join(rows[:ROWS]))
    with pytest.raises(InputError, match=r"a.csv: line \d+, column 'time': time runs backwards"):
        read(tmp_path / "a.csv")


def test_a_column_that_is_not_there_is_named(tmp_path):
    with pytest.raises(InputError, match=r"a.csv: no column 'trail' to tell trials by; did you mean 'trial'"):
        read(write(tmp_path / "a.csv", 300.0), trial="trail")


def test_trials_in_two_files_are_joined_one_by_one():
    t = np.concatenate([p[0] + 20.0 * k for k, p in enumerate(PARTS[:2])])
    speed, fan = (np.concatenate([p[i] for p in PARTS[:2]]) for i in (1, 2))
    own = (Trial(0), Trial(ROWS, 20.0))
    late = (Trial(0), Trial(ROWS, 50.0))
    moved = t + 30.0 * (np.arange(t.size) >= ROWS)
    joined = join_logs(Log("a", t, {"speed": speed}, trials=own), Log("b", moved, {"fan": fan}, trials=late))
    assert np.array_equal(joined["fan"], fan) and np.array_equal(joined["speed"], speed)
    assert [trial.first for trial in joined.trials] == [0, ROWS]
    with pytest.raises(
        InputError, match="a: time begins again: expected as many trials as in b, found 2 and 1"
    ):
        join_logs(Log("a", t, {"speed": speed}, trials=own), Log("b", moved, {"fan": fan}))
