"""FMUs of small Blocks, as the exporter makes their sources, driven through FMPy's bindings."""

from __future__ import annotations

import re
import subprocess
import tempfile
from collections.abc import Sequence
from ctypes import POINTER, c_double
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import fmpy
import fmpy.fmi2
import fmpy.fmi3
import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.sundials import CVodeSolver

from hovercontrol import Block
from hovercontrol.blocks.backends.compiled import compile_block
from hovercontrol.blocks.backends.runtime import FMI
from hovercontrol.fmi.exporter.sources import fmu_sources, without_prefix
from hovercontrol.fmi.exporter.variables import Interface

from .support import RUNTIME, objects

STRICT = "-std=c99 -Wall -Wextra -Wshadow -Wconversion -Werror -pedantic".split()  # noqa: SIM905
SHARED = "-O1 -ffp-contract=off -fPIC -fvisibility=hidden".split()  # noqa: SIM905
FOLDERS = {2: fmpy.platform, 3: fmpy.platform_tuple}
ME, CS = "ME", "CS"
OK, WARNING, DISCARD, ERROR = range(4)


@dataclass(frozen=True)
class Built:
    """The compiled FMU of a Block, as an unzipped folder."""

    interface: Interface
    version: int
    folder: Path
    library: Path
    token: str

    def vr(self, kind: str, *names: str) -> list[int]:
        """Value references of some variables of a kind, or of all."""
        block = self.interface.block
        groups = {"state": block.states, "derivative": block.states, "input": block.inputs,
                  "parameter": block.parameters, "output": block.outputs}  # fmt: skip
        if kind in ("event", "mode"):
            known = [f.state for f in self.interface.frictions]
        else:
            known = [s.name for s in groups[kind]]
        first = self.interface.first(kind)
        return [first + known.index(name) for name in names or known]

    def open(self, kind: str, *, logging: bool = True, name: str = "one", **options: Any) -> Instance:
        return Instance(self, kind, logging, name, options)


def write_sources(
    block: Block, version: int, folder: Path, rtol: float = 1e-6, *, prefix: bool = True
) -> list[Path]:
    """Write the C files of a Block's FMU; return the paths of those to compile."""
    files = fmu_sources(Interface(block, "events"), version, rtol, 1e-3 * rtol)
    if not prefix:
        files = without_prefix(files)
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        (folder / name).write_text(text)
    return [folder / name for name in sorted(files) if name.endswith(".c")]


def token_in(folder: Path) -> str:
    return re.search(r'"(\{[-0-9a-f]+\})"', (folder / "description.c").read_text()).group(1)


def run(command: Sequence[object]) -> str:
    result = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def build(compiler: str, sources: Sequence[Path], flags: Sequence[str], more: Sequence[object]) -> None:
    """Compile and link the sources of an FMU; its runtime, the same for all Blocks, once in this process."""
    runtime = [path for path in sources if path.name.startswith("hc_")]
    texts = [(path.name, path.read_text()) for path in sorted(sources[0].parent.glob("hc_*"))]
    own = [path for path in sources if path not in runtime]
    made = _runtime(compiler, tuple(path.name for path in runtime), tuple(flags), tuple(texts))
    run([compiler, *STRICT, *flags, f"-I{sources[0].parent}", *own, *made, *more, "-lm"])


@cache
def _runtime(
    compiler: str, names: tuple[str, ...], flags: tuple[str, ...], texts: tuple[tuple[str, str], ...]
) -> tuple[Path, ...]:
    with tempfile.TemporaryDirectory(prefix="hovercontrol-runtime-") as folder:
        for name, text in texts:
            Path(folder, name).write_text(text)
        return objects(compiler, Path(folder), names, (*STRICT, *flags))


def build_fmu(compiler: str, block: Block, version: int, folder: Path) -> Built:
    interface, place = Interface(block, "events"), folder / "binaries" / FOLDERS[version]
    sources = write_sources(block, version, folder / "sources", prefix=False)
    place.mkdir(parents=True)
    library = place / f"{interface.identifier}{fmpy.sharedLibraryExtension}"
    build(compiler, sources, SHARED, ["-shared", "-o", library])
    return Built(interface, version, folder, library, token_in(folder / "sources"))


