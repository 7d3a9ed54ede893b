"""A fleet: check, identify and compare the logs of many craft by one model."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hovercontrol.base.arguments import at_least
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.files import check_folder, write_quietly
from hovercontrol.base.folders import write_folder
from hovercontrol.base.plain_json import json_text
from hovercontrol.base.short_repr import short_repr
from hovercontrol.craft.effects import Effect
from hovercontrol.craft.models.interface import AnyModel, as_model
from hovercontrol.identification.engine.subject import Subject, named
from hovercontrol.identification.fleet.findings import (
    Coefficient,
    by_craft,
    coefficients,
    common,
    lacking,
    left,
    middle_values,
    scattered,
    suspects,
)
from hovercontrol.identification.fleet.run import Report, Store, each_of, executor, key_of, model_text, run
from hovercontrol.identification.fleet.sources import By, bare_reason, digest, file_name, find
from hovercontrol.identification.fleet.worker import Work
from hovercontrol.logs.reader import Reader

#: Most effects that are added for all craft, logs in which rival names are compared, logs of one diagnosis.
MOST_COMMON, COMPARED, TOGETHER = 3, 10, 3


@dataclass(frozen=True)
class Common:
    """An effect that the model lacks in most craft.

    Attributes
    ----------
    name : str
    craft, of : int
        Number of craft that lack it, and of all.
    before, after : mapping
        For each equation the missing acceleration of all logs, that seen, and their unit.
    rivals : tuple of str
        Effects that were likely in as many craft, and together less likely.
    """

    name: str
    craft: int
    of: int
    before: Mapping[str, tuple[float, float, str]]
    after: Mapping[str, tuple[float, float, str]]
    rivals: tuple[str, ...]

    @property
    def equation(self) -> str:
        """The equation of which it takes most, relative to the acceleration seen."""
        return max(
            self.before,
            key=lambda e: (
                (self.before[e][0] ** 2 - self._after(e) ** 2) / max(self.before[e][1] ** 2, 1e-300)
            ),
        )

    @property
    def taken(self) -> float:
        """Fraction of the missing mean square that it takes in that equation."""
        before = self.before[self.equation][0]
        return 1.0 - (self._after(self.equation) / before) ** 2 if before > 0.0 else 0.0

    def _after(self, equation: str) -> float:
        return self.after.get(equation, self.before[equation])[0]


@checked
@dataclass(frozen=True, eq=False)
class Fleet:
    """The result of :func:`fleet`.

    Attributes
    ----------
    model : Model or BlockModel
        With the effects that most craft lacked.
    results : mapping of str to mapping
        Result of each log by its address; ``refused`` is the reason why one could not be used.
    coefficients : tuple of Coefficient
    common : tuple of Common
        Effects that the given model lacks in most craft, in order.
    faults : mapping of str to mapping
        Diagnosis of each craft that lacks more than the others do.
    seconds : float
        Processor time of all logs together [s], also of results that were there before.

    Examples
    --------
    >>> import tempfile, hovercontrol as hc
    >>> from hovercontrol.documents.samples import sample_path
    >>> with tempfile.TemporaryDirectory() as out:
    ...     found = hc.fleet(hc.vehicle("c17_experiment"), [str(sample_path())], out=out)
    >>> len(found.results), found.refused
    (1, {})
    """

    model: Subject
    results: Mapping[str, Mapping[str, Any]]
    coefficients: tuple[Coefficient, ...]
    common: tuple[Common, ...]
    faults: Mapping[str, Mapping[str, Any]]
    seconds: float

    __repr__ = short_repr

    @property
    def refused(self) -> dict[str, str]:
        """Why logs could not be used, by their addresses."""
        return {log: r["refused"] for log, r in self.results.items() if "refused" in r}

    @property
    def craft(self) -> list[str]:
        """The names of the craft."""
        return sorted({r["craft"] for r in self.results.values() if "refused" not in r})

    def text(self) -> str:
        """Return the findings as plain text."""
        from hovercontrol.identification.fleet.display import sentences

        return "\n".join(sentences(self))

    def _repr_html_(self) -> str:
        from hovercontrol.identification.fleet.display import body

        return "".join(body(self))

    @property
    def negative(self) -> bool:
        """Whether something is to be looked at: a fault, a change, a missing effect, an unused log."""
        off = any(c.off or c.trends or c.unlike or c.differs for c in self.coefficients)
        off = off or bool(scattered(self.results.values()))
        return off or bool(self.common or self.refused) or any(f.get("effects") for f in self.faults.values())

    def to_json(self) -> dict[str, Any]:
        """Return the findings for JSON."""
        from hovercontrol.identification.fleet.tables import summary

        return summary(self)

    def save(self, folder: str | Path) -> list[Path]:
        """Write fleet.parquet, craft.parquet, fleet.json, report.html and the amended model.

        Parameters
        ----------
        folder : path
            Created if it does not exist. The files do not depend on the number of workers.
        """
        from hovercontrol.craft.models.parameters import FITTED, save_fitted
        from hovercontrol.identification.fleet.display import page
        from hovercontrol.identification.fleet.tables import craft_table, log_table, write_table

        def write(temporary: Path) -> None:
            write_table(log_table(self), temporary / "fleet.parquet")
            write_table(craft_table(self), temporary / "craft.parquet")
            (temporary / "fleet.json").write_text(json_text(self.to_json()), encoding="utf-8")
            (temporary / "report.html").write_text(page(self), encoding="utf-8")
            save_fitted(self.model, temporary)

        return write_folder(folder, write, stale=FITTED)


@checked
def fleet(
    model: AnyModel,
    logs: Sequence[str],
    *,
    by: str = "folder",
    read: Reader | None = None,
    fixed: Sequence[str] = (),
    workers: int | None = 1,
    on: str = "",
    every: bool = False,
    out: str | Path,
    progress: Callable[[float, str], None] | None = None,
) -> Fleet:
    """Check and identify every log of many craft, and tell which craft, which log and which equation is off.

    An effect that more than half of the craft lack is a fault of the model: it is added for all. A craft that
    still lacks more than the others is diagnosed by itself. Then coefficients are compared: between craft and
    over time (:mod:`.random_effects`, :mod:`.trends`).

    Parameters
    ----------
    model : Model, BlockModel or Block
    logs : sequence of str
        Files, folders, patterns, or addresses that fsspec knows.
    by : str, optional
        What tells the craft of a log: ``folder``, a regular expression with a group, or a column.
    read : Reader, optional
        How a log is read; default: by the model.
    fixed : sequence of str, optional
        Coefficients that keep their values.
    workers : int or None, optional
        Processes; None: one for each processor. More than one need Dask, and in a script
        ``if __name__ == "__main__":``.
    on : str, optional
        Address of a Dask scheduler, in place of processes of this machine.
    every : bool, optional
        Diagnose every log and replay it through the monitor, too.
    out : path
        Folder in which each result is kept: what is done is not done again.
    progress : callable, optional
        Called with the fraction done (0 to 1) of the present step and a text.

    Returns
    -------
    Fleet

    Raises
    ------
    InputError
        If there is no log, no log can be used, or the scheduler does not answer.

    Examples
    --------
    >>> import tempfile, hovercontrol as hc
    >>> from hovercontrol.documents.samples import sample_path
    >>> with tempfile.TemporaryDirectory() as out:
    ...     found = fleet(hc.vehicle("c17_experiment"), [str(sample_path())], out=out)
    >>> found.craft
    ['samples']
    """
    subject, rule = as_model(model), By(by)
    if workers is not None:
        at_least("fleet: workers", workers, least=1)
    kept = tuple(name.rpartition(".")[2] for name in named(subject, fixed))
    folder = Path(out)
    check_folder(folder)
    names = find(logs, folder)
    said = progress or (lambda part, what: None)
    with executor(on, workers) as given:
        said(0.0, "reading logs")
        digests = each_of(given, digest, names)
        refused = {n: {"refused": str(d)} for n, d in digests.items() if isinstance(d, BaseException)}
        refused |= _copies({n: d for n, d in digests.items() if isinstance(d, str)})
        good = [n for n in names if n not in refused]
        crew = _Crew(given, Store(folder / "done"), {n: str(digests[n]) for n in good}, said)
        work = Work("identify", (), subject, read or Reader(model=subject), rule.text, (), kept)
        found = crew.work(good, work, f"identifying {len(good)} logs")
        if good and all("refused" in r for r in found.values()):
            first, r = next(iter(found.items()))
            raise InputError(
                f"fleet: none of {len(good)} logs can be used; {first}: {bare_reason(first, r['refused'])}"
            )
        work, found, shared = crew.complete(work, found)
        faults = crew.diagnose(work, found)
        found |= crew.amended(work, found, faults)
        if every:
            found = crew.every(work, found)
    results = {n: found.get(n) or refused[n] for n in names}
    for craft, fault in faults.items():
        _write_report(folder, craft, fault)
    compared = tuple(coefficients(list(results.values())))
    return Fleet(work.model, results, compared, tuple(shared), faults, crew.spent)


def _copies(digests: Mapping[str, str]) -> dict[str, dict[str, str]]:
    """Return a refusal for each log whose bytes are those of another one before it."""
    first: dict[str, str] = {}
    return {
        name: {"refused": f"the same bytes as {first[known]}"}
        for name, known in digests.items()
        if first.setdefault(known, name) != name
    }


def _write_report(folder: Path, craft: str, fault: Mapping[str, Any]) -> None:
    if fault.get("report"):
        write_quietly(
            folder / "reports" / f"{file_name(craft)}.html",
            lambda f: f.write_text(fault["report"], encoding="utf-8"),
        )


class _Crew:
    """What does the work: workers, the store, and the digests of the logs."""

    def __init__(
        self, given: Executor, store: Store, digests: Mapping[str, str], said: Callable[[float, str], None]
    ) -> None:
        self.given, self.store, self.digests, self.said = given, store, digests, said
        self.spent = 0.0  # processor time [s]

    def work(self, logs: Sequence[str], work: Work, what: str) -> dict[str, dict[str, Any]]:
        """Return the result of a task for each log."""
        return self._run({log: replace(work, logs=(log,)) for log in logs}, what)

    def _run(self, tasks: Mapping[str, Work], what: str) -> dict[str, dict[str, Any]]:
        models = {id(task.model): task.model for task in tasks.values()}
        texts = {k: model_text(model) for k, model in models.items()}
        keys = {name: key_of(task, texts[id(task.model)], self.digests) for name, task in tasks.items()}
        report: Report = lambda done, total: self.said(done / max(total, 1), f"{what}: {done} of {total}")  # noqa: E731
        found = run(self.given, self.store, {keys[n]: task for n, task in tasks.items()}, report)
        self.spent += sum(r.get("seconds", 0.0) for r in found.values())
        return {name: found[key] for name, key in keys.items()}

    def complete(
        self, work: Work, found: dict[str, dict[str, Any]]
    ) -> tuple[Work, dict[str, dict[str, Any]], list[Common]]:
        """Add the effects that most craft lack, one by one; return the task, its results, and the effects."""
        added: list[Common] = []
        while len(added) < MOST_COMMON and (names := common(list(found.values()))):
            best, rivals = self._likeliest(work, found, names)
            if best is None:
                break
            every = list(found.values())
            craft, of, before = len(lacking(every)[best.added[-1]]), len(by_craft(every)), left(every)
            work, found = best, self.work(list(found), best, f"identifying with {best.added[-1]}")
            added.append(Common(best.added[-1], craft, of, before, left(list(found.values())), rivals))
        return work, found, added

    def _likeliest(
        self, work: Work, found: Mapping[str, dict[str, Any]], names: Sequence[str]
    ) -> tuple[Work | None, tuple[str, ...]]:
        """Return the task with the effect that makes logs of several craft likeliest; None if none does."""
        first: dict[str, str] = {}
        for log, r in sorted(found.items(), key=lambda one: -one[1].get("gain", 0.0)):
            if "refused" not in r and r["missing"]:
                first.setdefault(r["craft"], log)
        some = list(first.values())[:COMPARED]
        costs: dict[str, float] = {}
        with_: dict[str, Work] = {}
        for name in names:
            effect = _made(work.model, name, middle_values(name, list(found.values())))
            with_[name] = replace(work, model=work.model.with_effects([effect]), added=(*work.added, name))
            tried = self.work(some, with_[name], f"comparing {name}")
            gains = [found[n]["cost"] - r["cost"] for n, r in tried.items() if "refused" not in r]
            costs[name] = -sum(gains)
        best = min(costs, key=lambda n: costs[n])
        return (with_[best] if costs[best] < 0.0 else None), tuple(n for n in names if n != best)

    def diagnose(self, work: Work, found: Mapping[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
        """Return the diagnosis of each craft that lacks more than the others do, by its most telling logs."""
        addresses = {id(r): log for log, r in found.items()}
        tasks = {}
        for craft, own in suspects(list(found.values())).items():
            logs = tuple(sorted(addresses[id(r)] for r in own[:TOGETHER]))
            tasks[craft] = replace(work, kind="diagnose", logs=logs)
        results = self._run(tasks, f"diagnosing {len(tasks)} craft") if tasks else {}
        return {craft: {**r, "logs": list(tasks[craft].logs)} for craft, r in results.items()}

    def amended(
        self, work: Work, found: Mapping[str, dict[str, Any]], faults: Mapping[str, Mapping[str, Any]]
    ) -> dict[str, dict[str, Any]]:
        """Return the results of craft with a fault in their model: else it would bend their coefficients."""
        again: dict[str, dict[str, Any]] = {}
        for craft, fault in faults.items():
            effects = [_made(work.model, e["name"], e["values"]) for e in fault.get("named", ())]
            if effects:
                own = replace(
                    work,
                    model=work.model.with_effects(effects),
                    added=(*work.added, *(e.name for e in effects)),
                )
                again |= self.work(
                    [n for n, r in found.items() if r.get("craft") == craft], own, f"identifying {craft}"
                )
        return again

    def every(self, work: Work, found: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
        """Return results with the diagnosis and the alarms of each log."""
        logs = [n for n, r in found.items() if "refused" not in r]
        more = {
            kind: self.work(logs, replace(work, kind=kind), f"{kind} {len(logs)} logs")
            for kind in ("diagnose", "replay")
        }
        for n in logs:
            said, alarms = more["diagnose"][n], more["replay"][n]
            found[n] |= {
                "verdict": said.get("verdict", said.get("refused")),
                "effects": said.get("effects", []),
            }
            found[n] |= {"alarms": alarms.get("alarms", alarms.get("refused"))}
        return found


def _made(model: Subject, name: str, values: Mapping[str, float]) -> Effect:
    """Return an effect of a model's catalogue with given numbers."""
    return model.effect_class(name).within_bounds(**values)
