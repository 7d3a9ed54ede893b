"""A run is put together from the files it was recorded in."""

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.logs import BenchTable, Condition, Log, gather


@pytest.fixture
def run(tmp_path):
    """Pose at 50 Hz, commands at 20 Hz in a file of their own with pulse widths; a bench table."""
    t = np.arange(0.0, 4.0, 0.02)
    Log("pose", t, {"x": 0 * t, "y": 0 * t, "psi": 0.1 * t}).save(tmp_path / "pose.csv")
    c = np.arange(0.5, 3.5, 0.05)
    lift = np.where((c > 1.0) & (c < 3.0), 1375.0, 1000.0)
    Log("cmd", c, {"pwm_left": np.full(c.size, 1200.0), "pwm_lift": lift}).save(tmp_path / "cmd.csv")
    (tmp_path / "bench.csv").write_text("pwm,gram\n1100,2\n1200,8\n1300,16\n")
    return tmp_path


def test_pose_and_commands_join_and_pulses_become_newton(run):
    log = gather(
        f"{run}/pose.csv+{run}/cmd.csv", ["left"], bench=BenchTable.from_csv(run / "bench.csv", fans=2)
    )
    assert log["left"] == pytest.approx(np.full(len(log), 0.004 * 9.80665))
    assert log.time[0] == pytest.approx(0.5, abs=0.02)


def test_only_the_stretch_where_the_craft_floats_is_kept(run):
    log = gather(
        f"{run}/pose.csv+{run}/cmd.csv", ["pwm_left"], only_while=Condition.parse("pwm_lift>1000"), settle=0.5
    )
    assert log.time[0] == pytest.approx(1.55, abs=0.06)
    assert log.time[-1] == pytest.approx(2.98, abs=0.06)


@pytest.mark.parametrize("files", ["pose.csv", "pose.csv+cmd.csv"])
def test_time_is_a_column_for_a_condition_too(run, files):
    files = "+".join(f"{run}/{name}" for name in files.split("+"))
    log = gather(files, only_while=Condition.parse("time>2"))
    assert log.time[0] == pytest.approx(2.02, abs=0.011) and len(log) > 50


def test_a_file_whose_name_has_a_plus_is_one_file(run):
    (run / "a+b.csv").write_text((run / "pose.csv").read_text())
    assert len(gather(str(run / "a+b.csv"))) == 200


def test_columns_are_looked_up_in_the_file_that_has_them(run):
    text = (run / "cmd.csv").read_text().replace('"time"', '"stamp"')
    (run / "cmd.csv").write_text(text)
    log = gather(f"{run}/pose.csv+{run}/cmd.csv", ["pwm_left"], columns={"time": "stamp"})
    assert log.has("pwm_left", "psi")


@pytest.mark.parametrize(
    ("condition", "said"),
    [
        ("pwm_lift>2000", "pwm_lift > 2000 holds in no row"),
        ("pwm_lift=>1", "expected a condition like 'pwm_lift>1000', found 'pwm_lift=>1'"),
        ("pwm_lft>1", "no column 'pwm_lft'; did you mean 'pwm_lift'?"),
        ("pwm_lift>1e", "expected a condition"),
    ],
)
def test_a_wrong_condition_is_refused(run, condition, said):
    with pytest.raises(InputError) as refused:
        gather(f"{run}/pose.csv+{run}/cmd.csv", ["pwm_left"], only_while=Condition.parse(condition))
    assert said in str(refused.value)


def test_three_files_for_one_run_are_refused(run):
    with pytest.raises(InputError, match="two files, found 3"):
        gather(f"{run}/pose.csv+{run}/cmd.csv+{run}/cmd.csv")


def test_a_missing_pulse_column_is_named(run):
    with pytest.raises(InputError, match="no column 'pwm_rigth'"):
        gather(f"{run}/pose.csv+{run}/cmd.csv", ["rigth"], bench=BenchTable.from_csv(run / "bench.csv"))


