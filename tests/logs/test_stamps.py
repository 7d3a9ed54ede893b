"""Time of dates and of stamps of an epoch counts from the first row, to the nanosecond."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest

from hovercontrol.base.errors import ArgumentError, InputError
from hovercontrol.logs import join_logs, read_log
from hovercontrol.logs.gather import gather

FIRST = 1_732_647_600_999_999_999

#: One nanosecond and 20 ms after the first stamp.
STEPS = [0, 1, 20_000_000]

FORMS = {
    "sec+nanosec": ("sec+nanosec", lambda k: f"{k // 10**9},{k % 10**9}", "sec,nanosec"),
    "units": ("a:s+b:ns", lambda k: f"{k // 10**9},{k % 10**9}", "a,b"),
    "secs+nsecs": ("h.secs+h.nsecs", lambda k: f"{k // 10**9},{k % 10**9}", "h.secs,h.nsecs"),
    "ns": ("t:ns", str, "t"),
    "ns by its size": ("t", str, "t"),
    "s": ("t:s", lambda k: f"{k // 10**9}.{k % 10**9:09}", "t"),
    "ms": ("t:ms", lambda k: f"{k // 10**6}.{k % 10**6:06}", "t"),
    "s by its size": ("t", lambda k: f"{k // 10**9}.{k % 10**9:09}", "t"),
    "a date": ("t", lambda k: f"2024-11-26T19:00:0{k // 10**9 - 1732647600}.{k % 10**9:09}Z", "t"),
    "a date with a blank": ("t", lambda k: f"2024-11-26 20:00:0{k // 10**9 - 1732647600}.{k % 10**9:09}+01:00", "t"),  # noqa: E501
    "a time of day": ("t", lambda k: f"19:00:0{k // 10**9 - 1732647600}.{k % 10**9:09}", "t"),
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
def test_differences_of_stamps_are_exact(tmp_path: Path, form: str) -> None:
    said, text, names = FORMS[form]
    rows = [f"{text(FIRST + step)},0,0,0" for step in STEPS]
    (tmp_path / "a.csv").write_text("\n".join([f"{names},x,y,psi", *rows]))
    log = read_log(tmp_path / "a.csv", {"time": said})
    assert log.time.tolist() == [0.0, 1e-9, 0.02]
    assert log.origin == FIRST or form == "a time of day"


@pytest.mark.parametrize(
    "kind", [pa.int64(), pa.timestamp("ns"), pa.timestamp("ns", "UTC"), pa.decimal128(20)]
)
def test_stamps_in_parquet_are_exact(tmp_path: Path, kind: pa.DataType) -> None:
    time = pa.array([FIRST + step for step in STEPS]).cast(kind)
    zeros = pa.array([0.0] * 3)
    pyarrow.parquet.write_table(
        pa.table({"t": time, **dict.fromkeys(("x", "y", "psi"), zeros)}), tmp_path / "a.pq"
    )
    said = "t:ns" if pa.types.is_integer(kind) or pa.types.is_decimal(kind) else "t"
    assert read_log(tmp_path / "a.pq", {"time": said}).time.tolist() == [0.0, 1e-9, 0.02]


def test_a_small_time_stays_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time,x,y,psi\n7,0,0,0\n8,0,0,0\n")
    log = read_log(tmp_path / "a.csv")
    assert log.time.tolist() == [7.0, 8.0] and log.origin == 0


def test_two_files_that_count_from_an_epoch_stay_on_one_clock(tmp_path: Path) -> None:
    second = 10**9
    pose = [f"{FIRST + k * second},{k},0,0" for k in range(6)]
    (tmp_path / "pose.csv").write_text("\n".join(["stamp,x,y,psi", *pose]))
    sent = [f"{FIRST + int((k + 0.5) * second)},{k}" for k in range(5)]
    (tmp_path / "fan.csv").write_text("\n".join(["stamp,fan", *sent]))
    columns = {"time": "stamp:ns"}
    log = gather(f"{tmp_path / 'pose.csv'}+{tmp_path / 'fan.csv'}", ["fan"], columns=columns)
    ours = join_logs(
        read_log(tmp_path / "pose.csv", columns), read_log(tmp_path / "fan.csv", columns, motion=False)
    )
    assert np.array_equal(log.time, ours.time)
    changes = {t: f for t, f in zip(log.time, log["fan"], strict=True)}
    assert changes[1.0] == 0.0 and changes[1.5] == 1.0 and changes[4.0] == 3.0


@pytest.mark.parametrize(
    ("text", "said", "error"),
    [
        ("t,x,y,psi\n2024-01-31T00:00:00,0,0,0\n2024-01-32T00:00:00,0,0,0\n", "t",
         "line 3, column 't': expected a time as ISO 8601 writes it"),
        ("t,x,y,psi\nlate,0,0,0\nlater,0,0,0\n", "t", "line 2, column 't': expected a time .*found 'late'"),
        ("t,x,y,psi\n1732647600.5,0,0,0\n1732647600.5,1,0,0\n", "t", "line 3, column 't': time repeats"),
        ("sec,nsec,x,y,psi\n5,1,0,0,0\n", "sec+nanosec", "no column 'nanosec' to read 'time' from"),
        ("sec,b,x,y,psi\n5,1,0,0,0\n", "sec+b:deg", "one of s, ms, us, ns, week, day for 'b', found 'deg'"),
    ],
)  # fmt: skip
def test_a_stamp_that_cannot_be_is_told(tmp_path: Path, text: str, said: str, error: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises((InputError, ArgumentError), match=error):
        read_log(tmp_path / "a.csv", {"time": said})


def test_times_of_day_go_on_after_midnight(tmp_path: Path) -> None:
    of_day = [f"{h:02d}:59:59.{k}" for h in (22, 23) for k in (5, 9)]
    of_day = [*of_day[2:], "00:00:00.25", "", "00:00:01", "12:00:01", "23:59:00", "00:00:00"]
    rows = [f"{text},{k}" for k, text in enumerate(of_day) if text]
    (tmp_path / "a.csv").write_text("\n".join(["time,x", *rows]))
    day = 86400.0
    expected = [0.0, 0.4, 0.75, 1.5, day / 2 + 1.5, day - 59.5, day + 0.5]
    assert np.allclose(read_log(tmp_path / "a.csv").time, expected, atol=1e-9)
