"""A stateful FMU behind pure functions of a state, which may be called in any order.

python-control's systems are functions ``f(t, x, u)`` and ``h(t, x, u)``; an FMU keeps its state to itself.
Here a state ``x`` is the number of a point in the FMU's history: 0 is the start of a run, and ``f`` returns
the number of the point after one step with these inputs. A step is computed only when outputs at its end are
requested, because python-control also calls ``f`` at the last instant of a response. An earlier point is
restored from the FMU's saved state if it can save one, else by a new run with the same inputs. An unknown
number is an error. After the FMU ends a run, all further points keep its last outputs.
"""

from __future__ import annotations

import contextlib
import hashlib
import warnings
from collections import OrderedDict
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.fmi.importer.instance import Engine, FmuError, RunEnded

Parameters = tuple[float | None, ...]

#: Points that can be returned to; python-control itself goes back one.
HELD = 16
#: Points of the same step, after different inputs, differ by this; too little to see in a plot.
_BRANCH = 2.0**-20


class Point:
    """One point of an FMU's history."""

    __slots__ = (
        "count",
        "ended",
        "handle",
        "history",
        "inputs",
        "parameters",
        "parent",
        "seen",
        "start",
        "token",
        "values",
    )

    def __init__(
        self, token: float, start: float, parameters: Parameters, inputs: Array, parent: Point | None
    ) -> None:
        self.token, self.start, self.parameters, self.parent = token, start, parameters, parent
        self.count: int = 0 if parent is None else parent.count + 1
        self.inputs = inputs  # those that led here; at the start those it was initialised with
        before = repr((start, parameters)).encode() if parent is None else parent.history
        self.history: bytes = hashlib.blake2b(before + inputs.tobytes(), digest_size=16).digest()
        self.values: Array | None = None  # outputs on arrival, with the inputs that led here
        self.seen: dict[bytes, Array] = {}  # outputs with other inputs
        self.handle: int | None = None  # the FMU's saved state
        self.ended: RunEnded | None = None  # how the FMU ended the run, on the way here or before


