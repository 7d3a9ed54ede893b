"""Stepwise simulation: inputs in, outputs out; for hardware in the loop and learning.

``block.start()`` uses plain Python floats, ``block.compile().start()`` machine code, and
:meth:`hovercontrol.fmi.importer.system.FmuSystem.start` an FMU. All three runners have the same methods.
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
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.base.short_repr import short_repr
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delays import UnderWay, delay_values, undelayed
from hovercontrol.blocks.simulation.arguments import by_state, initial_state
from hovercontrol.blocks.simulation.reasons import REASONS, StoppedError, where_it_stops
from hovercontrol.blocks.simulation.ticking import between_ticks

Inputs = Sequence[float] | Mapping[str, float] | float | Array

_REAL = np.dtype(float)
#: Status of an engine's step if an input is not finite; the engine is then unchanged.
INPUT_NOT_FINITE = -1


@dataclass(frozen=True)
class Snapshot:
    """The complete state of a runner, from :meth:`Runner.save`; can be pickled.

    Parameters
    ----------
    time : float
        Time of the snapshot [s].
    of : tuple of str
        Identifies the system that the state belongs to.
    data : tuple
        The state, in the runner's own format.

    Attributes
    ----------
    checksum : str
        SHA-256 of the other fields; detects damage.
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
        """Whether the content no longer matches its checksum."""
        try:
            return self.checksum != self._computed()
        except (AttributeError, TypeError, ValueError):  # a damaged pickle can contain other types
            return True


class Runner(ABC):
    """A system simulated step by step, returned by ``start(...)``. Use a runner in one thread only.

    Attributes
    ----------
    input_labels, state_labels, output_labels : list of str
        Signal names, in the order of the arrays.
    time : float
        Present time [s].
    """

    input_labels: list[str]
    state_labels: list[str]
    output_labels: list[str]
    #: Set the inputs, integrate to a time [s], and return a status (0: no error).
    _advance: Callable[[float, bytes], int]
    #: The present outputs.
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
        """Hold the inputs for a time `dt` and return the outputs at its end, shape (n_outputs,).

        Ticks due at the end are executed. If the next step changes the inputs, these ticks are executed again
        with the new inputs.

        Parameters
        ----------
        inputs : sequence of float, or mapping by name, or float for a single input
            They act from now on. None keeps all inputs; a mapping keeps those that it does not name.
        dt : float
            Step length [s]; may differ from step to step. After n equal steps the time is n `dt` to
            rounding: rounding errors do not accumulate.

        Raises
        ------
        InputError
            If an input is unknown or not finite, if `dt` is not positive, or if the simulation cannot
            continue. In the last case the runner stays at the time reached, which the message gives.

        Examples
        --------
        >>> from hovercontrol.blocks.signals import Signal
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
        # Kahan's compensated sum t + dt: without it rounding could delay a tick by one step.
        # y = dt - c,  t_new = t + y,  c_new = (t_new - t) - y
        length = dt - self._rest
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
        """Set inputs, parameters or states now; ticks of this instant are executed again.

        Parameters
        ----------
        inputs
            As for :meth:`step`.
        params : mapping, optional
            Values by key (``plant.yaw_coulomb``); parameters not given keep their present values.
        state : mapping by name, or array_like of shape (n_states,), optional
            A state that a tick sets at this instant is given as its value before the tick.

        Raises
        ------
        InputError
            If a name is unknown, a value is out of bounds, or the system does not allow the change.
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
        """The present inputs, shape (n_inputs,); for a delayed input, the value sent last."""
        return np.frombuffer(self._sent).copy()

    @property
    def outputs(self) -> Array:
        """The present outputs, shape (n_outputs,)."""
        return self._y.copy()

    @property
    @abstractmethod
    def state(self) -> Array:
        """The present states, shape (n_states,)."""

    @property
    @abstractmethod
    def params(self) -> dict[str, float]:
        """The parameters by key."""

    @abstractmethod
    def save(self) -> Snapshot:
        """Return the complete present state of the runner, for :meth:`restore`."""

    @abstractmethod
    def restore(self, snapshot: Snapshot) -> None:
        """Set the runner to the time and state of a snapshot; a rerun gives bit-identical results.

        Raises
        ------
        InputError
            If the snapshot belongs to another system or is damaged; the runner is then unchanged.
        """

    # ---- inside --------------------------------------------------------------------------------------

    @abstractmethod
    def _jump(self, params: Mapping[str, float], state: Mapping[str, float] | ArrayLike | None) -> None:
        """Set parameters and states now."""

    def _fail(self, status: int) -> None:
        if status == INPUT_NOT_FINITE:
            values = np.frombuffer(self._sent)
            n = int(np.flatnonzero(~np.isfinite(values))[0])
            raise InputError(f"{self._label}: input {self.input_labels[n]!r} is {values[n]}")
        text = f"{self._label}: the run stops at t = {self.time:.6g} s: {REASONS[status]}{self._where()}"
        raise StoppedError(text, status)

    def _where(self) -> str:
        """Return the end of the error message: the state that stops the run."""
        return ""

    def _packed(self, inputs: Any) -> bytes:
        """Return the inputs as bytes; raise if they are not one number for each input."""
        names = self.input_labels
        if isinstance(inputs, Mapping):
            values = np.frombuffer(self._sent).copy()
            for name, value in inputs.items():
                check_known(name, names, f"{self._label}: unknown input {name!r}")
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
    """Steps a Block without delays: :mod:`.python_runner`, or :mod:`.native_runner` in machine code."""

    kind: str
    y: Array  # the present outputs
    step: Any  # (until, sent) -> status

    def jump(self, states: Mapping[int, float], params: Sequence[float]) -> int:
        """Set states, by index, and all parameters now; return the status."""

    def time(self) -> float:
        """Return the time reached [s]."""

    def states(self) -> Array:
        """Return the states."""

    def save(self) -> Any:
        """Return the complete state of the engine."""

    def load(self, saved: Any) -> None:
        """Restore what :meth:`save` returned; raise ValueError if its size is wrong."""


class BlockRunner(Runner):
    """Steps a Block; see :class:`Runner`. Returned by ``block.start()`` and ``block.compile().start()``.

    Parameters
    ----------
    block : Block
        Continuous or hybrid, not purely sampled.
    make : callable
        ``(time, states, inputs, parameters) -> Engine`` for the Block without its delays.
    x0, params, inputs, time
        As for :meth:`hovercontrol.blocks.block.Block.start`.
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
        """The present states, shape (n_states,), after the ticks of this instant."""
        return self._engine.states()

    @property
    def params(self) -> dict[str, float]:
        """The parameters by key."""
        return dict(zip(self._block.default_parameters, self._values, strict=True))

    def save(self) -> Snapshot:
        """Return the complete present state of the runner, for :meth:`restore`."""
        late = self._late.save() if self._late else None
        data = (self._rest, self._sent, self._values, late, self._engine.save())
        return Snapshot(self.time, self._of(), data)

    def restore(self, snapshot: Snapshot) -> None:
        """Set the runner to the time and state of a snapshot; see :meth:`Runner.restore`."""
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
            for name, value in by_state(block, state).items():
                check_known(name, self.state_labels, f"{self._label}: unknown state {name!r}")
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
