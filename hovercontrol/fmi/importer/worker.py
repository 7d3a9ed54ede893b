"""An FMU in a separate process, so that its crash, hang or exit is only an error here.

The parent writes one line of JSON per call to the child's standard input and reads one line back; floats are
exact in it. This protects against faults, not against malice: the child has the user's rights.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import IO, Any

from hovercontrol.fmi.importer.clocks import Clock
from hovercontrol.fmi.importer.instance import FmuError, RunEnded
from hovercontrol.fmi.importer.interface import Interface, Variable
from hovercontrol.fmi.importer.ticking import instance_of

#: Time for the child to load Python and the FMU, and to free it [s].
START_TIME, STOP_TIME = 60.0, 2.0

#: Shortest wait before a limit is looked at again [s].
POLL = 0.05


class Remote:
    """An FMU in a separate process, a :class:`hovercontrol.fmi.importer.instance.Engine`.

    Parameters
    ----------
    folder : Path
        Folder of the unpacked FMU.
    name : str
        The instance's name, for its messages.
    timeout : float
        Longest time for one call [s], in which the process computes or sleeps: on Linux the time in which it
        waits for a processor does not count.
    serving : {"instance", "replayer"}, optional
        What the process makes of the FMU: an Instance, or a
        :class:`hovercontrol.fmi.replay.replayer.Replayer`, whose methods are called by :meth:`call`.

    Raises
    ------
    FmuError
        If the FMU cannot be loaded in that process.
    """

    def __init__(
        self, folder: Path, interface: Interface, name: str, timeout: float, serving: str = "instance"
    ) -> None:
        self._opening: dict[str, Any] = {
            "folder": str(folder), "interface": asdict(interface), "name": name, "serving": serving,
        }  # fmt: skip
        self._timeout = timeout
        self._child: subprocess.Popen[bytes] | None = None
        self._answers: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._open()

    def start(self, time: float, parameters: Sequence[float | None], inputs: Sequence[float]) -> list[float]:
        """Begin a run, in a new process if the last one has ended."""
        if self._child is None:
            self._open()
        return self._call("start", time, list(parameters), list(inputs))

    def outputs(self, inputs: Sequence[float]) -> list[float]:
        """Set the inputs and read the outputs."""
        return self._call("outputs", list(inputs))

    def step(self, time: float, step: float, inputs: Sequence[float]) -> list[float]:
        """Advance in time."""
        return self._call("step", time, step, list(inputs))

    def save(self) -> int:
        """Save the present state."""
        return self._call("save")

    def restore(self, handle: int) -> None:
        """Restore a saved state."""
        self._call("restore", handle)

    def drop(self, handle: int) -> None:
        """Discard a saved state."""
        self._call("drop", handle)

    @property
    def alive(self) -> bool:
        """Whether the process runs."""
        return self._child is not None

    def call(self, name: str, *arguments: Any) -> Any:
        """Return what a method of the served object returns, in a new process if the last one has ended."""
        if self._child is None:
            self._open()
        return self._call(name, *arguments)

    def close(self) -> None:
        """End the process; may be called twice."""
        child = self._child
        if child is None:
            return
        with contextlib.suppress(OSError, subprocess.TimeoutExpired):
            self._send(child, ["close"])
            child.wait(STOP_TIME)
        self._end(child)

    def _open(self) -> None:
        # A process that the user's terminal interrupts would leave half a conversation: the child stays deaf
        # to it (see main) and is ended by its parent.
        self._child = child = subprocess.Popen(
            [sys.executable, "-P", "-c", "from hovercontrol.fmi.importer.worker import main; main()"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=self._opening["folder"],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, map(os.path.abspath, sys.path)))},
        )
        self._answers = queue.SimpleQueue()
        reader = threading.Thread(target=_forward, args=(child.stdout, self._answers), daemon=True)
        reader.start()
        self._call("open", self._opening, timeout=START_TIME + self._timeout)

    def _call(self, name: str, *arguments: Any, timeout: float | None = None) -> Any:
        child = self._child
        if child is None:
            raise FmuError("its process has ended")
        wait = self._timeout if timeout is None else timeout
        try:
            self._send(child, [name, *arguments])
            line = _answer(self._answers, child.pid, wait)
            if not line:
                raise EOFError
            answer = json.loads(line)
        except queue.Empty:
            self._end(child)
            raise FmuError(f"it did not answer within {wait:g} s; its process was ended") from None
        except (OSError, EOFError, ValueError):
            self._end(child, patience=STOP_TIME)
            raise FmuError(f"its process ended by itself ({_status(child.returncode)})") from None
        except BaseException:  # an interrupt: the answer to this call must not be taken for the next one's
            self._end(child)
            raise
        if "ended" in answer:
            raise RunEnded(*answer["ended"])
        if "fault" in answer:
            raise FmuError(str(answer["fault"]))
        return answer["result"]

    def _send(self, child: subprocess.Popen[bytes], message: list[Any]) -> None:
        assert child.stdin is not None
        child.stdin.write(json.dumps(message).encode() + b"\n")
        child.stdin.flush()

    def _end(self, child: subprocess.Popen[bytes], patience: float = 0.0) -> None:
        with contextlib.suppress(subprocess.TimeoutExpired):
            child.wait(patience)
        if child.poll() is None:
            child.kill()
            child.wait()
        for pipe in (child.stdin, child.stdout):
            with contextlib.suppress(OSError):
                if pipe is not None:
                    pipe.close()
        self._child = None


def _answer(answers: queue.SimpleQueue[bytes], pid: int, limit: float) -> bytes:
    """Return the next line of a child.

    Only time in which the child computes or sleeps counts towards `limit` [s]; time in which it waits for a
    processor that other processes use does not. A child that sleeps for ever is thus given up after `limit`.

    Raises
    ------
    queue.Empty
        If there is none in time.
    """
    begin, queued, left = time.monotonic(), _queued(pid), limit
    while True:
        try:
            return answers.get(timeout=max(left, POLL))
        except queue.Empty:
            left = limit - (time.monotonic() - begin - (_queued(pid) - queued))
            if left <= 0.0:
                raise


def _queued(pid: int) -> float:
    """Return how long a process has waited for a processor [s], as Linux says it; elsewhere 0."""
    try:
        return int(Path(f"/proc/{pid}/schedstat").read_text().split()[1]) / 1e9
    except (OSError, IndexError, ValueError):
        return 0.0


def _forward(pipe: IO[bytes], answers: queue.SimpleQueue[bytes]) -> None:
    """Forward the child's lines to a queue, then an empty one: reading a pipe has no timeout."""
    with contextlib.suppress(OSError, ValueError):
        for line in pipe:
            answers.put(line)
    answers.put(b"")


