"""Messages of FMUs: status and text, kept for each instance."""

from __future__ import annotations

import contextlib
import ctypes
from collections import deque
from typing import Any

from fmpy import calloc, fmi2, free  # type: ignore[import-untyped]


def text_of(message: bytes | None) -> str:
    """Return a message as one line."""
    return " ".join((message or b"").decode("utf-8", "replace").split())[:500]


#: Messages of FMI 2 come with variable arguments, which FMPy's helper library formats; it knows one receiver
#: for the whole process, so that messages are told apart by the environment they carry.
LOGS: dict[int, deque[tuple[int, str]]] = {}


def _receive(environment: int | None, name: bytes, status: int, category: bytes, message: bytes) -> None:
    log = LOGS.get(environment or 0)
    if log is None:  # an instance that FMPy itself runs in this process
        fmi2.printLogMessage(environment, name, status, category, message)
    else:
        log.append((status, text_of(message)))


_prototype = fmi2.fmi2CallbackFunctions()
_prototype.logger = fmi2.fmi2CallbackLoggerTYPE(_receive)
_prototype.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(calloc)
_prototype.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(free)
with contextlib.suppress(AttributeError):  # no helper library for this platform: messages stay unformatted
    fmi2.addLoggerProxy(ctypes.byref(_prototype))


def callbacks_of(log: deque[tuple[int, str]]) -> Any:
    """Return the callbacks of an instance of FMI 2 whose messages go to `log`."""
    LOGS[id(log)] = log
    callbacks = fmi2.fmi2CallbackFunctions()
    ctypes.memmove(ctypes.byref(callbacks), ctypes.byref(_prototype), ctypes.sizeof(callbacks))
    callbacks.componentEnvironment = id(log)
    return callbacks
