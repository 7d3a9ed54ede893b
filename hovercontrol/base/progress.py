"""Progress of long work: below a notebook's cell, on a terminal, or one line at the end."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from html import escape
from typing import Any, Protocol

from hovercontrol.base.boundary import checked

#: From one change of a notebook's bar to the next [s].
PAUSE = 0.2

__all__ = ["progress_bar"]


class Report(Protocol):
    """The function that long work calls to report its progress and current step."""

    def __call__(self, done: float, what: str = "", /) -> None: ...


@checked
@contextmanager
def progress_bar(text: str, total: float = 1.0) -> Iterator[Report]:
    """Show the progress of long work; for the ``progress=`` of sweeps, fits, diagnoses and analyses.

    In a notebook a bar below the cell, on a terminal a bar that is removed if the work fails, in a pipe one
    line at the end (on standard error).

    Parameters
    ----------
    text : str
        What is done.
    total : float, optional
        What the work reports at its end: 1 for fits, diagnoses and analyses, the number of runs for a
        compiled sweep, the simulated time [s] for a scenario.

    Yields
    ------
    callable
        ``report(done, what="")``.

    Examples
    --------
    >>> import numpy as np, hovercontrol as hc
    >>> from hovercontrol.base.progress import progress_bar
    >>> loop = hc.vehicle("c17_simulation").plant().compile()
    >>> with progress_bar("sweep", total=3) as report:
    ...     found = loop.sweep([0.0, 1.0], params={"plant.thrust": [0.5, 0.6, 0.7]}, progress=report)
    >>> found["x"].final.shape
    (3,)
    """
    shell: Any = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    if getattr(shell, "kernel", None) is not None:
        yield from _below_the_cell(text, total)
    elif sys.stderr.isatty():
        yield from _on_the_terminal(text, total)
    else:
        begin = time.perf_counter()
        yield lambda done, what="": None
        print(f"{text}: done in {time.perf_counter() - begin:.1f} s", file=sys.stderr)


def _below_the_cell(text: str, total: float) -> Iterator[Report]:
    from IPython.display import HTML, display

    begin, last = time.perf_counter(), 0.0
    handle: Any = display(HTML(_bar(text, 0.0)), display_id=True)

    def report(done: float, what: str = "") -> None:
        nonlocal last
        now = time.perf_counter()
        if now - last > PAUSE:
            last = now
            handle.update(HTML(_bar(f"{text}: {what}" if what else text, done / total)))

    try:
        yield report
    except BaseException:
        handle.update(HTML(escape(f"{text}: stopped after {time.perf_counter() - begin:.1f} s")))
        raise
    handle.update(HTML(escape(f"{text}: done in {time.perf_counter() - begin:.1f} s")))


def _bar(text: str, share: float) -> str:
    share = min(max(share, 0.0), 1.0)
    return f"<progress value='{share:.3f}' max='1'></progress> {100 * share:.0f} % {escape(text)}"


def _on_the_terminal(text: str, total: float) -> Iterator[Report]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    parts = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"))
    with Progress(*parts, TimeElapsedColumn(), console=Console(stderr=True)) as bar:
        task = bar.add_task(text, total=total)

        def report(done: float, what: str = "") -> None:
            bar.update(task, completed=done, description=f"{text}: {what}" if what else text)

        try:
            yield report
        except BaseException:
            bar.live.transient = True
            raise
        bar.update(task, completed=total, description=text)
