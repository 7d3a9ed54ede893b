"""What is done with a log, in whatever process: check, identify, and where asked diagnose and replay."""

from __future__ import annotations

import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hovercontrol.base.errors import InputError, one_line
from hovercontrol.base.plain_json import plain
from hovercontrol.craft.effects.law import is_law
from hovercontrol.identification.check.facts import facts
from hovercontrol.identification.diagnose.checks import check_fitted, check_logs
from hovercontrol.identification.diagnose.diagnose import diagnose
from hovercontrol.identification.diagnose.report import write_report
from hovercontrol.identification.engine.measure import angles
from hovercontrol.identification.engine.subject import Subject, structure
from hovercontrol.identification.fleet.sources import By, local, recorded
from hovercontrol.identification.identify import identify
from hovercontrol.identification.identify.result import Fitted, Identified
from hovercontrol.identification.monitor.build import build
from hovercontrol.identification.monitor.replay import replay
from hovercontrol.logs import Log
from hovercontrol.logs.reader import Reader


@dataclass(frozen=True)
class Work:
    """One task: the logs of one craft, by their addresses, and what is asked.

    Attributes
    ----------
    kind : {"identify", "diagnose", "replay"}
    model : Model or BlockModel
    added : tuple of str
        Names of effects of the model that are estimated, beside the coefficients that it has.
    fixed : tuple of str
        Coefficients that keep their values.
    """

    kind: str
    logs: tuple[str, ...]
    model: Subject
    read: Reader
    by: str = "folder"
    added: tuple[str, ...] = ()
    fixed: tuple[str, ...] = ()


def done(work: Work) -> dict[str, Any]:
    """Return the result of a task as plain values; a log that cannot be used is a result with its reason."""
    begin = time.process_time()
    try:
        with warnings.catch_warnings(record=True) as said, ExitStack() as stack:
            warnings.simplefilter("always", UserWarning)
            paths = [stack.enter_context(local(address)) for address in work.logs]
            found = _KINDS[work.kind](work, paths)
        found["notes"] = sorted(
            {*found.get("notes", ()), *(one_line(w.message) for w in said if w.category is UserWarning)}
        )
    except InputError as error:
        found = {"refused": str(error)}
    except (OSError, MemoryError, ArithmeticError, ValueError, TypeError, LookupError, RuntimeError) as error:
        found = {"refused": one_line(f"unexpected {type(error).__name__}: {error}")}  # one log ends no fleet
    if "refused" in found and work.kind == "identify":
        with suppress(InputError, OSError, ValueError):
            found["craft"] = By(work.by).craft(work.logs[0], None)
    result: dict[str, Any] = plain(found)
    return result | {"seconds": time.process_time() - begin}


def _identified(work: Work, paths: Sequence[str]) -> dict[str, Any]:
    (address,), (path,) = work.logs, paths
    craft, log = By(work.by).craft(address, path), work.read(path)
    when, clock = recorded(address, log)
    block = structure(work.model)
    units = {s.name: s.unit for s in (*block.inputs, *block.states, *block.outputs)}
    seen = facts(log, [s.name for s in block.inputs], units, craft=work.model.is_craft, angles=angles(block))
    notes = [*seen.remarks, *check_logs(work.model, [log])]
    found = identify(work.model, [log], estimated(work), fixed=work.fixed)
    notes += [line for line in check_fitted(found.fit) if "is not excited by these logs" not in line]
    notes += [line for line in (found.misfit, found.not_converged) if line]
    return {
        "craft": craft,
        "time": when,
        "clock": clock,
        "duration": float(log.time[-1] - log.time[0]),
        "rows": found.rows,
        "coefficients": [_coefficient(c) for c in (*found.coefficients, *found.groups)],
        "remaining": {r.equation: {"rms": r.rms, "seen": r.seen, "unit": r.unit} for r in found.remaining},
        "missing": [{"name": e.name, "values": dict(e.values)} for e in found.missing],
        "gain": found.gain,
        "cost": _cost(found),
        "notes": notes,
    }


def estimated(work: Work) -> list[str]:
    """Return what is estimated: the model's coefficients, and the numbers of added effects but fixed ones."""
    free = [n for n in work.model.free_coefficients() if n.rpartition(".")[2] not in work.fixed]
    added = [e for e in work.model.effects if e.name in work.added]
    more = [e.parameter(k) for e in added for k, n in e.numbers.items() if not getattr(n, "fixed", False)]
    return list(dict.fromkeys([*free, *more]))


def _cost(found: Identified) -> float:
    """Return twice the negative log likelihood, with the penalty of each number that was fitted."""
    from hovercontrol.identification.diagnose.criteria import CRITERIA

    return CRITERIA.penalised(found.fit)


def _coefficient(c: Fitted) -> dict[str, Any]:
    return {
        "name": c.name, "value": c.value, "std": c.std, "noise_std": c.noise_std, "unit": c.unit,
        "bound": c.bound, "reason": c.reason, "readings": "; ".join(map(str, c.readings)),
    }  # fmt: skip


def _read(work: Work, paths: Sequence[str]) -> list[Log]:
    return [work.read(path) for path in paths]


def _diagnosed(work: Work, paths: Sequence[str]) -> dict[str, Any]:
    found = diagnose(work.model, _read(work, paths), fixed=work.fixed)
    with tempfile.TemporaryDirectory() as folder:
        page = write_report(found, Path(folder) / "report.html").read_text(encoding="utf-8")
    said = found.result()
    known = [name for name in dict.fromkeys(e.effect for e in found.effects) if not is_law(name)]
    return {
        "verdict": found.verdict,
        "effects": said["effects"],
        "named": [{"name": n, "values": dict(found.amended.effect(n).values)} for n in known],
        "sentences": found.sentences(),
        "report": page,
        "notes": list(found.warnings),
    }


def _replayed(work: Work, paths: Sequence[str]) -> dict[str, Any]:
    (log,) = _read(work, paths)
    found = replay(build(work.model, log).block, log)
    return {"alarms": found.to_json()["alarms"]}


_KINDS: dict[str, Callable[[Work, Sequence[str]], dict[str, Any]]] = {
    "identify": _identified,
    "diagnose": _diagnosed,
    "replay": _replayed,
}
