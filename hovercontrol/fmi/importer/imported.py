"""FMUs as python-control systems, with their names, units and parameters: :func:`load`.

A module called ``load`` would hide the function ``hovercontrol.fmi.load``; hence this name.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import control

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.fmi.importer.interface import Kind
from hovercontrol.fmi.importer.system import FmuSystem
from hovercontrol.fmi.importer.unpacked import Source, open_source
from hovercontrol.fmi.importer.values import (
    checked_name,
    checked_step,
)

if TYPE_CHECKING:
    from hovercontrol.fmi.importer.model import FmuModel


@checked
def load(
    path: str | Path,
    *,
    step: float | None = None,
    name: str | None = None,
    params: Mapping[str, float | bool] | None = None,
    isolated: bool = False,
    timeout: float = 60.0,
    kind: Kind | None = None,
    strict: bool = True,
) -> FmuSystem | FmuModel | control.InterconnectedSystem:
    """Return an FMU (FMI 2.0 or 3.0), or a system of FMUs (.ssp), as a python-control system.

    One for Co-Simulation becomes a discrete-time :class:`FmuSystem`, whose state stays in the FMU; one for
    Model Exchange a continuous :class:`~hovercontrol.fmi.importer.model.FmuModel`, which can be linearised.
    Clocks of FMI 3 with a constant or fixed interval tick.

    **An FMU is a program.** Its binary runs with the rights of the user who loads it: it can read, write and
    send what that user can. Load FMUs only from people whose programs you would run. The archive is checked
    (all files stay in the FMU's temporary folder, sizes are limited, no XML entities), and `isolated`
    protects against faults. Neither is a sandbox against malice.

    Parameters
    ----------
    path : path
        The ``.fmu`` file, or a ``.ssp`` file: its FMUs, connected by ``control.interconnect``.
    step : float, optional
        Communication step and ``dt`` [s] (default: the FMU's DefaultExperiment, else its
        fixedInternalStepSize, else a thousandth of the experiment's duration or 10 ms, with a warning).
    name : str, optional
        System name, without dots (default: the FMU's model identifier).
    params : mapping of str to float, optional
        Parameter values instead of the FMU's start values, by key (``plant.mass``) or by the FMU's own name.
        Structural parameters, which size arrays, can be set here alone, in FMI 3's Configuration Mode; the
        elements of a parameter whose size changes must be given too, or keep the FMU's values.
    isolated : bool, optional
        Run the FMU in a separate process, so that its crash, exit or hang is an error here.
    timeout : float, optional
        Longest time for one call into an isolated FMU [s]; then its process is ended. On Linux, time in
        which it waits for a busy processor does not count.
    kind : {"CoSimulation", "ModelExchange"}, optional
        Which part of the FMU (default: Co-Simulation if it has both).
    strict : bool, optional
        Whether an FMU whose description breaks the standard is refused (the default). If not, the findings
        are a warning and the FMU is used as other tools do.

    Returns
    -------
    FmuSystem or FmuModel, or control.InterconnectedSystem for a ``.ssp`` file

    Raises
    ------
    InputError
        If the file is not an archive or unsafe, the FMU is not of FMI 2.0 or 3.0, is not of that kind or has
        no binary for this platform, its description breaks the standard, its binary cannot be loaded, or an
        argument does not fit it (Model Exchange has no `step` and is not isolated).

    Warns
    -----
    UserWarning
        If inputs or outputs are left out because they are not numbers (String, Binary, Clock) or their clock
        is not ticked, or the FMU has no step size or no outputs. If findings are tolerated (`strict`). If an
        FMU for Model Exchange has time events, which python-control's simulations do not pass.

    Examples
    --------
    >>> plant = load("plant.fmu", step=0.01)  # doctest: +SKIP
    >>> loop = control.interconnect([plant, controller], outputs=["psi"])  # doctest: +SKIP
    """
    path = Path(path)
    if path.suffix == ".ssp":
        from hovercontrol.fmi.ssp.read import load_ssp

        if name is not None or params is not None:
            raise InputError(f"{path}: name and params are for one FMU; a system has its own")
        options = {"step": step, "isolated": isolated, "timeout": timeout, "kind": kind, "strict": strict}
        return load_ssp(path, load, **options)
    source = open_source(path, kind, strict, params)
    try:
        interface = source.interface
        if interface.findings:
            text = "; ".join(" ".join(finding.split()) for finding in interface.findings)
            warnings.warn(f"{path}: breaks FMI {interface.fmi}.0: {text}", stacklevel=2)
        if interface.left_out:
            text = ", ".join(interface.left_out)
            warnings.warn(f"{path}: left out, not real numbers or clocked: {text}", stacklevel=2)
        if not interface.outputs:
            warnings.warn(f"{path}: has no outputs", stacklevel=2)
        if interface.kind == "ModelExchange":
            return _model(source, step, checked_name(interface, name), params, isolated)
        dt = checked_step(path, interface, step)
        if not isinstance(timeout, (int, float)) or not 0 < timeout < math.inf:
            raise InputError(f"{path}: timeout [s] must be a positive number, found {timeout!r}")
        system = FmuSystem(source, dt, checked_name(interface, name), params, isolated, timeout)
    except BaseException:
        source.unpacked.release()
        raise
    source.unpacked.release()  # the system holds it now
    return system


def _model(
    source: Source, step: float | None, name: str, params: Mapping[str, float] | None, isolated: bool
) -> FmuModel:
    """Return an FMU for Model Exchange as a system."""
    path = source.path
    if step is not None:
        raise InputError(f"{path}: Model Exchange has no communication step, found step={step!r}")
    if isolated:
        raise InputError(f"{path}: isolated=True is for Co-Simulation alone")
    from hovercontrol.fmi.importer.model import FmuModel

    system = FmuModel(source, name, params)
    source.unpacked.release()  # the system holds it now
    if system.next_event < math.inf:
        warnings.warn(
            f"{path}: has time events, the first at t = {system.next_event:.9g} s: simulate() passes them, "
            "python-control's simulations do not",
            stacklevel=4,
        )
    return system
