"""Run a user's Python file in this process: restore the state, and report errors as the file's."""

from __future__ import annotations

import builtins
import contextlib
import os
import signal
import sys
import threading
import traceback
import warnings
from collections.abc import Callable
from concurrent.futures import thread as pools
from pathlib import Path
from typing import Any, NoReturn, TextIO, TypeVar

import numpy as np

from hovercontrol.base.errors import InputError, one_line

T = TypeVar("T")

#: Longest that a thread of the file's may go on after it [s].
PATIENCE = 0.5
#: Names of this package's own threads begin so; who ends the process waits for them.
OWN_THREADS = "hovercontrol"

_files: dict[str, Path] = {}
_left: list[threading.Thread] = []


def run_users_code(path: Path, work: Callable[[], T]) -> T:
    """Execute a user's file and restore the state of the process.

    Parameters
    ----------
    path : Path
        The file, for error lines.

    Raises
    ------
    InputError
        If anything is raised, sys.exit() and all; if a thread or a process is left running, or sys.path lacks
        what it had. An interrupt by the user passes.
    """
    _files[os.path.realpath(path)] = path
    before, process = _Process(), os.getpid()
    try:
        found = work()
    except BaseException as error:
        if os.getpid() != process:
            _end_fork()
        before.restore()
        if _is_stop(error):
            raise
        raise InputError(_said(path, error)) from error
    if os.getpid() != process:
        _end_fork()
    broken = before.restore()
    if broken:
        raise InputError(f"{path}: {broken}")
    return found


def fault(error: BaseException) -> str:
    """Return the error line of an exception from a user's loaded file; empty if none was involved."""
    for frame, _ in reversed(list(traceback.walk_tb(error.__traceback__))):
        path = _files.get(os.path.realpath(frame.f_code.co_filename))
        if path is not None:
            return _said(path, error)
    return ""


def is_running() -> bool:
    """Return whether a thread of a user's file still runs: Python would wait for it at exit."""
    return any(thread.is_alive() for thread in _left)


def text_of(error: BaseException) -> str:
    """Return the text of an error, even if its ``__str__`` fails."""
    try:
        return str(error)
    except BaseException as other:
        if _is_stop(other):
            raise
        return "its text cannot be shown"


def _said(path: Path, error: BaseException) -> str:
    text = (error.msg or "") if isinstance(error, SyntaxError) else text_of(error)
    why = next(iter(text.strip().splitlines()), "no message")
    return f"{path}{_line(path, error)}: {type(error).__name__}: {one_line(why, 400)}"


def _line(path: Path, error: BaseException) -> str:
    file = os.path.realpath(path)
    own = [
        n for f, n in traceback.walk_tb(error.__traceback__) if os.path.realpath(f.f_code.co_filename) == file
    ]
    at = error.lineno if isinstance(error, SyntaxError) else own[-1] if own else None
    return f", line {at}" if at else ""


def _is_stop(error: BaseException) -> bool:
    """Return whether the user interrupts: a command's handler raises its own class."""
    plain = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    ours = type(error).__module__.startswith("hovercontrol.")
    return isinstance(error, KeyboardInterrupt) and (ours or plain)


def _end_fork() -> NoReturn:
    """End a process that the file forked and that returned here."""
    with contextlib.suppress(Exception):
        sys.stdout.flush()
    os._exit(0)


class _Shared:
    """Standard output or error while a user's file runs: closing it does not close the stream."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def close(self) -> None:
        """Flush the output."""
        self._stream.flush()


class _Process:
    """Process state that a user's file can change."""

    def __init__(self) -> None:
        self._built_in = dict(vars(builtins))
        self._numerics, self._trace = np.geterr(), sys.gettrace()
        self._warnings = warnings.catch_warnings()
        self._warnings.__enter__()
        self._path, self._entries = sys.path, list(sys.path)
        self._finders = sys.meta_path, list(sys.meta_path)
        self._modules = dict(sys.modules)
        self._folder = _folder()
        self._threads = set(threading.enumerate())
        self._children = _children()
        self._limit, self._umask = sys.getrecursionlimit(), os.umask(0)
        os.umask(self._umask)
        self._signals = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
        self._streams = sys.stdin, sys.stdout, sys.stderr
        self._descriptors = {number: copy for number in (0, 1, 2) if (copy := _copy(number)) is not None}
        for name, stream in (("stdout", sys.stdout), ("stderr", sys.stderr)):
            if stream is not None:
                with contextlib.suppress(Exception):
                    stream.flush()
                setattr(sys, name, _Shared(stream))

    def restore(self) -> str:
        """Restore the state; return an error that must be reported, empty if there is none."""
        builtins.__dict__.update(self._built_in)  # first: all below needs them
        sys.settrace(self._trace)
        self._warnings.__exit__(None, None, None)
        np.seterr(**self._numerics)
        lost = not isinstance(sys.path, list) or not set(self._entries) <= set(sys.path)
        self._restore_imports()
        self._restore_streams()
        if self._folder is not None:
            with contextlib.suppress(OSError):
                os.chdir(self._folder)
        sys.setrecursionlimit(self._limit)
        os.umask(self._umask)
        if threading.current_thread() is threading.main_thread():
            for number, handler in self._signals.items():
                if handler is not None:
                    signal.signal(number, handler)
        return "removes entries of sys.path" if lost else self._left_running()

    def _restore_imports(self) -> None:
        added = [entry for entry in sys.path if entry not in self._entries] if sys.path else []
        sys.path, self._path[:] = self._path, [*self._entries, *added]
        finders, known = self._finders
        finders[:] = [*known, *(f for f in sys.meta_path if f not in known)]
        sys.meta_path = finders
        for name, module in self._modules.items():
            if sys.modules.get(name) is not module:
                sys.modules[name] = module

    def _restore_streams(self) -> None:
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(Exception):
                stream.flush()
        for number, copy in self._descriptors.items():
            os.dup2(copy, number)
            os.close(copy)
        for name, number, stream in zip(("stdin", "stdout", "stderr"), range(3), self._streams, strict=True):
            closed = getattr(stream, "closed", False)
            mode = "r" if name == "stdin" else "w"
            setattr(sys, name, open(number, mode, closefd=False) if closed else stream)  # noqa: SIM115

    def _left_running(self) -> str:
        new = [t for t in threading.enumerate() if t not in self._threads and not t.daemon]
        waiting = getattr(pools, "_threads_queues", {})  # threads of pools end with the interpreter
        new = [t for t in new if t not in waiting]
        for thread in new:
            thread.join(PATIENCE / len(new))
        running = [t for t in new if t.is_alive()]
        _left.extend(running)
        if running:
            return f"leaves the thread {running[0].name!r} running: end it, or make it a daemon"
        children = [child for child in _children() if child not in self._children and not child.daemon]
        for child in children:
            child.kill()
        return f"leaves the process {children[0].name!r} running" if children else ""


def _folder() -> str | None:
    with contextlib.suppress(OSError):
        return os.getcwd()
    return None


def _copy(number: int) -> int | None:
    with contextlib.suppress(OSError):
        return os.dup(number)
    return None


def _children() -> list[Any]:
    module = sys.modules.get("multiprocessing")
    return module.active_children() if module is not None else []
