"""How a command ends: the one place for signals, closed pipes, full devices and exit statuses.

Nothing here takes time to import, so that Ctrl-C is understood from the first moment on.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import os
import platform
import shlex
import signal
import sys
import tempfile
import threading
import time
import traceback
import warnings
from collections.abc import Callable
from types import FrameType
from typing import Any, NoReturn

from hovercontrol.base import files, output
from hovercontrol.base.errors import InputError, one_line

DONE, FINDING, WRONG, FAULT = 0, 1, 2, 3

#: What every status means; ``hovercontrol --help`` prints it.
STATUSES = (
    "Exit status: 0 done; 1 done, with a negative finding; 2 wrong input or output not writable, with a "
    "one-line message; 3 an internal error, with a file to send; 130 stopped by Ctrl-C, 143 by SIGTERM. "
    "Results are written atomically."
)

#: Signals that stop a command, and its status then: 128 and the signal's number, as shells have it.
STOPS = {signal.SIGINT: 130, signal.SIGTERM: 143}

#: Longest that threads and exit handlers of a user's file may delay the end of a command [s].
LONGEST_END = 5.0

_asked: list[signal.Signals] = []


class Stopped(KeyboardInterrupt):
    """A signal asks the command to end."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.status = STOPS[signal.Signals(number)]


def run(command: Callable[[], object]) -> int:
    """Run a command to its end, whatever that is, and return its exit status.

    Parameters
    ----------
    command : callable
        Returns the status, or None for 0. An :class:`.InputError` and anything that the system refuses (a
        full disk, a missing permission) are one line and 2, a signal is one line and 130 or 143, a closed
        pipe is 0 without a message, everything else one line and 3, with a file to send. Warnings are
        printed at the end of work that succeeds.
    """
    _open_streams()
    files.placed.clear()
    files.kept.clear()
    _asked.clear()
    notices, before = _Notices(), warnings.showwarning
    warnings.showwarning = notices.add  # type: ignore[assignment]
    try:
        _listen()
        try:
            found = command()
            status = found if isinstance(found, int) else DONE
        except SystemExit as end:  # of the library that draws tables: its reader has left
            text = _users_fault(end)
            if text:
                return _say(text, WRONG)
            status = end.code if isinstance(end.code, int) and end.code != 1 else DONE
        if status in STOPS.values():  # the library of the command line knows one status for all signals
            return _stopped(STOPS[_asked[-1]] if _asked else status)
        notices.print_all()
        _flush()
        return status
    except KeyboardInterrupt as stop:
        return _stopped(stop.status if isinstance(stop, Stopped) else STOPS[signal.SIGINT])
    except Exception as error:
        if _asked:  # machine code that is interrupted may end in an error of its own
            return _stopped(STOPS[_asked[-1]])
        return _failed(error)
    except BaseException as error:  # a class of the user's
        text = _users_fault(error)
        if not text:
            raise
        return _say(text, WRONG)
    finally:
        warnings.showwarning = before
        output.release()


def _failed(error: Exception) -> int:
    """Say in one line why a command fails; return the status for that."""
    if isinstance(error, InputError):
        return _say(str(error), WRONG)
    if isinstance(error, BrokenPipeError):
        _drop_output()
        return DONE
    text = _users_fault(error)
    if text:
        return _say(text, WRONG)
    if isinstance(error, OSError):
        _drop_output()
        return _say(f"{error.filename or 'the output cannot be written'}: {files.reason(error)}", WRONG)
    if isinstance(error, MemoryError):
        return _say("not enough memory", WRONG)
    # a fault of ours: never a traceback at a user, never taken for a finding
    file = _fault_file(error)
    send = f"please report this and send {file}" if file else "please report this"
    return _say(f"unexpected {one_line(f'{type(error).__name__}: {error}', 600)}; {send}", FAULT)


def _fault_file(error: Exception) -> str:
    """Write what helps to find a fault into a file of its own that a user can send; return its path.

    It lies in the folder for temporary files: a command that fails leaves nothing where it runs. Empty where
    that cannot be written.
    """
    from importlib.metadata import PackageNotFoundError, version

    lines = [f"command: {shlex.join(sys.argv)}", f"system: {platform.platform()}, Python {sys.version}"]
    for name in ("hovercontrol", "numpy", "scipy", "sympy", "control", "matplotlib", "pyarrow"):
        with contextlib.suppress(PackageNotFoundError):
            lines.append(f"{name} {version(name)}")
    trace = "".join(traceback.format_exception(error))
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="hovercontrol-fault-", suffix=".txt", delete=False, encoding="utf-8", errors="replace"
        ) as file:
            file.write("\n".join([*lines, "", trace]))
    except OSError:
        return ""
    return file.name


