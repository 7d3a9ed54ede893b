"""A point of an FMU for Model Exchange: the time, states and inputs that it has, and the calls for them.

The calls go to the FMU's library itself with arguments made once, since FMPy's wrappers take several times as
long. Where there is a C compiler, point.c makes them all in one call.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Sequence
from functools import cache
from importlib import resources
from typing import Any, NoReturn

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.backends.compiler import NoCompilerError, load_library
from hovercontrol.fmi.importer.instance import FmuError
from hovercontrol.fmi.importer.interface import Interface, Variable

Read = Callable[[float, Array, Array], Array]

DOUBLES = ("Real", "Float64")


class Point:
    """The point of an instance in Continuous-Time Mode, set and read by calls from Python.

    What has not changed is not set again; after a new time the states are.

    Parameters
    ----------
    fmu : object
        FMPy's, instantiated.
    refused : callable
        Of a status and a call's name; raises.
    jump : callable
        Sets inputs in an event, where some change at events only or are not all Float64.

    Attributes
    ----------
    rates, outputs, indicators : callable
        Of time [s], states and inputs. `outputs` is None if they are not all Float64 or some are clocked.
    """

    def __init__(
        self,
        fmu: Any,
        interface: Interface,
        refused: Callable[[int, str], NoReturn],
        jump: Callable[[Array], None],
    ) -> None:
        two = interface.fmi == 2
        # Without giving up Python's lock at each call: a right-hand side takes less time than that.
        self._library = ctypes.PyDLL(fmu.dll._name, handle=fmu.dll._handle)
        self._component = ctypes.c_void_p(fmu.component)
        self._refused, self._jump, self._fmi = refused, jump, interface.fmi
        self._n = sum(len(v.labels) for v in interface.states)
        self._clock, self._size = ctypes.c_double(), ctypes.c_size_t(self._n)
        self._put_time, self._put_states = self._call("SetTime"), self._call("SetContinuousStates")
        self.plain = all_doubles(interface.inputs) and not any(v.discrete for v in interface.inputs)
        self._put_inputs = self._call("SetReal" if two else "SetFloat64")
        self._into = references(interface.inputs, two)
        self.forget()
        rates = self._call("GetDerivatives" if two else "GetContinuousStateDerivatives")
        self.rates = self._reader(rates, (), self._n, self._size)
        count = interface.indicators
        self.indicators = self._reader(self._call("GetEventIndicators"), (), count, ctypes.c_size_t(count))
        self.outputs: Read | None = None
        if all_doubles(interface.outputs) and not interface.clocks:
            first, last = references(interface.outputs, two)
            n = sum(len(v.labels) for v in interface.outputs)
            self.outputs = self._reader(self._call("GetReal" if two else "GetFloat64"), first, n, *last)

    def begin(self, time: float, u: Array) -> None:
        """Say which time and inputs the FMU was initialised with."""
        self._time, self._x, self._u = time, b"", u.tobytes()

    def forget(self) -> None:
        """Set everything at the next point."""
        self._time, self._x, self._u = math.nan, b"", b""

    def forget_states(self) -> None:
        """Set the states at the next point."""
        self._x = b""

    def has_inputs(self, u: Array) -> None:
        """Say which inputs the FMU has."""
        self._u = u.tobytes()

    def inputs_now(self, u: Array) -> Array:
        """Return the inputs before an event: those that change at events only are set in it."""
        return u if self.plain else np.frombuffer(self._u)

    def set(self, time: float, x: Array, u: Array) -> None:
        """Set a point."""
        if time != self._time:
            self._clock.value = self._time = time
            if (status := self._put_time(self._component, self._clock)) > 1:
                self._refused(status, "SetTime")
            self._x = b""
        key = x.tobytes()
        if key != self._x:
            self._x = key
            if self._n and (status := self._put_states(self._component, key, self._size)) > 1:
                self._refused(status, "SetContinuousStates")
        key = u.tobytes()
        if key != self._u:
            self._u = key
            if self.plain:
                first, last = self._into
                if (status := self._put_inputs(self._component, *first, key, *last)) > 1:
                    self._refused(status, "Set inputs")
            else:
                self._jump(u)

    def _call(self, name: str) -> Any:
        return self._library[f"fmi{self._fmi}{name}"]

    def _reader(self, call: Any, before: tuple[Any, ...], n: int, *after: Any) -> Read:
        """Return a function of a point that sets it and reads n numbers by one call."""
        buffer = (ctypes.c_double * n)()
        values: Array = np.ctypeslib.as_array(buffer)
        arguments = (self._component, *before, buffer, *after)

        def read(time: float, x: Array, u: Array) -> Array:
            self.set(time, x, u)
            if n and (status := call(*arguments)) > 1:
                self._refused(status, call.__name__)
            return values.copy()

        return read


class _Job(ctypes.Structure):
    """hc_point of point.c."""

    _fields_ = (
        ("now", ctypes.c_double),
        ("component", ctypes.c_void_p),
        ("fmi", ctypes.c_long),
        *((name, ctypes.c_size_t) for name in ("states", "inputs", "outputs", "indicators")),
        *((name, ctypes.c_void_p) for name in ("set_time", "set_states", "get_rates", "get_indicators")),
        *((name, ctypes.c_void_p) for name in ("set2", "get2", "set3", "get3")),
        *((name, ctypes.c_void_p) for name in ("input_references", "output_references")),
        *((name, ctypes.c_size_t) for name in ("input_count", "output_count")),
        *((name, ctypes.c_void_p) for name in ("x", "u", "rates", "y", "z")),
        ("time", ctypes.c_double),
        *((name, ctypes.c_long) for name in ("has_time", "has_states", "has_inputs", "status")),
    )


class CompiledPoint(Point):
    """A point that is set and read by one call of point.c: all inputs and outputs are continuous doubles."""

    def __init__(
        self,
        fmu: Any,
        interface: Interface,
        refused: Callable[[int, str], NoReturn],
        jump: Callable[[Array], None],
        library: Any,
    ) -> None:
        self._job = _Job(fmi=interface.fmi)
        super().__init__(fmu, interface, refused, jump)
        self._fill(interface)
        self._set = library.hc_point_set
        self._bytes = 8 * self._job.states, 8 * self._job.inputs
        self.rates = self._compiled(library.hc_point_rates, self._values["rates"])
        self.outputs = self._compiled(library.hc_point_outputs, self._values["y"])
        self.indicators = self._compiled(library.hc_point_indicators, self._values["z"])

    def _fill(self, interface: Interface) -> None:
        """Fill in the sizes, the memory and the calls that point.c needs."""
        job, fmi, two = self._job, interface.fmi, interface.fmi == 2
        (into, n_in), _ = references(interface.inputs, two)
        (out, n_out), _ = references(interface.outputs, two)
        self._kept = into, out
        job.component, job.input_count, job.output_count = self._component.value, n_in.value, n_out.value
        job.input_references, job.output_references = ctypes.addressof(into), ctypes.addressof(out)
        job.states, job.indicators = self._n, interface.indicators
        job.inputs = sum(len(v.labels) for v in interface.inputs)
        job.outputs = sum(len(v.labels) for v in interface.outputs)
        sizes = {"x": job.states, "u": job.inputs, "rates": job.states, "y": job.outputs, "z": job.indicators}
        self._values = {name: np.zeros(size) for name, size in sizes.items()}
        for name, values in self._values.items():
            setattr(job, name, values.ctypes.data)
        get, put = ("GetReal", "SetReal") if two else ("GetFloat64", "SetFloat64")
        rates = "GetDerivatives" if two else "GetContinuousStateDerivatives"
        read = [f"fmi{fmi}{name}" for name in (rates, get, "GetEventIndicators")]
        self._names = ("", "SetTime", "SetContinuousStates", "Set inputs", *read)
        calls = {"set_time": "SetTime", "set_states": "SetContinuousStates", "get_rates": rates}
        calls |= {"get_indicators": "GetEventIndicators", f"get{fmi}": get, f"set{fmi}": put}
        for name, call in calls.items():
            setattr(job, name, ctypes.cast(self._call(call), ctypes.c_void_p).value)

    def begin(self, time: float, u: Array) -> None:
        """Say which time and inputs the FMU was initialised with."""
        self._job.time, self._job.has_time = time, 1
        self.forget_states()
        self.has_inputs(u)

    def forget(self) -> None:
        """Set everything at the next point."""
        self._job.has_time = self._job.has_states = self._job.has_inputs = 0

    def forget_states(self) -> None:
        """Set the states at the next point."""
        self._job.has_states = 0

    def has_inputs(self, u: Array) -> None:
        """Say which inputs the FMU has."""
        self._values["u"][:] = u
        self._job.has_inputs = 1

    def set(self, time: float, x: Array, u: Array) -> None:
        """Set a point."""
        self._job.now = time
        if what := self._set(ctypes.byref(self._job), *self._sized(x.tobytes(), u.tobytes())):
            self._refused(self._job.status, self._names[what])

    def _sized(self, x: bytes, u: bytes) -> tuple[bytes, bytes]:
        if (len(x), len(u)) != self._bytes:
            wanted, found = ([n // 8 for n in pair] for pair in (self._bytes, (len(x), len(u))))
            raise FmuError(
                f"expected {wanted[0]} states and {wanted[1]} inputs, found {found[0]} and {found[1]}"
            )
        return x, u

    def _compiled(self, call: Any, values: Array) -> Read:
        """Return a function of a point that sets it and reads the values, by one call."""
        job, names, refused, copy = self._job, self._names, self._refused, values.copy
        here, sized, (nx, nu) = ctypes.byref(job), self._sized, self._bytes

        def read(time: float, x: Array, u: Array) -> Array:
            job.now = time
            states, inputs = x.tobytes(), u.tobytes()
            if len(states) != nx or len(inputs) != nu:
                sized(states, inputs)
            if what := call(here, states, inputs):
                refused(job.status, names[what])
            return copy()

        return read


def point_of(
    fmu: Any, interface: Interface, refused: Callable[[int, str], NoReturn], jump: Callable[[Array], None]
) -> Point:
    """Return the point of an instance: compiled where all signals are doubles and there is a compiler."""
    simple = all_doubles((*interface.inputs, *interface.outputs))
    simple = simple and not any(v.discrete for v in interface.inputs) and not interface.clocks
    library = _built() if simple else None
    if library is None:
        return Point(fmu, interface, refused, jump)
    return CompiledPoint(fmu, interface, refused, jump, library)


@cache
def _built() -> Any:
    """Return point.c as a library, or None if there is no compiler."""
    source = (resources.files("hovercontrol") / "fmi" / "importer" / "point.c").read_text("utf-8")
    try:
        library = load_library("fmu_point", {"point.c": source})
    except NoCompilerError:
        return None
    return ctypes.PyDLL(library._name, handle=library._handle)  # the FMU may call back into Python


def all_doubles(variables: Sequence[Variable]) -> bool:
    """Return whether all variables are Real or Float64."""
    return all(v.kind in DOUBLES for v in variables)


def references(variables: Sequence[Variable], two: bool) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """Return the arguments before and after the values of a call that sets or gets variables."""
    of = (ctypes.c_uint32 * len(variables))(*(v.reference for v in variables))
    size = ctypes.c_size_t(sum(len(v.labels) for v in variables))
    return (of, ctypes.c_size_t(len(variables))), (() if two else (size,))