class Instance:
    """One instance, with the differences between the versions of FMI taken out."""

    def __init__(self, built: Built, kind: str, logging: bool, name: str, options: dict[str, Any]) -> None:
        self.built, self.kind, self.messages = built, kind, []
        version = built.version
        module = {2: fmpy.fmi2, 3: fmpy.fmi3}[version]
        maker = getattr(module, f"FMU{version}{'Model' if kind == ME else 'Slave'}")
        where = {"guid": built.token, "unzipDirectory": str(built.folder), "instanceName": name}
        self.fmu = fmu = maker(modelIdentifier=built.interface.identifier, **where)
        self.event_mode = options.get("eventModeUsed", False)
        if version == 2:
            self._log = fmpy.fmi2.fmi2CallbackLoggerTYPE(self._message2)
            self._callbacks = fmpy.fmi2.fmi2CallbackFunctions(logger=self._log)
            self._instantiate(callbacks=self._callbacks, loggingOn=logging)
            self.get, self.set, self.modes = fmu.getReal, fmu.setReal, fmu.getInteger
            self.update = getattr(fmu, "newDiscreteStates", None)
            self.derivatives = getattr(fmu, "getDerivatives", None)
        else:
            self._instantiate(loggingOn=logging, logMessage=self._message3, **options)
            self.get, self.set, self.modes = fmu.getFloat64, fmu.setFloat64, fmu.getInt32
            self.update = fmu.updateDiscreteStates
            self.derivatives = getattr(fmu, "getContinuousStateDerivatives", None)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.fmu, name)

    def _instantiate(self, **options: Any) -> None:
        try:
            self.fmu.instantiate(**options)
        except Exception:  # FMPy raises no other
            raise RuntimeError(f"not instantiated: {self.messages}") from None

    def _message2(self, _: Any, name: bytes, status: int, category: bytes, message: bytes) -> None:
        self.messages.append((status, category.decode(), message.decode()))

    def _message3(self, _: Any, status: int, category: bytes, message: bytes) -> None:
        self.messages.append((status, category.decode(), message.decode()))

    @property
    def last(self) -> str:
        return self.messages[-1][2]

    def enter_initialization(self, start=0.0, tolerance=None, stop=None) -> None:
        times = {"startTime": start, "tolerance": tolerance, "stopTime": stop}
        if self.built.version == 2:
            self.fmu.setupExperiment(**times)
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(**times)

    def start(self, **options: Any) -> Instance:
        """Go on to Step Mode or Continuous-Time Mode."""
        self.enter_initialization(**options)
        self.fmu.exitInitializationMode()
        if self.kind == ME or self.event_mode:
            self.update()
            self.fmu.enterContinuousTimeMode() if self.kind == ME else self.fmu.enterStepMode()
        return self

    def step(self, at: float, length: float) -> tuple[bool, bool, float]:
        """Do a step; return whether there was an event, whether it returned early, and the time reached."""
        if self.built.version == 2:
            self.fmu.doStep(at, length)
            return False, False, at + length
        event, terminate, early, reached = self.fmu.doStep(at, length)
        assert not terminate
        return event, early, reached

    def states(self) -> np.ndarray:
        return np.array(self.get(self.built.vr("state")))

    def snapshot(self) -> bytes:
        """The whole state, as bytes."""
        state = self.fmu.getFMUState()
        data = self.fmu.serializeFMUState(state)
        self.fmu.freeFMUState(state)
        return data

    def restore(self, data: bytes) -> None:
        state = self.fmu.deserializeFMUState(data)
        self.fmu.setFMUState(state)
        self.fmu.freeFMUState(state)

    def close(self) -> None:
        self.fmu.freeInstance()


def sticking(block):
    """The compiled Block with the dry friction that its FMU has."""
    return compile_block(block, friction="events")


def march(instance, times):
    rows = [instance.states()]
    for begin, end in pairwise(times):
        instance.step(begin, end - begin)
        rows.append(instance.states())
    return np.array(rows)


def vector(array: np.ndarray) -> Any:
    """Return a pointer that keeps its array alive."""
    return array.ctypes.data_as(POINTER(c_double))


class Nothing:
    """No inputs that vary, for FMPy's solver."""

    def apply(self, t: float) -> None:
        pass


def integrate(model: Instance, times: Sequence[float], rtol: float, **start: Any) -> tuple[np.ndarray, int]:
    """Integrate a Model Exchange instance with FMPy's CVode; return states and the number of events."""
    n, z = len(model.built.vr("state")), len(model.built.vr("event"))
    model.enter_initialization(start=times[0], **start)
    model.exitInitializationMode()
    *_, defined, at = model.update()
    model.enterContinuousTimeMode()
    names = {"get_x": model.getContinuousStates, "set_x": model.setContinuousStates,
             "get_dx": model.derivatives, "get_z": model.getEventIndicators,
             "get_nominals": model.getNominalsOfContinuousStates, "set_time": model.setTime}  # fmt: skip
    solver = CVodeSolver(
        n,
        z,
        input=Nothing(),
        startTime=times[0],
        maxStep=0.1,
        relativeTolerance=rtol,
        maxNumSteps=5000,
        **names,
    )
    result, events, now = [model.states()], 0, times[0]
    for until in times[1:]:
        while now < until:
            stop = min(until, at) if defined else until
            state_event, _, now = solver.step(now, stop)
            model.setTime(now)
            step_event, _ = model.completedIntegratorStep()
            if state_event or step_event or (defined and now >= at):
                events += 1
                model.enterEventMode()
                *_, defined, at = model.update()
                model.enterContinuousTimeMode()
                solver.reset(now)
        result.append(model.states())
    return np.array(result), events


