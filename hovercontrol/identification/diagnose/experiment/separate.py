"""The manoeuvre that tells a model from its rivals.

Every manoeuvre of a family is simulated with one rival as the truth. The other rival is fitted to this
simulation and to the information of the logs so far. The misfit that remains is the expected evidence of the
added log; the smaller one of both directions counts. This is the discrimination design of Atkinson and
Fedorov, Biometrika 62, 1975, over a family instead of a continuum. With what the logs say so far it gives the
probability that the right one will be ahead; short manoeuvres are tried first, longer ones if none is sure.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from hovercontrol.base.percent import percent
from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.experiment.manoeuvres import Manoeuvre
from hovercontrol.identification.diagnose.experiment.predict import (
    PROPOSAL,
    Benefit,
    Search,
    added,
    best_of,
    information,
    length,
    predicted,
    room,
    stays,
)
from hovercontrol.identification.diagnose.experiment.proposal import Experiment
from hovercontrol.identification.engine.data import Data
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.passes import inverse

#: Fractions of the manoeuvres that are tried in turn until one is sure enough, and most rivals considered.
LENGTHS, RIVALS = (1 / 16, 1 / 4, 1.0), 8


@dataclass(frozen=True, eq=False)
class Other:
    """A model that the logs so far do not tell from the likeliest one.

    Attributes
    ----------
    fit : Fit
    name : str
    behind : float
        By how much the likeliest one is ahead of it, in twice the log likelihood.
    """

    fit: Fit
    name: str
    behind: float = 0.0


def separate(
    one: Fit, name: str, others: Sequence[Other], *, search: Search | None = None
) -> Experiment | str:
    """Return the shortest manoeuvre that surely tells a model from others, or why there is none.

    Parameters
    ----------
    one : Fit
        Fit of the likeliest model to the logs so far.
    name : str
        Its name.
    others : sequence of Other
        Of which the likeliest few are considered.
    search : Search, optional
        The manoeuvres.
    """
    search = search or Search()
    others = sorted(others, key=lambda o: o.behind)[:RIVALS]
    weights = np.exp([-0.5 * max(o.behind, 0.0) for o in others])

    def benefit(manoeuvre: Manoeuvre) -> Benefit | None:
        mine = predicted(one, manoeuvre)
        if mine is None or not stays(mine, search.within):
            return None
        gains = []
        for o in others:
            theirs, gain = predicted(o.fit, manoeuvre), left(o.fit, mine)
            if theirs is not None and not stays(theirs, search.within):
                return None
            gains.append(gain if theirs is None else min(gain, left(one, theirs)))
        sure = [assurance(gain, o.behind) for gain, o in zip(gains, others, strict=True)]
        k = int(np.argmax(sure))
        return Benefit(float(np.average(sure, weights=weights)), gains[k], manoeuvre, mine, k)

    best = best_of(one, benefit, search, LENGTHS)
    rival = others[best.rival if best else 0]
    second = rival.name
    # a rival that nothing tells apart is no reason to keep the others
    if best is None or assurance(best.gain, rival.behind) < PROPOSAL.worth:
        found = f" ({percent(best.value)} sure, by {best.manoeuvre.name})" if best else ""
        return f"no manoeuvre within the limits distinguishes {name} from {second}{found}"
    text = (
        f"Drive {best.manoeuvre.text}, {length(best.manoeuvre)}{room(best.seen)}: {name} and {second} then "
        f"differ by about {best.gain:.3g} in twice the log likelihood, and with {percent(best.value)} "
        "probability the logs tell the right one."
    )
    return Experiment(
        best.manoeuvre.name, text, best.manoeuvre.time, best.manoeuvre.commands, best.gain, best.value
    )


def assurance(gain: float, behind: float) -> float:
    """Return the probability that the right one of two models will be ahead by `CRITERIA.apart`.

    Parameters
    ----------
    gain : float
        Expected difference of twice the log likelihood in a new log.
    behind : float
        By how much one is ahead so far; it may be the wrong one.

    Examples
    --------
    >>> round(assurance(40.0, 0.0), 3), round(assurance(12.0, 0.0), 3)
    (0.987, 0.5)
    """
    # twice a log likelihood ratio of mean D has the variance 4 D
    return float(norm.cdf((gain - abs(behind) - CRITERIA.apart) / (2.0 * math.sqrt(max(gain, 1e-12)))))


def left(rival: Fit, seen: Data) -> float:
    """Return the misfit of a rival to the noise-free simulation of the other model.

    Its coefficients are fitted to the simulation and to the logs so far, of information I:
    ``|w0|^2 - g'(I + S)^-1 g`` (:func:`.added`).
    """
    rest, S, g = added(rival, seen)
    if not np.isfinite(rest):
        return 0.0  # cannot be judged
    return rest - float(g @ inverse(information(rival) + S) @ g)
