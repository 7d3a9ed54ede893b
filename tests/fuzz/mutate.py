"""Hostile and clumsy values, and texts and bytes changed at random."""

from __future__ import annotations

import math
from collections.abc import Sequence
from random import Random

NUMBERS = [
    "0",
    "-0.0",
    "1e300",
    "1e308",
    "-1e308",
    "1e309",
    "nan",
    "-nan",
    "inf",
    "-inf",
    "1e-320",
    "5e-324",
    "0x1F",
    "1_000",
    "9" * 30,
    "9" * 400,
    "1" * 4000,
    "1" * 5000,
    "",
    "1e",
    "--1",
    "1.5.2",
    "½",
    "１",
    "true",
    "2026-01-01",
    "-1",
    "3",
    "1e9",
    "1e-9",
    "1e15",
]
TEXTS = [
    "",
    " ",
    "\0",
    "a\0b",
    "\x1b[31m",
    "../x",
    "a" * 300,
    "a" * 5000,
    "ä",
    "\u202e",
    "name",
    "self",
    "value",
    "unit",
    "psi",
    "thrust",
    "__class__",
    "a.b",
    "a b",
    "%s",
    "{x}",
    "${HOME}",
    "\\",
    '"',
    "1/s*9**9**9",
    "(",
    "))",
    "m^999999999",
    "m**-1**-1",
    "m/s^2",
    "1",
    "//",
    "x[0]",
    "lambda",
    "for",
    "int",
    "sin",
    "nan",
    "e" * 99,
]
VALUES = [
    None,
    True,
    False,
    0,
    -1,
    3,
    2.5,
    math.nan,
    math.inf,
    -math.inf,
    1e308,
    1e-320,
    10**400,
    10**5000,
    1j,
    "",
    "x",
    b"x",
    [],
    [1, 2],
    [[1], [2, 3]],
    ["a"],
    (),
    {},
    {"a": 1},
    {1: 2},
    set(),
    object(),
    len,
    int,
    "a\0b",
    "\n",
    "x" * 500,
    [math.nan],
    [1e308] * 3,
    range(3),
    [None],
    {"": None},
    [True],
    "thrust",
    ["thrust"],
    {"thrust": "x"},
]


def text(rng: Random, base: str, tokens: Sequence[str] = (*NUMBERS, *TEXTS)) -> str:
    """Return a text with some of it removed, doubled, swapped or replaced."""
    for _ in range(rng.choice((1, 1, 1, 2, 3, 6))):
        lines = base.split("\n")
        k, kind = rng.randrange(len(lines)), rng.randrange(8)
        line = lines[k]
        if kind == 0:
            del lines[k]
        elif kind == 1:
            lines.insert(rng.randrange(len(lines)), line)
        elif kind == 2 and line:
            at = rng.randrange(len(line))
            lines[k] = (
                line[:at] + rng.choice(["", rng.choice(tokens), chr(rng.randrange(1, 300))]) + line[at + 1 :]
            )
        elif kind in (3, 4, 5):
            for mark in rng.sample([",", "=", " ", "."], 4):
                if mark in line:
                    parts = line.split(mark)
                    parts[rng.randrange(len(parts))] = rng.choice(tokens)
                    lines[k] = mark.join(parts)
                    break
        elif kind == 6:
            lines[k] = line + rng.choice(["[" * 5, ",", '"', "'''", "{", "\\", "\t;", "#", ",,,,"])
        else:
            j = rng.randrange(len(lines))
            lines[k], lines[j] = lines[j], lines[k]
        base = "\n".join(lines) or "\n"
    return base


def data(rng: Random, base: bytes) -> bytes:
    """Return bytes with some of them changed, cut out or cut off."""
    found = bytearray(base)
    for _ in range(rng.choice((1, 1, 2, 5, 20))):
        if not found:
            break
        at = rng.randrange(len(found))
        kind = rng.randrange(5)
        if kind < 2:
            found[at] = rng.randrange(256)
        elif kind == 2:
            del found[at : at + rng.randrange(1, 200)]
        elif kind == 3:
            found[at:at] = bytes(rng.randrange(256) for _ in range(rng.randrange(1, 20)))
        elif rng.random() < 0.3:
            del found[at:]
    return bytes(found)
