"""An FMU step by step, with the interface of a Block's runner; made by :meth:`FmuSystem.start`."""

from __future__ import annotations

import contextlib
import uuid
import warnings
import weakref
from collections.abc import Iterator, Mapping
from types import TracebackType
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.simulation.runner import Inputs, Runner, Snapshot
from hovercontrol.fmi.importer.instance import Engine, FmuError, RunEnded

if TYPE_CHECKING:
    from hovercontrol.fmi.importer.system import FmuSystem
    from hovercontrol.fmi.importer.unpacked import Unpacked


class FmuRunner(Runner):
    """An FMU while it runs; see :class:`hovercontrol.blocks.simulation.runner.Runner`.

    Parameters
    ----------
    engine : Engine
        An instance for this run only.
    params : mapping of str to float
        All parameters by key.
    inputs, time
        As for :meth:`FmuSystem.start`.

    Attributes
    ----------
    ended : float or None
        Time at which the FMU ended the run [s]. The step with the end returns the last outputs, with a
        warning, and `time` stays there; a further step is an error.
    """

    ended: float | None

    def __init__(
        self,
        system: FmuSystem,
        engine: Engine,
        params: Mapping[str, float],
        inputs: Inputs | None,
        time: float,
    ) -> None:
        interface = system.interface
        self.input_labels, self.output_labels = list(system.input_index), list(system.output_index)
        self.state_labels = []
        self._system, self._engine, self._params = system, engine, dict(params)
        self._interface, self._token = interface, uuid.uuid4().hex
        self._direct = np.array([bool(names) for names in system.feedthrough.values()], dtype=bool)
        system.unpacked.hold()
        self._end = weakref.finalize(self, _release, engine, system.unpacked)
        starts = [s for v in interface.inputs for s in (v.start or (0.0,) * len(v.labels))]
        super().__init__(f"FMU {system.name!r}", starts, time)
        self.ended = None
        if inputs is not None:
            self._sent = self._packed(inputs)
        self._sent = system.checked_inputs(self.time, np.frombuffer(self._sent)).tobytes()
        with self._fmu(f"at the start of a run, t = {self.time:.9g} s"):
            values = engine.start(self.time, system.values_in_order(params), self._listed())
        self._y = np.array(values)
        self._advance = self._advance_fmu

    def step(self, inputs: Inputs | None, dt: float) -> Array:
        """Advance with constant inputs and return the outputs at the end; see :meth:`Runner.step`.

        Raises
        ------
        InputError
            If an input or `dt` is wrong, the FMU rejects it, or the run has ended.
        """
        y = super().step(inputs, dt)
        if self.ended is not None:
            self.time, self._rest = self.ended, 0.0
        return y

    @property
    def state(self) -> Array:
        """Not accessible; raises :class:`InputError`."""
        raise InputError(f"{self._label}: an FMU's state is not accessible; use save() and restore()")

    @property
    def params(self) -> dict[str, float]:
        """The parameters by key, as they were set at the start."""
        return dict(self._params)

    def save(self) -> Snapshot:
        """Return a handle of the saved state, which is kept in this instance.

        Raises
        ------
        InputError
            If the FMU cannot save its state.
        """
        if not self._interface.has_states:
            raise InputError(f"{self._label}: it cannot save its state (canGetAndSetFMUState)")
        with self._fmu(f"at t = {self.time:.9g} s, saving its state"):
            handle = self._engine.save()
        snapshot = Snapshot(
            self.time, self._of(), (self._rest, self._sent, self._y.copy(), self.ended, handle)
        )
        weakref.finalize(snapshot, _drop, weakref.ref(self), handle)
        return snapshot

    def restore(self, snapshot: Snapshot) -> None:
        """Restore a snapshot of this runner; see :meth:`Runner.restore`."""
        self._check(snapshot, self._of())
        self._rest, self._sent, y, ended, handle = snapshot.data
        with self._fmu(f"going back to t = {snapshot.time:.9g} s"):
            try:
                self._engine.restore(handle)
            except KeyError:  # a copy, by pickle, of a snapshot that is gone
                raise InputError(f"{self._label}: the FMU no longer has that snapshot") from None
        self.time, self._y, self.ended = snapshot.time, y.copy(), ended

    def close(self) -> None:
        """Free the FMU's instance; may be called twice."""
        self._end()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _of(self) -> tuple[str, ...]:
        return "FMU", self._system.name, self._token

    def _advance_fmu(self, until: float, sent: bytes) -> int:
        if self.ended is not None:
            raise InputError(f"{self._label} ended the run at t = {self.ended:.9g} s; no step can follow")
        checked = self._system.checked_inputs(self.time, np.frombuffer(sent))
        self._sent = checked.tobytes()
        if until == self.time:
            with self._fmu(f"at t = {self.time:.9g} s"):
                now = np.array(self._engine.outputs(self._listed()))
            self._y = np.where(self._direct, now, self._y)
            return 0
        length, fixed = until - self.time, self._interface.fixed_step
        if fixed and abs(length / fixed - max(round(length / fixed), 1)) > 1e-6:
            raise InputError(
                f"{self._label}: a step must be a multiple of the FMU's own {fixed:g} s, found {length:g} s"
            )
        with self._fmu(f"in the step from t = {self.time:.9g} s"):
            try:
                self._y = np.array(self._engine.step(self.time, length, self._listed()))
            except RunEnded as end:
                self._y = self._y if end.values is None else np.array(end.values)
                self.ended = end.time
                warnings.warn(f"{self._label} {end}; these are its last outputs", stacklevel=4)
        return 0

    def _jump(self, params: Mapping[str, float], state: Mapping[str, float] | ArrayLike | None) -> None:
        if state is not None:
            raise InputError(f"{self._label}: an FMU's state is not accessible")
        if params:
            raise InputError(
                f"{self._label}: an FMU's parameters are set where a run starts: start(params=...)"
            )

    def _listed(self) -> list[float]:
        values: list[float] = np.frombuffer(self._sent).tolist()
        return values

    @contextlib.contextmanager
    def _fmu(self, when: str) -> Iterator[None]:
        if not self._end.alive:
            raise InputError(f"{self._label} is closed")
        try:
            yield
        except FmuError as fault:
            raise InputError(f"{self._label} failed {when}: {fault}") from None


def _release(engine: Engine, unpacked: Unpacked) -> None:
    engine.close()
    unpacked.release()


def _drop(runner: weakref.ref[FmuRunner], handle: int) -> None:
    alive = runner()
    if alive is not None and alive._end.alive:
        with contextlib.suppress(FmuError, KeyError):
            alive._engine.drop(handle)
