"""Checks after a first fit: coefficients that the logs do not excite, and a model that does not predict."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.identification.diagnose.checks.input_gain_check import refuse_gains
from hovercontrol.identification.engine.coasting import coasting
from hovercontrol.identification.engine.excitation import Excitation
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.levels import unlike
from hovercontrol.identification.engine.navigation import Navigated
from hovercontrol.identification.engine.prediction import horizons, predict


@dataclass(frozen=True)
class ExcitationCriteria:
    """Settings that decide when a first fit shows that a model does not predict its logs.

    No published source: set by hand, exercised by tests/identification/diagnose/test_checks.py.

    Attributes
    ----------
    swallowed : float
        Process noise relative to the acceleration above which the prediction is checked.
    ahead : float
        Prediction horizon of that check [s].
    better : float
        Maximum prediction error relative to that of constant velocities, median over channels. A model with
        drag along one axis alone reaches less.
    """

    swallowed: float = 0.3
    ahead: float = 0.2
    better: float = 0.9


#: The values in use.
EXCITATION = ExcitationCriteria()


@checked
def check_fitted(base: Fit) -> list[str]:
    """Refuse logs without information on a model or in other units; warn of coefficients not excited.

    Parameters
    ----------
    base : Fit
        Fit of the given model.

    Returns
    -------
    list of str
        Warnings, one line each.

    Raises
    ------
    InputError
        If no coefficient can be estimated, or a command is in other units or of opposite sign.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> from hovercontrol.identification.identify import identify
    >>> from hovercontrol.logs import read_log
    >>> from hovercontrol.documents.samples import sample_path
    >>> found = identify(hc.vehicle("c17_experiment"), [read_log(sample_path())])
    >>> check_fitted(found.fit)
    []
    """
    data = base.problem.data
    refuse_gains(base)
    nothing = predicts_nothing(base)
    navigated = [f"{m.name}: {m.drift}" for m in data.logs if isinstance(m, Navigated)]
    alike = unlike(data.channels, data.scales)
    return [*navigated, *alike, *check_excitation(base, bool(nothing)), *nothing]


def check_excitation(base: Fit, predicts_nothing: bool = False) -> list[str]:
    """Return a warning for each coefficient that the logs do not excite.

    Parameters
    ----------
    base : Fit
        Fit of the given model.
    predicts_nothing : bool, optional
        Whether all motion is noise to the model; then no coefficient is expected to be excited.

    Raises
    ------
    InputError
        If no coefficient is excited: motion and commands are nearly constant.
    """
    problem, free = base.problem, base.problem.model.free_coefficients()
    names = [name for name in problem.names if name in free]
    if not names:
        return []
    size = problem.size[[problem.names.index(name) for name in names]]
    shown = Excitation(base, size, names)
    blind = np.flatnonzero(np.sqrt(np.diag(shown.covariance)) > size).tolist()
    moving = [any(np.ptp(m.inputs[i]) > 0.0 for m in problem.logs) for i in range(len(problem.block.inputs))]
    if len(blind) == len(names) and not shown.groups and not (predicts_nothing and any(moving)):
        logs = ", ".join(m.name for m in problem.logs)
        raise InputError(
            f"{logs}: no coefficient of the model is excited: motion and commands are nearly constant"
        )
    return [f"{names[j]} is not excited by these logs: {shown.reason(j)}" for j in blind]


def predicts_nothing(base: Fit) -> list[str]:
    """Return a warning if a model predicts hardly better than constant velocities; empty otherwise.

    Parameters
    ----------
    base : Fit
        Of the given model.
    """
    problem = base.problem
    if not problem.driven or np.any(base.noise.process < EXCITATION.swallowed * problem.accelerations):
        return []
    horizon = horizons(base, (EXCITATION.ahead,))[0]
    still = copy(problem)
    still.block = coasting(problem.block)
    found, trivial = predict(base, horizon), predict(replace(base, problem=still), horizon)
    if found is None or trivial is None:
        return []
    ratios = [found.rms[c] / trivial.rms[c] for c in found.channels if trivial.rms[c] > 0.0]
    if not ratios or float(np.median(ratios)) < EXCITATION.better:
        return []
    return [
        f"the model does not predict the motion: {horizon:.2g} s ahead it is hardly better than "
        f"constant velocities; "
        "are model, commands and motion of the same craft and time?"
    ]
