"""Where the time of a diagnosis goes: six fixed cases, each by itself, seconds of processor time by step.

``python -m benchmarks.diagnose_profile none gusts`` runs two of them; ``--wall`` prints seconds on the clock.
The first run on a machine compiles the models' libraries too.
"""

from __future__ import annotations

import argparse
import importlib
import json
import resource
import subprocess
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from functools import partial, wraps
from typing import Any

from benchmarks import real_craft
from hovercontrol.craft.models.modelfile import load_model
from hovercontrol.logs import Log, read_log

#: The steps, each with the functions whose time it is; a step within another one counts for itself.
STEPS = {
    "read": ("diagnose.checks.logs:check_logs", "engine.data:gather"),
    "base fit": ("diagnose.search.base:base_fit",),
    "score": ("diagnose.search.score:Scores.__init__", "diagnose.search.score:Scores._left_out"),
    "fits": ("diagnose.search.select:select",),
    "laws": ("diagnose.laws.screen:screened", "diagnose.laws.search:with_laws"),
    "confirm": ("diagnose.search.confirm:confirmed",),
    "challenge": ("diagnose.search.challenge:challenged",),
    "hold out": ("diagnose.search.hold_out:held_out", "diagnose.evidence.holdout:gap"),
    "remainder": ("diagnose.evidence.remainder:remainders", "diagnose.evidence.sensors:slow_errors"),
    "yardstick": ("diagnose.laws.scan:yardsticks",),
    "experiment": ("diagnose.experiment.propose:next_experiment",),
}
FIT, PASS = "engine.fit:estimate", "engine.passes:run_pass"

Given = tuple[Any, Sequence[Log], Log]


def _simulated(*names: str, gusts: bool = False) -> Given:
    from tests.identification.diagnose.generator import Conditions, make

    made = make(3, names, Conditions(dt=0.01, gusts=gusts))
    return made.model, made.logs, made.holdout


def _partial() -> Given:
    from tests.identification.diagnose.imperfect import Key

    made = Key("partial", "slope", "cable", "", 0).case()
    return made.model, made.logs, made.holdout


def _six_fans() -> Given:
    _, craft, (log,), held = real_craft.holohover_halves("h1")[0]
    return craft, [log.between(log.time[0], log.time[0] + 30.0)], held


def _own_machine() -> Given:
    folder = real_craft.DATA.parent / "machines" / "airboat"
    return load_model(folder / "model.toml"), [read_log(folder / "train.csv")], read_log(folder / "hold.csv")


#: Logs of 2 x 60 s at 100 Hz (partial: 50 Hz), of the real six fans (30 s at 240 Hz) and of a boat (40 s).
CASES: dict[str, Callable[[], Given]] = {
    "none": _simulated,
    "one effect": partial(_simulated, "yaw_quadratic_drag"),
    "partial": _partial,
    "gusts": partial(_simulated, "thrust_lag", gusts=True),
    "six fans": _six_fans,
    "own machine": _own_machine,
}


class Profile:
    """Seconds by step, and fits and passes, of the functions that it stands before."""

    def __init__(self) -> None:
        self.seconds: dict[str, list[float]] = defaultdict(lambda: [0.0, 0.0])
        self.count, self.fits = Counter[str](), list[Any]()
        self._open = ["other"]
        self._since = self._now()
        importlib.import_module("hovercontrol.identification.diagnose")
        for step, places in STEPS.items():
            for place in places:
                _before(place, partial(self._timed, step))
        _before(FIT, partial(self._called, self.fits.append))
        _before(PASS, partial(self._called, lambda _: self.count.update(["passes"])))

    @staticmethod
    def _now() -> list[float]:
        return [time.process_time(), time.perf_counter()]

    def turn(self) -> None:
        """Count the time since the last turn for the step that is open."""
        now = self._now()
        self.seconds[self._open[-1]] = [
            s + b - a for s, a, b in zip(self.seconds[self._open[-1]], self._since, now, strict=True)
        ]
        self._since = now

    def _timed(self, step: str, call: Callable[..., Any], *given: Any, **named: Any) -> Any:
        self.turn()
        self._open.append(step)
        try:
            return call(*given, **named)
        finally:
            self.turn()
            self._open.pop()

    def _called(
        self, with_it: Callable[[Any], None], call: Callable[..., Any], *given: Any, **named: Any
    ) -> Any:
        found = call(*given, **named)
        with_it(found)
        return found


