"""How far long work is, on standard error."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn


class Tell(Protocol):
    """What long work calls to say how far it is, and with what it is busy."""

    def __call__(self, done: float, what: str = "", /) -> None: ...  # noqa: D102


@contextmanager
def progress_bar(text: str, total: float) -> Iterator[Tell]:
    """Show on standard error how far the work is; yields a function that is told.

    A terminal sees a bar, which leaves if the work ends in an error; a pipe gets one line at the end.
    """
    console = Console(stderr=True)
    if not console.is_terminal:
        begin = time.perf_counter()
        yield lambda done, what="": None
        print(f"{text}: done in {time.perf_counter() - begin:.1f} s", file=sys.stderr)
        return
    parts = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"))
    with Progress(*parts, TimeElapsedColumn(), console=console) as bar:
        task = bar.add_task(text, total=total)

        def tell(done: float, what: str = "") -> None:
            bar.update(task, completed=done, description=f"{text}: {what}" if what else text)

        try:
            yield tell
        except BaseException:
            bar.live.transient = True
            raise
        bar.update(task, completed=total, description=text)
