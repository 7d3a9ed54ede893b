"""The whole public API with each argument in turn replaced by something wrong: ``python -m tests.fuzz.walk``.

What an example of the documentation calls is called again, once for each argument and each wrong thing. It
may return; otherwise it must refuse in one line, within the time that counts as a hang.
"""

from __future__ import annotations

import argparse
import contextlib
import inspect
import os
import resource
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

import matplotlib
import numpy as np

from tests.fuzz.judge import LONGEST, Broken, call
from tests.fuzz.sound import Call, sound_calls


class Thing:
    """Something that no function of the package knows."""

    def __repr__(self) -> str:
        return "a thing"


#: What an argument is replaced by. A wrong thing is made anew for each call: what is called may change it.
WRONG: dict[str, Callable[[], Any]] = {
    "None": lambda: None,
    "text": lambda: "nonsense",
    "empty text": lambda: "",
    "number": lambda: 2.5,
    "nan": lambda: float("nan"),
    "inf": lambda: float("inf"),
    "negative": lambda: -3,
    "large": lambda: 1e300,
    "huge": lambda: 10**400,
    "complex": lambda: 1j,
    "empty list": lambda: [],
    "array of another shape": lambda: np.zeros((2, 3)),
    "array of NaN": lambda: np.full(4, np.nan),
    "ragged list": lambda: [[1.0], [2.0, 3.0]],
    "empty dict": dict,
    "dict": lambda: {"nonsense": 1.0},
    "dict of wrong things": lambda: {1: Thing()},
    "object": Thing,
    "class": lambda: Thing,
    "list of wrong things": lambda: [None, Thing()],
    "list of texts": lambda: ["nonsense"],
}

MEMORY = 8 * 2**30
"""Address space [bytes]: what asks for a size without bounds ends in MemoryError, not in swapping."""


@dataclass
class Count:
    """What the probes of a walk ended in."""

    probes: Counter[str] = field(default_factory=Counter)
    unnamed: list[str] = field(default_factory=list)
    broken: list[str] = field(default_factory=list)
    late: list[str] = field(default_factory=list)

    def total(self) -> int:
        return sum(self.probes.values())


def probes(sound: Call) -> Iterator[tuple[str, Callable[[], object]]]:
    """Yield what is changed, and the call."""
    parameters = inspect.signature(sound.function).parameters
    for argument in sound.given:
        parameter = parameters.get(argument)
        many = parameter is not None and parameter.kind is parameter.VAR_POSITIONAL
        called = argument == "progress" or "Callable" in str(getattr(parameter, "annotation", ""))
        for kind, make in WRONG.items():
            if not (called and kind == "class"):  # it can be called; what it says is its own
                yield f"{argument} = {kind}", _changed(sound, argument, make, many)


def _changed(sound: Call, argument: str, make: Callable[[], Any], many: bool) -> Callable[[], object]:
    return lambda: sound(**{argument: [make()] if many else make()})


def walk(calls: Mapping[str, Call], seconds: float = LONGEST, every: int = 1) -> Count:
    """Try every probe of every call, or each so-manieth; one may still be at work after `seconds`."""
    count = Count()
    with tempfile.TemporaryDirectory(prefix="hc-walk-") as folder, contextlib.chdir(folder), _bounded():
        for name, sound in calls.items():
            for what, probe in islice(probes(sound), sum(map(ord, name)) % every, None, every):
                said: list[str] = []
                try:
                    status = call(probe, seconds, said)
                    count.probes["refused" if status else "accepted"] += 1
                    if status and what.partition(" ")[0] not in said[0]:
                        count.unnamed.append(f"{name}: {what}: {said[0]}")
                except Broken as fault:
                    late = str(fault).startswith("hangs") and seconds < LONGEST
                    count.probes["at work" if late else "broken"] += 1
                    if late:
                        count.late.append(f"{name}: {what}")
                    else:
                        count.broken.append(f"{name}: {what}: {str(fault).strip()}")
    return count


@contextlib.contextmanager
def _bounded() -> Iterator[None]:
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def main() -> int:
    parser = argparse.ArgumentParser(description="Call everything public with each argument wrong in turn.")
    parser.add_argument("--only", default="", help="callables whose name has this in it")
    parser.add_argument("--patience", type=float, default=60.0, help="seconds for an example (default: 60)")
    parser.add_argument("--seconds", type=float, default=LONGEST, help="that a call may take")
    parser.add_argument("--all", action="store_true", help="print what took long, what names no argument")
    given = parser.parse_args()
    matplotlib.use("Agg")
    begin = time.monotonic()
    calls = sound_calls(given.patience, given.only)
    count = walk(calls, given.seconds)
    for line in [*count.broken, *(count.late + count.unnamed if given.all else ())]:
        print(line, end="\n\n")
    print(f"{len(calls)} callables, {sum(len(one.given) for one in calls.values())} arguments")
    print(f"{count.total()} probes in {time.monotonic() - begin:.0f} s: {dict(count.probes)}")
    print(f"{len(count.unnamed)} refusals name something else than the argument")
    return 1 if count.broken else 0


if __name__ == "__main__":
    status = main()
    sys.stdout.flush()
    os._exit(status)
