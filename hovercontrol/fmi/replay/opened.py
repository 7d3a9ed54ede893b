"""An FMU's file as a model: :func:`fmu_plant`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.base.files import readable
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.units import is_plain_si
from hovercontrol.fmi.around import Around
from hovercontrol.fmi.importer.interface import Kind, Variable
from hovercontrol.fmi.importer.unpacked import Source, open_source
from hovercontrol.fmi.importer.values import checked_name
from hovercontrol.fmi.replay.plant import FmuPlant
from hovercontrol.fmi.replay.runs import Runs


@checked
def fmu_plant(
    path: str | Path,
    fit: Sequence[str] = (),
    *,
    values: Mapping[str, float] | None = None,
    kind: Kind | None = None,
    free_start: bool = True,
    laws_in: Sequence[str] = (),
    isolated: bool = True,
    timeout: float = 60.0,
    strict: bool = True,
    name: str | None = None,
) -> FmuPlant:
    """Return an FMU (FMI 2.0 or 3.0) as a model for :func:`hovercontrol.identify` and ``diagnose``.

    **An FMU is a program** that runs with your rights; see :func:`hovercontrol.fmi.load`.

    Parameters
    ----------
    path : path
    fit : sequence of str, optional
        Parameters that a fit estimates, by the FMU's names; the others keep their values.
    values : mapping of str to float, optional
        Values in place of the FMU's start values.
    kind : {"CoSimulation", "ModelExchange"}, optional
        Default: Model Exchange if the FMU has it, for its states can then be set.
    free_start : bool, optional
        Whether the states at the start of each log are estimated (Model Exchange only). If not, and for
        Co-Simulation, each log begins at the FMU's start.
    laws_in : sequence of str, optional
        Continuous states to whose derivatives ``diagnose`` may add a law (an offset, drag, dry friction);
        Model Exchange only.
    isolated : bool, optional
        Run the FMU in a process of its own, so that its crash or hang is an error here.
    timeout : float, optional
        Longest time for one run over a log [s].
    strict : bool, optional
        Whether an FMU whose description breaks the standard is refused.
    name : str, optional
        Default: the FMU's model identifier.

    Returns
    -------
    FmuPlant

    Raises
    ------
    InputError
        If the FMU cannot be used, or has no such parameter.

    Examples
    --------
    >>> plant = fmu_plant("plant.fmu", fit=["mass"])  # doctest: +SKIP
    >>> found = hc.identify(plant, [hc.read_log("run.csv")])  # doctest: +SKIP
    """
    path = readable(path, "an FMU")
    if not isinstance(timeout, (int, float)) or not 0 < timeout < math.inf:
        raise InputError(f"{path}: timeout [s] must be a positive number, found {timeout!r}")
    source = _open(path, kind, strict)
    try:
        interface = source.interface
        called = checked_name(interface, name)
        exchange = interface.kind == "ModelExchange"
        states = _signals(interface.states)
        derivatives = [label for v in interface.derivatives for label in v.labels]
        around = Around(
            _signals(interface.inputs),
            _signals(interface.outputs),
            states,
            tuple(zip((s.name for s in states), derivatives, strict=True)),
        )
        runs = Runs(source, called, isolated, float(timeout))
        free = free_start and exchange and bool(states)
        plant = FmuPlant(called, source, runs, tuple(fit), {}, around, free, tuple(laws_in))
        known = [s.name for s in states]
        for one in laws_in:
            check_known(one, known, f"{path}: no continuous state {one!r}")
        for one in fit:
            plant.value(one)
            if list(fit).count(one) > 1:
                raise InputError(f"{path}: the parameter {one!r} is listed twice")
        return plant.with_values(values or {})
    except BaseException:
        source.unpacked.release()
        raise


def _open(path: Path, kind: Kind | None, strict: bool) -> Source:
    if kind is not None:
        return open_source(path, kind, strict)
    source = open_source(path, None, strict)
    if source.interface.kind == "CoSimulation":
        try:
            other = open_source(path, "ModelExchange", strict)
        except InputError:
            return source
        source.unpacked.release()
        return other
    return source


def _signals(variables: Sequence[Variable]) -> tuple[Signal, ...]:
    """Return the elements of variables as signals; a unit that is not SI counts as no unit."""
    found = []
    for v in variables:
        starts = v.start or (0.0,) * len(v.labels)
        for label, start, unit, text in zip(v.labels, starts, v.units, v.descriptions, strict=True):
            unit = unit or "1"
            try:
                unit = unit if is_plain_si(unit) else "1"
            except InputError:
                unit = "1"
            found.append(Signal(_word(label), unit, text, start=start))
    return tuple(found)


def _word(label: str) -> str:
    """Return a label as the name of a signal: ``der(x)`` becomes ``der_x``."""
    try:
        Signal(label)
    except InputError:
        stem = "".join(c if c.isalnum() or c == "_" else "_" for c in label).strip("_")
        return stem if stem[:1].isalpha() else f"v_{stem}"
    return label
