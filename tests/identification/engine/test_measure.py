"""What a log says about a Block: whose stamps scatter, whose rows are missing or hold a command only."""

import os
from pathlib import Path

import numpy as np
import pytest

from hovercontrol.craft.models.vehicles import c17_experiment
from hovercontrol.identification.engine.levels import noise_levels
from hovercontrol.identification.identify import identify, measure
from hovercontrol.logs import Log, gather, join_logs

POSE, VELOCITY = ("x", "y", "psi"), ("u", "v", "r")
SHARED = Path(os.environ.get("HOVERCONTROL_DATA", Path(__file__).parents[3].parent / "shared" / "data"))


def scattered(log: Log, rng: np.random.Generator, scatter: np.ndarray) -> tuple[Log, np.ndarray]:
    """Return a log with scattered stamps, 5 % of rows lost, 2 % of samples wrong; and its true times."""
    columns = dict(log.columns)
    for name, size in {"x": 0.5, "y": 0.5, "psi": 2.0, "u": 1.0, "v": 1.0, "r": 5.0, "p": 1.0}.items():
        if name in columns:
            wrong = rng.random(len(log)) < 0.02
            columns[name] = columns[name] + wrong * rng.uniform(0.3, 1.0, len(log)) * size
    kept = rng.random(len(log)) > 0.05
    stamped = Log(log.name, log.time + scatter, columns)
    return stamped.select(kept), log.time[kept]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("channels", [VELOCITY, POSE, (*POSE, *VELOCITY)], ids="/".join)
def test_a_steady_clock_is_found_under_a_scatter_of_a_third_of_its_period(rudder_log, channels, seed):
    rng = np.random.default_rng(seed)
    exact = rudder_log(channels, seconds=30.0, seed=seed)
    log, true = scattered(exact, rng, rng.uniform(-3e-3, 3e-3, len(exact)))
    data = measure(c17_experiment().plant(), log)
    error = data.time - true
    assert np.sqrt(np.mean(error**2)) < 3e-4
    assert data.inputs[0].tolist() == log["thrust"].tolist()  # commands stay with their row
    assert data.origin == data.time[0]


def test_so_it_is_for_what_a_block_alone_puts_out(cart, cart_log, rng):
    log, true = scattered(cart_log(1), rng, rng.uniform(-0.015, 0.015, len(cart_log(1))))
    assert np.sqrt(np.mean((measure(cart, log).time - true) ** 2)) < 2.5e-3  # of 50 ms, by 227 rows


def test_late_stamps_count_from_the_earliest_and_jittering_ones_from_their_mean(rudder_log, rng):
    exact = rudder_log(VELOCITY, seconds=30.0)
    late, true = scattered(exact, rng, rng.exponential(1e-3, len(exact)).clip(0.0, 4e-3))
    assert np.abs(measure(c17_experiment().plant(), late).time - true).max() < 2e-4


def test_exact_and_truly_irregular_stamps_are_kept(rudder_log, rng):
    plant, log = c17_experiment().plant(), rudder_log(VELOCITY, seconds=30.0, noise=0.1)
    assert measure(plant, log).time.tolist() == log.time.tolist()
    some = log.select(rng.random(len(log)) > 0.05)
    assert measure(plant, some).time.tolist() == some.time.tolist()
    own = log.time[:-10] + rng.uniform(-3e-3, 3e-3, len(log) - 10)  # sampled when stamped
    sampled = {c: np.interp(own, log.time, column) for c, column in log.columns.items()}
    assert measure(plant, Log("own", np.sort(own), sampled)).time.tolist() == np.sort(own).tolist()


@pytest.mark.slow
@pytest.mark.parametrize("channels", [VELOCITY, (*POSE, *VELOCITY)], ids="/".join)
def test_rows_of_commands_alone_keep_their_time_and_cost_nothing(rudder_log, channels):
    """Samples at 45 Hz, commands when they change: what is found is that of the commands' own times."""
    log = rudder_log(channels, seconds=30.0, rate=500.0)
    seen = log.select(slice(None, None, 11))
    pose = Log("run", seen.time, {c: seen[c] for c in channels})
    commands = Log("commands", log.time, {c: log[c] for c in ("thrust", "rudder")})
    joined = join_logs(pose, commands)
    data = measure(c17_experiment().plant(), joined)
    assert data.time.tolist() == joined.time.tolist()
    alone = np.isnan(joined["r"])
    assert 10 < np.count_nonzero(alone) < 200
    assert np.isnan(data.values[:, alone]).all() and np.isfinite(data.values[:, ~alone]).all()
    assert np.isfinite(data.states[3:]).all()
    assert data.rejected == () and data.segments == ((0, len(joined)),)
    assert noise_levels([data], ["r"]) == pytest.approx(0.02, rel=0.15)
    own, rounded = (identify(c17_experiment(), [each]) for each in (joined, joined.select(~alone)))
    assert own.residual["r"] == pytest.approx(0.02, rel=0.1)
    assert rounded.ahead["r"] > 1.3 * own.ahead["r"]
    left, wrong = ({r.equation: r.share for r in found.remaining}["r'"] for found in (own, rounded))
    assert left < 0.01 and wrong > 0.03  # commands at the wrong time look like a torque


def test_a_loss_of_sight_is_a_break_though_commands_came_meanwhile(rudder_log):
    log = rudder_log((*POSE, *VELOCITY), seconds=20.0)
    seen = log.select((log.time < 7.3) | (log.time > 9.1))
    pose = Log("run", seen.time, {c: seen[c] for c in (*POSE, *VELOCITY)})
    joined = join_logs(pose, Log("commands", log.time, {c: log[c] for c in ("thrust", "rudder")}))
    data = measure(c17_experiment().plant(), joined)
    assert [joined.time[a] for a, _ in data.segments] == pytest.approx([0.0, 9.11])
    assert np.isnan(joined["x"][(joined.time > 7.3) & (joined.time < 9.1)]).any()


def test_what_is_left_out_is_told_by_span_rows_and_reason(rudder_log):
    log = rudder_log(POSE, seconds=20.0)
    columns = {name: log[name].copy() for name in log.columns}
    columns["psi"][500:520] += np.pi
    columns["x"][900] += 0.4
    data = measure(c17_experiment().plant(), Log("run", log.time, columns))
    assert [(s.rows, s.reason) for s in data.rejected] == [(20, "heading flip"), (1, "position jump")]
    assert [s.start for s in data.rejected] == pytest.approx([5.0, 9.0])
    assert np.count_nonzero(np.isnan(data.values).all(axis=0)) == 21


@pytest.mark.skipif(
    not (SHARED / "holohover").is_dir(),
    reason=f"measured data not at {SHARED}; set HOVERCONTROL_DATA to the folder that holds it",
)
def test_commands_on_a_clock_of_their_own_join_a_real_pose_at_their_own_time():
    """At 240 Hz and 100 Hz; rounded to the next pose row commands would come 2 ms late."""
    files = [SHARED / "holohover" / f"h1_blue_raw_{name}.csv" for name in ("pose", "command")]
    joined = gather("+".join(map(str, files)), ["motor_a_1"])
    sent = gather(str(files[1]))
    alone = np.isnan(joined["x"])
    assert np.isin(joined.time[alone], sent.time).all()
    changes = joined.time[1:][np.diff(joined["motor_a_1"]) != 0]
    nearest = np.abs(sent.time[:, None] - changes).min(axis=0)
    assert nearest.max() < 5e-5  # a hundredth of a sampling period
