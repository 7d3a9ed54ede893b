"""Stepwise simulation, inputs in and outputs out, for hardware in the loop and learning.

``block.start()`` runs on plain Python floats, ``block.compile().start()`` in machine code and
:meth:`hovercontrol.fmi.importer.imported.FmuSystem.start` an FMU; the runner is used in the same way.
"""

from __future__ import annotations

import hashlib
import math
import struct
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hovercontrol.core.block import Block
from hovercontrol.core.delays import UnderWay, delay_values, undelayed
from hovercontrol.errors import InputError, did_you_mean
from hovercontrol.io.short_repr import short_repr
from hovercontrol.simulation.given import initial_state
from hovercontrol.simulation.reasons import REASONS, StoppedError, where_it_stops
from hovercontrol.simulation.ticking import between_ticks

Array = NDArray[np.float64]
Inputs = Sequence[float] | Mapping[str, float] | float | Array

_REAL = np.dtype(float)
#: Status of an engine's step where an input is no number; nothing has changed then.
INPUT_NOT_FINITE = -1


@dataclass(frozen=True)
class Snapshot:
    """The complete state of a runner; made by :meth:`Runner.save`. It may be pickled.

    Parameters
    ----------
    time : float
        [s]
    of : tuple of str
        What it is a state of.
    data : tuple
        For the runner.

    Attributes
    ----------
    checksum : str
        SHA-256 of all that, by which damage is seen.
    """

    time: float
    of: tuple[str, ...]
    data: tuple[Any, ...]
    checksum: str = field(init=False, repr=False, default="")

    __repr__ = short_repr

    def __post_init__(self) -> None:
        object.__setattr__(self, "checksum", self._computed())

    def _computed(self) -> str:
        content = (self.time, self.of, tuple(_as_bytes(part) for part in self.data))
        return hashlib.sha256(repr(content).encode()).hexdigest()

    @property
    def damaged(self) -> bool:
        """Whether it is not what :meth:`Runner.save` made."""
        try:
            return self.checksum != self._computed()
        except (AttributeError, TypeError, ValueError):  # what was pickled comes back as something else
            return True


