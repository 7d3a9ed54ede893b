"""Real time: a thread that advances the loop with the clock and supervises the pilot's connection."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from hovercontrol.app.cockpit.orders import Flown
from hovercontrol.app.cockpit.recorder import LONGEST, Recorder
from hovercontrol.app.cockpit.watch import Watch
from hovercontrol.base.errors import InputError

#: Simulated time between two frames and between two rows of a recording [s]. Commands take effect on a row,
#: so that a recording holds them exactly.
FRAME, ROW = 0.02, 0.01

#: Commands go to zero when the pilot's browser was silent for so long [s].
SILENCE = 0.4

#: Time that the loop may be behind before it lets the lost time go [s].
LAG = 0.1

#: Below this part of real time the machine is called too slow.
SLOW = 0.97


class Pacer:
    """A loop in real time. Every method may be called from any thread.

    Attributes
    ----------
    listeners : list of callable
        Called without arguments, in the pacer's thread, after each frame.

    Notes
    -----
    The simulation never catches up on lost time: on a slow machine the reference of the clock is shifted, and
    ``factor`` is the achieved fraction of real time.
    """

    def __init__(self, loop: Flown) -> None:
        self.loop = loop
        self.listeners: list[Callable[[], None]] = []
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="pacer", daemon=True)
        self._recorder: Recorder | None = None
        self._monitor: Watch | None = None
        self._finished: list[Recorder] = []
        self._paused, self._note, self._frame = True, "", 0
        self._heard: float | None = None
        self._paused_at = 0.0
        self._begin()
        self._state: dict[str, Any] = {}
        self._tell()

    # ---- what the server says ------------------------------------------------------------------------

    def start(self) -> None:
        """Start the thread; time stands still until :meth:`pause`."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()

    def heard(self, stick: tuple[Any, Any]) -> None:
        """Set the stick; this also shows that the pilot's browser is connected.

        Raises
        ------
        InputError
            If the stick is not a pair of numbers from -1 to 1; it is then unchanged.
        """
        with self._lock:
            self.loop.command(stick=stick)
            self._note = "" if any(stick) else self._note
            self._heard = time.monotonic()

    def left(self) -> None:
        """Report that the pilot's browser has left: commands go to zero."""
        with self._lock:
            if self._heard is not None:
                self._release("The browser left: commands were set to zero.")

    def command(self, **orders: Any) -> None:
        """Apply the pilot's commands, see :meth:`.orders.Flown.command`; a sign of life, like the stick."""
        with self._lock:
            self.loop.command(**orders)
            if any(orders.values()):  # an order that orders nothing may come from nobody
                self._heard = time.monotonic()
            self._note = ""
            self._tell()

    def pause(self, paused: bool) -> None:
        """Stop or continue time; silence of the browser counts while time goes on."""
        with self._lock:
            if paused != self._paused:
                self._paused, now = paused, time.monotonic()
                if paused:
                    self._paused_at = now
                elif self._heard is not None:
                    self._heard = now - max(0.0, self._paused_at - self._heard)
                self._begin()
            self._tell()

    def reset(self) -> None:
        """Put the craft back to its start; this ends a recording."""
        with self._lock:
            self._end_recording()
            self.loop.reset()
            if self._monitor is not None:
                self._monitor.restart()
            self._note = ""
            self._begin()
            self._tell()

    def fly(self, loop: Flown) -> None:
        """Switch to another loop at its start, under the same law; this ends a recording."""
        with self._lock:
            self._end_recording()
            loop.reset()
            loop.command(law=self.loop.law if self.loop.law in loop.choices else "manual", stick=(0.0, 0.0))
            self.loop, self._note, self._monitor = loop, "", None
            self._begin()
            self._tell()

    def monitor(self, watch: Watch | None) -> None:
        """Let a monitor watch the craft from now on; None ends it."""
        with self._lock:
            self._monitor = watch
            self._tell()

    def record(self, on: bool) -> None:
        """Begin a recording, or end it; :meth:`finished` then returns it."""
        with self._lock:
            if on and self._recorder is None:
                self._recorder = Recorder([s.name for s in self.loop.inputs], self.loop.logged)
            elif not on:
                self._end_recording()
            self._tell()

    def finished(self) -> list[Recorder]:
        """Return the finished recordings, each once."""
        with self._lock:
            done, self._finished = self._finished, []
        return done

    @property
    def state(self) -> dict[str, Any]:
        """The state for the page: frame, signals, law, references, disturbances, and the pace of time."""
        return self._state

    # ---- the thread ----------------------------------------------------------------------------------

    def _run(self) -> None:
        while not self._stop.is_set():
            with self._lock:
                self._watch()
                if not self._paused:
                    self._advance()
                self._tell()
                next_frame = self._wall + self.loop.time + FRAME - self._simulated
            for listener in list(self.listeners):
                listener()
            pause = FRAME if self._paused else next_frame - time.monotonic()
            self._stop.wait(max(pause, 0.001))

    def _advance(self) -> None:
        now = time.monotonic()
        due = int((now - self._wall + 1e-6) / FRAME)
        done = round((self.loop.time - self._simulated) / FRAME)
        if (due - done) * FRAME > LAG:  # let go of what is lost, catch up with the rest
            self._wall += (due - done - 1) * FRAME
            due = done + 1
        try:
            for _ in range(done, due):
                for _ in range(round(FRAME / ROW)):
                    if self._recorder is not None or self._monitor is not None:
                        signals = self.loop.signals()
                        if self._recorder is not None:
                            self._recorder.add(signals)
                        if self._monitor is not None:
                            self._monitor.row(signals)
                    self.loop.advance(self.loop.time + ROW)
        except (InputError, ArithmeticError, ValueError) as error:
            self._paused, self._note = True, str(error)
        if self._recorder is not None and self._recorder.seconds > LONGEST:
            self._end_recording()
            self._note = f"The recording ended: it was {LONGEST / 3600:g} h long."
        self._pace.append((now, self.loop.time, time.thread_time()))

    def _watch(self) -> None:
        if self._paused:  # no command acts, and only the pilot can let time go on
            return
        if self._heard is not None and time.monotonic() - self._heard > SILENCE:
            self._release(f"No word from the browser for {SILENCE:g} s: commands were set to zero.")

    def _release(self, note: str) -> None:
        self.loop.command(law="manual", stick=(0.0, 0.0))
        self._heard, self._note = None, note
        self._tell()

    def _end_recording(self) -> None:
        if self._recorder is not None:
            self._finished.append(self._recorder)
            self._recorder = None

    def _begin(self) -> None:
        """Synchronise the clock and simulated time."""
        self._wall, self._simulated = time.monotonic(), self.loop.time
        self._pace: deque[tuple[float, float, float]] = deque(maxlen=round(1.0 / FRAME))

    def _measured(self) -> tuple[float | None, float | None]:
        """Return simulated time and processor time of the last second, relative to real time."""
        if len(self._pace) < 25:  # half a second
            return None, None
        (wall, simulated, cpu), last = self._pace[0], self._pace[-1]
        passed = max(last[0] - wall, 1e-9)
        return (last[1] - simulated) / passed, (last[2] - cpu) / passed

    def _tell(self) -> None:
        loop, (factor, load) = self.loop, self._measured()
        self._frame += 1
        slow = factor is not None and factor < SLOW
        self._state = {
            "frame": self._frame,
            "loop": loop.kind,
            "switches": loop.switches,
            "signals": loop.signals(),
            "law": loop.law,
            "modes": loop.modes(),
            "references": loop.references[loop.law],
            "disturbances": loop.switched_on,
            "paused": self._paused,
            "monitor": None if self._monitor is None else self._monitor.state(),
            "recording": None if self._recorder is None else self._recorder.seconds,
            "factor": factor,
            "load": load,
            "slow": slow,
            "note": self._note or loop.notes(),
        }
