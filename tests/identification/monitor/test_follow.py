"""Live rows: whatever is wrong with them is said, and a change is found nevertheless."""

import json
import math
import os
import threading
import time
from itertools import pairwise

import numpy as np
import pytest
from jsonschema import Draft202012Validator

import hovercontrol as hc
from hovercontrol.app.schema import schema
from hovercontrol.base.errors import InputError
from hovercontrol.identification.monitor.clock import Clock, Row
from hovercontrol.identification.monitor.follow import follow, json_line
from hovercontrol.identification.monitor.lines import LONGEST, Lines, growing_lines, lines_of
from hovercontrol.identification.monitor.rows import Rows
from tests.identification.monitor.cart import PERIOD, cart_monitor, log

EVENT = Draft202012Validator(schema("monitor_event"))


def cells(seed=1, drag=0.3):
    """Return the header and the rows of a log whose drag grows at 30 s, as text."""
    run = log(seed=seed, drag=drag)
    rows = zip(run.time.tolist(), run["p"].tolist(), run["F"].tolist(), strict=True)
    return [["time", "p", "F"], *([f"{t:.10g}", f"{p:.8g}", f"{F:g}"] for t, p, F in rows)]


def told(lines, columns=None, **given):
    """Return the events of lines; each fits the schema."""
    events = list(follow(cart_monitor(), lines, columns or {}, "a pipe", 5.0, **given))
    for event in events:
        assert list(EVENT.iter_errors(json.loads(json_line(event)))) == []
    return events


def text(rows):
    return [f"{','.join(row)}\n" for row in rows]


def kinds(events):
    return [e["event"] for e in events[1:-1]]


def names(events):
    """Return what is named without a rival."""
    return [e["name"] for e in events if e["event"] == "named" and not e["rivals"]]


def at(begin, end, column, value):
    """Return a change of cells: `value` is text, or a function of the number that stands there."""

    def change(rows):
        for row in rows[1 + begin : 1 + end]:
            row[column] = value if isinstance(value, str) else f"{value(float(row[column])):.12g}"
        return rows

    return change


TIME, POSITION, FORCE, ALL = 0, 1, 2, 600


@pytest.mark.parametrize("stamp", ["1e9", "0", "-5", "17", "1e300", "5.9"])
@pytest.mark.parametrize("row", [60, 0])
def test_one_absurd_stamp_is_left_out_and_nothing_begins_anew(stamp, row):
    events = told(text(at(row, row + 1, TIME, stamp)(cells())))
    end = events[-1]
    if row == 0 and float(stamp) <= 0.0:  # an early first row: a gap after it
        assert end["late_rows"] <= 1 and end["restarts"] <= 1
    else:
        assert (end["late_rows"], end["restarts"], kinds(events)[0]) == (1, 0, "clock")
    assert names(events) == ["c"] and end["alarms"] == 1


@pytest.mark.parametrize(
    ("begin", "change", "events", "restarts"),
    [
        (200, lambda t: t - 20.0, ["restart"], 1),
        (200, lambda t: t - 3.0, ["restart"], 1),
        (200, lambda t: t + 7200.0, ["restart"], 1),
        (200, lambda t: 1e9 * t, ["clock", "restart"], 1),
        (0, lambda t: 1e3 * t, ["clock"], 0),
        (0, lambda t: 1e6 * t + 1.7e15, ["clock"], 0),
        (0, lambda t: 1e9 * t, ["clock"], 0),
        (0, lambda t: t + 1.7e9, [], 0),
    ],
)
def test_another_clock_is_said_at_once_and_the_change_is_found_on_it(begin, change, events, restarts):
    found = told(text(at(begin, ALL, TIME, change)(cells())))
    assert kinds(found)[: len(events) + 1] == [*events, "alarm"] and names(found) == ["c"]
    assert found[-1]["restarts"] == restarts and found[-1]["late_rows"] == 0


def test_a_unit_that_is_given_is_not_doubted():
    """Rows 200 times as far apart as is usual are a slow log, if their unit is known."""
    clock = Clock(0.1, 0.1)
    clock.in_seconds = True
    rows = [row for k in range(9) for row in clock.take(20.0 * k, {"p": float(k)})]
    assert [row.time for row in rows if isinstance(row, Row)] == [20.0 * k for k in range(8)]


def test_rows_of_one_time_are_one_row_if_they_do_not_contradict():
    both = cells()
    halves = [both[0]]
    for t, p, F in both[1:]:
        halves += [[t, p, ""], [t, "", F]]
    whole, split = told(text(both)), told(text(halves))
    assert [e | {"rows": 0} for e in split[1:]] == [e | {"rows": 0} for e in whole[1:]]
    doubled = [row for row in both for _ in range(2)][1:]
    end = told(
        text([doubled[0], *([t, str(float(p) + k % 2), F] for k, (t, p, F) in enumerate(doubled[1:]))])
    )
    assert end[-1]["late_rows"] == 600 and names(end) == ["c"]