def separate_interrupts(command: Callable[..., object]) -> Callable[..., object]:
    """Return a command in which an interrupt that a user's file raises is its error, not a stop by the user.

    The library of the command line would take both for the same.
    """

    @functools.wraps(command)
    def run(**given: Any) -> object:
        try:
            return command(**given)
        except (EOFError, KeyboardInterrupt) as error:
            text = "" if isinstance(error, Stopped) else _users_fault(error)
            if text:
                raise InputError(text) from error
            raise

    return run


def _users_fault(error: BaseException) -> str:
    """Return the error line of what a Python file of the user's raised, empty if none was involved."""
    module = sys.modules.get("hovercontrol.base.users_code")  # there if such a file was run
    return module.fault(error) if module is not None else ""


def leave(status: int) -> NoReturn:
    """End the process with a status, in time whatever threads and exit handlers a user's file has left."""
    if output.was_reserved:
        output.reserve()  # a handler at the end may print, too
    module = sys.modules.get("hovercontrol.base.users_code")
    if module is not None and module.is_running():
        with contextlib.suppress(OSError, ValueError):
            _flush()
        atexit._run_exitfuncs()
        os._exit(status)
    if module is not None:
        threading.Thread(target=_end_in_time, args=(status, module.OWN_THREADS), daemon=True).start()
    sys.exit(status)


def _end_in_time(status: int, own: str) -> None:
    time.sleep(LONGEST_END)
    for thread in threading.enumerate():
        if thread.name.startswith(own):  # a library is being built
            thread.join()
    os._exit(status)


class _Notices:
    """Warnings about the input, printed when the work is done."""

    def __init__(self) -> None:
        self.texts: list[str] = []

    def add(self, message: Warning | str, category: type[Warning], *where: Any) -> None:
        """Keep a warning, once; those of numerics are not for a user."""
        text = one_line(message)
        if issubclass(category, UserWarning) and text not in self.texts:
            self.texts.append(text)

    def print_all(self) -> None:
        """Print one line for each."""
        for text in self.texts:
            print(f"warning: {text}", file=sys.stderr)


def refuse(text: str) -> int:
    """Say in one line what was wrong; return the status for that."""
    return _say(text, WRONG)


def _say(text: str, status: int) -> int:
    with contextlib.suppress(OSError, ValueError):  # nobody reads it, or its device is full
        print(f"hovercontrol: {one_line(text)}", file=sys.stderr, flush=True)
    return status


def _stopped(status: int) -> int:
    for number in STOPS:
        with contextlib.suppress(ValueError):  # not in the main thread
            signal.signal(number, signal.SIG_IGN)  # the end itself is not interrupted
    return _say(_farewell(), status)


def _farewell() -> str:
    if files.kept:
        return f"stopped; results so far are kept in {files.kept[-1]}"
    if files.placed:
        return f"stopped; {files.placed[-1]} was written before"
    return "stopped; nothing was written"


def _open_streams() -> None:
    """Give a command that was started with a closed output (``2>&-``) one that leads nowhere."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115  it stays open to the end


def _flush() -> None:
    """Write out what was printed, while a failure can still be reported."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.flush()


def _drop_output() -> None:
    """Let what is still to be printed go nowhere, so that Python's own end does not stumble over it."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError, AttributeError):
            try:
                stream.flush()
            except OSError:
                nowhere = os.open(os.devnull, os.O_WRONLY)
                os.dup2(nowhere, stream.fileno())
                os.close(nowhere)


# ---- signals -------------------------------------------------------------------------------------------


def _listen() -> None:
    if threading.current_thread() is threading.main_thread():
        for number in STOPS:
            signal.signal(number, _on_signal)
        sys.unraisablehook = _again


def _on_signal(number: int, frame: FrameType | None) -> None:
    if _importing(frame):  # an import may swallow an exception, or print it
        _leave(number)
    _asked.append(signal.Signals(number))
    raise Stopped(number)


def _importing(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename == "<frozen importlib._bootstrap>":
            return True
        frame = frame.f_back
    return False


def _leave(number: int) -> NoReturn:
    """End at once: remove what is unfinished, say the line, no more."""
    files.clear_own()
    if sys.stderr is not None and sys.stderr.isatty():
        sys.stderr.write("\x1b[?25h")  # a progress bar hides the cursor
    _stopped(STOPS[signal.Signals(number)])
    os._exit(STOPS[signal.Signals(number)])


def _again(missed: Any) -> None:
    """Interrupt once more where an interrupt came in a place that cannot raise it, such as a finaliser."""
    if isinstance(missed.exc_value, Stopped):
        number = next(n for n, status in STOPS.items() if status == missed.exc_value.status)
        threading.Timer(0.05, os.kill, (os.getpid(), number)).start()
    else:
        sys.__unraisablehook__(missed)
