"""Progress of long work, on standard error."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn


class Report(Protocol):
    """The function that long work calls to report its progress and current step."""

    def __call__(self, done: float, what: str = "", /) -> None: ...  # noqa: D102


@contextmanager
def progress_bar(text: str, total: float) -> Iterator[Report]:
    """Show progress on standard error; yields the function that reports it.

    A terminal shows a bar, removed if the work fails; a pipe gets one line at the end.
    """
    console = Console(stderr=True)
    if not sys.stderr.isatty():  # notebooks ask for colours, and have no line to write over
        begin = time.perf_counter()
        yield lambda done, what="": None
        print(f"{text}: done in {time.perf_counter() - begin:.1f} s", file=sys.stderr)
        return
    parts = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"))
    with Progress(*parts, TimeElapsedColumn(), console=console) as bar:
        task = bar.add_task(text, total=total)

        def report(done: float, what: str = "") -> None:
            bar.update(task, completed=done, description=f"{text}: {what}" if what else text)

        try:
            yield report
        except BaseException:
            bar.live.transient = True
            raise
        bar.update(task, completed=total, description=text)