class Runner(ABC):
    """A system while it runs, step by step; made by a ``start(...)``. One runner belongs to one thread.

    Attributes
    ----------
    input_labels, state_labels, output_labels : list of str
        Names, in the order of the arrays.
    time : float
        Now [s].
    """

    input_labels: list[str]
    state_labels: list[str]
    output_labels: list[str]
    #: Let inputs jump, go to a time, and return a status, 0 if all is well.
    _advance: Callable[[float, bytes], int]
    #: The outputs now.
    _y: Array

    def __init__(self, label: str, inputs: Sequence[float], time: float) -> None:
        if not (isinstance(time, int | float) and math.isfinite(time)):
            raise InputError(f"{label}: expected a time in seconds to start at, found {time!r}")
        self.time = float(time)
        self._label, self._rest, self._asked = label, 0.0, 1.0
        self._pack, self._shape = struct.Struct(f"{len(inputs)}d").pack, (len(inputs),)
        self._sent = self._pack(*inputs)

    def __repr__(self) -> str:
        groups = (("input", self.input_labels), ("state", self.state_labels), ("output", self.output_labels))
        counts = ", ".join(f"{len(names)} {kind}{'s' * (len(names) != 1)}" for kind, names in groups)
        return f"{type(self).__name__} of {self._label} at t = {self.time:.6g} s: {counts}"

    def step(self, inputs: Inputs | None, dt: float) -> Array:
        """Hold inputs for a time and return the outputs at its end, shape (n_outputs,).

        Ticks due at the end are taken; if inputs jump there, with the next step, they are taken again.

        Parameters
        ----------
        inputs : sequence of float, or mapping by name, or float for a single input
            They act from now on; None leaves them, as does a mapping those that it does not name.
        dt : float
            How long [s]; each step may have its own. Many equal steps reach the time that their product
            tells, to rounding.

        Returns
        -------
        ndarray

        Raises
        ------
        InputError
            If an input is unknown or no finite number, `dt` not positive, or the system cannot go on: the
            runner then stands at the time it reached, which the line names.

        Examples
        --------
        >>> from hovercontrol.core.signals import Signal
        >>> v, a = Signal("v", "m/s"), Signal("a", "m/s^2")
        >>> cart = Block("cart", [v], [a], [v], derivatives={"v": a.symbol}).start()
        >>> [round(float(cart.step([2.0], 0.1)[0]), 9) for _ in range(3)]
        [0.2, 0.4, 0.6]
        """
        if not 0.0 < dt < math.inf:
            raise InputError(f"{self._label}: expected a step longer than 0 s, found {dt!r}")
        if isinstance(inputs, np.ndarray) and inputs.dtype is _REAL and inputs.shape == self._shape:
            self._sent = inputs.tobytes()
        elif inputs is not None:
            try:
                self._sent = self._pack(*inputs)  # type: ignore[misc]
            except (TypeError, struct.error):
                self._sent = self._packed(inputs)
        length = dt - self._rest  # sums of many steps are compensated: ticks must not come a step late
        until = self.time + length
        self._asked = length
        status = self._advance(until, self._sent)
        if status:
            self._fail(status)
        self._rest = (until - self.time) - length
        self.time = until
        return self._y.copy()

    def set(
        self,
        *,
        inputs: Inputs | None = None,
        params: Mapping[str, float] | None = None,
        state: Mapping[str, float] | ArrayLike | None = None,
    ) -> None:
        """Let inputs, parameters or states jump now; what ticks at this instant is computed again.

        Parameters
        ----------
        inputs
            As for :meth:`step`.
        params : mapping, optional
            Values by key (``plant.yaw_coulomb``), over those that hold now.
        state : mapping by name, or array_like of shape (n_states,), optional
            What ticks set at this very instant is given as it was before them.

        Raises
        ------
        InputError
            If a name is unknown, a value out of its bounds, or the system cannot have it changed.
        """
        if params is not None or state is not None:
            self._jump(params or {}, state)
        if inputs is not None:
            self._sent = self._packed(inputs)
        status = self._advance(self.time, self._sent)
        if status:
            self._fail(status)

    @property
    def inputs(self) -> Array:
        """The inputs that hold, shape (n_inputs,); of those that act late, what was sent last."""
        return np.frombuffer(self._sent).copy()

    @property
    def outputs(self) -> Array:
        """The outputs now, shape (n_outputs,)."""
        return self._y.copy()

    @property
    @abstractmethod
    def state(self) -> Array:
        """The states now, shape (n_states,)."""

    @property
    @abstractmethod
    def params(self) -> dict[str, float]:
        """The parameters by key."""

    @abstractmethod
    def save(self) -> Snapshot:
        """Return all that the runner knows now, for :meth:`restore`."""

    @abstractmethod
    def restore(self, snapshot: Snapshot) -> None:
        """Go back, or on, to where a snapshot was taken; from there all goes as it did, to the bit.

        Raises
        ------
        InputError
            If it was taken of something else, or is damaged; the runner is then as it was.
        """

    # ---- inside --------------------------------------------------------------------------------------

    @abstractmethod
    def _jump(self, params: Mapping[str, float], state: Mapping[str, float] | ArrayLike | None) -> None:
        """Let parameters and states jump."""

    def _fail(self, status: int) -> None:
        if status == INPUT_NOT_FINITE:
            values = np.frombuffer(self._sent)
            n = int(np.flatnonzero(~np.isfinite(values))[0])
            raise InputError(f"{self._label}: input {self.input_labels[n]!r} is {values[n]}")
        text = f"{self._label}: the run stops at t = {self.time:.6g} s: {REASONS[status]}{self._where()}"
        raise StoppedError(text, status)

    def _where(self) -> str:
        """Return the state at which the run stops, for the end of its error."""
        return ""

    def _packed(self, inputs: Any) -> bytes:
        """Return inputs as bytes; say in one line what is wrong with them."""
        names = self.input_labels
        if isinstance(inputs, Mapping):
            values = np.frombuffer(self._sent).copy()
            for name, value in inputs.items():
                if name not in names:
                    raise InputError(f"{self._label}: unknown input {name!r}{did_you_mean(name, names)}")
                values[names.index(name)] = _number(self._label, name, value)
            return values.tobytes()
        try:
            given = np.atleast_1d(np.asarray(inputs, dtype=float))
        except (TypeError, ValueError):
            raise InputError(f"{self._label}: expected numbers as inputs, found {inputs!r}") from None
        if given.shape != (len(names),):
            listed = ", ".join(names) or "none"
            raise InputError(
                f"{self._label}: expected {len(names)} inputs ({listed}), found {given.size} "
                f"of shape {given.shape}"
            )
        return given.tobytes()

    def _check(self, snapshot: Snapshot, of: tuple[str, ...]) -> None:
        if not isinstance(snapshot, Snapshot):
            raise InputError(f"{self._label}: expected what save() returned, found {snapshot!r}")
        if snapshot.damaged:
            raise InputError(f"{self._label}: the snapshot is damaged: its checksum differs")
        if snapshot.of != of:
            other = (
                "another version or instance of it"
                if snapshot.of[:2] == of[:2]
                else " ".join(snapshot.of[:2])
            )
            raise InputError(f"{self._label}: the snapshot is of {other}, not of {' '.join(of[:2])}")


class Engine(Protocol):
    """What steps a Block without delays: :mod:`.python_runner`, or in machine code :mod:`.native_runner`."""

    kind: str
    y: Array  # the outputs, kept up to date
    step: Any  # (until, sent) -> status

    def jump(self, states: Mapping[int, float], params: Sequence[float]) -> int:
        """Let states by their places and all parameters jump; return the status."""

    def time(self) -> float:
        """Return the time reached [s]."""

    def states(self) -> Array:
        """Return the states."""

    def save(self) -> Any:
        """Return all that it knows."""

    def load(self, saved: Any) -> None:
        """Go on from what :meth:`save` returned; raise ValueError where it is of another size."""


