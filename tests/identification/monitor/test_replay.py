"""Logs of a cart in exact steps, replayed through a monitor: names, sizes, times, lost samples."""

import json
import math

import numpy as np
import pytest
from jsonschema import Draft202012Validator

import hovercontrol as hc
from hovercontrol.app.schema import schema
from hovercontrol.base.errors import InputError
from hovercontrol.identification.monitor.alarms import Alarm
from hovercontrol.identification.monitor.follow import follow
from hovercontrol.identification.monitor.rows import Rows
from tests.identification.monitor.cart import PERIOD, cart_monitor, log


@pytest.fixture(scope="module")
def watch():
    return cart_monitor()


def changed(run, **columns):
    return hc.Log(run.name, run.time, {**run.columns, **columns})


def test_a_change_is_named_with_its_size_and_time(watch):
    found = hc.replay(watch, log(drag=0.3))
    (alarm,) = found.alarms  # it is put into the monitor, so that it is told once
    assert (alarm.name, alarm.kind, alarm.unit, alarm.rivals) == ("c", "change", "1/s", ())
    assert 30.0 < alarm.time < 34.0 and abs(alarm.since - 30.0) < 2.0
    assert abs(alarm.change - 0.3) < 0.05 and 0 < alarm.std < 0.05
    assert found.evidence["c"].max() > found.threshold > found.evidence["c"][found.time < 30.0].max()


def test_a_bias_of_the_sensor_is_named_once(watch):
    (alarm,) = hc.replay(watch, log(bias=0.2)).alarms
    assert (alarm.name, alarm.kind, alarm.unit) == ("p_bias", "bias", "m")
    assert abs(alarm.change - 0.2) < 0.03 and abs(alarm.since - 30.0) < 2.0


def test_nothing_changed_is_one_line(watch):
    found = hc.replay(watch, log())
    assert found.alarms == () and found.text().splitlines()[1:] == ["cart.csv: nothing changed in 59.9 s"]
    assert "the monitor knows no errors of its coefficients" in found.text()


def test_lost_late_and_jittering_samples_are_no_alarm(watch, rng):
    run = log()
    p = np.where(rng.uniform(size=run.time.size) < 0.3, np.nan, run["p"])
    jitter = hc.Log("cart.csv", run.time + rng.uniform(-0.004, 0.004, run.time.size), {"p": p, "F": run["F"]})
    assert hc.replay(watch, jitter).alarms == ()
    some = np.sort(rng.choice(run.time.size, 400, replace=False))
    assert hc.replay(watch, run.select(some)).time[-1] == pytest.approx(run.time[some[-1]], abs=PERIOD)


@pytest.mark.parametrize("seed", range(8))
def test_rows_that_are_lost_with_their_commands_are_no_alarm(watch, seed):
    """The force changes its sign in some of them: when, nobody knows."""
    lost = np.random.default_rng(seed).uniform(size=600) < 0.1
    assert hc.replay(watch, log(seed=seed).select(~lost)).alarms == ()
    (alarm,) = hc.replay(watch, log(seed=seed, drag=0.3).select(~lost)).alarms
    assert alarm.name == "c" and abs(alarm.change - 0.3) < 3 * alarm.std < 0.15


@pytest.mark.parametrize("clock", [0.99, 0.999, 1.001, 1.01])
def test_a_clock_that_runs_at_another_rate_is_no_alarm(watch, clock):
    """After 50 to 500 rows its stamps are half a period off the ticks of the reference log."""
    run = log(120.0)
    assert hc.replay(watch, hc.Log("cart.csv", clock * run.time, run.columns)).alarms == ()


def test_a_first_stamp_that_is_off_by_half_a_period_is_no_alarm(watch):
    run = log()
    time = np.append(run.time[0] - 4.5 * PERIOD, run.time[1:])
    assert hc.replay(watch, hc.Log("cart.csv", time, run.columns)).alarms == ()


def test_a_silent_sensor_is_dead_from_its_last_sample_until_it_speaks(watch):
    run = log()
    silent = (run.time > 20.0) & (run.time < 24.05)
    found = hc.replay(watch, changed(run, p=np.where(silent, np.nan, run["p"])))
    (alarm,) = found.alarms
    assert (alarm.kind, alarm.name) == ("dead", "p")
    assert alarm.since == pytest.approx(20.0, abs=0.11) and alarm.last == pytest.approx(24.1, abs=0.11)
    assert "no samples of p since 20" in found.text() and "until 24.1 s" in found.text()


def test_after_a_long_gap_the_monitor_starts_anew(watch):
    early, late = log(20.0), log(60.0, seed=2, drag=0.3, start=1e6)
    both = hc.Log(
        "cart.csv",
        np.concatenate([early.time, late.time]),
        {k: np.concatenate([early[k], late[k]]) for k in ("p", "F")},
    )
    found = hc.replay(watch, both)
    assert found.restarts == 1 and found.time.size < 900
    assert "cart.csv: the time of rows goes from 19.9 s to 1000000 s: the monitor starts anew" in found.text()
    (alarm,) = found.alarms
    assert alarm.name == "c" and abs(alarm.since - 1e6 - 30.0) < 2.0


def lines_of(run, header="t_ms;pos;F"):
    yield "# a comment\n"
    yield f"{header}\n"
    for t, p, F in zip(run.time.tolist(), run["p"].tolist(), run["F"].tolist(), strict=True):
        yield f"{1000 * t:.1f};{100 * p!r};{F}\n"


