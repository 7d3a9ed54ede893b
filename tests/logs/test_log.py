"""Logs, their joining, and the bench table."""

from pathlib import Path

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.logs import BenchTable, Log, join_logs


def test_a_log_refuses_columns_of_other_length_and_time_that_stands_still() -> None:
    with pytest.raises(InputError, match=r"run: column 'u' has shape \(2,\).* 3 times"):
        Log("run", np.arange(3.0), {"u": np.zeros(2)})
    with pytest.raises(InputError, match="run: time must increase, but sample 2 is at 1 s after 1 s"):
        Log("run", np.array([0.0, 1.0, 1.0]), {})
    with pytest.raises(InputError, match="run: no column 'thurst'; did you mean 'thrust'"):
        Log("run", np.arange(3.0), {"thrust": np.zeros(3)})["thurst"]


def test_a_gap_is_a_quarter_second_and_five_steps() -> None:
    fast = np.concatenate([0.02 * np.arange(10), 0.5 + 0.02 * np.arange(10)])
    assert Log("fast", fast, {}).gaps == ((pytest.approx(0.18), pytest.approx(0.5)),)
    slow = np.array([0.0, 0.1, 0.2, 0.6, 0.7])  # 0.4 s is only four steps
    assert Log("slow", slow, {}).gaps == ()
    assert Log("one", np.zeros(1), {}).gaps == ()


def commands() -> Log:
    # the second row comes 0.1 ms after the first, as real command files have it
    return Log("fans", np.array([1.0, 1.0001, 2.0]), {"pwm": np.array([1100.0, 1200.0, 1000.0])})


def pose() -> Log:
    return Log("run", np.array([0.0, 0.9, 1.00005, 1.5, 2.0, 2.4, 3.0]), {"x": np.zeros(7)})


def test_commands_hold_until_the_next_one() -> None:
    joined = join_logs(pose(), commands(), before={"pwm": 1000.0}, hold=0.5)
    assert joined.time[-1] == 2.4  # the last command is forgotten after 0.5 s
    assert joined.time.tolist() == pose().time[:-1].tolist()  # commands as near to a sample come with it
    assert joined["pwm"].tolist() == [1000, 1000, 1200, 1200, 1000, 1000]


def test_a_command_between_two_samples_changes_at_its_own_time() -> None:
    fans = Log("fans", np.array([1.2, 1.3, 1.7, 2.1]), {"pwm": np.array([1100.0, 1100.0, 1300.0, 1000.0])})
    joined = join_logs(pose(), fans, before=1000.0)
    assert joined.time.tolist() == [0.0, 0.9, 1.00005, 1.2, 1.5, 1.7, 2.0, 2.1, 2.4]
    assert joined["pwm"].tolist() == [1000, 1000, 1000, 1100, 1100, 1300, 1300, 1000, 1000]
    assert np.flatnonzero(np.isnan(joined["x"])).tolist() == [3, 5, 7]


def test_without_an_idle_value_the_pose_is_cut_at_the_first_command() -> None:
    assert join_logs(pose(), commands()).time.tolist() == [1.00005, 1.5, 2.0, 2.4]


def test_logs_that_do_not_fit_are_refused() -> None:
    with pytest.raises(InputError, match="run: no time in common with fans: 10 to 12 s against 1 to 2"):
        join_logs(Log("run", np.array([10.0, 12.0]), {}), commands(), before=0.0)
    with pytest.raises(InputError, match="run: column 'pwm' is also in fans"):
        join_logs(pose().with_columns({"pwm": np.zeros(7)}), commands())
    with pytest.raises(InputError, match=r"fans: idle value for 'pmw'.* did you mean 'pwm'"):
        join_logs(pose(), commands(), before={"pmw": 0.0})
    with pytest.raises(InputError, match="fans: no idle value for command 'pwm'"):
        join_logs(pose(), commands(), before={})


BENCH = "pwm,one,two\n1100,1.0,3.0\n1200,8,12\n1300,20,24\n"


def bench(tmp_path: Path, text: str = BENCH) -> BenchTable:
    path = tmp_path / "bench.csv"
    path.write_text(text)
    return BenchTable.from_csv(path)


def test_bench_thrust_is_the_mean_of_trials_shared_by_two_fans(tmp_path: Path) -> None:
    table = bench(tmp_path)
    gram = 9.80665e-3
    assert table.force([1100, 1200, 1300]) == pytest.approx([1.0 * gram, 5 * gram, 11 * gram])
    assert table.force([0, 999, 1000]).tolist() == [0, 0, 0]
    between = table.force(np.linspace(1000, 1300, 200))
    assert np.all(np.diff(between) > 0)
    assert 0 < table.force(1050) < 1.0 * gram


def test_commands_above_the_bench_are_clipped_and_counted(tmp_path: Path) -> None:
    log = Log("run", np.arange(3.0), {"pwm_a": np.array([1000.0, 1300.0, 1400.0])})
    with pytest.warns(UserWarning, match="run: 1 of 3 values of 'pwm_a' are above 1300"):
        forces = bench(tmp_path).apply(log, {"pwm_a": "a"})
    assert forces["a"][2] == forces["a"][1] > 0
    with pytest.raises(InputError, match="no column 'pwm_b'; did you mean 'pwm_a'"):
        bench(tmp_path).apply(log, {"pwm_b": "b"})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("pwm,one\n1100,1\n1200,x\n", "line 3, column 'one': expected a number, found 'x'"),
        ("pwm,one\n1100,1\n1200,\n", "line 3, column 'one': expected a finite number, found ''"),
        ("pwm,one\n1100,1\n1100,2\n", "line 3, column 'pwm': expected more than 1100, found 1100"),
        ("pwm,one\n900,1\n1100,2\n", "line 2, column 'pwm': expected more than 1000, found 900"),
        ("pwm,one\n1100,1\n", "at least two bench rows, found 1"),
        ("pwm\n1100\n1200\n", "at least one trial"),
        ("pwm,one\n1100,-1\n1200,2\n", "line 2: expected thrust of zero or more, found -1"),
    ],
)
def test_a_bad_bench_table_is_named_in_one_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=r"bench\.csv") as caught:
        bench(tmp_path, text)
    assert message in str(caught.value)