def _before(place: str, around: Callable[..., Any]) -> None:
    """Put a function before another one, in every module that has it."""
    module, _, name = place.partition(":")
    owner: Any = importlib.import_module(f"hovercontrol.identification.{module}")
    *path, last = name.split(".")
    for part in path:
        owner = getattr(owner, part)
    call = getattr(owner, last)

    @wraps(call)
    def instead(*given: Any, **named: Any) -> Any:
        return around(call, *given, **named)

    for other in [owner, *(m for n, m in sys.modules.items() if n.startswith("hovercontrol."))]:
        for key in [k for k, v in vars(other).items() if v is call]:
            setattr(other, key, instead)


def profile(name: str) -> dict[str, Any]:
    """Return what a case took; to be called in a process of its own."""
    from hovercontrol.identification.diagnose import diagnose

    given = CASES[name]()
    begin = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    seen = Profile()
    found = diagnose(*given)
    seen.turn()
    used = found.selection
    fits = [used.base, used.final, *used.without.values(), *(r.fit for r in used.rivals)]
    kept = {id(fit) for fit in (*fits, found.held_before, found.held_after)}
    return {
        "verdict": f"{found.verdict} {'+'.join(e.parameter for e in found.effects)}".strip(),
        "numbers": {e.parameter: [e.value, e.std] for e in found.effects},
        "seconds": seen.seconds,
        "fits": len(seen.fits),
        "thrown away": sum(id(fit) not in kept for fit in seen.fits),
        "passes": seen.count["passes"],
        "peak": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20,
        "begin": begin,
    }


def rows(
    names: Sequence[str] = tuple(CASES), clock: bool = False
) -> Iterator[tuple[str, str, str, bool | None]]:
    for name in names:
        if name in ("six fans", "own machine") and not real_craft.DATA.exists():
            yield name, "skipped: no data", "", None
            continue
        command = [sys.executable, "-m", "benchmarks.diagnose_profile", "--alone", name]
        done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
        found = json.loads(done.stdout)
        used, wall = (sum(s[k] for s in found["seconds"].values()) for k in (0, 1))
        yield f"{name}: {found['verdict']}", f"{used:.1f} s, {wall:.1f} s on the clock", "", None
        by_step = sorted(found["seconds"].items(), key=lambda one: -one[1][clock])
        for step, seconds in by_step:
            yield f"  {step}", f"{seconds[clock]:.2f} s", "", None
        passes = found["passes"] / max(found["fits"], 1)
        yield (
            "  fits, thrown away, passes a fit",
            f"{found['fits']}, {found['thrown away']}, {passes:.1f}",
            "",
            None,
        )
        yield "  peak memory", f"{found['peak']:.2f} GiB ({found['begin']:.2f} before)", "", None


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="benchmarks.diagnose_profile", description=__doc__.splitlines()[0])
    parser.add_argument("cases", nargs="*", default=list(CASES), help=", ".join(CASES))
    parser.add_argument("--wall", action="store_true", help="seconds on the clock by step")
    parser.add_argument("--alone", action="store_true", help="in this process, as JSON")
    given = parser.parse_args(arguments)
    if unknown := [name for name in given.cases if name not in CASES]:
        parser.error(f"unknown case {unknown[0]!r}; known: {', '.join(CASES)}")
    if given.alone:
        print(json.dumps(profile(given.cases[0])))
        return 0
    for what, value, _, _ in rows(given.cases, given.wall):
        print(f"{what:58} {value:>34}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
