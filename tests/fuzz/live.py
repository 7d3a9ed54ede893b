"""Rows as they come from a pipe, damaged in every way: no false alarm, and no missing one, without a word."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

from jsonschema import Draft202012Validator

from hovercontrol.app.schema import schema
from hovercontrol.identification.monitor.follow import follow, json_line
from hovercontrol.identification.monitor.lines import Lines
from tests.fuzz import mutate
from tests.fuzz.judge import Broken, call
from tests.identification.monitor.cart import cart_monitor, log

Cells = list[list[str]]

#: What is wrong with rows, told by an event of its own.
FAULTS = {"bad", "clock", "restart", "header", "dead"}

#: Most lines of one log: faults are told for the 1st, 10th and 100th row of a kind, alarms are few.
MOST = 150


@cache
def _cells(seed: int, drag: float) -> Cells:
    run = log(seed=seed, drag=drag)
    rows = zip(run.time.tolist(), run["p"].tolist(), run["F"].tolist(), strict=True)
    return [["time", "p", "F"], *([f"{t:.10g}", f"{p:.8g}", f"{F:g}"] for t, p, F in rows)]


def live_rows(rng: Random, folder: Path) -> int:
    """Follow a damaged stream of a cart whose drag changes at 30 s, or does not."""
    drag = rng.choice((0.0, 0.3))
    rows = [list(row) for row in _cells(rng.randrange(8), drag)]
    for _ in range(rng.choice((0, 1, 1, 2, 3))):
        rows = rng.choice(WAYS)(rng, rows)
    raw = "".join(f"{','.join(row)}\n" for row in rows).encode(errors="surrogatepass")
    damaged = rng.random() < 0.2
    if damaged:
        raw = mutate.data(rng, raw)
    events: list[dict[str, Any]] = []
    status = call(lambda: events.extend(follow(cart_monitor(), _lines(raw), {}, "a pipe", 5.0, sizes=SIZES)))
    check = Draft202012Validator(schema("monitor_event"))
    for event in events:
        if list(check.iter_errors(json.loads(json_line(event)))):
            raise Broken(f"not of the schema: {event}")
    if len(events) > MOST:
        raise Broken(f"{len(events)} lines")
    if status:
        return status
    told = [k for k, event in enumerate(events) if event["event"] in FAULTS]
    alarms = [k for k, event in enumerate(events) if event["event"] == "alarm"]
    if not drag and alarms and not damaged and (not told or told[0] > alarms[0]):
        raise Broken(f"a false alarm without a word: {events[alarms[0]]}")
    if drag and not alarms and not told and not damaged:
        raise Broken("the change is not found, without a word")
    return 1 if alarms else 0


SIZES = {"p": 8.0, "F": 2.0}


def _lines(raw: bytes) -> Any:
    lines = Lines()
    yield from lines.take(raw)
    yield from lines.end()


# ---- what happens to rows ------------------------------------------------------------------------------


def _cell(rng: Random, rows: Cells) -> Cells:
    """Put something else into a cell, or into that column of some rows."""
    begin, column = rng.randrange(len(rows)), rng.randrange(3)
    value = rng.choice([text for text in mutate.NUMBERS if column < 2 or not _is_force(text)])
    for row in rows[begin : begin + rng.choice((1, 1, 2, 30, 300))]:
        row[column : column + 1] = [value]
    return rows


def _is_force(text: str) -> bool:
    """Return whether a text is a force that the cart may have had: who can know that it had not?"""
    try:
        return abs(float(text)) <= 1000.0 * SIZES["F"]
    except ValueError:
        return False


def _clock(rng: Random, rows: Cells) -> Cells:
    """Let the clock jump, or go on in another unit; a short jump ahead cannot be told from a gap."""
    shift, scale = rng.choice((0.0, -20.0, -0.35, 7200.0, 1.7e9)), rng.choice((1.0, 1.0, 1e3, 1e6, 1e9))
    begin = rng.choice((1, rng.randrange(1, len(rows))))
    for row in rows[begin : begin + rng.choice((1, 2, 1000, 1000))]:
        row[:1] = [_changed(cell, lambda t: scale * (t + shift)) for cell in row[:1]]
    return rows


def _changed(cell: str, change: Any) -> str:
    try:
        return f"{change(float(cell)):.12g}"
    except ValueError:
        return cell


def _order(rng: Random, rows: Cells) -> Cells:
    """Leave rows out, give them twice, or in another order."""
    begin, count = rng.randrange(1, len(rows)), rng.choice((1, 2, 5, 40))
    part, kind = rows[begin : begin + count], rng.randrange(4)
    new = [[], [*part, *part], part[::-1], [row for row in part for _ in range(2)]][kind]
    return [*rows[:begin], *map(list, new), *rows[begin + count :]]


def _header(rng: Random, rows: Cells) -> Cells:
    """Let the table go on below another header, of other columns."""
    begin, order = rng.randrange(1, len(rows)), rng.sample(range(3), 3)
    if rng.random() < 0.5:
        return [*rows[:begin], list(rows[0]), *rows[begin:]]
    return [*rows[:begin], *([row[k] for k in order if k < len(row)] for row in (rows[0], *rows[begin:]))]


def _line(rng: Random, rows: Cells) -> Cells:
    """Put a line of text between the rows, or cut and join rows."""
    begin, kind = rng.randrange(1, len(rows)), rng.randrange(3)
    if kind == 0:
        return [*rows[:begin], [rng.choice(mutate.TEXTS)], *rows[begin:]]
    if kind == 1:
        return [*rows[:begin], rows[begin][: rng.randrange(3)], *rows[begin + 1 :]]
    return [*rows[:begin], [cell for row in rows[begin : begin + 2] for cell in row], *rows[begin + 2 :]]


WAYS = (_cell, _cell, _clock, _clock, _order, _header, _line)
