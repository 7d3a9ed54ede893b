"""A running instance of an FMU for Co-Simulation, through FMPy: one interface for FMI 2 and 3.

Values are flat lists of floats, in the order of the interface's labels. If the FMU rejects a call, a
:class:`FmuError` has its message. Native code runs here, with this process's rights.
"""

from __future__ import annotations

import contextlib
import itertools
import os
from collections import deque
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol

from fmpy import fmi2, fmi3  # type: ignore[import-untyped]
from fmpy.fmi1 import FMICallException  # type: ignore[import-untyped]

from hovercontrol.fmi.importer.access import Some, Values
from hovercontrol.fmi.importer.interface import Interface
from hovercontrol.fmi.importer.messages import LOGS, callbacks_of, text_of

STATUS = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
_FATAL = 4
#: Updates of the discrete states at one instant; more is an FMU whose event iteration does not end.
MOST_UPDATES = 1000


#: Instantiation tokens of the FMUs in use that allow one instance in a process.
_ONLY: set[str] = set()


class FmuError(Exception):
    """An FMU refused a call, ended the run, or is gone; the text is one line."""


class RunEnded(FmuError):  # noqa: N818 - an end is no error
    """The FMU ended the run at `time` [s] with these outputs (None: not available)."""

    def __init__(self, text: str, time: float, values: list[float] | None) -> None:
        super().__init__(text)
        self.time, self.values = time, values


class Engine(Protocol):
    """Interface of a running FMU, in this process or in another."""

    def start(self, time: float, parameters: Sequence[float | None], inputs: Sequence[float]) -> list[float]:
        """Begin a run: a new instance with these parameters (None: the FMU's value), initialised."""

    def outputs(self, inputs: Sequence[float]) -> list[float]:
        """Set the inputs and read the outputs; no time passes."""

    def step(self, time: float, step: float, inputs: Sequence[float]) -> list[float]:
        """Advance in time with these inputs and return the outputs; raise RunEnded if it is the last step."""

    def save(self) -> int:
        """Save the present state and return its handle."""

    def restore(self, handle: int) -> None:
        """Restore a saved state."""

    def drop(self, handle: int) -> None:
        """Discard a saved state."""

    def close(self) -> None:
        """Free the instance and its resources."""


