"""Run tools on cases, several at a time; what is done already is kept."""

from __future__ import annotations

import hashlib
import json
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from hovercontrol import __version__
from hovercontrol.base.errors import InputError
from hovercontrol.base.files import write_atomically
from hovercontrol.control.analysis.intervals import clopper_pearson
from hovercontrol.identification.benchmark.cases import benchmark_case, lacks
from hovercontrol.identification.benchmark.scoring import score_answer
from hovercontrol.identification.benchmark.tools import tool_of

Row = dict[str, Any]


def score_case(name: str, tool: str) -> Row:
    """Return the row of one case and one tool: the answer, the score, the seconds that the tool took.

    A tool that fails has its error in the row; it counts as one that cannot tell.
    """
    from hovercontrol.identification.benchmark.answer import Answer

    case, run = benchmark_case(name), tool_of(tool)
    begin = time.perf_counter()
    error = ""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            answer = run(case.model, case.train, case.holdout)
            spent = time.perf_counter() - begin
            score = score_answer(case, answer)
        except InputError as failed:
            if 'pip install ".[' in str(failed):
                raise
            error = str(failed)
        except Exception as failed:  # of a tool that is not ours: anything
            error = f"{type(failed).__name__}: {failed}"
        if error:
            spent, answer = time.perf_counter() - begin, Answer("unknown")
            score = score_answer(case, answer)
    return {
        "case": name,
        "tool": tool,
        "seconds": spent,
        "verdict": answer.verdict,
        "terms": [vars(t) for t in answer.terms],
        "error": error,
        **score.result(),
    }


def run_cases(
    names: Sequence[str], tools: Sequence[str], kept: Path, jobs: int, report: Callable[[int], object]
) -> list[Row]:
    """Return the rows of all cases and tools, in this order; rows in the folder `kept` are not run again."""
    found: dict[tuple[str, str], Row] = {}
    todo = []
    for name, tool in ((n, t) for n in names for t in tools):
        file = _file(kept, name, tool)
        if file.exists():
            found[name, tool] = json.loads(file.read_text(encoding="utf-8"))
        else:
            todo.append((name, tool))
    report(len(found))
    for (name, tool), row in _each(todo, jobs):
        found[name, tool] = row
        _keep(_file(kept, name, tool), row)
        report(len(found))
    return [found[n, t] for n in names for t in tools]


def _each(todo: Sequence[tuple[str, str]], jobs: int) -> Iterator[tuple[tuple[str, str], Row]]:
    if jobs == 1 or len(todo) < 2:
        yield from ((pair, score_case(*pair)) for pair in todo)
        return
    with ProcessPoolExecutor(min(jobs, len(todo)), get_context("spawn")) as pool:
        running = {pool.submit(score_case, *pair): pair for pair in todo}
        try:
            for done in as_completed(running):
                yield running[done], done.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _keep(file: Path, row: Row) -> None:
    text = json.dumps(row, default=float)
    write_atomically(file, lambda path: path.write_text(text, encoding="utf-8"))


def _file(kept: Path, name: str, tool: str) -> Path:
    """Return the file of a row; a tool whose file or package has changed has rows of its own."""
    source = Path(tool.rpartition(".py:")[0] + ".py")
    state = source.read_bytes() if source.is_file() else __version__.encode()
    digest = hashlib.sha256(f"{name}\0{tool}\0".encode() + state).hexdigest()[:16]
    return kept / f"case-{digest}.json"


#: Figures of the table: title, what counts as one case, and what counts as one met.
FIGURES: dict[str, tuple[str, Callable[[Row], bool], Callable[[Row], bool]]] = {
    "missing, detected": ("share", lambda r: r["missing"], lambda r: r["detected"]),
    "nothing missing, said so": ("share", lambda r: not r["missing"], lambda r: r["detected"]),
    "effect named": ("share", lambda r: r["missing"] and lacks(r["case"]) == "effect", lambda r: r["form"]),
    "law named": ("share", lambda r: r["missing"] and lacks(r["case"]) == "law", lambda r: r["form"]),
    "right among readings": ("share", lambda r: r["missing"], lambda r: r["reading"]),
    "equation right": ("share", lambda r: r["missing"], lambda r: r["equation"]),
    "coefficient within two errors": ("share", lambda r: r["coefficient"] is not None,
                                      lambda r: r["coefficient"]),
    "false name, something missing": ("share", lambda r: r["missing"], lambda r: r["false_names"] > 0),
    "false name, nothing missing": ("share", lambda r: not r["missing"], lambda r: r["false_names"] > 0),
}  # fmt: skip


def table(rows: Sequence[Row]) -> list[Row]:
    """Return one row for each tool and figure: cases, met, share, and the exact 95 % interval.

    Shares have the interval of Clopper and Pearson; reductions of the held-out error are medians over the
    cases that lack something, a case without a prediction counting as 0.
    """
    found: list[Row] = []
    for tool in dict.fromkeys(r["tool"] for r in rows):
        own = [r for r in rows if r["tool"] == tool]
        for figure, (_, counts, met) in FIGURES.items():
            of = [r for r in own if counts(r)]
            if not of:
                continue
            k = sum(bool(met(r)) for r in of)
            low, high = clopper_pearson(k, len(of))
            found.append({"tool": tool, "figure": figure, "cases": len(of), "met": k, "value": k / len(of),
                          "low": float(low), "high": float(high)})  # fmt: skip
        missing = [r for r in own if r["missing"]]
        for ahead in ("0.2", "1") if missing else ():
            values = [r["reduction"].get(ahead, 0.0) for r in missing]
            low, middle, high = np.quantile(values, [0.25, 0.5, 0.75])
            found.append({"tool": tool, "figure": f"held-out error {ahead} s ahead, median fall",
                          "cases": len(values), "met": None, "value": float(middle), "low": float(low),
                          "high": float(high)})  # fmt: skip
        seconds = float(np.median([r["seconds"] for r in own]))
        found.append({"tool": tool, "figure": "seconds a case, median", "cases": len(own), "met": None,
                      "value": seconds, "low": None, "high": None})  # fmt: skip
    return found