STATES = "INECSTX"  # Instantiated, iNitialization, Event, Continuous-time, Step, Terminated, error (X)


def in_state(built: Built, kind: str, state: str) -> Instance:
    """Return an instance that was led to a state."""
    options = {"eventModeUsed": True} if built.version == 3 and kind == CS else {}
    instance = built.open(kind, **options)
    if state == "I":
        return instance
    if state == "N":
        instance.enter_initialization()
        return instance
    if state == "E" and (kind == ME or options):
        instance.enter_initialization()
        instance.exitInitializationMode()
        instance.update()
        return instance
    instance.start()
    if state == "T":
        instance.terminate()
    if state == "X":
        refused(lambda: instance.get([10_000]))
    return instance


def states_of(built: Built, kind: str) -> str:
    own = "INCETX" if kind == ME else "INSETX" if built.version == 3 else "INSTX"
    return "".join(s for s in STATES if s in own)


def refused(call: Any) -> bool:
    """Whether a call returned fmi2Error or fmi3Error."""
    try:
        call()
    except FMICallException as error:
        return error.status == ERROR
    return False


def allowed_states(built: Built, kind: str, call: Any) -> str:
    """Return the states in which a call is no error; where it is one, a message must say so."""
    found = ""
    for state in states_of(built, kind):
        instance = in_state(built, kind, state)
        instance.messages.clear()
        if refused(lambda: call(instance)):  # noqa: B023
            assert any(
                status == ERROR and category == "logStatusError" for status, category, _ in instance.messages
            )
        else:
            found += state
        instance.close()
    return found


def official_functions(version: int) -> set[str]:
    """Return the names of all functions that the standard's header declares."""
    header = Path(fmpy.__file__).parent / "c-code" / f"fmi{version}Functions.h"
    return set(re.findall(rf"FMI{version}_Export fmi{version}\w+TYPE\s+(\w+);", header.read_text()))


def check_official_headers(compiler: str, version: int, folder: Path) -> None:
    """The binding compiles with the standard's own types and prototypes for ours, and our types are those."""
    headers = Path(fmpy.__file__).parent / "c-code"
    bindings = [RUNTIME / name for name in FMI[version] if name.endswith(".c")]
    first = "fmi2TypesPlatform.h" if version == 2 else "fmi3PlatformTypes.h"
    official = [first, f"fmi{version}FunctionTypes.h", f"fmi{version}Functions.h"]
    included = [part for name in official for part in ("-include", headers / name)]
    folders = [f"-I{headers}", f"-I{RUNTIME}"]
    for binding in bindings:
        run([compiler, *STRICT, *included, *folders, "-c", binding, "-o", folder / "binding.o"])

    names = set(re.findall(rf"\bfmi{version}[A-Z]\w*", (RUNTIME / f"hc_fmi{version}.h").read_text()))
    text = "".join((headers / name).read_text() for name in official)
    types = sorted(n for n in names if re.search(rf"typedef[^;(]*\b{n}\s*;|\(\*\s*{n}\)|\}} {n};", text))
    body = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    words = sorted(
        {w for e in re.findall(r"typedef enum \{(.*?)\}", body, re.DOTALL) for w in re.findall(r"\w+", e)}
    )
    assert len(types) > 10
    assert len(words) > 10
    printed = []
    for k, wanted in enumerate(([f"hc_fmi{version}.h"], official)):
        lines = [f'#include "{name}"' for name in wanted] + ["#include <stdio.h>", "int main(void)", "{"]
        lines += [f'    printf("{t} %zu\\n", sizeof({t}));' for t in types]
        lines += [f'    printf("{w} %d\\n", (int){w});' for w in words]
        if version == 2:
            lines += [
                "    fmi2EventInfo e;",
                '    printf("%d\\n", (int)((char *)&e.nextEventTime - (char *)&e));',
            ]
        source = folder / f"types{k}.c"
        source.write_text("\n".join([*lines, "    return 0;", "}", ""]))
        run([compiler, "-std=c99", f"-I{headers}", f"-I{RUNTIME}", source, "-o", folder / f"types{k}"])
        printed.append(run([folder / f"types{k}"]))
    assert printed[0] == printed[1]


def symbols(path: Path, *flags: str) -> set[str]:
    """Return the names that a library or object file defines."""
    lines = run(["nm", *flags, "--defined-only", path]).splitlines()
    return {line.split()[-1] for line in lines if re.search(r" [TDRB] ", line)}
