"""A measurement that was held over the rows of a faster log is said to be, with its own rate."""

from __future__ import annotations

import numpy as np
import pytest

from hovercontrol.errors import InputError
from hovercontrol.identify import identify
from hovercontrol.log_check import check
from hovercontrol.logs import Log, join_logs
from hovercontrol.logs.held import held, held_faults
from hovercontrol.models.vehicles import c17_experiment

POSE, COMMANDS = ("x", "y", "psi"), ("thrust", "rudder")


def craft_log(noise: float = 1e-3) -> Log:
    """A craft at 50 Hz under random commands, each kept for 0.8 s."""
    rng, t = np.random.default_rng(0), 0.02 * np.arange(1000)
    commands = [np.repeat(rng.uniform(*span, 25), 40) for span in ((1, 4), (-0.4, 0.4))]
    run = c17_experiment().plant().compile().simulate(t, commands)
    seen = dict(zip(run.output_labels, run.outputs, strict=True))
    pose = {name: seen[name] + noise * rng.normal(size=t.size) for name in POSE}
    return Log("run.csv", t, pose | dict(zip(COMMANDS, commands, strict=True)))


def holding(log: Log, rows: int) -> Log:
    at = np.arange(len(log)) // rows * rows
    return log.with_columns({name: log[name][at] for name in POSE})


@pytest.mark.parametrize(("rows", "rate"), [(5, 10), (10, 5), (25, 2)])
def test_a_held_pose_is_told_with_its_rate(rows, rate):
    log = holding(craft_log(), rows)
    line = f"run.csv: the pose repeats for {rows} rows: it is measured at about {rate} Hz and held between"
    with pytest.raises(InputError, match=line):
        identify(c17_experiment(), [log])
    found = check([log], c17_experiment())
    assert [e.startswith(line) for e in found.errors] == [True] and not found.warnings
    assert [w.startswith(line) for w in check([log]).warnings] == [True]


def test_a_pose_held_for_two_rows_is_a_warning():
    log = holding(craft_log(), 2)
    with pytest.warns(UserWarning, match="repeats for 2 rows: it is measured at about 25 Hz"):
        assert identify(c17_experiment(), [log]).converged
    assert any("measured at about 25 Hz" in line for line in check([log], c17_experiment()).warnings)


def test_the_advice_gives_the_coefficients_of_the_craft():
    log, truth = craft_log(), c17_experiment().coefficients()
    pose = Log("pose", log.time, {name: log[name] for name in POSE}).select(slice(0, None, 10))
    commands = Log("commands", log.time, {name: log[name] for name in COMMANDS})
    found = identify(c17_experiment(), [join_logs(pose, commands)])
    for c in found.coefficients:
        assert c.value == pytest.approx(truth[c.name], abs=4.0 * c.std), c.name


def test_what_is_measured_in_each_row_is_not_held():
    log = craft_log()
    t = log.time
    some = np.sort(np.random.default_rng(1).choice(1400, 1000, replace=False)) // 2
    assert held_faults(log, POSE) == []
    assert held(Log("at rest", t, {"x": np.zeros(t.size)}), ["x"]) is None
    assert held(Log("coarse", t, {"x": np.round(0.3 * t, 2)}), ["x"]) is None  # 1 cm at 0.3 m/s
    assert held(Log("now and then", t, {"x": np.sin(t)[some]}), ["x"]) is None


def test_each_measurement_is_judged_by_itself():
    log = holding(craft_log(), 10)
    rates = {name: np.cos(log.time + k) for k, name in enumerate(("u", "v", "r"))}
    said = held_faults(log.with_columns(rates), (*POSE, *rates))
    assert len(said) == 1 and "the pose repeats for 10 rows" in said[0]
    slow = np.repeat(np.sin(log.time[::4]), 4)
    machine = Log("m", log.time, {"speed": slow})
    assert "column 'speed' repeats for 4 rows" in held_faults(machine, ["speed"])[0]
