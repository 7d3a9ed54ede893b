"""An FMU for Co-Simulation as a discrete-time python-control system."""

from __future__ import annotations

import copy
import weakref
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.simulation.runner import Inputs
from hovercontrol.fmi.importer.follow import Follower
from hovercontrol.fmi.importer.instance import Engine, FmuError
from hovercontrol.fmi.importer.loaded import Loaded
from hovercontrol.fmi.importer.ticking import instance_of
from hovercontrol.fmi.importer.unpacked import Source, Unpacked, digest_of, open_source
from hovercontrol.fmi.importer.worker import Remote

if TYPE_CHECKING:
    from hovercontrol.fmi.importer.runner import FmuRunner


class FmuSystem(Loaded):
    """An FMU as a python-control system with ``dt`` = its communication step; made by :func:`load`.

    Inputs and outputs are the FMU's, by their names and in their order; arrays are expanded into elements,
    ``name[1]``,
    ``name[2]``, ``name[1,2]``, counted from 1 as in FMI, the last index fastest. Integers, enumerations and
    booleans (0, 1) are numbers too; other values are an error. python-control sets unconnected inputs to 0:
    an enumeration without an item 0 then has its start value. python-control reads a dot as "system.signal",
    so that a signal ``body.u`` is connected as ``("plant", "body.u")``, or renamed first by python-control's
    own ``update_names``.

    The only state, ``step``, counts the steps of a run: it identifies a point of the FMU's history and is 0
    at the start of a run. At 0 the FMU is instantiated, gets its parameters and the first inputs, and is
    initialised. Its internal state stays in the FMU. A point can be evaluated again, with the same or other
    inputs: from a state saved by the FMU, if it can save states, else from a repeated run. ``x0 =
    response.states[:, -1]`` continues a run. A state that the FMU was never in is an error, and so is
    linearisation.

    Inputs are held over a step; outputs are those of the communication point. An output that does not depend
    on inputs at the same instant (by the FMU's ModelStructure, see ``feedthrough``) is read before inputs are
    set. For the others the new inputs are set and the outputs read without a step in between. FMI allows an
    FMU to return the values of its last step then: a delay of one step that importers cannot detect.

    An FMU may end a run (terminateSimulation). The response is then returned with constant outputs after the
    end; a warning and `ended` give its time.

    Parameter keys carry the system's name (``plant.mass``), as those of a Block do, since
    ``control.interconnect`` shares equal keys among all systems. They are set at the start of a run.

    A copy (``copy.deepcopy``, or python-control's where a system is listed twice) and an unpickled system
    have their own instance and begin at 0; unpickling reads the same file again. ``close()``, the end
    of a ``with`` block, garbage collection and the interpreter's exit free instance and temporary folder.

    Attributes
    ----------
    units, descriptions : dict of str to str
        By the FMU's signal name, and by key for parameters; empty if the FMU has none.
    feedthrough : dict of str to tuple of str
        For each output, the inputs on which it depends at the same instant, as declared.
    params : dict of str to float
        The parameters with their values.
    path : Path
    ended : float or None
        When the FMU ended the run that was computed last [s]; None where it did not.
    """

    def __init__(
        self,
        source: Source,
        step: float,
        name: str,
        params: Mapping[str, float] | None,
        isolated: bool,
        timeout: float,
    ) -> None:
        self._isolated, self._timeout = isolated, timeout
        super().__init__(source, name, params, step, ["step"])
        interface = source.interface
        spread = {v.name: v.labels for v in interface.inputs}
        self.feedthrough = {
            label: tuple(i for name in interface.feedthrough[v.name] for i in spread[name])
            for v in interface.outputs
            for label in v.labels
        }
        engine, unpacked = self._engine(), self.unpacked
        direct = np.array([bool(inputs) for inputs in self.feedthrough.values()], dtype=bool)
        self._follower = Follower(engine, step, interface.has_states, direct, f"FMU {self.name!r}")
        unpacked.hold()
        self._end = weakref.finalize(self, _release, self._follower, unpacked)

    def _engine(self) -> Engine:
        interface, folder = self._source.interface, self._source.unpacked.folder
        try:
            if self._isolated:
                return Remote(folder, interface, self.name, self._timeout)
            return instance_of(folder, interface, self.name)
        except FmuError as fault:
            raise InputError(f"{self.path}: {fault}") from None

    def start(
        self,
        x0: None = None,
        params: Mapping[str, float] | None = None,
        *,
        inputs: Inputs | None = None,
        time: float = 0.0,
    ) -> FmuRunner:
        """Start a run of the FMU step by step, in a separate instance.

        The runner is used as that of a Block (:class:`hovercontrol.blocks.simulation.runner.Runner`); it can
        be saved if the FMU can save its state. The caller chooses the length of steps; it must be a multiple
        of a fixed step of the FMU.

        Parameters
        ----------
        x0 : None
            An FMU's initial state is not accessible; settable start values are parameters.
        params : mapping, optional
            Parameter values by key, in place of the system's.
        inputs : sequence of float, or mapping by name, optional
            Inputs at the start, in place of the FMU's start values; used for initialisation.
        time : float, optional
            Start time [s].

        Raises
        ------
        InputError
            If a name or a value is wrong, `x0` is given, or the FMU refuses.
        """
        from hovercontrol.fmi.importer.runner import FmuRunner

        self._alive()
        if x0 is not None:
            raise InputError(
                f"FMU {self.name!r}: expected x0 = None, because its state is not accessible; start "
                "values that can be set are among its params"
            )
        values = {**self._checked(self.params, pushed=False), **self._checked(params or {}, pushed=False)}
        return FmuRunner(self, self._engine(), values, inputs, time)

    @property
    def ended(self) -> float | None:
        """When the FMU ended the run that was computed last [s]; None where it did not."""
        return self._follower.ended

    @property
    def unpacked(self) -> Unpacked:
        """The FMU's temporary folder."""
        return self._source.unpacked

    def __deepcopy__(self, memo: dict[int, Any]) -> FmuSystem:
        self._alive()
        return self._named_as(
            FmuSystem(self._source, self.dt, self._prefix, dict(self.params), self._isolated, self._timeout),
            self._names(),
        )

    def __copy__(self) -> FmuSystem:
        return copy.deepcopy(self)  # two systems cannot share one instance

    def __reduce__(self) -> tuple[Any, ...]:
        sizes = {name: size for name, (_, _, size) in self.interface.sizes.items()}
        arguments = {"step": self.dt, "name": self._prefix, "params": dict(self.params) | sizes}
        arguments |= {"isolated": self._isolated, "timeout": self._timeout}
        return _again, (self.path.absolute(), self._source.digest, arguments, self._names())

    def _names(self) -> tuple[str, dict[str, int], dict[str, int]]:
        return self.name, dict(self.input_index), dict(self.output_index)

    @staticmethod
    def _named_as(system: FmuSystem, names: tuple[str, dict[str, int], dict[str, int]]) -> FmuSystem:
        system.name, system.input_index, system.output_index = names
        return system

    def _repr_html_(self) -> str:
        from hovercontrol.fmi.importer.display import fmu_html

        return fmu_html(self)

    def linearize(self, *args: Any, **kwargs: Any) -> NoReturn:
        """Raise: an FMU's state is not accessible, so it cannot be linearised.

        Raises
        ------
        InputError
            Always. The Block from which an FMU was exported has exact Jacobians.
        """
        raise InputError(
            f"FMU {self.name!r}: its state is not accessible, so it cannot be linearised; linearise the "
            "Block from which it was made, or the FMU's Model Exchange: load(..., kind='ModelExchange')"
        )

    def checked_inputs(self, t: float, u: Any) -> Array:
        """Return the inputs at a time, converted for the FMU; raise :class:`InputError` if impossible."""
        return self._input_check.checked(f"FMU {self.name!r}", t, u)

    def _connected(self, t: float, u: Any) -> Array:
        return self._input_check.connected(f"FMU {self.name!r}", t, u)

    def _rhs(self, t: float, x: Any, u: Any) -> Array:
        token = float(np.asarray(x, dtype=float).reshape(-1)[0])
        return np.array([self._follower.advance(token, float(t), self._values, self._connected(t, u))])

    def _out(self, t: float, x: Any, u: Any) -> Array:
        token = float(np.asarray(x, dtype=float).reshape(-1)[0])
        return self._follower.outputs(token, float(t), self._values, self._connected(t, u))


def _again(path: Path, digest: str, arguments: dict[str, Any], names: Any) -> FmuSystem:
    """Load an FMU once more, for a system that was pickled."""
    try:
        found = digest_of(path)
    except OSError as error:
        raise InputError(f"{path} of a pickled FMU cannot be read: {error.strerror}") from None
    if found != digest:
        raise InputError(f"{path} has changed since the system was pickled")
    source = open_source(path, "CoSimulation", False, arguments["params"])
    try:
        system = FmuSystem(source, **arguments)
    finally:
        source.unpacked.release()  # the system holds it now
    return FmuSystem._named_as(system, names)


def _release(follower: Follower, unpacked: Unpacked) -> None:
    follower.close()
    unpacked.release()