class Instance:
    """An FMU in this process.

    Parameters
    ----------
    folder : Path
        Folder of the unpacked FMU.
    name : str
        The instance's name, for its messages.

    Raises
    ------
    FmuError
        If the binary cannot be loaded or lacks functions, or is in use and allows one instance only.
    """

    def __init__(self, folder: Path, interface: Interface, name: str) -> None:
        self._interface, self._name = interface, name
        self._inputs = Some(interface.inputs, [v for v in interface.inputs if not v.clocks])
        self._outputs = Values(interface.outputs)
        self._log: deque[tuple[int, str]] = deque(maxlen=20)
        self._running = self._initialised = self._fatal = False
        self._states: dict[int, Any] = {}
        self._handles = itertools.count(1)
        self._holds_token = False
        self._options: dict[str, bool] = {}  # of the instantiation in FMI 3
        if interface.once_per_process:
            if interface.token in _ONLY:
                raise FmuError(
                    "it allows one instance in a process, which exists; isolated=True uses a separate process"
                )
            _ONLY.add(interface.token)
            self._holds_token = True
        kind = {
            (2, "CoSimulation"): fmi2.FMU2Slave,
            (3, "CoSimulation"): fmi3.FMU3Slave,
            (2, "ModelExchange"): fmi2.FMU2Model,
            (3, "ModelExchange"): fmi3.FMU3Model,
        }[interface.fmi, interface.kind]
        here = os.getcwd()
        try:
            self._fmu = kind(
                guid=interface.token,
                modelIdentifier=interface.identifier,
                unzipDirectory=str(folder),
                instanceName=name,
            )
        except Exception as error:
            self._release_token()
            # The path is that of a temporary copy, which tells nobody anything.
            text = " ".join(str(error).replace(f"{folder}{os.sep}", "").split())
            raise FmuError(f"its binary cannot be loaded: {text}") from None
        finally:
            os.chdir(here)  # FMPy leaves the folder changed where loading fails

    def start(self, time: float, parameters: Sequence[float | None], inputs: Sequence[float]) -> list[float]:
        """Begin a run, see :class:`Engine`."""
        with self._faults():
            self._fresh()
            self._set_parameters(parameters)
            tolerance = self._interface.tolerance
            if self._interface.fmi == 2:
                self._fmu.setupExperiment(tolerance=tolerance, startTime=time)
                self._fmu.enterInitializationMode()
            else:
                self._fmu.enterInitializationMode(tolerance=tolerance, startTime=time)
            self._inputs.set(self._fmu, inputs)
            self._fmu.exitInitializationMode()
            self._initialised = True
            return self._read()

    def outputs(self, inputs: Sequence[float]) -> list[float]:
        """Set the inputs and read the outputs, see :class:`Engine`."""
        with self._faults():
            self._inputs.set(self._fmu, inputs)
            return self._read()

    def step(self, time: float, step: float, inputs: Sequence[float]) -> list[float]:
        """Advance in time, see :class:`Engine`."""
        with self._faults():
            self._inputs.set(self._fmu, inputs)
            final = not self._interface.has_states  # then nobody goes back
            if self._interface.fmi == 2:
                self._step2(time, step, final)
            else:
                _event, ended, early, reached = self._fmu.doStep(time, step, final)
                if ended:
                    raise self._ended(reached)
                if early:  # never allowed; without the flag many FMUs leave the time reached unset
                    raise FmuError(f"it returned early from the step, at t = {reached:.9g} s{self._words()}")
            return self._read()

    def _step2(self, time: float, step: float, final: bool) -> None:
        try:
            self._fmu.doStep(time, step, final)
        except FMICallException as error:
            if STATUS[error.status] != "Discard":
                raise
            # A discarded step may have gone part of the way, or the FMU may want no further one.
            with contextlib.suppress(FMICallException):
                reached = self._fmu.getRealStatus(fmi2.fmi2LastSuccessfulTime)
                ended = self._fmu.getBooleanStatus(fmi2.fmi2Terminated)
                if ended:
                    raise self._ended(reached) from None
                if time < reached < time + step:
                    raise FmuError(
                        f"it returned early from the step, at t = {reached:.9g} s{self._words()}"
                    ) from None
            raise

    def _ended(self, reached: float) -> RunEnded:
        words = self._words(silent="")
        values = None
        with contextlib.suppress(FMICallException):  # FMI allows to read; not every FMU answers any more
            values = self._read()
        return RunEnded(f"ended the run at t = {reached:.9g} s{words}", reached, values)

    def save(self) -> int:
        """Keep the present state, see :class:`Engine`."""
        with self._faults():
            handle = next(self._handles)
            self._states[handle] = self._fmu.getFMUState()
            return handle

    def restore(self, handle: int) -> None:
        """Return to a state, see :class:`Engine`."""
        with self._faults():
            self._fmu.setFMUState(self._states[handle])

    def drop(self, handle: int) -> None:
        """Keep a state no longer, see :class:`Engine`."""
        with self._faults():
            self._fmu.freeFMUState(self._states.pop(handle))

    def close(self) -> None:
        """Free the instance and unload the library; may be called twice."""
        if self._fmu is None:
            return
        fmu, self._fmu, fatal = self._fmu, None, self._fatal
        with contextlib.suppress(Exception):
            self._free(fmu)
        if not fatal:  # after a fatal error nothing of the FMU may be touched any more
            with contextlib.suppress(Exception):
                fmu.freeLibrary()
        self._release_token()

    def _fresh(self) -> None:
        """Provide an instance that has not been initialised.

        A new instance is safer than a reset, which many FMUs do incompletely; but some allow only one.
        """
        if self._running and self._interface.once_per_process:
            self._drop_all(self._fmu)
            self._fmu.reset()
            self._initialised = False
            return
        self._free(self._fmu)
        if self._interface.fmi == 2:
            self._fmu.instantiate(callbacks=callbacks_of(self._log), loggingOn=True)
        else:
            self._fmu.instantiate(loggingOn=True, logMessage=self._listen, **self._options)
            if sizes := self._interface.sizes:
                self._fmu.enterConfigurationMode()
                for reference, kind, value in sizes.values():
                    getattr(self._fmu, f"set{kind}")([reference], [value])
                self._fmu.exitConfigurationMode()
        self._running = True

    def _free(self, fmu: Any) -> None:
        if not self._running or self._fatal:
            return
        self._drop_all(fmu)
        if self._initialised:
            with contextlib.suppress(FMICallException):  # not allowed after an error, and of no matter then
                fmu.terminate()
        self._running = self._initialised = False
        # freeInstance of FMPy would unload the library as well.
        (fmu.fmi2FreeInstance if self._interface.fmi == 2 else fmu.fmi3FreeInstance)(fmu.component)
        LOGS.pop(id(self._log), None)

    def _drop_all(self, fmu: Any) -> None:
        for state in self._states.values():
            with contextlib.suppress(FMICallException):
                fmu.freeFMUState(state)
        self._states.clear()

    def _set_parameters(self, parameters: Sequence[float | None]) -> None:
        values = iter(parameters)
        for variable in self._interface.parameters:
            own = [next(values) for _ in variable.labels]
            if any(value is not None for value in own):
                filled = [s if v is None else v for v, s in zip(own, variable.start, strict=True)]
                if any(value != value for value in filled):
                    raise FmuError(f"parameter {variable.name!r} has another size now: give all its elements")
                Values([variable]).set(self._fmu, filled)

    def _read(self) -> list[float]:
        return self._outputs.get(self._fmu, self._interface.fmi)

    def _listen(self, _environment: Any, status: int, _category: bytes, message: bytes) -> None:
        self._log.append((status, text_of(message)))

    @contextlib.contextmanager
    def _faults(self) -> Iterator[None]:
        """Convert exceptions of FMPy to a FmuError with the FMU's message."""
        self._log.clear()
        if self._fmu is None or self._fatal:
            raise FmuError("it cannot be used after its fatal error")
        try:
            yield
        except FmuError:
            raise
        except FMICallException as error:
            self._fatal = error.status == _FATAL
            label = STATUS[error.status] if error.status in range(len(STATUS)) else error.status
            raise FmuError(
                f"{error.function} returned fmi{self._interface.fmi}{label}{self._words()}"
            ) from None
        except Exception as error:
            raise FmuError(f"{' '.join(str(error).split())}{self._words()}") from None

    def _words(self, silent: str = "; it gives no message") -> str:
        """Return the FMU's last message, errors first."""
        grave = [text for status, text in self._log if status >= 2]
        words = grave or [text for _, text in self._log]
        return f"; its message: {words[-1]}" if words else silent

    def _release_token(self) -> None:
        if self._holds_token:
            _ONLY.discard(self._interface.token)
            self._holds_token = False