@pytest.mark.parametrize(
    ("change", "bad"),
    [
        (at(60, 61, FORCE, "1e308"), 1),
        (at(60, 61, FORCE, "-inf"), 1),
        (at(60, 66, POSITION, "1e308"), 6),
        (at(60, 61, POSITION, "0.1.2"), 1),
        (at(60, 66, POSITION, "ERR"), 6),
        (at(60, 61, TIME, "nan"), 1),
        (at(60, 61, TIME, "\ufffd6"), 1),
        (lambda rows: [*rows[:60], ["6.0", "1"], *rows[61:]], 1),
        (lambda rows: [*rows[:60], [*rows[60], "1"], *rows[61:]], 1),
        (lambda rows: [*rows[:60], ["no link"], ["link lost", "retry"], *rows[60:]], 2),
    ],
)
def test_a_damaged_row_is_counted_and_told_and_raises_no_alarm(change, bad):
    events = told(text(change(cells())), sizes={"p": 8.0, "F": 2.0})
    assert kinds(events)[0] == "bad" and events[-1]["bad_rows"] == bad
    assert names(events) == ["c"] and events[-1]["alarms"] == 1 and events[-1]["restarts"] == 0


def test_without_a_sound_log_equations_that_give_no_number_begin_anew():
    events = told(text(at(60, 61, FORCE, "1e308")(cells())))
    assert kinds(events)[0] == "restart" and names(events) == ["c"] and events[-1]["restarts"] == 1


def test_faults_of_many_rows_are_told_ten_times_less_each_time():
    events = told(text(at(60, 260, POSITION, "ERR")(cells())))
    assert [e["rows"] for e in events if e["event"] == "bad"] == [1, 10, 100]
    assert [e["name"] for e in events if e["event"] in ("dead", "back")] == ["p", "p"]
    assert names(events) == ["c"]


@pytest.mark.parametrize(("begin", "end"), [(0, 600), (0, 100), (100, 200), (100, 600)])
def test_a_command_that_is_lost_is_dead_and_no_change_of_the_craft(begin, end):
    events = told(text(at(begin, end, FORCE, "nan")(cells(drag=0.0))))
    assert [(e["event"], e["name"]) for e in events[1:-1]] == [("dead", "F"), ("back", "F")][
        : 1 + (end < 600)
    ]
    assert events[1]["since"] == pytest.approx(PERIOD * max(begin - 1, 0))
    (alarm,) = hc.replay(
        cart_monitor(), at_log(log(), slice(begin, end), F=math.nan)
    ).alarms  # a log that is read says the same
    assert (alarm.kind, alarm.name) == ("dead", "F")


def at_log(run, rows, **values):
    columns = {name: np.array(column) for name, column in run.columns.items()}
    for name, value in values.items():
        columns[name][rows] = value
    return hc.Log(run.name, run.time, columns)


def test_a_command_that_is_logged_when_it_changes_holds():
    rows = cells()
    for before, row in reversed(list(pairwise(rows[1:]))):
        row[FORCE] = "" if row[FORCE] == before[FORCE] else row[FORCE]
    events = told(text(rows))
    assert kinds(events) == ["alarm", "named"] and names(events) == ["c"]


def test_rows_that_are_missing_with_their_commands_are_no_change():
    """The force changes its sign within the gap, which nobody saw."""
    rows = cells(drag=0.0)
    events = told(text([*rows[:150], *rows[182:]]))
    assert kinds(events) == ["restart"] and "no rows" in events[1]["text"]


def stamped(rows, stamp):
    return [[stamp(float(row[TIME])), *row[1:]] for row in rows[1:]]


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (lambda rows: text([*rows[:100], rows[0], *rows[100:]]), []),
        (lambda rows: text([*rows[:100], *([r[2], r[0], r[1]] for r in (rows[0], *rows[100:]))]), ["header"]),
        (lambda rows: text([*(["x", *r] for r in rows[:100]), *rows[:1], *rows[100:]]), ["header"]),
        (lambda rows: ["\ufeff" + text(rows)[0].replace("\n", "\r\n"), *text(rows)[1:]], []),
        (lambda rows: ["Boot 1.2\n", "ready, steady\n", *text(rows)], []),
        (lambda rows: ["# " + text(rows)[0], *text(rows)[1:]], []),
        (lambda rows: [",".join(f'"{c}"' for c in row) for row in rows], []),
        (lambda rows: [line.replace(",", "\t").replace(".", ",") for line in text(rows)], []),
        (lambda rows: text([rows[0], ["ms", "m", "N"], *stamped(rows, lambda t: f"{1e3 * t:g}")]), []),
        (lambda rows: text([rows[0], *stamped(rows, lambda t: f"2026-01-31T12:00:{t:06.3f}")]), []),
    ],
    ids=["again", "reordered", "fewer", "crlf", "boot", "comment", "quotes", "commas", "units", "dates"],
)  # fmt: skip
def test_a_header_is_a_header_wherever_and_however_it_stands(lines, said):
    events = told(lines(cells()))
    assert kinds(events) == [*said, "alarm", "named"] and names(events) == ["c"]
    assert events[-1]["bad_rows"] == events[-1]["late_rows"] == 0


