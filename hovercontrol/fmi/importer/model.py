"""FMUs for Model Exchange as continuous python-control systems, with our own simulation of their events."""

from __future__ import annotations

import contextlib
import weakref
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import control
import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.backends.linear import state_space
from hovercontrol.fmi.importer.continuous import Continuous
from hovercontrol.fmi.importer.instance import FmuError
from hovercontrol.fmi.importer.loaded import Loaded
from hovercontrol.fmi.importer.unpacked import Source, Unpacked

if TYPE_CHECKING:
    from hovercontrol.blocks.simulation.response import Response


#: Step of central differences over the size of a value: the cube root of a double's precision.
_DIFFERENCE = float(np.finfo(float).eps ** (1 / 3))


class FmuModel(Loaded):
    """An FMU's equations as a continuous python-control system; made by :func:`hovercontrol.fmi.load`.

    States, inputs and outputs are the FMU's, by their names and in their order; arrays are expanded into
    elements ``name[1]``, ``name[1,2]``, counted from 1. A point ``(t, x, u)`` may be evaluated in any order.
    python-control integrates the equations between events: discrete states keep the values that they have at
    time 0 with these inputs. :meth:`simulate` passes state events, time events and step events.

    Inputs that change at events only (discrete or whole numbers) are set in an event of their own.

    Attributes
    ----------
    units, descriptions : dict of str to str
        By the FMU's signal name, and by key for parameters.
    params : dict of str to float
        The parameters with their values.
    path : Path

    Notes
    -----
    ``control.linearize(system, x, u)`` takes the FMU's directional derivatives (FMI 2.0 section 2.1.9, FMI
    3.0 section 2.2.11) where it gives them, else central differences.
    """

    def __init__(self, source: Source, name: str, params: Mapping[str, float] | None) -> None:
        super().__init__(source, name, params, 0, source.interface.states)
        interface = source.interface
        starts = [s for v in interface.inputs for s in (v.start or (0.0,) * len(v.labels))]
        self._first_inputs = np.array(starts, dtype=float)
        self._begun: tuple[float | None, ...] | None = None
        try:
            self._engine = Continuous(source.unpacked.folder, interface, name)
        except FmuError as fault:
            raise InputError(f"{self.path}: {fault}") from None
        source.unpacked.hold()
        self._end = weakref.finalize(self, _release, self._engine, source.unpacked)
        self._begin()

    @property
    def initial_state(self) -> Array:
        """The states after initialisation with the present parameters, shape (n_states,)."""
        self._begin()
        return self._initial.copy()

    @property
    def next_event(self) -> float:
        """Time of the first time event after initialisation [s]; infinite if there is none."""
        self._begin()
        return self._next_event

    def close(self) -> None:
        """Free the FMU's instance and its temporary folder; may be called twice."""
        self._begun = None
        self._end()

    def __deepcopy__(self, memo: dict[int, Any]) -> FmuModel:
        self._alive()
        system = FmuModel(self._source, self._prefix, dict(self.params))
        system.name, system.state_index = self.name, dict(self.state_index)
        system.input_index, system.output_index = dict(self.input_index), dict(self.output_index)
        return system

    __copy__ = lambda self: self.__deepcopy__({})  # noqa: E731 - two systems cannot share one instance

    def simulate(
        self,
        time: ArrayLike,
        inputs: ArrayLike | Mapping[str, ArrayLike] | None = None,
        x0: ArrayLike | None = None,
        *,
        params: Mapping[str, float] | None = None,
        method: str = "DOP853",
        rtol: float = 1e-6,
        atol: float = 1e-9,
    ) -> Response:
        """Return a simulation that passes the FMU's events.

        Parameters
        ----------
        time : array_like, shape (n,)
            Increasing times [s].
        inputs : array_like, shape (n_inputs, n), or mapping of str to array_like, optional
            Values at these times, interpolated in between; those that change at events only are held. Inputs
            that are not given keep the FMU's start values.
        x0 : array_like, shape (n_states,), optional
            Continuous states at the start (default: the FMU's).
        params : mapping of str to float, optional
            Parameter values by key, in place of the system's.
        method : {"DOP853", "RK45", "Radau", "BDF", "LSODA"}, optional
            Solver of :mod:`scipy.integrate`.
        rtol, atol : float, optional
            Tolerances of the solver.

        Returns
        -------
        Response

        Raises
        ------
        InputError
            If an argument is wrong, or the FMU refuses a call.
        """
        from hovercontrol.fmi.importer.events import simulated

        self._alive()
        given = self._checked(params or {}, pushed=False)
        values = self.values_in_order({**self.params, **given})
        self._begun = None  # the instance is not at its start afterwards
        with self._faults("in a simulation"):
            return simulated(self, self._engine, values, (time, inputs, x0), (method, rtol, atol))

    def linearize(
        self,
        x0: Any,
        u0: ArrayLike | None = None,
        t: float = 0.0,
        params: Mapping[str, float] | None = None,
        *,
        copy_names: bool = True,
        **kwargs: Any,
    ) -> control.StateSpace:
        """Return the linearisation at a point, from the FMU's directional derivatives.

        Parameters
        ----------
        x0 : array_like, shape (n_states,), scalar for all states, or control.OperatingPoint
        u0 : array_like, shape (n_inputs,), or scalar for all inputs; default the operating point's, or 0
        t : float, optional
            Time [s].
        params : mapping, optional
            Parameter values by key.
        copy_names : bool, optional
            Whether the signals and the system keep their names.
        **kwargs
            As for :func:`control.linearize`: ``name``, ``inputs``, ``outputs``, ``states``.

        Raises
        ------
        InputError
            If a value is wrong or the FMU refuses.
        """
        if isinstance(x0, control.OperatingPoint):
            x0, u0 = x0.states, x0.inputs if u0 is None else u0
        x = np.broadcast_to(np.asarray(x0, dtype=float), (self.nstates,)).copy()
        u = np.broadcast_to(np.asarray(0.0 if u0 is None else u0, dtype=float), (self.ninputs,)).copy()
        kwargs.pop("eps", None)
        self._update_params(params)
        self._begin()
        with self._faults(f"linearised at t = {t:.9g} s"):
            matrices = self._engine.partials(float(t), x, self._input_check.checked(self._label, t, u))
        if matrices is None:
            matrices = self._differences(float(t), x, u)
        if copy_names:
            labels = {"inputs": self.input_labels, "outputs": self.output_labels, "states": self.state_labels}
            kwargs = {"name": f"{self.name}$linearized", **labels, **kwargs}
        return state_space(matrices, 0, **kwargs)

    def _differences(self, t: float, x: Array, u: Array) -> list[Array]:
        """Return A, B, C, D by central differences: (f(z + h) - f(z - h)) / 2h."""
        z, n = np.concatenate([x, u]), len(x)
        columns = []
        for k in range(len(z)):
            h = _DIFFERENCE * max(1.0, abs(z[k]))
            ends = []
            for sign in (1.0, -1.0):
                moved = z.copy()
                moved[k] += sign * h
                ends.append([self._rhs(t, moved[:n], moved[n:]), self._out(t, moved[:n], moved[n:])])
            columns.append(np.concatenate([(a - b) / (2.0 * h) for a, b in zip(*ends, strict=True)]))
        table = np.array(columns).reshape(len(z), n + self.noutputs).T
        return [table[:n, :n], table[:n, n:], table[n:, :n], table[n:, n:]]

    def _begin(self) -> None:
        """Initialise the FMU with the present parameters, if they differ from those that it has."""
        self._alive()
        if self._begun == self._values:
            self._begun = self._values  # the same tuple: found equal at once
            return
        with self._faults("at its initialisation"):
            self._engine.begin(0.0, self._values, self._first_inputs.tolist())
        self._begun = self._values
        self._initial, self._next_event = self._engine.states.copy(), self._engine.event.next

    @contextlib.contextmanager
    def _faults(self, when: str) -> Iterator[None]:
        try:
            yield
        except FmuError as fault:
            self._begun = None
            raise InputError(f"{self._label} failed {when}: {fault}") from None

    def _rhs(self, t: float, x: Any, u: Any) -> Array:
        if self._begun is not self._values:
            self._begin()
        if u is None:  # control.find_operating_point, where there are no inputs
            u = self._first_inputs
        if type(x) is not np.ndarray or x.dtype is not _FLOAT:  # without a call: this is done at every point
            x = np.asarray(x, dtype=float)
        if type(u) is not np.ndarray or u.dtype is not _FLOAT:
            u = np.asarray(u, dtype=float)
        try:
            return self._engine.derivatives(t, x, u)
        except FmuError as fault:
            raise self._failed(t, fault) from None

    def _out(self, t: float, x: Any, u: Any) -> Array:
        if self._begun is not self._values:
            self._begin()
        if u is None:
            u = self._first_inputs
        try:
            x = np.asarray(x if self.nstates else (), dtype=float)
            return self._engine.outputs_at(t, x, np.asarray(u, dtype=float))
        except FmuError as fault:
            raise self._failed(t, fault) from None

    def _failed(self, t: float, fault: FmuError) -> InputError:
        self._begun = None
        return InputError(f"{self._label} failed at t = {t:.9g} s: {fault}")


_FLOAT = np.dtype(float)


def _release(engine: Continuous, unpacked: Unpacked) -> None:
    engine.close()
    unpacked.release()