def _status(code: int | None) -> str:
    if code is not None and code < 0:
        with contextlib.suppress(ValueError):
            return f"signal {signal.Signals(-code).name}"
    return f"status {code}"


def main() -> None:
    """Serve one FMU until the close command or the parent's end."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # The FMU may print: its standard output becomes standard error, the answers go another way.
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    requests: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(requests,), daemon=True).start()
    engine: Any = None
    while True:
        name, *arguments = json.loads(requests.get())
        reply: dict[str, Any]
        try:
            if name == "open":
                opening = arguments[0]
                folder, interface = Path(opening["folder"]), _interface(opening["interface"])
                engine = _serving(opening["serving"])(folder, interface, opening["name"])
                reply = {"result": None}
            elif engine is None:
                reply = {"fault": "no FMU is open"}
            else:
                reply = {"result": getattr(engine, name)(*arguments)}
        except RunEnded as end:
            reply = {"ended": [str(end), end.time, end.values]}
        except FmuError as fault:
            reply = {"fault": str(fault)}
        if name == "close":
            break
        answers.write(json.dumps(reply).encode() + b"\n")
        answers.flush()
    os._exit(0)  # the FMU is freed; what it left behind may not hold up the end


def _serving(what: str) -> Callable[[Path, Interface, str], Any]:
    if what == "instance":
        return instance_of
    from hovercontrol.fmi.replay.replayer import Replayer

    return Replayer


def _listen(requests: queue.SimpleQueue[bytes]) -> None:
    """Forward the parent's lines; at their end this process exits, whatever the FMU is doing."""
    for line in sys.stdin.buffer:
        requests.put(line)
        if json.loads(line)[0] == "close":
            return
    os._exit(1)


def _interface(plain: dict[str, Any]) -> Interface:
    for key in ("inputs", "outputs", "parameters", "states", "derivatives"):
        plain[key] = tuple(Variable(**variable) for variable in plain[key])
    plain["clocks"] = tuple(Clock(**clock) for clock in plain["clocks"])
    return Interface(**plain)