def test_gaps_are_bridged_and_counted_though_commands_came_meanwhile(run):
    log = gather(f"{run}/pose.csv")
    log.select((log.time < 1.0) | (log.time > 1.26)).save(run / "pose.csv")
    with pytest.warns(
        UserWarning,
        match=r"pose\.csv: 1 gap of 0\.3 s, .*by the model; the median interval between rows is 0\.02 s",
    ):
        joined = gather(f"{run}/pose.csv+{run}/cmd.csv")
    within = (joined.time > 0.99) & (joined.time < 1.27)
    assert joined["pwm_lift"][within].tolist() == [1375.0]  # it changed in the gap, at its own time
    assert np.isnan(joined["psi"][within]).all()


def test_a_log_with_more_gap_than_rows_is_refused(run):
    log = gather(f"{run}/pose.csv")
    log.select((log.time < 1.0) | (log.time > 3.5)).save(run / "pose.csv")
    with pytest.raises(InputError, match=r"pose\.csv: 1 gap of 2\.5\d s, .* and only 1\.4\d? s remain"):
        gather(f"{run}/pose.csv")


@pytest.fixture
def topics(tmp_path):
    """Two topics of one log that name their columns alike."""
    for name, late, size in (("rate", 0, 1.0), ("torque", 10, 57.0)):
        rows = [f"{20_000 * k + late},{20_000 * k},{k},{size * k % 7}" for k in range(100)]
        (tmp_path / f"{name}.csv").write_text("\n".join(["stamp,stamp_sample,xyz[0],xyz[1]", *rows]))
    return f"{tmp_path}/rate.csv+{tmp_path}/torque.csv"


def read_topics(topics, **columns):
    columns = {"time": "stamp:us", **columns}
    return gather(topics, {"fan": "rad"}, columns=columns, motion=False)


def test_a_column_of_both_files_may_be_named_with_its_file(topics):
    log = read_topics(topics, r="rate.csv:xyz[1]", fan="torque.csv:xyz[1]:deg")
    sampled = np.isfinite(log["r"])  # from the first command on
    assert log["r"][sampled][:3].tolist() == [1.0, 2.0, 3.0]
    assert np.degrees(log["fan"][sampled][:3]) == pytest.approx([57.0 % 7, 114.0 % 7, 171.0 % 7])
    assert log.has("stamp_sample", "xyz[0]")  # nobody wants them: those of the first file


def test_a_wanted_column_of_both_files_is_asked_for(topics):
    with pytest.raises(
        InputError,
        match=r"rate.csv: column 'xyz\[1\]', to be 'r', is also in .*torque.csv: name the file, --columns "
        r"r=rate.csv:xyz\[1\]",
    ):
        read_topics(topics, r="xyz[1]", fan="torque.csv:xyz[1]")
    with pytest.raises(InputError, match=r"no column 'torque.csv:xyz\[7\]'|no column 'xyz\[7\]'"):
        read_topics(topics, fan="torque.csv:xyz[7]")


def test_an_input_of_the_same_name_in_both_files_is_asked_for(run):
    (run / "pose.csv").write_text((run / "pose.csv").read_text().replace('"y"', '"pwm_left"'))
    with pytest.raises(InputError, match=r"pose.csv: column 'pwm_left' is also in cmd.csv: name the file"):
        gather(f"{run}/pose.csv+{run}/cmd.csv", ["pwm_left"], columns={"y": "psi", "psi": "x"}, motion=False)
    columns = {"pwm_left": "cmd.csv:pwm_left"}
    log = gather(f"{run}/pose.csv+{run}/cmd.csv", ["pwm_left"], columns=columns, motion=False)
    assert set(log["pwm_left"]) == {1200.0}


def test_blank_commands_of_a_file_hold(run):
    lines = (run / "cmd.csv").read_text().splitlines()
    lines[20:30] = [line.split(",")[0] + ",," for line in lines[20:30]]
    (run / "cmd.csv").write_text("\n".join(lines))
    log = gather(f"{run}/pose.csv+{run}/cmd.csv", ["pwm_left"], only_while=Condition.parse("pwm_lift>1000"))
    assert not np.isnan(log["pwm_left"]).any() and log.missing("pwm_left") == 10
    assert log.time[-1] - log.time[0] > 1.8
