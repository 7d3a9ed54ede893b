"""The manoeuvre that most reduces a standard error: of a number, of a table, or of what still is missing."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.evidence.missing import rate
from hovercontrol.identification.diagnose.experiment.manoeuvres import Manoeuvre
from hovercontrol.identification.diagnose.experiment.predict import (
    PROPOSAL,
    Benefit,
    Search,
    added,
    best_of,
    family_of,
    followed,
    information,
    length,
    predicted,
    room,
    stays,
)
from hovercontrol.identification.diagnose.experiment.proposal import Experiment
from hovercontrol.identification.diagnose.laws.scan import KNOTS, Local, Scan
from hovercontrol.identification.engine.data import Data
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.passes import inverse


def sharpen(
    final: Fit, parameters: Sequence[str], name: str, *, search: Search | None = None
) -> Experiment | None:
    """Return the manoeuvre that most reduces a large standard error; None if none does.

    With the information I of the logs so far and S of the manoeuvre, the standard error of parameter j is
    reduced by the factor ``([I^-1]_jj / [(I + S)^-1]_jj)^(1/2)``. Of several, the mean variance counts.

    Parameters
    ----------
    final : Fit
        Fit of the logs so far.
    parameters : sequence of str
        Parameters of the fitted model: one number, or all values of a table.
    name : str
        What they are, for the sentence.
    search : Search, optional
        The manoeuvres.
    """
    search = search or Search()
    own, known = [final.problem.names.index(p) for p in parameters], information(final)

    def error(more: Array | float) -> float:
        return math.sqrt(float(np.mean(np.diag(inverse(known + more))[own])))

    def benefit(manoeuvre: Manoeuvre) -> Benefit | None:
        seen = predicted(final, manoeuvre)
        if seen is None or not stays(seen, search.within):
            return None
        then = error(added(final, seen)[1])
        factor = error(0.0) / then if then > 0.0 else 0.0
        return Benefit(factor, factor, manoeuvre, seen)

    return _sharper(
        best_of(final, benefit, search),
        lambda f: f"the standard error of {name} then falls by a factor of {f:.2g}",
    )


def sharpen_missing(
    final: Fit, equations: Sequence[str], *, search: Search | None = None
) -> tuple[Experiment | None, str]:
    """Return the manoeuvre that shows most of what equations still lack, and a sentence.

    What is missing is the function of one signal that tells most of it (:mod:`.laws.scan`), over all values
    that the logs or a manoeuvre reach. Each of its k hats has a prior of the size of the function in the
    logs: where no log has been, only its size is known. With the information I of logs and prior and S of a
    manoeuvre, the mean variance is then ``tr (I + S)^-1/k``. What is missing stays process noise, which hides
    part of it.

    Parameters
    ----------
    final : Fit
        Of the amended model.
    equations : sequence of str
        States in whose equations a remainder is left.
    search : Search, optional
        The manoeuvres.
    """
    search = search or Search()
    told = [(scan.best(), scan) for scan in (Scan(final, e) for e in equations)]
    known = [
        (one, scan) for one, scan in told if one and one.gain >= CRITERIA.least and one.of.signal != "time"
    ]
    if not known:
        left = " ".join(f"{e}'" for e in equations)
        return (
            None,
            f"what remains in {left} is not a function of signals in these logs: no manoeuvre shows its form",
        )
    local, scan = max(known, key=lambda one: one[0].gain)
    every = {m.name: _scanned(final, local, predicted(final, m), search) for m in family_of(final, search)}
    reached = [
        scan.along_logs(local.of),
        *(own.along_logs(local.of) for own, _ in filter(None, every.values())),
    ]
    low, high = min(float(a.min()) for a in reached), max(float(a.max()) for a in reached)
    low = 0.0 if local.of.of_abs else low
    places, size = np.linspace(low, high, KNOTS), float(np.sqrt(np.mean(scan.yardstick().force ** 2)))
    prior = np.r_[final.prior.precision, np.full(KNOTS, size**-2)]
    now = scan.information(local, places) + np.diag(prior)

    def error(more: Array | float) -> float:
        return math.sqrt(float(np.mean(np.diag(inverse(now + more))[-KNOTS:])))

    before = error(0.0)

    def benefit(manoeuvre: Manoeuvre) -> Benefit | None:
        found = every[manoeuvre.name]
        if found is None:
            return None
        factor = before / error(found[0].information(local, places))
        return Benefit(factor, factor, manoeuvre, found[1])

    what = f"what {local.equation}' lacks, as a function of {local.of.argument} from {low:.3g} to {high:.3g}"
    unit = rate(final.problem.block.signal(local.equation).unit)
    best = _sharper(
        best_of(final, benefit, search),
        lambda f: (
            f"the mean standard error of {what}, then falls from {before:.2g} to {before / f:.2g} {unit}"
        ),
    )
    return best, best.text if best else f"no manoeuvre within the limits shows more of {what}"


def _scanned(final: Fit, local: Local, seen: Data | None, search: Search) -> tuple[Scan, Data] | None:
    """Return the signals of a function along a predicted log; None if it leaves its ranges."""
    if seen is None or not stays(seen, search.within):
        return None
    try:
        own = Scan(followed(final, seen), local.equation, local.signals)
    except FloatingPointError:
        return None
    return (own, seen) if local.signals <= own.values.keys() else None


def _sharper(best: Benefit | None, said: Callable[[float], str]) -> Experiment | None:
    if best is None or best.value < PROPOSAL.sharper:
        return None
    m = best.manoeuvre
    text = f"Drive {m.text}, {length(m)}{room(best.seen)}: {said(best.value)}."
    return Experiment(m.name, text, m.time, m.commands, best.value)
