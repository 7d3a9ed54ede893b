"""An FMU that is run over logs again and again, in a process of its own or in this one."""

from __future__ import annotations

import base64
import pickle
import weakref
from collections.abc import Sequence
from typing import Any

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.fmi.importer.instance import FmuError
from hovercontrol.fmi.importer.unpacked import Source
from hovercontrol.fmi.importer.worker import Remote
from hovercontrol.fmi.replay.added import Added
from hovercontrol.fmi.replay.replayer import Replayer, array_of, text_of


class RunFailed(Exception):  # noqa: N818 - of one trial of a fit
    """The FMU refused a call, crashed or hung in a run, or answered NaN; the text is one line."""


class Runs:
    """Runs of one FMU.

    Parameters
    ----------
    source : Source
    name : str
    isolated : bool
        Whether the FMU runs in a process of its own.
    timeout : float
        Longest time for one run over a log [s]; then that process is ended.
    """

    def __init__(self, source: Source, name: str, isolated: bool, timeout: float) -> None:
        self._source, self._name, self._isolated, self._timeout = source, name, isolated, timeout
        self._times: dict[str, str] = {}
        self._told: set[str] = set()
        self._remote: Remote | None = None
        self._local: Replayer | None = None
        self.count = 0
        self._holders: list[Remote | Replayer] = []
        self._end = weakref.finalize(self, _release, source, self._holders)

    @property
    def rows(self) -> int:
        """Numbers that the FMU answers at a row: outputs, then states."""
        interface = self._source.interface
        return sum(len(v.labels) for v in (*interface.outputs, *interface.states))

    def initial(self, parameters: Sequence[float | None], inputs: Sequence[float]) -> list[float]:
        """Return the continuous states after initialisation.

        Raises
        ------
        RunFailed
        """
        found: list[float] = self._call("initial", list(parameters), list(inputs))
        return found

    def run(
        self,
        time: Array,
        inputs: Array,
        parameters: Sequence[float | None],
        states: Sequence[float] | None,
        pieces: int,
        added: Added | None = None,
        numbers: Sequence[Sequence[float]] = (),
    ) -> Array:
        """Return outputs and states at the rows, shape (K, n_outputs + n_states).

        Raises
        ------
        RunFailed
        """
        key = str(hash(time.tobytes()))
        self._times.setdefault(key, text_of(time))
        self.count += 1
        law = base64.b64encode(pickle.dumps(added)).decode() if added else ""
        begin = None if states is None else [float(x) for x in states]
        text = self._call("run", key, text_of(inputs), list(parameters), begin, pieces, law, list(numbers))
        return array_of(text).reshape(len(time), self.rows)

    def close(self) -> None:
        """End the process and free the folder; may be called twice."""
        self._end()

    def _call(self, name: str, *arguments: object) -> Any:
        if not self._end.alive:
            raise InputError(f"FMU {self._name!r} is closed")
        try:
            if self._isolated:
                return self._remotely(name, *arguments)
            return self._locally(name, *arguments)
        except FmuError as fault:
            raise RunFailed(str(fault)) from None

    def _remotely(self, name: str, *arguments: object) -> object:
        source = self._source
        if self._remote is None:
            self._remote = Remote(
                source.unpacked.folder, source.interface, self._name, self._timeout, "replayer"
            )
            self._holders.append(self._remote)
            self._told = set()
        elif not self._remote.alive:
            self._told = set()
        for key in self._times.keys() - self._told:
            self._remote.call("log", key, self._times[key])
            self._told.add(key)
        return self._remote.call(name, *arguments)

    def _locally(self, name: str, *arguments: object) -> object:
        source = self._source
        if self._local is None:
            self._local = Replayer(source.unpacked.folder, source.interface, self._name)
            self._holders.append(self._local)
        for key in self._times.keys() - self._told:
            self._local.log(key, self._times[key])
            self._told.add(key)
        return getattr(self._local, name)(*arguments)


def _release(source: Source, holders: list[Remote | Replayer]) -> None:
    for holder in holders:
        holder.close()
    source.unpacked.release()
