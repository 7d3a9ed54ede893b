"""What every input must end in: done, a finding, or one line; never a traceback, a hang, half a result."""

from __future__ import annotations

import contextlib
import io
import os
import signal
import sys
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

from hovercontrol.app import cli
from hovercontrol.base import endings
from hovercontrol.base.errors import InputError

LONGEST = 20.0
"""Seconds after which an input counts as a hang."""

LINE = 1100
"""Characters of the longest line that is still one."""


class Broken(AssertionError):  # noqa: N818
    """An input ended otherwise than it must."""


class Hang(BaseException):
    """The time is up."""


@contextlib.contextmanager
def limited(seconds: float = LONGEST) -> Iterator[None]:
    def end(number, frame):
        raise Hang(f"hangs in {frame.f_code.co_filename}, line {frame.f_lineno}" if frame else "hangs")

    before = signal.signal(signal.SIGALRM, end)
    signal.setitimer(signal.ITIMER_REAL, seconds, 1.0)  # again where a finaliser swallowed it
    try:
        yield
    except Hang as hang:
        raise Broken(str(hang)) from None
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def call(function: Callable[[], object], seconds: float = LONGEST, said: list[str] | None = None) -> int:
    """Call a function of the package: 0 if it returns, 2 if it refuses in one line, kept in `said`."""
    with limited(seconds), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            function()
        except InputError as error:
            text = str(error)
            if "\n" in text or len(text) > LINE or not text:
                raise Broken(f"not one line: {text[:300]!r}") from None
            if said is not None:
                said.append(text)
            return 2
        except Hang:
            raise
        except BaseException as error:
            raise Broken("".join(traceback.format_exception(error)[-4:])) from None
    return 0


def command(words: list[str], folder: Path, wanted: tuple[int, ...] = (0, 1, 2)) -> int:
    """Run ``hovercontrol WORDS`` in a folder; whatever it refuses, it leaves the folder as it was."""
    before = tree(folder)
    out, said = io.StringIO(), io.StringIO()
    handlers = {number: signal.getsignal(number) for number in endings.STOPS}
    hook, argv, here = sys.unraisablehook, sys.argv, Path.cwd()
    sys.argv = ["hovercontrol", *words]
    os.chdir(folder)
    try:
        with limited(), contextlib.redirect_stdout(out), contextlib.redirect_stderr(said):
            status = endings.run(cli._command)
    finally:
        os.chdir(here)
        sys.argv, sys.unraisablehook = argv, hook
        for number, handler in handlers.items():
            signal.signal(number, handler)
    return judged(status, said.getvalue(), before, tree(folder), wanted)


def judged(status: int, said: str, before: set[str], after: set[str], wanted: tuple[int, ...]) -> int:
    """Return a status if what was said and left goes with it."""
    if status not in wanted:
        raise Broken(f"status {status}: {said[-1500:]}")
    if "Traceback" in said:
        raise Broken(said[-1500:])
    if status == 130 and _stopped_after_the_last_file(said, before, after):
        return status
    if status not in (0, 1):
        if len(said.splitlines()) > 1 or len(said) > LINE:
            raise Broken(f"more than a line: {said[:1500]!r}")
        if after != before:
            raise Broken(f"left behind: {sorted(after ^ before)[:5]}")
    if any("/.writing-" in name or "/.placing-" in name for name in after):
        raise Broken(f"half-written: {sorted(after)[:5]}")
    return status


def _stopped_after_the_last_file(said: str, before: set[str], after: set[str]) -> bool:
    """Return whether a run of the sample was stopped between its last file and its end, and says so."""
    if not said.endswith("stopped; out was written before\n") or not before <= after:
        return False
    return {name.split(" ")[0] for name in after - before} == {f"out/{name}" for name in SAMPLE_RUN}


SAMPLE_RUN = (".hovercontrol.json", "log.csv", "path.png", "rudder.png", "thrust.png", "velocities.png")
"""The files of ``hovercontrol simulate sample``, and the list of them."""


def forked(words: list[str], folder: Path, fault: Callable[[int], None], inside: Callable[[], None]) -> int:
    """Run a command in a copy of this process; `inside` prepares it, `fault` may happen to it."""
    before = tree(folder)
    with (folder / ".said").open("w+") as said:
        signal.pthread_sigmask(signal.SIG_BLOCK, endings.STOPS)  # nothing happens before it begins
        child = os.fork()
        if child == 0:
            with contextlib.suppress(BaseException):
                os.chdir(folder)
                os.dup2(said.fileno(), 2)
                os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
                sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w")
                sys.argv = ["hovercontrol", *words]
                inside()

                def begin() -> object:
                    signal.pthread_sigmask(signal.SIG_UNBLOCK, endings.STOPS)
                    return cli._command()

                status = endings.run(begin)
                sys.stderr.flush()
                os._exit(status)
            os._exit(99)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, endings.STOPS)
        fault(child)
        end = time.monotonic() + LONGEST
        found, status = os.waitpid(child, os.WNOHANG)
        while not found and time.monotonic() < end:
            time.sleep(0.002)
            found, status = os.waitpid(child, os.WNOHANG)
        if not found:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            raise Broken("hangs")
        said.seek(0)
        text = said.read()
    (folder / ".said").unlink()
    return judged(os.waitstatus_to_exitcode(status), text, before, tree(folder), (0, 1, 2, 130))


def tree(folder: Path) -> set[str]:
    """Return what is in a folder, each file with its size and time."""
    found = set()
    for place, _, names in os.walk(folder):
        for name in names:
            path = os.path.join(place, name)
            about = os.lstat(path)
            found.add(f"{os.path.relpath(path, folder)} {about.st_size} {about.st_mtime_ns}")
    return {name for name in found if not name.startswith(".said ")}