COLUMNS = {"time": "t_ms:ms", "p": "pos:cm"}


def test_rows_as_they_come_say_what_the_replay_says(watch):
    run = log(drag=0.3)
    events = list(follow(watch, lines_of(run), COLUMNS, "a pipe", 5.0))
    (alarm,) = hc.replay(watch, run).alarms
    assert [e["event"] for e in events] == ["start", "alarm", "named", "end"]
    assert events[0]["columns"] == ["time", "p", "F"] and events[1]["time"] == alarm.time
    assert events[2]["name"] == "c" and events[2]["change"] == pytest.approx(alarm.change, rel=1e-6)
    assert events[3]["alarms"] == 1
    json.dumps(events, allow_nan=False)


def test_an_alarm_comes_with_its_row_not_later(watch):
    told = []

    def rows():
        for line in lines_of(log(drag=0.3)):
            if told and told[-1]["event"] == "alarm":
                return
            last.append(line)
            yield line

    last = []
    for event in follow(watch, rows(), COLUMNS, "a pipe", 5.0):
        told.append(event)
    when = next(e["time"] for e in told if e["event"] == "alarm")
    assert float(last[-1].split(";")[0]) / 1000 - when < 2.5 * PERIOD


def test_decimal_commas_and_units_in_the_header_are_read_as_in_a_log():
    columns = {"time": "Zeit", "F": "F (N):kN", "p": "p:-"}
    rows = Rows(["p", "F"], columns, {"p": "m", "F": "N"}, "a pipe")
    found = [list(rows.take(line)) for line in ("Zeit [ms];p [mm];F (N)\n", "0,0;1,5;2\n", "12,5;-3;0,5\r\n")]
    assert found == [[], [(0.0, {"p": -0.0015, "F": 2000.0})], [(0.0125, {"p": 0.003, "F": 500.0})]]


def test_times_that_are_no_numbers_are_one_line(watch):
    rows = ["time,p,F\n", *(f"12 h 0{k},0,0\n" for k in range(9))]
    with pytest.raises(InputError, match="a pipe: first 5 rows, time: expected a number, found '12 h 0"):
        list(follow(watch, iter(rows), {}, "a pipe", 5.0))


def test_the_result_fits_its_schema_and_its_files(watch, tmp_path):
    run = log(drag=0.3)
    found = hc.replay(watch, changed(run, p=np.where(run.time > 55.0, np.nan, run["p"])))
    files = {f.name for f in found.save(tmp_path / "out")}
    assert files == {"result.json", "timeline.csv", "timeline.png", "timeline.svg"}
    told = json.loads((tmp_path / "out" / "result.json").read_text())
    check = Draft202012Validator(schema("monitor"))
    assert list(check.iter_errors(told)) == [] and [a["kind"] for a in told["alarms"]] == ["change", "dead"]
    assert told["alarms"][1]["change"] is None
    table = np.genfromtxt(tmp_path / "out" / "timeline.csv", delimiter=",", names=True)
    assert table["evidence_c"].size == told["ticks"]
    assert "1/s" in found._repr_html_() and "no samples of p" in found._repr_html_()
    axes = found.plot().axes
    assert [label.get_text() for label in axes[1].get_yticklabels()] == ["c", "p"]


def test_an_alarm_says_size_error_unit_and_rivals():
    alarm = Alarm(31.2, "c", "change", -0.3123, 0.021, "1/s", 30.5, ("m",), 60.0, 36.2)
    assert str(alarm) == "31.2 s: c changed by -0.312 +- 0.021 1/s since 30.5 s; or m"
    assert math.isfinite(alarm.last)


@pytest.mark.parametrize(
    ("columns", "said"),
    [({"p": "P"}, "no column 'P' for 'p' in its header"), ({"p": "pos:kg"}, "column 'p', read as 'kg'")],
)
def test_a_wrong_header_is_one_line(watch, columns, said):
    with pytest.raises(InputError, match=said):
        list(follow(watch, lines_of(log(1.0)), {"time": "t_ms:ms", **columns}, "a pipe", 5.0))


def test_what_is_no_monitor_or_lacks_a_column_is_one_line(watch):
    with pytest.raises(InputError, match="'gusts' is not a monitor"):
        hc.replay(hc.Block("gusts"), log(1.0))
    with pytest.raises(InputError, match=r"log 'cart\.csv' has no column 'F'"):
        hc.replay(watch, hc.Log("cart.csv", [0.0, 0.1], {"p": [0.0, 0.0]}))
    with pytest.raises(InputError, match="hold"):
        hc.replay(watch, log(1.0), hold=0.0)


def test_a_log_that_ends_before_the_tests_begin_is_refused(watch):
    with pytest.raises(InputError, match=r"lasts 1\.9 s: the tests begin 2 s after the start"):
        hc.replay(watch, log(2.0))


def test_values_that_are_rounded_more_than_their_noise_allows_are_told(watch):
    """Rounding to q adds the variance q^2/12: (0.01^2 + 0.05^2/12)^(1/2) = 0.0176."""
    run = log(10.0)
    rounded = {q: changed(run, p=q * np.round(run["p"] / q)) for q in (0.05, 0.01)}
    said = hc.replay(watch, rounded[0.05]).text()
    assert "p is rounded to 0.05 m, so its noise is 0.018 m and not 0.01 m" in said
    assert "rounded" not in hc.replay(watch, rounded[0.01]).text() + hc.replay(watch, run).text()