class BlockRunner(Runner):
    """A Block while it runs; see :class:`Runner`. Made by ``block.start()`` or ``block.compile().start()``.

    Parameters
    ----------
    block : Block
        Not sampled alone.
    make : callable
        ``(time, states, inputs, parameters) -> Engine`` of the Block without its delays.
    x0, params, inputs, time
        As for :meth:`hovercontrol.core.block.Block.start`.
    """

    def __init__(
        self,
        block: Block,
        make: Any,
        x0: ArrayLike | Mapping[str, float] | None,
        params: Mapping[str, float] | None,
        inputs: Inputs | None,
        time: float,
    ) -> None:
        self.input_labels = [s.name for s in block.inputs]
        self.state_labels = [s.name for s in block.states]
        self.output_labels = [s.name for s in block.outputs]
        starts = [s.start for s in block.inputs]
        super().__init__(f"block {block.name!r}", starts, time)
        self._block, self._values = block, block.parameter_values(params)
        late = delay_values(block, self._values) if block.delays else {}
        self._late = UnderWay(block, late) if late else None
        self._engine: Engine = make(self.time, initial_state(block, x0).tolist(), starts, self._values)
        self._advance = self._advance_late if late else self._engine.step
        self._y = self._engine.y
        if inputs is not None:
            self.set(inputs=inputs)

    @property
    def state(self) -> Array:
        """The states now, shape (n_states,); after the ticks of this instant."""
        return self._engine.states()

    @property
    def params(self) -> dict[str, float]:
        """The parameters by key."""
        return dict(zip(self._block.default_parameters, self._values, strict=True))

    def save(self) -> Snapshot:
        """Return all that the runner knows now, for :meth:`restore`."""
        late = self._late.save() if self._late else None
        data = (self._rest, self._sent, self._values, late, self._engine.save())
        return Snapshot(self.time, self._of(), data)

    def restore(self, snapshot: Snapshot) -> None:
        """Go back, or on, to where a snapshot was taken; see :meth:`Runner.restore`."""
        self._check(snapshot, self._of())
        before = self.save()
        try:
            self._take(snapshot)
        except (TypeError, ValueError) as error:
            self._take(before)
            raise InputError(f"{self._label}: the snapshot is not one of save(): {error}") from None

    def _take(self, snapshot: Snapshot) -> None:
        rest, sent, values, late, saved = snapshot.data
        numbers = [snapshot.time, rest, *values, *np.frombuffer(sent)]
        if (len(sent), len(values)) != (len(self._sent), len(self._values)) or not np.isfinite(numbers).all():
            raise ValueError("its time, inputs or parameters are not those of this Block")
        self._engine.load(saved)
        if not np.isfinite(self._engine.states()).all():
            raise ValueError("a state is not a number")
        if self._late:
            self._late.load(late)
        self._rest, self._sent, self._values, self.time = rest, sent, values, snapshot.time

    def _of(self) -> tuple[str, ...]:
        return "block", self._block.name, self._block.content_hash, self._engine.kind

    def _advance_late(self, until: float, sent: bytes) -> int:
        late = self._late
        assert late
        if not np.isfinite(np.frombuffer(sent)).all():
            return INPUT_NOT_FINITE
        late.send(self.time, np.frombuffer(sent).tolist())
        now, status = self.time, 0
        while not status:
            status = self._engine.step(now, self._pack(*late.arrived(now)))
            if status or now >= until:
                break
            now = late.next(until)
            status = self._engine.step(now, self._pack(*late.inputs))
        return status

    def _jump(self, params: Mapping[str, float], state: Mapping[str, float] | ArrayLike | None) -> None:
        block = self._block
        values = block.parameter_values({**self.params, **params})
        if self._late and delay_values(block, values) != delay_values(block, self._values):
            raise InputError(f"{self._label}: the delay of an input cannot change while a command is delayed")
        places: dict[int, float] = {}
        if isinstance(state, Mapping):
            for name, value in state.items():
                if name not in self.state_labels:
                    hint = did_you_mean(name, self.state_labels)
                    raise InputError(f"{self._label}: unknown state {name!r}{hint}")
                places[self.state_labels.index(name)] = _number(self._label, name, value)
        elif state is not None:
            places = dict(enumerate(initial_state(block, state).tolist()))
        status = self._engine.jump(places, values)
        self._values = values
        if status:
            self._fail(status)

    def _fail(self, status: int) -> None:
        if status != INPUT_NOT_FINITE:
            self.time, self._rest = self._engine.time(), 0.0
        super()._fail(status)

    def _where(self) -> str:
        n, x = self._block.n_continuous, self.state.tolist()
        inputs = self._late.inputs if self._late else self.inputs.tolist()
        held, moves = [*inputs, *x[n:]], between_ticks(undelayed(self._block))
        return where_it_stops(moves, self.time, x[:n], held, self._values, span=self._asked)


def _as_bytes(value: Any) -> Any:
    return (value.shape, value.tobytes()) if isinstance(value, np.ndarray) else value


def _number(label: str, name: str, value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        raise InputError(f"{label}: {name!r} must be a number, found {value!r}") from None