@pytest.mark.parametrize("at_row", [1, 100])
@pytest.mark.parametrize("line", ["sensor,time,out", "boot,ok,v1", "abc,def,ghi", "time,F,w"])
def test_a_line_that_lacks_columns_is_one_bad_row_and_the_header_stays(line, at_row):
    rows = text(cells())
    events = told([*rows[:at_row], f"{line}\n", *rows[at_row:]])
    assert kinds(events) == ["bad", "alarm", "named"] and names(events) == ["c"]
    assert events[-1]["bad_rows"] == 1 and events[-1]["restarts"] == 0


def test_rows_below_a_header_with_a_unit_of_another_quantity_are_left_out():
    rows = cells()
    events = told(text([*rows[:100], ["time", "p [N]", "F"], *rows[100:]]))
    assert kinds(events)[:2] == ["header", "bad"] and "dead" in kinds(events)
    assert events[-1]["bad_rows"] == 501


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (["0,1,2\n"], "a pipe: expected a header with"),
        ([], "a pipe: expected a header with"),
        (["time,p,p,F\n"], "two columns 'p'"),
        (
            ["time,p,F\n", *(f"0,{k},0\n" for k in range(30))],
            "no row can be used: 0 are damaged, and the",
        ),
    ],
)
def test_what_gives_no_row_at_all_is_one_line(lines, said):
    with pytest.raises(InputError, match=said):
        told(lines)


# ---- pipes and files -----------------------------------------------------------------------------------


def test_a_line_without_end_takes_no_memory_and_is_one_bad_row():
    lines, found = Lines(), []
    for block in (b"time,p\n0", b",1\n", *(b"1" * 2**16 for _ in range(40)), b"\n1,2", b"\xff\n3"):
        found += lines.take(block)
        assert len(lines._part) <= LONGEST
    found += lines.end()
    assert found == ["time,p\n", "0,1\n", "1" * 40 + "...", "1,2\ufffd\n", "3"]
    rows = Rows(["p"], {}, {"p": "m"}, "a pipe")
    assert [len(list(rows.take(line))) for line in found] == [0, 1, 1, 1, 0] and rows.bad.total == 3


def test_a_pipe_gives_its_lines_as_they_come_and_none_while_nothing_comes():
    out, into = os.pipe()
    with os.fdopen(out) as stream, os.fdopen(into, "wb", buffering=0) as pipe:
        lines = lines_of(stream)
        pipe.write(b"a\nb")
        assert [next(lines), next(lines)] == ["a\n", None]
        pipe.write(b"c\nd")
        pipe.close()
        assert [line for line in lines if line] == ["bc\n", "d"]


def test_a_source_that_falls_silent_is_dead_by_the_clock_on_the_wall(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    rows = text(cells(drag=0.0))

    def lines():
        for passed, some in ((2.0, rows[:200]), (3.0, rows[200:400]), (0.5, rows[400:])):
            now[0] += passed
            yield None
            yield from some

    events = told(lines())
    assert [(e["event"], e["name"]) for e in events[1:-1]] == [("dead", "p"), ("back", "p")] * 2
    first, _, dead, _ = events[1:-1]
    assert first["time"] is None and dead["since"] == pytest.approx(19.8, abs=PERIOD)
    assert dead["time"] == pytest.approx(19.8 + 3.0, abs=PERIOD)


def given(lines, count):
    """Return the next lines and notes, at most some; those that follow are not awaited."""
    found = []
    while len(found) < count:
        line = next(lines)
        if line is not None:
            found.append(line if isinstance(line, str) else line.event)
    return found


@pytest.fixture
def growing(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("time,p\n0.0,1")
    lines = growing_lines(path)
    yield path, lines
    lines.close()


def test_a_growing_file_is_read_to_its_last_whole_line(growing):
    path, lines = growing
    assert given(lines, 1) == ["time,p\n"]

    def more():
        with path.open("a") as file:
            file.write(".5\n0.1,2\n")

    timer = threading.Timer(0.15, more)
    timer.start()
    assert given(lines, 2) == ["0.0,1.5\n", "0.1,2\n"]
    timer.join()


def test_a_log_that_is_rotated_is_followed_by_its_name(growing):
    path, lines = growing
    assert given(lines, 1) == ["time,p\n"]
    os.rename(path, path.with_suffix(".1"))
    assert next(lines) is None
    path.touch()
    with path.with_suffix(".1").open("a") as old:  # its writer has not noticed yet
        old.write("\n0.1,2\n")
    assert given(lines, 2) == ["0.0,1\n", "0.1,2\n"]
    path.write_text("time,p\n0.2,3\n")
    assert given(lines, 3) == ["file", "time,p\n", "0.2,3\n"]


@pytest.mark.parametrize("content", ["0.1,2\n", "0.1,2\n0.2,3\n0.3,4\n0.4,5\n"])
def test_a_log_that_is_emptied_and_goes_on_is_read_from_its_start(growing, content):
    path, lines = growing
    assert given(lines, 1) == ["time,p\n"]
    path.write_text(content)  # shorter, or longer than what was read
    assert given(lines, 3) == ["0.0,1...", "file", "0.1,2\n"]