class Follower:
    """An engine that moves to requested points of the history.

    Parameters
    ----------
    step : float
        Communication step [s].
    can_return : bool
        The FMU can save and restore its state.
    feedthrough : ndarray of bool
        Which outputs depend on the inputs at the same instant.
    label : str
        Prefix of messages.
    """

    def __init__(
        self, engine: Engine, step: float, can_return: bool, feedthrough: NDArray[np.bool_], label: str
    ) -> None:
        self._engine, self._step, self._can_return, self._label = engine, step, can_return, label
        self._feedthrough = feedthrough
        self._direct = bool(feedthrough.any())
        self._held: OrderedDict[bytes, Point] = OrderedDict()
        self._position: Point | None = None
        self._closed = False
        self.ended: float | None = None  # when the FMU ended the run computed last [s]

    def outputs(self, token: float, time: float, parameters: Parameters, inputs: Array) -> Array:
        """Return the outputs at a point with these inputs."""
        point = self._find(token, time, parameters, inputs)
        if point.values is None:
            self._reach(point)
        assert point.values is not None
        self._note(point.ended)
        if not self._direct or point.ended is not None or np.array_equal(inputs, point.inputs):
            return point.values.copy()
        key = inputs.tobytes()
        found = point.seen.get(key)
        if found is None:
            self._reach(point)
            with self._fmu(f"at t = {self._time(point):.9g} s"):
                now = np.array(self._engine.outputs(inputs.tolist()))
            self._position = point  # setting inputs moves nothing
            found = np.where(self._feedthrough, now, point.values)
            if len(point.seen) >= 4:
                point.seen.clear()
            point.seen[key] = found
        return found.copy()

    def advance(self, token: float, time: float, parameters: Parameters, inputs: Array) -> float:
        """Return the number of the point that one step with these inputs leads to."""
        point = self._find(token, time, parameters, inputs)
        following = Point(self._free_token(point.count + 1), point.start, parameters, inputs, point)
        return self._hold(following).token

    def close(self) -> None:
        """Free the FMU; may be called twice."""
        self._closed = True
        self._held.clear()
        self._position = None
        self._engine.close()

    def _find(self, token: float, time: float, parameters: Parameters, inputs: Array) -> Point:
        """Return the point with a number; raise if there is none, or it belongs to another time or run."""
        if self._closed:
            raise InputError(f"{self._label} is closed")
        if token == 0:
            point = Point(0.0, time, parameters, inputs, None)
            return self._hold(point)
        named = next((p for p in self._held.values() if p.token == token), None)
        if named is None:
            raise InputError(
                f"{self._label}: {token!r} names no state of the FMU: 0 starts a run, its last {HELD} "
                "states can be taken up again; they stay in the FMU, so nothing may vary them (linearize, "
                "find_operating_point)"
            )
        if named.parameters != parameters:
            raise InputError(
                f"{self._label}: state {token:g} was reached with other parameters; they are set "
                "where a run starts"
            )
        if abs(time - self._time(named)) > 1e-3 * self._step:
            raise InputError(
                f"{self._label}: state {token:g} is that of t = {self._time(named):.9g} s, "
                f"asked for at t = {time:.9g} s"
            )
        self._held.move_to_end(named.history)
        return named

    def _time(self, point: Point) -> float:
        return point.start + point.count * self._step

    def _free_token(self, count: int) -> float:
        taken = {p.token for p in self._held.values()}
        return next(n for n in (count + k * _BRANCH for k in range(HELD + 1)) if n not in taken)

    def _hold(self, point: Point) -> Point:
        """Return the stored point with this history, else store this one; the oldest of its kind goes."""
        if (known := self._held.get(point.history)) is not None:
            self._held.move_to_end(known.history)
            return known
        self._held[point.history] = point
        alike = [p for p in self._held.values() if (p.parent is None) == (point.parent is None)]
        if len(alike) > HELD:
            old = self._held.pop(alike[0].history)
            handle, old.handle, old.values = old.handle, None, None
            old.seen.clear()
            if handle is not None:
                with self._fmu("", moves=False):
                    self._engine.drop(handle)
        return point

    def _reach(self, point: Point) -> None:
        """Move the FMU to a point: from the present point, from a saved state, or from the start."""
        ahead: list[Point] = []
        base = point
        while (
            base is not self._position
            and base.handle is None
            and base.ended is None
            and base.parent is not None
        ):
            ahead.append(base)
            base = base.parent
        if base is not self._position and base.ended is None:
            self._save()
            if base.handle is not None:
                with self._fmu(f"at t = {self._time(base):.9g} s"):
                    self._engine.restore(base.handle)
            else:
                self._forget()  # saved states belong to the instance that ends here
                with self._fmu(f"at the start of a run, t = {base.start:.9g} s"):
                    first = self._engine.start(base.start, base.parameters, base.inputs.tolist())
                base.values = np.array(first)
            self._position = base
        for following in reversed(ahead):
            if base.ended is not None:
                following.values, following.ended = base.values, base.ended
                base = following
                continue
            self._save()
            time = self._time(following) - self._step
            values: list[float] | None
            with self._fmu(f"in the step from t = {time:.9g} s"):
                try:
                    values = self._engine.step(time, self._step, following.inputs.tolist())
                except RunEnded as end:
                    following.ended, values = end, end.values
            following.values = base.values if values is None else np.array(values)
            if following.ended is None:
                self._position = following
            else:
                self._forget()
            base = following

    def _note(self, end: RunEnded | None) -> None:
        """Warn once in a run that the FMU ended it."""
        before, self.ended = self.ended, None if end is None else end.time
        if end is not None and before is None:
            warnings.warn(f"{self._label} {end}; its outputs stay as they were then", stacklevel=2)

    def _save(self) -> None:
        """Save the present state if a return to it is possible."""
        point = self._position
        if not self._can_return or point is None or point.handle is not None:
            return
        if self._held.get(point.history) is point:
            with self._fmu(f"at t = {self._time(point):.9g} s", moves=False):
                point.handle = self._engine.save()

    def _forget(self) -> None:
        self._position = None
        for point in self._held.values():
            point.handle = None

    @contextlib.contextmanager
    def _fmu(self, when: str, moves: bool = True) -> Iterator[None]:
        """Raise a one-line error with the time of the FMU's failure; after a failure a new run is needed."""
        if moves:
            self._position = None
        try:
            yield
        except FmuError as fault:
            self._forget()
            raise InputError(f"{self._label} failed {when}: {fault}".replace("  ", " ")) from None
        except BaseException:
            self._forget()
            raise
